"""MuJoCo's warnings as errors: after one, a simulation means nothing."""

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
from mujoco.batch import SimulationError

from epuck_mj.errors import UserError
from epuck_mj.scene.model import Scene


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
        text = mujoco.mju_warningText(int(first[-1]), int(last[first]))
        raise unstable(scene, text)


def unstable(scene: Scene, said: str) -> UserError:
    """The error for a scene of which MuJoCo says that it cannot be simulated."""
    words = " ".join(said.split())
    return UserError(
        f"robot '{scene.robot}' cannot be simulated in arena '{scene.arena}': MuJoCo "
        f"warns: {words}"
    )
