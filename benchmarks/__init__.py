"""Measurements: what the physics step costs, and what it may cost."""

from epuck_mj.host.loading import set_environment

set_environment()
