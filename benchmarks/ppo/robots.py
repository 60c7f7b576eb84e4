"""The vector environment as stable-baselines3 wants it."""

# the extra `ppo` is for those who train
# pyright: reportMissingImports=false

from collections.abc import Iterable
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from stable_baselines3.common.vec_env import VecEnv


class Robots(VecEnv):
    """A vector environment whose infos are a dictionary for each robot.

    Both sides put robots on new starts in the same step, so nothing else differs.
    """

    def __init__(self, env: VectorEnv):
        """Wrap an environment."""
        self._env = env
        super().__init__(
            env.num_envs, env.single_observation_space, env.single_action_space
        )

    def reset(self) -> np.ndarray:
        """Observations `(n, 8)` on new starts; of the seed that `seed` was told."""
        observation, _ = self._env.reset(seed=self._seeds[0])
        self._reset_seeds()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions `(n, 2)` of the next step."""
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Observations, rewards, which trials are over, and infos."""
        seen, reward, crashed, over, infos = self._env.step(self._actions)
        each: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        done = crashed | over
        for i in np.flatnonzero(done):
            each[i] = {
                "terminal_observation": infos["final_obs"][i],
                "TimeLimit.truncated": bool(over[i]),
            }
        return seen, reward, done, each

    def close(self) -> None:
        """Close the environment."""
        self._env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the environment, once for each robot."""
        return [getattr(self._env, attr_name)] * self._n(indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: all robots share one environment."""
        raise NotImplementedError("robots share one environment")

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Refuse: all robots share one environment."""
        raise NotImplementedError("robots share one environment")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Of no robot."""
        return [False] * self._n(indices)

    def _n(self, indices: int | Iterable[int] | None) -> int:
        return len(list(self._get_indices(indices)))
