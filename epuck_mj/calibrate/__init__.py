"""Calibration of one robot: `python -m epuck_mj.calibrate --port PORT`.

- `fitting`: gains, wheel radii and track computed from measurements;
- `bench`: drives and readings of the robot, as safe as the bridge's;
- `guide`: instructions and questions to the person with the ruler.

Or from the log of a drive: `python -m epuck_mj.calibrate fit LOG`.

- `recorded_drive`: what a log holds for a fit, checked;
- `command_delay`: how late the motors do what they are told;
- `parameters`: of a robot, in one array;
- `drive_model`: how poses, wheels and sensors explain what was recorded;
- `normal_equations`, `smoothing`: sparse least squares of all poses and the parameters;
- `drive_fit`: the fit, and what the drive does not show;
- `quantities`: how well it explains the drive;
- `fit_command`: the command line, and its report.
"""
