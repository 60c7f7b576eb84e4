"""Geoms of a compiled scene as shapes of rerun."""

import mujoco
import numpy as np
import rerun as rr

from epuck_mj.scene.boxes import at_rest
from epuck_mj.scene.geometry import arena_box, color, drawn, mesh, moving_bodies
from epuck_mj.scene.robot_parts import PREFIX, ROBOT_BODY
from epuck_mj.show.recording.entities import ARENA, Entities

FLOOR_THICKNESS = 0.002
"""Thickness of planes, as drawn [m]."""


MARK_HEIGHT, LABEL_HEIGHT = 0.085, 0.25
"""Heights of a robot's coloured mark and of its name [m]: the name hides no robot."""

LABEL_COLOR = (255, 255, 255)
"""Colour of a name, which rerun writes on dark grey."""


def log_arena(stream: rr.RecordingStream, model: mujoco.MjModel) -> None:
    """Log the geoms that stand still."""
    data = at_rest(model)
    for geom in _drawn(model, moving=False):
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, data.geom_xmat[geom])
        _log(stream, model, geom, ARENA, data.geom_xpos[geom], quaternion)


def log_robot(
    stream: rr.RecordingStream, model: mujoco.MjModel, place: Entities
) -> None:
    """Log the moving geoms in their bodies' frames, and a mark among several trials."""
    for geom in _drawn(model, moving=True):
        body = place.body(body_name(model, model.geom_bodyid[geom]))
        _log(stream, model, geom, body, model.geom_pos[geom], model.geom_quat[geom])
    if not place.alone:
        mark = rr.Points3D(
            [(0, 0, MARK_HEIGHT)],
            radii=[0.01],
            colors=[place.color],
        )
        stream.log(f"{place.body(ROBOT_BODY)}/mark", mark, static=True)
        label = rr.Points3D(
            [(0, 0, LABEL_HEIGHT)],
            radii=[0.0],
            colors=[LABEL_COLOR],
            labels=[place.name],
        )
        stream.log(f"{place.body(ROBOT_BODY)}/name", label, static=True)


def body_name(model: mujoco.MjModel, body: int) -> str:
    """Name of a body, made up if the model has none."""
    return model.body(body).name or f"body{body}"


def _drawn(model: mujoco.MjModel, moving: bool) -> list[int]:
    """Visible geoms that move, or that do not."""
    moves = np.isin(model.geom_bodyid, moving_bodies(model))
    return np.flatnonzero(drawn(model) & (moves == moving)).tolist()


def _log(
    stream: rr.RecordingStream,
    model: mujoco.MjModel,
    geom: int,
    parent: str,
    position: np.ndarray,
    quaternion: np.ndarray,
) -> None:
    name = model.geom(geom).name.removeprefix(PREFIX) or f"geom{geom}"
    # MuJoCo says wxyz, rerun xyzw
    place = rr.Transform3D(
        translation=position, quaternion=quaternion[[1, 2, 3, 0]].tolist()
    )
    stream.log(f"{parent}/{name}", place, _shape(model, geom), static=True)


def _shape(model: mujoco.MjModel, geom: int) -> rr.AsComponents:
    """A geom in its own frame; MuJoCo's sizes are half sizes."""
    size, kind = model.geom_size[geom], mujoco.mjtGeom(model.geom_type[geom])
    colors, solid = [color(model, geom)], rr.components.FillMode.Solid
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return rr.Cylinders3D(
            lengths=[2 * size[1]], radii=[size[0]], colors=colors, fill_mode=solid
        )
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        # rerun's begin at their origin
        return rr.Capsules3D(
            lengths=[2 * size[1]],
            radii=[size[0]],
            translations=[[0, 0, -size[1]]],
            colors=colors,
            fill_mode=solid,
        )
    if kind in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID):
        radii = size[[0, 0, 0]] if kind == mujoco.mjtGeom.mjGEOM_SPHERE else size
        return rr.Ellipsoids3D(half_sizes=[radii], colors=colors, fill_mode=solid)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        vertices, faces = mesh(model, geom)
        return rr.Mesh3D(
            vertex_positions=vertices, triangle_indices=faces, albedo_factor=colors[0]
        )
    center, half = model.geom_aabb[geom].reshape(2, 3)
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        # size 0 is an endless plane
        reach = np.abs(arena_box(model)).max()
        half = np.where(size[:2] > 0, size[:2], reach)
        center, half = (0, 0, -FLOOR_THICKNESS / 2), (*half, FLOOR_THICKNESS / 2)
    return rr.Boxes3D(
        centers=[center], half_sizes=[half], colors=colors, fill_mode=solid
    )
