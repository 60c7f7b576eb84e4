"""Gymnasium's environment of many robots at once."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from epuck_mj.environments.endless_trials import EndlessTrials
from epuck_mj.environments.options import Options
from epuck_mj.environments.spaces import check_mode, checked_action, spaces, start_of
from epuck_mj.errors import UserError
from epuck_mj.host.limits import check


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
        check_mode(render_mode, self.metadata["render_modes"])
        try:
            check("num_envs", num_envs)
        except ValueError as error:
            raise UserError(str(error)) from None
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = spaces()
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
        starts = start_of(options, "starts", (self.num_envs, 3))
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
