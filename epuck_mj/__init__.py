"""A MuJoCo e-puck: model, sensors, motors, controllers, environments for agents."""

import importlib
from typing import TYPE_CHECKING, Any

from epuck_mj.host.loading import prepare as _prepare

if TYPE_CHECKING:
    from epuck_mj.environments.dm_control import SUITE, load
    from epuck_mj.errors import UserError
    from epuck_mj.policies.file import ControllerFile, load_controller
    from epuck_mj.policies.network import Controller, Network
    from epuck_mj.policies.topology import check_network
    from epuck_mj.policies.wall_follower import WallFollower
    from epuck_mj.rungs.simulator import Simulator
    from epuck_mj.rungs.table import robots_in
    from epuck_mj.scene.model import Scene, load_scene
    from epuck_mj.scene.starts import FreeSpace
    from epuck_mj.show.figures import trajectory_figure
    from epuck_mj.step.calibration import Calibration
    from epuck_mj.step.conditions import Conditions
    from epuck_mj.step.control import TaskParameters, Trials, run_trials
    from epuck_mj.step.fitness import StepFacts
    from epuck_mj.trials.recorder import record, record_trajectories
    from epuck_mj.trials.trajectory import Trajectory

# the first of a command's modules: loading the others takes seconds
_prepare()

__all__ = [
    "SUITE",
    "Calibration",
    "Conditions",
    "Controller",
    "ControllerFile",
    "FreeSpace",
    "Network",
    "Scene",
    "Simulator",
    "StepFacts",
    "TaskParameters",
    "Trajectory",
    "Trials",
    "UserError",
    "WallFollower",
    "check_network",
    "load",
    "load_controller",
    "load_scene",
    "record",
    "record_trajectories",
    "robots_in",
    "run_trials",
    "trajectory_figure",
]

_MODULES = {
    "Calibration": "epuck_mj.step.calibration",
    "Conditions": "epuck_mj.step.conditions",
    "Controller": "epuck_mj.policies.network",
    "ControllerFile": "epuck_mj.policies.file",
    "FreeSpace": "epuck_mj.scene.starts",
    "Network": "epuck_mj.policies.network",
    "SUITE": "epuck_mj.environments.dm_control",
    "Scene": "epuck_mj.scene.model",
    "Simulator": "epuck_mj.rungs.simulator",
    "StepFacts": "epuck_mj.step.fitness",
    "TaskParameters": "epuck_mj.step.control",
    "Trajectory": "epuck_mj.trials.trajectory",
    "Trials": "epuck_mj.step.control",
    "UserError": "epuck_mj.errors",
    "WallFollower": "epuck_mj.policies.wall_follower",
    "check_network": "epuck_mj.policies.topology",
    "load": "epuck_mj.environments.dm_control",
    "load_controller": "epuck_mj.policies.file",
    "load_scene": "epuck_mj.scene.model",
    "record": "epuck_mj.trials.recorder",
    "record_trajectories": "epuck_mj.trials.recorder",
    "robots_in": "epuck_mj.rungs.table",
    "run_trials": "epuck_mj.step.control",
    "trajectory_figure": "epuck_mj.show.figures",
}


def __getattr__(name: str) -> Any:
    """Import the module of a public name at its first use (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """Names of the module, including those not yet imported."""
    return sorted({*globals(), *__all__})
