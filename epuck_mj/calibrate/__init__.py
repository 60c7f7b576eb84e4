"""Calibration of one robot: `python -m epuck_mj.calibrate --port PORT`.

- `fitting`: gains, wheel radii and track computed from measurements;
- `bench`: drives and readings of the robot, as safe as the bridge's;
- `guide`: instructions and questions to the person with the ruler.
"""
