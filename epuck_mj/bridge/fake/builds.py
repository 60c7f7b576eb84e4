"""The e-pucks that can be emulated: hardware and firmware together.

Source: gctronic/e-puck-library, `Asercom.c`, `BTcom.c`; e-puck2/e-puck2_main-processor,
`Asercom2.c`, `motors.h`. The banner's second line and the hardware versions are ours.
"""

from dataclasses import dataclass

from epuck_mj.bridge.fake.motors_and_sensors import MotorTimer
from epuck_mj.constants import (
    MOTOR_TICK_RATE,
    MOTOR_TICK_RATE_2,
    PROXIMITY_PERIOD,
    PROXIMITY_PERIOD_2,
    STEP_RATE_MAX,
    STEP_RATE_MAX_2,
)


@dataclass(frozen=True)
class Build:
    r"""A robot and its firmware.

    Attributes:
        version: the lines it answers to V.
        greeting: its banner; `{}` is the selector's position.
        timer: of its motors.
        period: of its proximity sensors [s].
        calibrates: by itself, as it starts.
        resets: on R; otherwise it doesn't even answer.
        tells_battery: on b.
    """

    version: tuple[str, ...]
    greeting: str
    timer: MotorTimer
    period: float
    calibrates: bool
    resets: bool
    tells_battery: bool


_TIMER = MotorTimer(STEP_RATE_MAX, MOTOR_TICK_RATE, saves_current=True)

_WELCOME = (
    "\f\aWELCOME to the SerCom protocol on e-Puck\r\n"
    'the EPFL education robot, type "H" for help\r\n'
)

BUILDS = {
    "asercom": Build(
        version=("v,Version 1.2.2 August 2008 GCtronic", "HW version: 1.1"),
        greeting="Selector pos {}\r\n" + _WELCOME,
        timer=_TIMER,
        period=PROXIMITY_PERIOD,
        calibrates=False,
        resets=True,
        tells_battery=True,
    ),
    "btcom": Build(
        version=("v,Version 2.0.0 January 2008",),
        greeting=_WELCOME,
        timer=_TIMER,
        period=PROXIMITY_PERIOD,
        calibrates=True,
        resets=True,
        tells_battery=False,
    ),
    "epuck2": Build(
        version=("v,Version 2.0 January 2018 GCtronic", "HW version: 1.3"),
        greeting=_WELCOME,
        timer=MotorTimer(STEP_RATE_MAX_2, MOTOR_TICK_RATE_2, saves_current=False),
        period=PROXIMITY_PERIOD_2,
        calibrates=False,
        resets=False,
        tells_battery=False,
    ),
}
"""Robots that can be emulated, by name."""
