"""Requirements on workers, so that they give the same bits as this machine."""

import hashlib
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Self

from distributed import get_worker

import epuck_mj
import evolution
from epuck_mj.errors import UserError
from epuck_mj.host.own_parts import own_part
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import on_wheels
from evolution.settings.config import ExperimentConfig

DECIDING = ("epuck-mj", "mujoco", "numpy", "scipy", "contourpy", "cmaes", "numba")
"""Packages whose versions change the bits of results."""


@dataclass(frozen=True)
class Requirements:
    """What the bits of a trial depend on besides controller, start and task.

    Attributes:
        robot: shipped robot, or the path of an MJCF file.
        arena: shipped arena, or the path of an MJCF file.
        control_step: duration of a control step [s].
        own: names of the user's own parts.
        facts: what has to be the same everywhere, and what it is here.
    """

    robot: str
    arena: str
    control_step: float
    own: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]

    @classmethod
    def here(
        cls, robot: str, arena: str, control_step: float, own: tuple[str, ...] = ()
    ) -> Self:
        """The requirements as met by this machine.

        Raises:
            UserError: if robot, arena or an own part cannot be used.
        """
        facts = {package: version(package) for package in DECIDING}
        facts["code of epuck-mj"] = code()
        for name in (robot, on_wheels(robot)):
            scene = load_scene(name, arena, control_step)
            for part, sha256 in scene.sha256.items():
                facts[f"{part} of '{name}' in '{arena}'"] = sha256[:12]
        for name in own:
            facts[f"'{name}'"] = own_part(name).sha256[:12]
        return cls(robot, arena, control_step, own, tuple(facts.items()))

    def refuse_another(self) -> None:
        """On a worker: refuse work whose results would differ from the client's.

        Raises:
            UserError: naming what differs.
        """
        here = Requirements.here(self.robot, self.arena, self.control_step, self.own)
        ours, theirs = dict(here.facts), dict(self.facts)
        differing = [
            f"{name} (there {ours.get(name)}, here {theirs.get(name)})"
            for name in {**theirs, **ours}
            if ours.get(name) != theirs.get(name)
        ]
        if differing:
            raise UserError(
                f"worker {get_worker().address} would give other results; these "
                f"differ: {', '.join(differing)}"
            )


@cache
def code() -> str:
    """First digits of a hash of this project's Python, which no version identifies."""
    digest = hashlib.sha256()
    for package in (epuck_mj, evolution):
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def requirements_of(config: ExperimentConfig, robot: str | None = None) -> Requirements:
    """The requirements of a run, as met by this machine.

    Args:
        config: of the run.
        robot: whose trials are asked for; None for the config's.

    Raises:
        UserError: as `Requirements.here`.
    """
    own = tuple(config.own_parts)
    robot = robot or config.robot
    return Requirements.here(robot, config.arena, config.control_step, own)
