"""Calibration of one robot: `python -m epuck_mj.calibrate --port PORT`.

- `fitting`: from what was measured to gains, wheel radii and track; numbers only;
- `bench`: the robot drives and is read, through the bridge and as safe as there;
- `guide`: tells a person what to do and asks what the ruler says.
"""
