"""Hardware numbers of the e-puck v1, each once, with unit and source.

Sources (each consulted for facts only):

- MECH: e-puck.org, mechanical design page.
- WEBOTS: `E-puck.proto` of cyberbotics/webots.
- FARSA: `phyepuck.cpp` of the FARSA simulator.
- PLAYER: `epuckIR.cpp` of playerproject/player, the software the paper used.
- FIRMWARE: `e_motors.c`, `e_epuck_ports.h` of gctronic/e-puck-library.
- PAPER: the wall-following study that this project replicates.
"""

import math

BODY_RADIUS = 0.035
"""Radius of the round body [m]. MECH (diameter 70 mm), FARSA, PLAYER."""

BODY_HEIGHT = 0.050
"""Height of the body's top above the floor [m]. WEBOTS guide (71 x 50 mm)."""

GROUND_CLEARANCE = 0.0015
"""Height of the body's underside above the floor [m]. FARSA (battery box)."""

MASS = 0.150
"""Mass of the whole robot with its battery [kg]. MECH, WEBOTS, FARSA."""

WHEEL_MASS = 0.010
"""Mass of one wheel [kg], part of MASS. FARSA."""

CENTER_OF_MASS_HEIGHT = 0.015
"""Height of the centre of mass above the floor, on the axis [m]. WEBOTS."""

INERTIA = (9.786e-5, 8.643e-5, 8.749e-5)
"""Principal inertia of the whole robot about its centre of mass [kg m^2]. WEBOTS."""

WHEEL_RADIUS = 0.0205
"""Wheel radius [m]. MECH (about 41 mm diameter), FARSA."""

WHEEL_WIDTH = 0.003
"""Wheel width [m]. WEBOTS (as drawn), FARSA."""

TRACK = 0.053
"""Distance between the wheels' middles [m]. MECH, FARSA."""

WHEEL_FRICTION = 0.9
"""Sliding friction of the tyre on the floor. FARSA (dynamic)."""

SUPPORT_RADIUS = 0.005
"""Radius of the two frictionless supports [m]. FARSA."""

SUPPORT_OFFSET = 0.0225
"""Distance of the supports from the axle, front and rear [m]. FARSA."""

DRIVE_INERTIA = 3e-4
"""Inertia of a motor's rotor as the wheel feels it through the gear [kg m^2].

Not published: chosen. A stepper's speed is commanded, so the robot's mass must not slow
it: this is ten times what the wheels feel of that mass. It also lets wheel servo and
tyre friction be integrated with one physics step: see benchmarks/convergence.md.
"""

DRIVE_GAIN = 0.02
"""Gain of a wheel's velocity servo [N m s/rad]: a time constant of about 15 ms.

Chosen: the real motor takes a new rate at once (FIRMWARE), with its tyre slipping.
"""

STEPS_PER_REVOLUTION = 1000
"""Motor steps per wheel revolution (20 per motor revolution, gear 50:1). MECH."""

STEP_RATE_MAX = 1000
"""Highest wheel speed the firmware accepts [steps/s]. FIRMWARE."""

WHEEL_SPEED_MAX = 2 * math.pi * STEP_RATE_MAX / STEPS_PER_REVOLUTION
"""Highest wheel speed [rad/s]."""

SPEED_MAX = WHEEL_SPEED_MAX * WHEEL_RADIUS
"""Highest forward speed, both wheels at their limit [m/s]: 0.1288."""

TURN_RATE_MAX = 2 * SPEED_MAX / TRACK
"""Highest yaw rate, turning on the spot [rad/s]: 4.86."""

N_PROXIMITY = 8
"""Number of infra-red proximity sensors. FIRMWARE, PAPER."""

PROXIMITY_ANGLES = (-17.2, -49.9, -90.0, -148.1, 148.1, 90.0, 49.9, 17.2)
"""Directions of ps0..ps7 [degrees from forward, left positive]. PLAYER.

Order of FIRMWARE: ps0 is front right, then clockwise seen from above.
"""

PROXIMITY_HEIGHT = 0.033
"""Height of the proximity sensors above the floor [m]. WEBOTS."""

PROXIMITY_RANGE = 0.04
"""Range of the proximity sensors [m]. PAPER."""
