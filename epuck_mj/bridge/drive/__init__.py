"""Driving a real robot: sensing, policy, speeds, schedule and log.

`robot` is `control.Robot` on a connection, with `schedule` and `odometry`. `session` is
the control loop. `mission` is a whole drive, from the greeting to the `log`, with
output on the `console` and stop keys of the `keyboard`.
"""
