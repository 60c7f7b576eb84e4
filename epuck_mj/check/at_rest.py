"""Robots at rest at starts: what they touch, and whether they stay."""

from dataclasses import dataclass

import mujoco
import numpy as np

from epuck_mj.check.findings import Finding, Place, error, info, warning
from epuck_mj.check.source import Places
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import PREFIX, ROBOT_BODY

SETTLING = 1.0
"""How long a robot is left at rest [s]."""

STEPS_MAX = 5000
"""Most physics steps for which a robot is left at rest."""

MOVED_MAX = 0.001
"""How far a robot at rest may move, in any direction [m]."""

DEPTH_MAX = 0.001
"""How deep geoms that touch may sink into each other [m]."""


@dataclass(frozen=True)
class Rest:
    """Result of leaving a robot at rest.

    Attributes:
        touching: pairs of geoms that touch, the robot's own among them.
        depth: how deep the deepest of them sinks in [m]; 0 if nothing touches.
        crashed: whether its shell touches something.
        moved: how far it moved along x, y and z [m], `(3,)`.
    """

    touching: frozenset[tuple[int, int]]
    depth: float
    crashed: bool
    moved: np.ndarray


def settle(scene: Scene, start: np.ndarray) -> Rest:
    """Simulate a robot without commands on a start `(3,)`."""
    model, data = scene.model, mujoco.MjData(scene.model)
    robot = model.body(ROBOT_BODY).id
    data.qpos[:] = scene.qpos(start)
    mujoco.mj_forward(model, data)
    before = data.xpos[robot].copy()
    n_steps = min(round(SETTLING / model.opt.timestep), STEPS_MAX)
    mujoco.mj_step(model, data, n_steps)
    # contacts and sensors of where it is now
    mujoco.mj_forward(model, data)
    touching, depth = set(), 0.0
    for contact in data.contact:
        first, second = (int(geom) for geom in contact.geom)
        if robot not in model.body_rootid[model.geom_bodyid[[first, second]]]:
            continue
        if contact.dist <= 0:
            touching.add((first, second))
            depth = max(depth, -float(contact.dist))
    crashed = bool(scene.reading(data.sensordata).contact)
    return Rest(frozenset(touching), depth, crashed, data.xpos[robot] - before)


def rest_findings(
    scene: Scene, starts: np.ndarray, topic: str, places: Places
) -> list[Finding]:
    """Findings about robots left at rest on starts `(n, 3)`."""
    rests = [settle(scene, start) for start in starts]
    place = Place(scene.arena)
    pairs = frozenset[tuple[int, int]]().union(*(rest.touching for rest in rests))
    names = [_pair(scene.model, pair, places) for pair in sorted(pairs)]
    depth = max(rest.depth for rest in rests)
    seconds = f"{SETTLING:g} s alone at {len(starts)} starts"
    findings = [
        info(
            topic,
            f"after {seconds} touch: {', '.join(names)}; "
            f"deepest penetration {1000 * depth:.3f} mm"
            if names
            else f"after {seconds} touch: nothing",
        )
    ]
    crashes = sum(rest.crashed for rest in rests)
    if crashes:
        text = f"the shell touches something after {seconds}, at {crashes} of them"
        findings.append(error(topic, text, place))
    else:
        findings.append(info(topic, "the shell touches nothing"))
    moved = max((rest.moved for rest in rests), key=lambda by: float(np.abs(by).max()))
    if not np.abs(moved).max() <= MOVED_MAX:
        x, y, z = 1000 * moved
        text = f"robots do not stay where they are put: after {seconds} one has moved "
        text += f"by {x:.1f}, {y:.1f}, {z:.1f} mm along x, y, z; expected a "
        findings.append(error(topic, text + "level floor", place))
    if depth > DEPTH_MAX:
        text = f"geoms at rest sink {1000 * depth:.1f} mm into each other; "
        findings.append(warning(topic, text + "expected a stiffer contact", place))
    return findings


def _pair(model: mujoco.MjModel, pair: tuple[int, int], places: Places) -> str:
    """Two geoms, by name or by line."""
    names = [
        model.geom(geom).name.removeprefix(PREFIX)
        or f"geom of line {places.geom(geom).line}"
        for geom in pair
    ]
    return " and ".join(names)
