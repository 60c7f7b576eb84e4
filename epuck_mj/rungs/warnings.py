"""MuJoCo's warnings as errors: after one, a simulation means nothing."""

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
from mujoco.batch import SimulationError

from epuck_mj.errors import UserError
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import ROBOT_BODY


def silence() -> None:
    """Keep MuJoCo from printing its warnings and writing them to a file: we raise."""
    config = mujoco.MjLogConfig.get()
    config.logto_console = config.logto_file = False
    mujoco.MjLogConfig.set(config)


@contextmanager
def heeded(scene: Scene, number: np.ndarray, last: np.ndarray) -> Iterator[None]:
    """Raise an error for what MuJoCo warns of, or refuses, in the block.

    Args:
        scene: that is simulated.
        number: MuJoCo's live counters of each kind of warning, `(..., kinds)`.
        last: what the last of each kind was about, likewise.

    Raises:
        UserError: with MuJoCo's words.
    """
    try:
        yield
    except (SimulationError, mujoco.FatalError) as problem:
        raise unstable(scene, str(problem)) from None
    if number.any():
        first = tuple(np.argwhere(number)[0])
        kind, about = int(first[-1]), int(last[first])
        mover = _mover(scene, about) if kind in _OF_A_DOF else None
        raise unstable(scene, mujoco.mju_warningText(kind, about), mover)


def unstable(scene: Scene, said: str, mover: str | None = None) -> UserError:
    """The error for a scene of which MuJoCo says that it cannot be simulated.

    Args:
        scene: robot and arena.
        said: MuJoCo's words.
        mover: what it is in the arena that cannot, if it is not the robot.
    """
    words = " ".join(said.split())
    step = f"a step of {scene.model.opt.timestep:g} s, that of robot '{scene.robot}'"
    what = (
        f"{mover} cannot be simulated with {step},"
        if mover
        else (f"robot '{scene.robot}' cannot be simulated")
    )
    return UserError(f"{what} in arena '{scene.arena}': MuJoCo warns: {words}")


_WARNING = mujoco.mjtWarning

_OF_A_DOF = {_WARNING.mjWARN_BADQPOS, _WARNING.mjWARN_BADQVEL, _WARNING.mjWARN_BADQACC}
"""Warnings about one of the degrees of freedom."""


def _mover(scene: Scene, dof: int) -> str | None:
    """The thing of an arena that has a degree of freedom; None if it is the robot's."""
    model = scene.model
    body = model.body_rootid[model.dof_bodyid[min(dof, model.nv - 1)]]
    name = model.body(body).name
    if name == ROBOT_BODY:
        return None
    return f"what moves, body '{name}'," if name else "what moves, a body without name,"
