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

from epuck_mj.errors import UserError

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise UserError(
        f"the environment needs '{error.name}', which is not installed: "
        "pip install 'epuck-mj[gym]'"
    ) from None

from epuck_mj.environments.many_robots import FollowWallsVectorEnv
from epuck_mj.environments.one_robot import FollowWallsEnv

__all__ = ["ID", "FollowWallsEnv", "FollowWallsVectorEnv"]

ID = "epuck_mj/FollowWalls-v0"

gymnasium.register(
    ID,
    entry_point=f"{__name__}:FollowWallsEnv",
    vector_entry_point=f"{__name__}:FollowWallsVectorEnv",
)
