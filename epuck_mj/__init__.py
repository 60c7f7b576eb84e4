"""A MuJoCo e-puck: model, sensors, motors, controllers and dm_control tasks."""

import os

# Nothing here draws: without this, a machine without a display prints GLFW warnings.
os.environ.setdefault("MUJOCO_GL", "disabled")

from epuck_mj.errors import UserError
from epuck_mj.tasks import SUITE, load

__all__ = ["SUITE", "UserError", "load"]
