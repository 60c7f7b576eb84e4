"""Driving a real robot: sensing, policy, speeds, schedule and log.

`robot` is `control.Robot` on a connection, with `schedule` and `odometry`; `session` is
the control loop; `mission` is all of it, from the first word to the `log`, with what a
person sees on the `console` and says by the `keyboard`.
"""
