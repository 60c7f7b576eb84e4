"""Findings about what rays see where the robot can touch something.

Robots are put to the outlines of things, headed straight at them. What counts is what
the shell meets there and what rays see there, from whichever geom.
"""

import mujoco
import numpy as np

from epuck_mj.check.findings import Finding, error, warning
from epuck_mj.check.heights import Heights, extent, mm
from epuck_mj.check.meetings import DEPTH, TOUCH, meetings
from epuck_mj.check.source import Places
from epuck_mj.check.walls import no_wall
from epuck_mj.constants import PROXIMITY_RANGE
from epuck_mj.scene.geometry import kinematics, seen_by_rays, walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import SHELL, of_robot, static
from epuck_mj.scene.starts import Grid

TOPIC = "walls"


def sight_findings(
    scene: Scene, grid: Grid, places: Places, heights: Heights
) -> list[Finding]:
    """Findings about walls that rays do not see, and seen things that are no walls."""
    model = scene.model
    solid = walls(model)
    ghost = static(model) & ~solid & seen_by_rays(model)
    ghost &= ~of_robot(model)
    met = meetings(scene, grid, solid | ghost, sum(heights.rays) / 2)
    unseen = met.touches & (met.behind > PROXIMITY_RANGE)
    deep = met.touches & ~unseen & (met.behind > DEPTH)
    blind = met.touches & ~unseen & (met.ahead > PROXIMITY_RANGE)
    through = met.passes & (np.abs(met.behind) <= TOUCH)
    findings = []
    for geom in np.unique(met.geom).tolist():
        of_geom, place = met.geom == geom, places.geom(geom)
        if (of_geom & unseen).any():
            text = f"rays cannot see it: {_why(model, geom, heights)}"
            where = _where(met.poses[of_geom & unseen])
            findings.append(error(TOPIC, text, place, where))
        elif (of_geom & deep).any():
            depth = met.behind[of_geom & deep].max()
            text = f"rays see a wall {mm(depth)} behind where the shell touches it"
            where = _where(met.poses[of_geom & deep])
            findings.append(warning(TOPIC, text, place, where))
        elif (of_geom & blind).any():
            rays = "the rays" if scene.cosines.size else "single rays"
            text = f"too thin for {rays}: straight ahead, a robot sees nothing "
            where = _where(met.poses[of_geom & blind])
            findings.append(warning(TOPIC, text + "until it crashes", place, where))
        elif (of_geom & through).any():
            findings.append(warning(TOPIC, no_wall(model, geom), place))
    return findings


def same_view(scene: Scene, other: Scene) -> bool:
    """Whether two robots hit and see alike in one arena, so one check will do."""
    if scene.rays.shape != other.rays.shape:
        return False
    views = []
    for one in (scene, other):
        _, _, origin, direction = kinematics(one, np.zeros((1, 3)))
        shell = one.model.geom(SHELL)
        low, high = extent(one.model, shell.id)
        views.append(
            np.concatenate([*origin[0], *direction[0], shell.size, [low, high]])
        )
    return np.allclose(*views, rtol=0, atol=TOUCH / 10)


def _why(model: mujoco.MjModel, geom: int, heights: Heights) -> str:
    """Why rays do not see a geom that the shell touches."""
    low, high = extent(model, geom)
    if not seen_by_rays(model)[geom]:
        material = model.geom_matid[geom]
        of = f" of material '{model.material(material).name}'" if material >= 0 else ""
        return f"alpha 0{of}; expected more"
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
        size = " x ".join(f"{half:g}" for half in model.geom_size[geom, :2])
        return f"rays see a plane within its size only, {size} m; expected more, or 0"
    if high < heights.rays[0]:
        return f"it ends at {mm(high)}, rays run at {mm(heights.rays[0])}"
    if low > heights.rays[1]:
        return f"it begins at {mm(low)}, rays run at {mm(heights.rays[1])}"
    return f"where the shell touches it, there is nothing within {mm(PROXIMITY_RANGE)}"


def _where(poses: np.ndarray) -> str:
    x, y, _ = poses[len(poses) // 2]
    return f" (near x {x:.2f} m, y {y:.2f} m)"
