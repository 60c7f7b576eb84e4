"""Measurements: what the physics step costs, and what it may cost."""

import os

# as in the project's commands: dm_control looks for no display
os.environ.setdefault("MUJOCO_GL", "disabled")
