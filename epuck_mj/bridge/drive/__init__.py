"""Driving a real robot: sensing, policy, speeds, schedule and log.

`robot` is `control.Robot` on a connection, with `schedule` and `odometry`. `session` is
the control loop. `mission` is a whole drive, from the greeting to the arrays of its
`log`, and an `order` is a mission in plain values. `alone` is a drive of one robot on a
terminal, with output on the `console`, stop keys of the `keyboard`, and `pictures`.
"""
