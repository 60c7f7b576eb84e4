"""dm_control tasks: wall following as a `dm_env` environment for agents.

As in dm_control's suite: `env = epuck_mj.load("follow_walls", {"random": 1})`. The
parts (observe, command, step fitness) are those of batched evaluation, so that the same
actions give the same bits.
"""

# dm_control's base class has no types: its abstract methods look as if they gave None
# pyright: reportIncompatibleMethodOverride=false

import warnings
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

with warnings.catch_warnings():
    # dm_control tries GLFW first, which complains where there is no display
    warnings.filterwarnings("ignore", module="glfw")
    from dm_control import mujoco

from dm_control.mujoco.wrapper import MjModel
from dm_control.rl import control
from dm_control.suite import base
from dm_control.utils import containers
from dm_env import specs

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError
from epuck_mj.host.limits import check, shown
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import is_kinematic, on_wheels
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import START_CLEARANCE, TaskParameters
from epuck_mj.step.fitness import StepFacts
from epuck_mj.step.motors import command
from epuck_mj.step.sensors import Reading, observe

PhysicsError = control.PhysicsError

SUITE = containers.TaggedTasks()
"""Tasks of dm_control by name: `follow_walls`."""


def load(
    task_name: str,
    task_kwargs: Mapping[str, Any] | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> control.Environment:
    """An environment of the named task, as `dm_control.suite.load` gives it.

    Args:
        task_name: one of `SUITE`.
        task_kwargs: arguments of the task's function below.
        environment_kwargs: arguments of `dm_control.rl.control.Environment`, but for
            `n_sub_steps` and `time_limit`, which the task knows.

    Raises:
        UserError: if there is no such task, or robot or arena cannot be used.
    """
    if task_name not in SUITE:
        raise UserError(f"unknown task '{task_name}'; available: {', '.join(SUITE)}")
    return SUITE[task_name](
        environment_kwargs=environment_kwargs, **(task_kwargs or {})
    )


@SUITE.add()
def follow_walls(
    robot: str = "epuck",
    arena: str = "arena",
    parameters: TaskParameters | None = None,
    start_clearance: float = START_CLEARANCE,
    random: np.random.RandomState | int | None = None,
    environment_kwargs: Mapping[str, Any] | None = None,
) -> control.Environment:
    """Follow the walls of an arena without touching them.

    Args:
        robot: name of a shipped robot, or path of an MJCF.
        arena: name of a shipped arena, or path of an MJCF.
        parameters: steps, control step, fitness, sensor range, speeds.
        start_clearance: least distance from the shell to a wall at a start [m].
        random: seed of the starts, or a generator to draw them from.
        environment_kwargs: arguments of `dm_control.rl.control.Environment`, but for
            `n_sub_steps` and `time_limit`, which the task knows.

    Raises:
        UserError: if robot or arena cannot be used.
    """
    parameters = parameters or TaskParameters()
    if is_kinematic(robot):
        raise UserError(
            f"the task moves robots in MuJoCo: expected robot '{on_wheels(robot)}' or "
            f"a path, got '{robot}'"
        )
    scene = load_scene(robot, arena, parameters.control_step)
    task = FollowWalls(
        scene, parameters, space=FreeSpace(scene, start_clearance), random=random
    )
    return environment(scene, task, environment_kwargs)


def environment(
    scene: Scene,
    task: "FollowWalls",
    environment_kwargs: Mapping[str, Any] | None = None,
) -> control.Environment:
    """The environment of a task in its scene; a trial is `parameters.steps` long."""
    return control.Environment(
        mujoco.Physics.from_model(MjModel(scene.sparing())),
        task,
        n_sub_steps=scene.n_substeps,
        # half a step less: a quotient of floats must not add one
        time_limit=(task.parameters.steps - 0.5) * task.parameters.control_step,
        **(environment_kwargs or {}),
    )


def _check_random(random: Any) -> None:
    """Refuse what is neither a seed nor a generator as dm_control's suite has it."""
    if random is None or isinstance(random, np.random.RandomState):
        return
    try:
        check("random", int(random) if isinstance(random, np.integer) else random)
    except ValueError as error:
        raise UserError(str(error)) from None


def _two_numbers(action: Any) -> np.ndarray:
    """A copy of an action `(2,)`, as floats."""
    try:
        array = np.asarray(action)
        if array.shape == (2,) and array.dtype.kind in "fiu":
            for number in array.tolist():
                check("action", number)
            return array.astype(float)
    except ValueError:
        # also of lists of unlike lengths
        pass
    raise UserError(
        f"expected an action of two finite numbers, v and w, got {shown(action)}"
    )


class FollowWalls(base.Task):
    """Drive fast, straight and close to a wall; a crash ends the episode."""

    def __init__(
        self,
        scene: Scene,
        parameters: TaskParameters,
        space: FreeSpace | None = None,
        starts: Iterable[np.ndarray] = (),
        random: np.random.RandomState | int | None = None,
    ):
        """Set the task up.

        Args:
            scene: robot and arena.
            parameters: what a trial is.
            space: where random starts are drawn, once `starts` are used up.
            starts: poses `(3,)` of the first episodes: x, y [m], yaw [rad].
            random: seed of the random starts, or a generator to draw them from.

        Raises:
            UserError: if `random` is anything else.
        """
        _check_random(random)
        super().__init__(random=random)
        self.parameters = parameters
        self._scene = scene
        self._space = space
        self._starts: Iterator[np.ndarray] = iter(starts)
        self._action = self._command = np.zeros(2)
        self._k = 0
        self._probe: ClearanceProbe | None = None

    def initialize_episode(self, physics: mujoco.Physics) -> None:
        """Put the robot at rest on the next start."""
        start = next(self._starts, None)
        if start is None:
            if self._space is None:
                raise RuntimeError("no start left, and no free space to draw from")
            rng = np.random.default_rng(self.random.randint(2**32, dtype=np.uint32))
            start = self._space.sample(rng, 1)[0]
        physics.data.qpos[:] = self._scene.qpos(start)
        self._k = 0
        super().initialize_episode(physics)

    def action_spec(self, physics: mujoco.Physics) -> specs.BoundedArray:
        """V (forward) in [0, 1] and w (turn, right positive) in [-1, 1]."""
        return specs.BoundedArray((2,), float, (0.0, -1.0), (1.0, 1.0), name="v_w")

    def observation_spec(
        self, physics: mujoco.Physics
    ) -> OrderedDict[str, specs.BoundedArray]:
        """Eight values, 0 near to 1 free, in the order ps0..ps7."""
        spec = specs.BoundedArray((N_PROXIMITY,), float, 0.0, 1.0, name="proximity")
        return OrderedDict(proximity=spec)

    def before_step(self, action: np.ndarray, physics: mujoco.Physics) -> None:
        """Send the wheel speeds.

        Raises:
            UserError: if the action is not two numbers.
        """
        self._action = _two_numbers(action)
        self._command = command(self._action, self.parameters.speeds)
        physics.data.ctrl[self._scene.wheels] = self._command
        self._k += 1

    def get_observation(self, physics: mujoco.Physics) -> OrderedDict[str, np.ndarray]:
        """Observation of the network."""
        return OrderedDict(proximity=self._observe(physics))

    def get_reward(self, physics: mujoco.Physics) -> float:
        """Step fitness."""
        reading = self._reading(physics)
        facts = StepFacts(
            action=self._action,
            command=self._command,
            observation=self._observe(physics),
            distance=reading.distance,
            contact=reading.contact,
            time=self._k * self.parameters.control_step,
            poses=lambda: self._pose(physics),
            clearances=lambda: self._clearance(physics),
        )
        return float(self.parameters.step_fitness(facts))

    def get_termination(self, physics: mujoco.Physics) -> float | None:
        """Discount 0 after a crash."""
        return 0.0 if self.crashed(physics) else None

    def crashed(self, physics: mujoco.Physics) -> bool:
        """Whether the shell touched a wall in the control step, however briefly."""
        return bool(self._reading(physics).contact)

    def _pose(self, physics: mujoco.Physics) -> np.ndarray:
        return self._scene.poses(physics.data.qpos)

    def _clearance(self, physics: mujoco.Physics) -> np.ndarray:
        if self._probe is None:
            self._probe = ClearanceProbe(self._scene, 1)
        return self._probe.measure(self._pose(physics)).distance

    def _reading(self, physics: mujoco.Physics) -> Reading:
        return self._scene.reading(physics.data.sensordata, physics.data.history)

    def _observe(self, physics: mujoco.Physics) -> np.ndarray:
        return observe(self._reading(physics).distance, self.parameters.sensor_range)
