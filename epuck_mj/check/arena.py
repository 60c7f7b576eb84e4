"""Check of an arena: its contents and its faults.

Each part examines a scene and returns findings. Only `report` makes text of them, and
only `__main__` prints.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from epuck_mj.check.at_rest import rest_findings
from epuck_mj.check.drive import drive_findings
from epuck_mj.check.findings import (
    Finding,
    Place,
    Unusable,
    error,
    errors,
    info,
    warning,
)
from epuck_mj.check.heights import heights_of
from epuck_mj.check.parts import part_findings
from epuck_mj.check.room import room_findings
from epuck_mj.check.sight import same_view, sight_findings
from epuck_mj.check.source import (
    TOPIC,
    Places,
    missing_files,
    place_of,
    places_of,
    read,
    settings_not_used,
)
from epuck_mj.check.speed import speed_findings
from epuck_mj.check.walls import (
    finite_findings,
    floor_findings,
    moving_findings,
    shape_findings,
    untouched_findings,
    wall_findings,
)
from epuck_mj.errors import UserError
from epuck_mj.scene.floor import BadGeom
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import find_arena, is_kinematic
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


def check_arena(
    arena: str, robots: Sequence[str], tell: Callable[[str], object] = lambda _: None
) -> Report:
    """Check an arena with each robot.

    Args:
        arena: name of a shipped arena, or path of an MJCF.
        robots: names of shipped robots, or paths of MJCF files.
        tell: called with the current step, as text: large arenas take half a minute.

    Raises:
        UserError: if the arena cannot be read, or a robot cannot be used at all.
    """
    path = find_arena(arena)
    checks, seen = list[Report](), list[Scene]()
    for robot in robots:
        # an error in the shipped arena is an error of the robot
        load_scene(robot, "arena")
        tell(f"Checking {path.name} with {Path(robot).stem} ...")
        checks.append(_check(path, robot, seen, alone=len(robots) == 1))
    # what was found with each robot is one finding
    findings = dict.fromkeys(found for check in checks for found in check.findings)
    drawn = next((check for check in checks if check.grid), checks[0])
    return Report(path, tuple(findings), drawn.scene, drawn.grid)


def _check(arena: Path, robot: str, seen: list[Scene], alone: bool) -> Report:
    """Findings about an arena with one robot, as far as they can be made.

    Args:
        arena: path of the MJCF.
        robot: name or path.
        seen: scenes of robots whose view was checked; this one is added.
        alone: whether no other robot can use the arena instead.
    """
    findings: list[Finding] = []
    scene = grid = None
    try:
        files = read(arena)
        findings += missing_files(files)
        if errors(findings):
            return Report(arena, tuple(findings), scene, grid)
        scene, places = _scene(files, robot)
        findings += _settings(files)
        findings += finite_findings(scene.model, places)
        findings += shape_findings(scene.model, places)
        if not errors(findings):
            heights = heights_of(scene)
            findings += floor_findings(scene, places)
            findings += moving_findings(scene.model, places)
            try:
                grid = survey(scene, START_CLEARANCE)
            except UserError as problem:
                findings += untouched_findings(scene.model, places, heights)
                findings.append(_about(problem, scene.arena))
                return Report(arena, tuple(findings), scene, None)
            findings += wall_findings(scene, grid, places, heights)
            findings += room_findings(scene, grid, places)
            if not errors(findings) and not any(same_view(scene, s) for s in seen):
                findings += sight_findings(scene, grid, places, heights)
                seen.append(scene)
            if not errors(findings):
                findings += _robot_findings(scene, robot, places, alone)
    except Unusable as problem:
        findings.append(problem.finding)
    return Report(arena, tuple(findings), scene, grid)


def _scene(files: SourceFiles, robot: str) -> tuple[Scene, Places]:
    """The scene and the places of its parts, if a usable one can be made of an arena.

    Raises:
        Unusable: if not.
    """
    try:
        scene = load_scene(robot, str(files.main))
    except BadGeom as problem:
        place = places_of(files).geom(problem.geom)
        raise Unusable(error(TOPIC, problem.problem, place)) from None
    except BadXml as problem:
        raise Unusable(error(TOPIC, problem.problem, place_of(problem))) from None
    except UserError as problem:
        # it may have a line
        places_of(files)
        raise Unusable(_about(problem, files.main)) from None
    try:
        return scene, places_of(files)
    except Unusable:
        return scene, Places((), (), Place(files.main))


def _settings(files: SourceFiles) -> list[Finding]:
    """Information about what the arena says of physics and is not used."""
    shown = settings_not_used(files)
    if not shown:
        return []
    text = f"not used, since the robot brings its own physics: {', '.join(shown)}"
    return [info(TOPIC, text)]


def _about(problem: UserError, arena: Path) -> Finding:
    """An error about an arena as a whole, whose path stands before it anyway."""
    text = str(problem).removeprefix(f"arena '{arena}': ")
    text = text.replace(f"arena '{arena}'", "the arena")
    return error(TOPIC, text.replace(f" '{arena}'", " it"), Place(arena))


def _robot_findings(
    scene: Scene, robot: str, places: Places, alone: bool
) -> list[Finding]:
    """Findings about a robot at starts, if the arena has any."""
    topic = f"robot {Path(robot).name}"
    rng = np.random.default_rng(SEED)
    starts = FreeSpace(scene, START_CLEARANCE).sample(rng, N_STARTS)
    place = Place(scene.arena)
    if is_kinematic(robot):
        try:
            return drive_findings(scene, robot, starts, topic, place)
        except UserError as problem:
            text = _about(problem, scene.arena).text
            return [error(topic, text, place) if alone else warning(topic, text, place)]
    findings = part_findings(scene, starts[0], topic)
    try:
        findings += rest_findings(scene, starts, topic, places)
        findings += drive_findings(scene, robot, starts, topic, place)
        findings += speed_findings(scene, starts[0], topic)
    except UserError as problem:
        findings.append(_about(problem, scene.arena))
    return findings
