"""Geoms of a compiled scene as rerun's shapes."""

import mujoco
import numpy as np
import rerun as rr

from epuck_mj.geometry import arena_box, color, drawn, moving_bodies

FLOOR_THICKNESS = 0.002
"""Of planes, as drawn [m]."""


def log_geoms(stream: rr.RecordingStream, model: mujoco.MjModel) -> None:
    """What does not change: geoms in the frame of their body."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    moving = moving_bodies(model)
    for geom in np.flatnonzero(drawn(model)):
        body = model.geom_bodyid[geom]
        position, quaternion = model.geom_pos[geom], model.geom_quat[geom]
        if body not in moving:
            position, quaternion = data.geom_xpos[geom], np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, data.geom_xmat[geom])
        name = model.geom(geom).name or f"geom{geom}"
        place = rr.Transform3D(
            translation=position, quaternion=quaternion[[1, 2, 3, 0]].tolist()
        )
        shape = _shape(model, int(geom))
        stream.log(f"{body_entity(model, body)}/{name}", place, shape, static=True)


def body_entity(model: mujoco.MjModel, body: int) -> str:
    """Where a body is logged; all that stands still is the arena."""
    if model.body_weldid[body] == 0:
        return "world/arena"
    return f"world/{model.body(body).name or f'body{body}'}"


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
        mesh = model.mesh(model.geom_dataid[geom])
        vertices = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
        faces = model.mesh_face[mesh.faceadr[0] :][: mesh.facenum[0]]
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
