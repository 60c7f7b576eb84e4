"""A MuJoCo e-puck: model, sensors, motors, controllers and dm_control tasks."""

import os

# Nothing here draws: without this, a machine without a display prints GLFW warnings.
os.environ.setdefault("MUJOCO_GL", "disabled")

from epuck_mj.environments.dm_control import SUITE, load
from epuck_mj.errors import UserError

__all__ = ["SUITE", "UserError", "load"]
