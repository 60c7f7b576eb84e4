"""Check of an arena: its contents and its faults.

Each part examines a scene and returns findings. Only `report` makes text of them, and
only `__main__` prints.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from epuck_mj.check.at_rest import rest_findings
from epuck_mj.check.findings import Finding, Place, Severity, Unusable, error
from epuck_mj.check.parts import part_findings
from epuck_mj.check.room import room_findings
from epuck_mj.check.source import TOPIC, Source, compiled_source, read
from epuck_mj.check.speed import speed_findings
from epuck_mj.check.walls import finite_findings, plane_findings, wall_findings
from epuck_mj.errors import UserError
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import find_arena, find_robot
from epuck_mj.scene.starts import FreeSpace, Grid, survey
from epuck_mj.step.control import START_CLEARANCE

SUBSTEPS_MAX = 10_000
"""Most physics steps in a control step: more would take too long."""

N_STARTS = 8
"""Number of starts at which a robot is left at rest."""

SEED = 0
"""Seed of the starts at which a robot is left at rest."""


@dataclass(frozen=True, eq=False)
class Report:
    """Findings of a check, with the scene and the free space.

    Attributes:
        arena: path of its MJCF.
        findings: in the order in which they were found, none of them twice.
        scene: the arena with the first robot; None if there is none.
        grid: where that robot fits; None if there are no walls.
    """

    arena: Path
    findings: tuple[Finding, ...]
    scene: Scene | None
    grid: Grid | None


def check_arena(arena: str, robots: Sequence[str]) -> Report:
    """Check an arena with each robot.

    Args:
        arena: name of a shipped arena, or path of an MJCF.
        robots: names of shipped robots, or paths of MJCF files.

    Raises:
        UserError: if the arena cannot be read, or a robot cannot be used at all.
    """
    path = find_arena(arena)
    checks = []
    for robot in robots:
        # in an arena that is sound, what is wrong is the robot
        load_scene(robot, "arena")
        checks.append(_check(path, robot))
    # what was found with each robot is one finding
    findings = dict.fromkeys(found for check in checks for found in check.findings)
    first = checks[0]
    return Report(path, tuple(findings), first.scene, first.grid)


def _check(arena: Path, robot: str) -> Report:
    """Findings about an arena with one robot, as far as they can be made."""
    findings: list[Finding] = []
    scene = grid = None
    try:
        source = read(arena, find_robot(robot))
        model, places = compiled_source(source)
        findings += finite_findings(model, places) or plane_findings(model, places)
        if not findings:
            scene = _scene(source, robot)
            findings += wall_findings(scene, places)
            grid = _grid(scene)
            findings += room_findings(scene, grid)
            if all(finding.severity is not Severity.ERROR for finding in findings):
                findings += _robot_findings(scene, robot, source, places)
    except Unusable as problem:
        findings.append(problem.finding)
    return Report(arena, tuple(findings), scene, grid)


def _scene(source: Source, robot: str) -> Scene:
    """The scene, if a usable one can be made of the source.

    Raises:
        Unusable: if not.
    """
    step = source.setting("option", "timestep")
    try:
        scene = load_scene(robot, str(source.scene.arena))
    except UserError as problem:
        place = step if "physics step" in str(problem) else Place(source.scene.arena)
        raise Unusable(error(TOPIC, str(problem), place)) from None
    if scene.n_substeps > SUBSTEPS_MAX:
        text = f"a control step would be {scene.n_substeps:,} physics steps long; "
        text += f"expected at most {SUBSTEPS_MAX:,}"
        raise Unusable(error(TOPIC, text, step))
    return scene


def _grid(scene: Scene) -> Grid:
    """Grid of the places where the robot fits.

    Raises:
        Unusable: if there are no walls.
    """
    try:
        return survey(scene, START_CLEARANCE)
    except UserError as problem:
        raise Unusable(error("walls", str(problem), Place(scene.arena))) from None


def _robot_findings(
    scene: Scene, robot: str, source: Source, places: tuple[Place, ...]
) -> list[Finding]:
    """Findings about a robot at starts, if the arena has any."""
    topic = f"robot {Path(robot).name}"
    rng = np.random.default_rng(SEED)
    starts = FreeSpace(scene, START_CLEARANCE).sample(rng, N_STARTS)
    step = source.setting("option", "timestep")
    return [
        *part_findings(scene, starts[0], topic),
        *rest_findings(scene, starts, topic, places),
        *speed_findings(scene, starts[0], topic, step),
    ]
