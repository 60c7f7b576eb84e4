"""The control step and the trial: the same for one robot and for thousands."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np

from epuck_mj.constants import PROXIMITY_RANGE
from epuck_mj.host.limits import check
from epuck_mj.host.own_parts import is_own
from epuck_mj.step.fitness import (
    FORMULAS,
    StepFacts,
    StepFitness,
    step_fitness,
    unknown_fitness,
)
from epuck_mj.step.motors import Speeds, command
from epuck_mj.step.sensors import Reading, observe

START_CLEARANCE = 0.01
"""Default of the least distance to a wall at a start [m]. Chosen."""

Policy = Callable[[np.ndarray], np.ndarray]

Lost = Callable[[np.ndarray], np.ndarray]
"""Which trials to end, `(trials,)`, given the most that each can still reach."""


class Robot(Protocol):
    """Anything that takes wheel speeds and reports what it senses one step later."""

    def step(self, command: np.ndarray) -> Reading:
        """Drive for one control step; the reading at its end."""
        ...

    def poses(self) -> np.ndarray:
        """Poses, `(..., 3)`: x, y [m], yaw [rad]; NaN if unknown."""
        ...

    def clearances(self) -> np.ndarray:
        """Distances from shell to nearest wall [m], `(...)`; NaN if unknown."""
        ...


class Robots(Robot, Protocol):
    """Robots that can be placed on starts and taken out one by one."""

    def reset(self, starts: np.ndarray) -> Reading:
        """Put one robot on each pose `(robots, 3)`: x, y [m], yaw [rad]."""
        ...

    def keep(self, mask: np.ndarray) -> None:
        """Keep only the active robots that `mask` selects."""
        ...

    def restart(self, which: np.ndarray, starts: np.ndarray) -> Reading:
        """Put some robots at rest on new starts, while the others go on.

        Only as long as no robot was taken out.

        Args:
            which: numbers of these robots, `(k,)`.
            starts: their poses `(k, 3)`: x, y [m], yaw [rad].

        Returns:
            What these robots sense there.
        """
        ...


@dataclass(frozen=True)
class TaskParameters:
    """Length, fitness, sensors and speeds of a trial.

    Attributes:
        steps: control steps of a trial.
        control_step: duration of a control step [s].
        fitness: name of the step fitness: one of `FORMULAS` or `my.py:name`.
        sensor_range: distance at which an obstacle stops being seen [m].
        speeds: what a full action means.

    Raises:
        ValueError: a value beyond its limit, or an unknown fitness.

    Source: paper, section 4, where it says; our choices otherwise.
    """

    steps: int = 300
    control_step: float = 0.1
    fitness: str = "product"
    sensor_range: float = PROXIMITY_RANGE
    speeds: Speeds = field(default_factory=Speeds)

    def __post_init__(self) -> None:
        """Refuse values beyond their limits."""
        for name in ("steps", "control_step", "sensor_range"):
            check(name, getattr(self, name))
        fitness: Any = self.fitness
        if not (isinstance(fitness, str) and (fitness in FORMULAS or is_own(fitness))):
            raise ValueError(unknown_fitness(fitness))

    @classmethod
    def of(cls, keys: Any) -> Self:
        """The task that a configuration describes.

        Args:
            keys: what has them as attributes, as evolution's configuration.

        Raises:
            ValueError: as the class.
        """
        return cls(
            steps=keys.steps,
            control_step=keys.control_step,
            fitness=keys.fitness,
            sensor_range=keys.sensor_range,
            speeds=Speeds(keys.v_max, keys.w_max),
        )

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Self:
        """Read what `dataclasses.asdict` gave, as stored with a controller.

        Raises:
            ValueError: if the fields are others.
        """
        try:
            return cls(**{**fields, "speeds": Speeds(**fields["speeds"])})
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"not the parameters of a task: {error}") from None

    @property
    def most(self) -> float | None:
        """The most that a trial can earn; None if that is not known."""
        return self.most_in(self.steps)

    def most_in(self, steps: int) -> float | None:
        """The most that so many control steps can earn; None if that is not known.

        It is 0 at least: a crash may end the trial before any of them.
        """
        maximum = self.step_fitness.maximum
        return None if maximum is None else steps * max(maximum, 0.0)

    @property
    def step_fitness(self) -> StepFitness:
        """The function of the step fitness."""
        return step_fitness(self.fitness)


@dataclass(frozen=True)
class ControlStep:
    """One control step of robots `(...)`: action, command, reading and fitness.

    Attributes:
        action: what the policy decided, `(..., 2)`.
        command: wheel speeds sent [rad/s], `(..., 2)`.
        reading: what was sensed after the world moved.
        observation: the same as network input, `(..., 8)`: the next step's input.
        fitness: step fitness, `(...)`.
    """

    action: np.ndarray
    command: np.ndarray
    reading: Reading
    observation: np.ndarray
    fitness: np.ndarray


def control_step(
    robot: Robot,
    policy: Policy,
    observation: np.ndarray,
    task: TaskParameters,
    k: int | np.ndarray,
) -> ControlStep:
    """Control step `k` of a trial, from 0 on, begun at `observation` `(..., 8)`.

    Robots whose trials began at different times have each a `k` of its own, `(...)`.
    """
    action = policy(observation)
    wheels = command(action, task.speeds)
    reading = robot.step(wheels)
    seen = observe(reading.distance, task.sensor_range)
    # fitness is computed without noise
    judged, distance = seen, reading.distance
    if reading.truth is not None:
        judged, distance = observe(reading.truth, task.sensor_range), reading.truth
    facts = StepFacts(
        action=action,
        command=wheels,
        observation=judged,
        distance=distance,
        contact=reading.contact,
        time=(k + 1) * task.control_step,
        poses=robot.poses,
        clearances=robot.clearances,
    )
    return ControlStep(action, wheels, reading, seen, task.step_fitness(facts))


def drive(
    robot: Robot, policy: Policy, first: Reading, task: TaskParameters
) -> Iterator[ControlStep]:
    """The control steps of one robot's trial, ended by a crash or after `task.steps`.

    Args:
        robot: that has been put on its start.
        policy: called with what is observed, `(1, 8)`.
        first: what was sensed there, before anything moved.
        task: what a trial is.
    """
    policy = started(policy, 1)
    observation = observe(first.distance, task.sensor_range)
    for k in range(task.steps):
        step = control_step(robot, policy, observation, task, k)
        observation = step.observation
        yield step
        if step.reading.contact.any():
            return


@dataclass(frozen=True)
class Trials:
    """Outcome of `(trials,)` trials.

    Attributes:
        fitness: sum of the step fitness, `(trials,)`.
        steps: control steps lived, the crash step included, `(trials,)`.
        crashed: whether a crash ended the trial, `(trials,)`.
    """

    fitness: np.ndarray
    steps: np.ndarray
    crashed: np.ndarray

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The trials of all parts, in their order."""
        none = np.zeros(0), np.zeros(0, int), np.zeros(0, bool)
        columns = zip(none, *(astuple(part) for part in parts), strict=True)
        return cls(*map(np.concatenate, columns))


class Watcher(Protocol):
    """Observer of trials while they are simulated."""

    def started(self, reading: Reading, observation: np.ndarray) -> None:
        """Receive all robots' first readings and observations."""
        ...

    def stepped(self, k: int, active: np.ndarray, step: ControlStep) -> None:
        """Receive the outcome of control step `k` of the active trials `(active,)`."""
        ...


class BatchPolicy(Protocol):
    """A policy with one member per robot, of which members can be selected."""

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(robots, 2)` for observations `(robots, 8)`."""
        ...

    def __getitem__(self, index: np.ndarray | slice) -> "BatchPolicy":
        """The members that a mask `(robots,)` or a slice selects."""
        ...


@runtime_checkable
class Remembering(Protocol):
    """A policy that carries a state from one control step to the next."""

    def started(self, n: int | None) -> BatchPolicy:
        """The policy of `n` robots on their starts, which remember nothing yet.

        None is one robot without an axis for it.
        """
        ...


def started(policy: Any, n: int | None) -> Any:
    """A policy, or a batch policy, at the start of `n` trials; see `Remembering`."""
    return policy.started(n) if isinstance(policy, Remembering) else policy


class Everybody:
    """A batch policy whose members are all the same."""

    def __init__(self, policy: Policy):
        """Store the policy of all members."""
        self._policy = policy

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Actions `(robots, 2)` for observations `(robots, 8)`."""
        return self._policy(observation)

    def __getitem__(self, index: np.ndarray | slice) -> Self:
        """The policy itself, as all members are the same."""
        return self

    def started(self, n: int | None) -> BatchPolicy:
        """See `Remembering`: each robot has memories of its own, if any."""
        policy = self._policy
        return policy.started(n) if isinstance(policy, Remembering) else self


def run_trials(
    robots: Robots,
    policy: BatchPolicy,
    starts: np.ndarray,
    task: TaskParameters,
    lost: Lost | None = None,
    watcher: Watcher | None = None,
) -> Trials:
    """One trial per start; a robot that crashes is not stepped again.

    Args:
        robots: to put on the starts.
        policy: one member per start.
        starts: poses `(trials, 3)`: x, y [m], yaw [rad].
        task: what a trial is.
        lost: asked after every step which trials to end early, without a crash and
            with their fitness so far; None ends none, nor does a step fitness without
            a maximum.
        watcher: told of starts and steps; None for no watcher.
    """
    n_trials = len(starts)
    fitness = np.zeros(n_trials)
    steps = np.zeros(n_trials, int)
    crashed = np.zeros(n_trials, bool)
    active = np.arange(n_trials)
    policy = started(policy, n_trials)
    reading = robots.reset(starts)
    observation = observe(reading.distance, task.sensor_range)
    if watcher is not None:
        watcher.started(reading, observation)
    for k in range(task.steps):
        step = control_step(robots, policy, observation, task, k)
        observation = step.observation
        if watcher is not None:
            watcher.stepped(k, active, step)
        fitness[active] += step.fitness
        steps[active] += 1
        alive = ~step.reading.contact
        crashed[active] = ~alive
        left = None if lost is None else task.most_in(task.steps - 1 - k)
        if lost is not None and left is not None:
            most = fitness.copy()
            most[active[alive]] += left
            alive &= ~lost(most)[active]
        # drop robots whose trial is over, and everything kept for them
        if not alive.all():
            active, observation = active[alive], observation[alive]
            if not active.size:
                break
            policy = policy[alive]
            robots.keep(alive)
    return Trials(fitness, steps, crashed)
