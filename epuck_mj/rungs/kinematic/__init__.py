"""The kinematic rung: wheels that roll without slipping, in a plan of the arena.

Robot and arena are read from the same compiled MJCF as in MuJoCo. `cut` makes outlines
of geoms, `plan` collects them with the robot's numbers, `kernel` moves robots among
them, `robots` is the simulator, and `fused` runs whole trials in compiled code.
"""
