"""Check of an arena: its contents and its faults.

Each part examines a scene and returns findings. Only `report` makes text of them, and
only `__main__` prints.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from epuck_mj.check.at_rest import rest_findings
from epuck_mj.check.drive import drive_findings
from epuck_mj.check.findings import Finding, Place, Unusable, error, errors, info
from epuck_mj.check.heights import heights_of
from epuck_mj.check.parts import part_findings
from epuck_mj.check.room import room_findings
from epuck_mj.check.sight import sight_findings
from epuck_mj.check.source import (
    TOPIC,
    geom_places,
    place_of,
    read,
    settings_not_used,
)
from epuck_mj.check.speed import speed_findings
from epuck_mj.check.walls import finite_findings, floor_findings, wall_findings
from epuck_mj.errors import UserError
from epuck_mj.scene.floor import BadGeom
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import find_arena
from epuck_mj.scene.source_files import SourceFiles
from epuck_mj.scene.starts import FreeSpace, Grid, survey
from epuck_mj.scene.xml_elements import BadXml
from epuck_mj.step.control import START_CLEARANCE

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
        files = read(arena)
        scene, places = _scene(files, robot)
        findings += _settings(files)
        findings += finite_findings(scene.model, places)
        if not errors(findings):
            grid = _grid(scene)
            heights = heights_of(scene)
            findings += floor_findings(scene, places)
            findings += wall_findings(scene, grid, places, heights)
            if not errors(findings):
                findings += sight_findings(scene, grid, places, heights)
            findings += room_findings(scene, grid)
            if not errors(findings):
                findings += _robot_findings(scene, robot, places)
    except Unusable as problem:
        findings.append(problem.finding)
    return Report(arena, tuple(findings), scene, grid)


def _scene(files: SourceFiles, robot: str) -> tuple[Scene, tuple[Place, ...]]:
    """The scene and the place of each geom, if a usable one can be made of an arena.

    Raises:
        Unusable: if not.
    """
    try:
        scene = load_scene(robot, str(files.main))
    except BadGeom as problem:
        place = geom_places(files)[problem.geom]
        raise Unusable(error(TOPIC, problem.problem, place)) from None
    except BadXml as problem:
        raise Unusable(error(TOPIC, problem.problem, place_of(problem))) from None
    except UserError as problem:
        # it may have a line
        geom_places(files)
        raise Unusable(error(TOPIC, str(problem), Place(files.main))) from None
    try:
        known = geom_places(files)
    except Unusable:
        known = ()
    unknown = (Place(files.main),) * scene.model.ngeom
    return scene, (*known, *unknown)[: scene.model.ngeom]


def _settings(files: SourceFiles) -> list[Finding]:
    """Information about what the arena says of physics and is not used."""
    shown = [
        f"{element.shown} of line {element.line}"
        for element in settings_not_used(files)
    ]
    if not shown:
        return []
    text = f"not used, since the robot brings its own physics: {', '.join(shown)}"
    return [info(TOPIC, text)]


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
    scene: Scene, robot: str, places: tuple[Place, ...]
) -> list[Finding]:
    """Findings about a robot at starts, if the arena has any."""
    topic = f"robot {Path(robot).name}"
    rng = np.random.default_rng(SEED)
    starts = FreeSpace(scene, START_CLEARANCE).sample(rng, N_STARTS)
    return [
        *part_findings(scene, starts[0], topic),
        *rest_findings(scene, starts, topic, places),
        *drive_findings(scene, starts, topic, Place(scene.arena)),
        *speed_findings(scene, starts[0], topic),
    ]
