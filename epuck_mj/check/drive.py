"""Findings about how a robot drives in an arena, compared with the plain one."""

import numpy as np

from epuck_mj.check.findings import Finding, Place, error, info
from epuck_mj.constants import SPEED_MAX, WHEEL_RADIUS
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.step.control import TaskParameters

PLAIN = "arena"
"""Name of the arena that a drive is compared with."""

LENGTH_MAX = 0.25
"""Longest way that is driven [m]: two seconds at full speed."""

SPACING = 0.01
"""Distance of the places on the way whose clearance is measured [m]."""

ROOM = 0.005
"""Least clearance on the way [m]."""

MOVED_MAX, TURNED_MAX = 0.005, np.radians(2)
"""Largest differences to the plain arena [m], [rad].

On wheels, half a metre in other directions differs by up to 2 mm: tyres slip.
"""


def drive_findings(
    scene: Scene, robot: str, starts: np.ndarray, topic: str, place: Place
) -> list[Finding]:
    """Findings about a robot that drives along a wall and back.

    Args:
        scene: robot and arena.
        robot: its name or path.
        starts: from which the one with the longest way is taken, `(n, 3)`.
        topic: heading of the findings.
        place: what an error is about.

    Raises:
        UserError: if MuJoCo warns of a simulation that means nothing.
    """
    start, length = _longest_way(scene, starts)
    plain = load_scene(robot, PLAIN)
    here, crashed = _driven(scene, start, length)
    there, _ = _driven(plain, np.array([-LENGTH_MAX / 2, 0, 0]), length)
    off = np.abs(here - there).max(axis=0)
    moved, turned = off[:2].max(), off[2]
    way = f"driving {1000 * length:.0f} mm along a wall and back"
    if crashed:
        text = f"{way}, the robot crashes where its way is free"
        return [error(topic, text, place)]
    text = f"{way}, it is {1000 * moved:.1f} mm and {np.degrees(turned):.1f} deg off "
    text += "what it does in the plain arena"
    if moved > MOVED_MAX or turned > TURNED_MAX:
        text += "; expected a level floor, and nothing on it or in the way"
        return [error(topic, text, place)]
    return [info(topic, text)]


def _longest_way(scene: Scene, starts: np.ndarray) -> tuple[np.ndarray, float]:
    """A start `(3,)`, headed along the nearest wall, and how far it can drive [m]."""
    probe = ClearanceProbe(scene, 1)
    direction = probe.measure(starts).direction
    poses = starts.copy()
    near = np.isfinite(direction)
    poses[near, 2] = direction[near] + np.pi / 2
    ahead = np.arange(0, LENGTH_MAX + SPACING, SPACING)
    heading = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
    ways = np.repeat(poses[:, None], len(ahead), axis=1)
    ways[..., :2] += ahead[:, None] * heading[:, None]
    free = (probe.measure(ways).distance >= ROOM).cumprod(axis=1).sum(axis=1)
    best = int(free.argmax())
    return poses[best], float(ahead[max(free[best] - 1, 0)])


def _driven(scene: Scene, start: np.ndarray, length: float) -> tuple[np.ndarray, bool]:
    """Poses `(rows, 3)` in the frame of the start, and whether the robot crashed."""
    task = TaskParameters()
    robots = robots_in(scene, 1, 1)
    robots.reset(start[None])
    n = max(1, int(length / (SPEED_MAX * task.control_step)))
    speed = length / (n * task.control_step * WHEEL_RADIUS)
    poses, crashed = [], False
    for command in (speed, -speed):
        for _ in range(n):
            reading = robots.step(np.full((1, 2), command))
            poses.append(robots.poses()[0] - start)
            crashed |= bool(reading.contact[0])
    moved = np.array(poses)
    cos, sin = np.cos(start[2]), np.sin(start[2])
    x, y = moved[:, 0].copy(), moved[:, 1].copy()
    moved[:, 0], moved[:, 1] = cos * x + sin * y, cos * y - sin * x
    moved[:, 2] = np.remainder(moved[:, 2] + np.pi, 2 * np.pi) - np.pi
    return moved, crashed
