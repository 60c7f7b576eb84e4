"""Gymnasium's environment of one robot."""

from typing import Any

import gymnasium
import numpy as np

from epuck_mj.environments.endless_trials import EndlessTrials
from epuck_mj.environments.options import Options
from epuck_mj.environments.picture import TrialPicture
from epuck_mj.environments.spaces import (
    check_mode,
    checked_action,
    checked_size,
    spaces,
    start_of,
)
from epuck_mj.errors import UserError


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
        check_mode(render_mode, self.metadata["render_modes"])
        chosen = Options.of({"threads": 1} | options)
        self.render_mode = render_mode
        self.observation_space, self.action_space = spaces()
        self._trials = EndlessTrials(chosen, 1)
        self._living, self._picture = False, None
        step = chosen.control_step
        self.metadata = self.metadata | {"render_fps": max(1, round(1 / step))}
        if render_mode is not None:
            size = checked_size(width, height)
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
        start = start_of(options, "start", (3,))
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
