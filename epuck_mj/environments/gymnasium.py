"""Gymnasium environments: wall following for one agent, and for many robots at once.

Importing this module registers `epuck_mj/FollowWalls-v0`:

    import gymnasium
    import epuck_mj.environments.gymnasium

    env = gymnasium.make("epuck_mj/FollowWalls-v0")
    many = gymnasium.make_vec("epuck_mj/FollowWalls-v0", num_envs=1024)

Observations and actions are float64, as in evaluation: so the same actions give the
same bits there and here. The reward is the step fitness. A crash terminates a trial;
after its steps it is truncated.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.environments.endless_trials import (
    HIGHEST,
    LOWEST,
    EndlessTrials,
    checked_action,
    checked_starts,
)
from epuck_mj.environments.options import Options
from epuck_mj.environments.picture import TrialPicture
from epuck_mj.errors import UserError
from epuck_mj.host.limits import check, shown

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError as error:
    raise UserError(
        f"the environment needs '{error.name}', which is not installed: "
        "pip install 'epuck-mj[gym]'"
    ) from None

ID = "epuck_mj/FollowWalls-v0"

OBSERVATIONS = Box(0.0, 1.0, (N_PROXIMITY,), np.float64)
"""Proximity ps0 to ps7: 0 near to 1 free."""

ACTIONS = Box(LOWEST, HIGHEST, (2,), np.float64)
"""Forward v in [0, 1] and turn w in [-1, 1], right positive."""


class FollowWallsEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """Drive fast, straight and close to a wall; a crash ends the trial."""

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        # pictures a second if every control step of 0.1 s is one
        "render_fps": 10,
    }

    def __init__(
        self,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
        **options: Any,
    ):
        """Load robot and arena.

        Args:
            render_mode: None, or "rgb_array" for pictures by `render`.
            width: of the pictures [pixels].
            height: of the pictures [pixels].
            options: fields of `Options`.

        Raises:
            UserError: for other options, or if robot or arena cannot be used.
        """
        _check_mode(render_mode, self.metadata["render_modes"])
        chosen = Options.of({"threads": 1} | options)
        self.render_mode = render_mode
        self.observation_space, self.action_space = _spaces()
        self._trials = EndlessTrials(chosen, 1)
        self._living, self._picture = False, None
        step = chosen.control_step
        self.metadata = self.metadata | {"render_fps": max(1, round(1 / step))}
        if render_mode is not None:
            size = _checked_size(width, height)
            self._picture = TrialPicture(self._trials.scene, self._trials.task, *size)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Observation `(8,)` on the start of a new trial, and an empty dictionary.

        Args:
            seed: of this and all later trials; None to go on.
            options: `start`, a pose `(3,)`: x, y [m], yaw [rad], to begin at.

        Raises:
            UserError: for other options.
        """
        super().reset(seed=seed)
        start = _start_of(options, "start", (3,))
        given = None if start is None else start[None]
        observation = self._trials.begin(self.np_random, given)[0]
        self._living = True
        if self._picture is not None:
            self._picture.begin(self._trials.poses()[0])
        return observation, {}

    def step(
        self, action: np.ndarray
    ) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Observation `(8,)`, reward, terminated, truncated and an empty dictionary.

        Args:
            action: v in [0, 1] and w in [-1, 1], `(2,)`.

        Raises:
            UserError: for other actions, without a trial, or if MuJoCo warns of a
                simulation that means nothing.
        """
        if not self._living:
            raise UserError("no trial is going on: expected reset() before step()")
        step, over = self._trials.step(checked_action(action, (2,))[None])
        crashed = bool(step.reading.contact[0])
        over, reward = bool(over[0]), float(step.fitness[0])
        self._living = not (crashed or over)
        if self._picture is not None:
            self._picture.add(self._trials.poses()[0], reward)
        return step.observation[0].copy(), reward, crashed, over and not crashed, {}

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Picture `(height, width, 3)`, 0 to 255, of the robot and its path so far.

        None without the render mode "rgb_array".

        Raises:
            UserError: if no OpenGL is there.
        """
        return None if self._picture is None else self._picture.pixels()

    def close(self) -> None:
        """Free OpenGL, if pictures were drawn."""
        if self._picture is not None:
            self._picture.close()


class FollowWallsVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many robots, each in its own copy of the arena, stepped at once.

    A robot whose trial is over begins the next one in the same step: the observation is
    that of its new start, and `infos["final_obs"]` has the last one of its trial. So
    every step is a control step of every robot.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": [],
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self, num_envs: int = 1, render_mode: str | None = None, **options: Any
    ):
        """Load robot and arena, and allocate the robots.

        Args:
            num_envs: number of robots.
            render_mode: None: a vector environment draws no pictures.
            options: fields of `Options`.

        Raises:
            UserError: for other options, or if robot or arena cannot be used.
        """
        _check_mode(render_mode, self.metadata["render_modes"])
        try:
            check("num_envs", num_envs)
        except ValueError as error:
            raise UserError(str(error)) from None
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = _spaces()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._trials = EndlessTrials(Options.of(options), num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Observations `(n, 8)` of all robots on new starts, and an empty dictionary.

        Args:
            seed: of these and all later trials of all robots; None to go on.
            options: `starts`, poses `(n, 3)`: x, y [m], yaw [rad], to begin at.

        Raises:
            UserError: for other options.
        """
        super().reset(seed=seed)
        starts = _start_of(options, "starts", (self.num_envs, 3))
        return self._trials.begin(self.np_random, starts), {}

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Observations `(n, 8)`, rewards, terminated and truncated `(n,)`, and infos.

        Where trials are over, infos have their last observations, `final_obs`, in an
        array of objects, as Gymnasium's own vector environments do.

        Args:
            actions: v in [0, 1] and w in [-1, 1], `(n, 2)`.

        Raises:
            UserError: for other actions, before `reset`, or if MuJoCo warns of a
                simulation that means nothing.
        """
        step, over = self._trials.step(checked_action(actions, (self.num_envs, 2)))
        crashed, observation = step.reading.contact, step.observation.copy()
        done, infos = crashed | over, {}
        if done.any():
            which = np.flatnonzero(done)
            last = np.full(self.num_envs, None)
            last[which] = np.fromiter(observation[which], object, len(which))
            infos = {
                "final_obs": last,
                "_final_obs": done,
                "final_info": {},
                "_final_info": done.copy(),
            }
            observation[which] = self._trials.restart(which)
        return observation, step.fitness, crashed, over & ~crashed, infos


def _spaces() -> tuple[Box, Box]:
    """Spaces of one observation and one action, which draw samples of their own."""
    return (
        Box(OBSERVATIONS.low, OBSERVATIONS.high, dtype=np.float64),
        Box(ACTIONS.low, ACTIONS.high, dtype=np.float64),
    )


def _check_mode(given: str | None, modes: Sequence[str]) -> None:
    """Refuse a render mode that an environment does not have."""
    if given is not None and given not in modes:
        available = ", ".join(("None", *modes))
        raise UserError(f"unknown render_mode {shown(given)}; available: {available}")


def _checked_size(width: int, height: int) -> tuple[int, int]:
    try:
        check("pixels", width, "width")
        check("pixels", height, "height")
    except ValueError as error:
        raise UserError(str(error)) from None
    return width, height


def _start_of(
    options: dict[str, Any] | None, name: str, shape: tuple[int, ...]
) -> np.ndarray | None:
    """The poses that the options of a reset name, if any."""
    given = options or {}
    if unknown := [key for key in given if key != name]:
        raise UserError(f"unknown reset option '{unknown[0]}'; available: {name}")
    return None if name not in given else checked_starts(given[name], shape)


gymnasium.register(
    ID,
    entry_point=f"{__name__}:FollowWallsEnv",
    vector_entry_point=f"{__name__}:FollowWallsVectorEnv",
)
