"""Hardware numbers of the e-puck v1, each once, with unit and source.

Sources (each consulted for facts only):

- MECH: e-puck.org, mechanical design page.
- WEBOTS: `E-puck.proto` of cyberbotics/webots.
- FARSA: `phyepuck.cpp` of the FARSA simulator.
- PLAYER: `epuckIR.cpp` of playerproject/player, the software the paper used.
- JBOTEVOLVER: `EpuckIRSensor.java` of BioMachinesLab/jbotevolver.
- FIRMWARE: gctronic/e-puck-library: `e_motors.c`, `e_agenda.c`, `e_epuck_ports.h`,
  `e_prox.c`, `e_ad_conv.h`, `e_uart1_rx_char.s`, `Asercom.c`, `BTcom.c`.
- FIRMWARE2: the e-puck2's main processor, e-puck2/e-puck2_main-processor.
- WIFI2: the e-puck2's radio, `socket_e-puck2.c` and `uart_e-puck2.c` of GCtronic.
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
"""Gain of a wheel's velocity servo [N m s/rad].

With the robot's mass, speeds follow a command with a time constant of 17 ms. Chosen:
the real motor takes a new rate at once (FIRMWARE), with its tyre slipping.
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

N_WHEELS = 2
"""Left and right, in this order everywhere."""

PROXIMITY_ANGLES = (-17.2, -49.9, -90.0, -148.1, 148.1, 90.0, 49.9, 17.2)
"""Directions of ps0..ps7 [degrees from forward, left positive]. PLAYER.

Order of FIRMWARE: ps0 is front right, then clockwise seen from above.
"""

PROXIMITY_HEIGHT = 0.033
"""Height of the proximity sensors above the floor [m]. WEBOTS."""

PROXIMITY_RANGE = 0.04
"""Range of the proximity sensors [m]. PAPER."""

PROXIMITY_COUNTS = {
    0.0: 3817.0,
    0.005: 3294.0,
    0.01: 1741.0,
    0.015: 898.0,
    0.02: 556.0,
    0.03: 215.0,
    0.04: 107.0,
    0.05: 60.0,
    0.06: 40.0,
    0.07: 26.0,
    0.08: 19.0,
    0.10: 11.0,
    0.12: 9.0,
}
"""Counts of a proximity sensor by distance [m] to a flat wall, ambient light taken off.

Mean of eight sensors of two real robots. JBOTEVOLVER.
"""

PROXIMITY_COUNT_NOISE = {
    0.0: 1.1,
    0.005: 37.0,
    0.01: 21.0,
    0.015: 8.0,
    0.02: 5.0,
    0.03: 3.5,
    0.04: 2.9,
    0.05: 2.3,
    0.06: 2.0,
    0.07: 1.8,
    0.08: 2.0,
    0.10: 1.8,
}
"""Standard deviation in time of those counts, by distance [m]. JBOTEVOLVER."""

PROXIMITY_COUNT_MAX = 4095
"""Highest count of a proximity or ambient light sensor: 12 bits. FIRMWARE."""

PROXIMITY_PERIOD = 0.0159
"""Time in which all proximity sensors are read anew [s]. FIRMWARE."""

PROXIMITY_PERIOD_2 = 0.010
"""Time in which the e-puck2 reads all proximity sensors anew [s]. FIRMWARE2."""

CALIBRATION_SAMPLES = 100
"""Samples of a sensor whose mean is its offset from then on. FIRMWARE."""

CALIBRATION_TIME_MAX = 3.0
"""Time after which a calibration has failed [s].

Estimated from the code (1 to 3 s); 100 samples alone take 1.6 s. FIRMWARE.
"""

MOTOR_TICK_RATE = 10_000
"""Ticks by which the motors' step periods are counted [1/s]. FIRMWARE."""

MOTOR_TICK_RATE_2 = 50_000
"""Ticks of the e-puck2's step periods: half-steps timed at 100 kHz [1/s]. FIRMWARE2."""

COIL_TICKS = 15
"""Ticks for which a slow motor's coil is on at each step: 1.5 ms. FIRMWARE."""

COIL_ALWAYS_ON = 601
"""Speed from which on the coils are never switched off [steps/s]. FIRMWARE."""

STEP_RATE_MAX_2 = 1100
"""Highest wheel speed of the e-puck2's main processor [steps/s]. FIRMWARE2.

Its radio accepts STEP_RATE_MAX. WIFI2.
"""

N_LEDS = 8
"""Number of red LEDs on the ring. FIRMWARE."""

N_SELECTOR = 16
"""Positions of the selector. FIRMWARE."""

BATTERY_LOW = 3.4
"""Voltage below which the battery is reported as low [V]. FIRMWARE."""

BAUD_RATE = 115_200
"""Rate of the UART, with 8 data bits, no parity, one stop bit [bit/s]. FIRMWARE."""

BYTE_TIME = 10 / BAUD_RATE
"""Time that one byte takes on the UART, start and stop bit included [s]."""

RECEIVE_RING = 64
"""Bytes the UART can keep for a firmware that is busy. FIRMWARE."""

REPLY_TIME_MAX = 0.3
"""Time after which a reply over Bluetooth is lost [s].

Never measured in public: chosen. Drivers wait for 0.1 to 1 s; comparable robots need
60 ms a transaction, and occasionally several 100 ms.
"""

OPERANDS_MAX = 19
"""Most operand bytes a binary command waits for. FIRMWARE2 (all actuators)."""

RESYNC_QUIET = 0.05
"""Silence after which nothing more of an abandoned reply will come [s].

Inferred, not measured. FIRMWARE.
"""

WIFI_PORT = 1000
"""TCP port of the e-puck2. WIFI2."""

WIFI_PERIOD = 0.010
"""Time between two packets of the e-puck2 over TCP [s]. WIFI2."""

WIFI_QUEUE = 5
"""Commands that may wait in the e-puck2's radio; further ones are dropped. WIFI2."""

READING_AGE_MAX = 0.3
"""Age of the latest reading at which a bridge stops its robot [s]. Chosen."""

CONNECT_TIME_MAX = 5.0
"""Time without an answer after which there is no robot [s].

Chosen: longer than an e-puck takes to calibrate itself as it starts.
"""

NOISE_TIME_MAX = 1.2
"""Time after which what has come without an answer in it is no robot [s]. Chosen.

Four times REPLY_TIME_MAX: answers that take longer come too late to drive by.
"""

STOP_TIME_MAX = 0.8
"""How long a robot is told to stop while it does not confirm [s]. Chosen.

With the age of a reading before it and the log after it, less than 2 s.
"""

PURSUIT_TIME = 5.0
"""How long another process goes on telling a robot to stop [s]. Chosen."""

STOP_REPLY_TIME = 0.2
"""Time without an answer after which a robot is told to stop again [s]. Chosen."""
