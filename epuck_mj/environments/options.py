"""Options of the Gymnasium environments: keys and values as of `evolution.run`."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

from epuck_mj.constants import PROXIMITY_RANGE, SPEED_MAX, TURN_RATE_MAX
from epuck_mj.errors import UserError
from epuck_mj.host.limits import check, shown
from epuck_mj.scene.model_files import KINEMATIC_ROBOT
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import START_CLEARANCE, TaskParameters
from epuck_mj.step.disturbances import NOISE
from epuck_mj.step.fitness import step_fitness


@dataclass(frozen=True)
class Options:
    """What an agent drives, where, and for what.

    Attributes:
        robot: name of a shipped robot, or path of an MJCF.
        arena: name of a shipped arena, or path of an MJCF.
        steps: control steps of a trial, after which it is truncated.
        control_step: duration of a control step [s].
        fitness: name of the step fitness, which is the reward: `product`, `literal`,
            `spaced` or `my.py:name`.
        v_max: forward speed at v = 1 [m/s].
        w_max: yaw rate at |w| = 1 [rad/s].
        sensor_range: distance at which an obstacle stops being seen [m].
        start_clearance: least distance from the shell to a wall at a start [m].
        noise: name of a level of `NOISE`.
        randomise: whether each trial has a different robot; needs noise.
        randomise_all: whether these differ in all that real ones differ in.
        calibration: calibration of the robot in all trials, or its file; needs noise.
        latency: control steps until a command has reached the wheels of ideal robots;
            randomised ones have latencies of their own.
        threads: threads that step robots in MuJoCo; 0 is one per core.

    Raises:
        UserError: for a value that is none of these.
    """

    robot: str = KINEMATIC_ROBOT
    arena: str = "arena"
    steps: int = 300
    control_step: float = 0.1
    fitness: str = "product"
    v_max: float = SPEED_MAX
    w_max: float = TURN_RATE_MAX
    sensor_range: float = PROXIMITY_RANGE
    start_clearance: float = START_CLEARANCE
    noise: str = "none"
    randomise: bool = False
    randomise_all: bool = False
    calibration: Calibration | str | Path | None = None
    latency: int = 0
    threads: int = 0

    def __post_init__(self) -> None:
        """Refuse what no environment can be made of."""
        try:
            for name in ("start_clearance", "latency", "threads"):
                check(name, getattr(self, name))
            for name in ("robot", "arena", "fitness", "noise"):
                if not isinstance(value := getattr(self, name), str):
                    raise ValueError(f"{name}: expected a text, got {shown(value)}")
            for name in ("randomise", "randomise_all"):
                if not isinstance(value := getattr(self, name), bool):
                    got = shown(value)
                    raise ValueError(f"{name}: expected True or False, got {got}")
            given = self.calibration
            if not isinstance(given, Calibration | str | Path | None):
                raise ValueError(f"calibration: expected a path, got {shown(given)}")
            if self.latency and NOISE.get(self.noise) is not None:
                raise ValueError(
                    f"latency: expected 0 with noise {self.noise}, got {self.latency}; "
                    "randomise gives each robot a latency of its own"
                )
            step_fitness(self.fitness)
            _ = self.task, self.conditions
        except ValueError as error:
            raise UserError(str(error)) from None

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Self:
        """The options that are given by name, and the defaults of all others.

        Raises:
            UserError: for an unknown name, or a value that it cannot have.
        """
        names = [field.name for field in fields(cls)]
        if unknown := [name for name in given if name not in names]:
            raise UserError(
                f"unknown option '{unknown[0]}'; available: {', '.join(names)}"
            )
        return cls(**given)

    @property
    def task(self) -> TaskParameters:
        """Length, fitness, sensors and speeds of a trial."""
        return TaskParameters.of(self)

    @property
    def conditions(self) -> Conditions:
        """Noise, randomisation and calibration of the robots."""
        given = self.calibration
        if isinstance(given, str | Path):
            given = Calibration.load(Path(given))
        return Conditions(self.noise, self.randomise, given, self.randomise_all)
