"""Clearance: how far the shell is from the nearest wall, by true geometry.

MuJoCo's own distance between convex shapes, so any arena will do. It is measured in a
separate model with only the walls and the shell, since a whole scene would also compute
the robot's rays for every pose.

The robot stands upright on its start height, as on a flat floor. Distances are those in
space, which beside upright walls are those in the plane.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from epuck_mj.errors import UserError
from epuck_mj.scene.geometry import mesh, walls
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import SHELL

CLEARANCE_MAX = 0.2
"""Clearance beyond which the nearest wall is not looked for, to save time [m]."""

CHUNK = 8192
"""Number of poses measured at once: bounds memory, changes no result."""

TOLERANCE = 1e-9
"""Tolerance of distances [m]: with MuJoCo's 1e-6 directions are wrong near contact."""

ITERATIONS = 200
"""Most iterations of MuJoCo's distances; most shapes need ten."""

_SHAPE, _SENSOR, _OBJECT = mujoco.mjtGeom, mujoco.mjtSensor, mujoco.mjtObj

MEASURED = {
    _SHAPE.mjGEOM_PLANE,
    _SHAPE.mjGEOM_SPHERE,
    _SHAPE.mjGEOM_CAPSULE,
    _SHAPE.mjGEOM_ELLIPSOID,
    _SHAPE.mjGEOM_CYLINDER,
    _SHAPE.mjGEOM_BOX,
    _SHAPE.mjGEOM_MESH,
}
"""Shapes with an exact distance; a mesh counts as its hull, as in collisions."""

_ROBOT = "robot"


@dataclass(frozen=True, eq=False)
class Clearance:
    """Nearest walls of robots on poses `(...)`; NaN where the pose is NaN.

    Attributes:
        distance: from the shell to the nearest wall [m], `(...)`: negative inside it,
            CLEARANCE_MAX if no wall is nearer than that.
        direction: of the nearest wall point from the robot's axis, in the world
            [rad], `(...)`; NaN if no wall is nearer than CLEARANCE_MAX.
    """

    distance: np.ndarray
    direction: np.ndarray


class ClearanceProbe:
    """Measures clearance in one scene."""

    def __init__(self, scene: Scene, threads: int = 0):
        """Copy walls and shell.

        Args:
            scene: robot and arena.
            threads: threads that measure; 0 is one per core.

        Raises:
            UserError: if a shape has no exact distance.
        """
        self._batch = Batch(_walls_and_shell(scene), CHUNK, threads)
        self._qpos = self._batch.bind("qpos")
        self._sensordata = self._batch.bind("sensordata")

    def measure(self, poses: np.ndarray) -> Clearance:
        """Clearance `(...)` on poses `(..., 3)`: x, y [m], yaw [rad], or NaN."""
        distance = np.full(poses.shape[:-1], np.nan)
        direction = np.full(poses.shape[:-1], np.nan)
        there = np.isfinite(poses).all(axis=-1)
        found = [self._measure(chunk) for chunk in _chunks(poses[there])]
        if found:
            distance[there], direction[there] = np.concatenate(found, axis=1)
        return Clearance(distance, direction)

    def _measure(self, poses: np.ndarray) -> np.ndarray:
        """Distance and direction `(2, n)` on `(n, 3)` poses."""
        ids = np.arange(len(poses), dtype=np.int32)
        self._qpos[ids] = poses
        self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)
        sensed = self._sensordata[ids]
        # from the axis: from the shell, it would have no direction at contact
        to_wall = sensed[:, 4:6] - poses[:, :2]
        direction = np.arctan2(to_wall[:, 1], to_wall[:, 0])
        direction[sensed[:, 0] >= CLEARANCE_MAX] = np.nan
        return np.stack([sensed[:, 0], direction])


def _chunks(poses: np.ndarray) -> list[np.ndarray]:
    return [poses[i : i + CHUNK] for i in range(0, len(poses), CHUNK)]


def _walls_and_shell(scene: Scene) -> mujoco.MjModel:
    """A model of the walls and of the shell on x, y and yaw, with two sensors.

    They give the least distance, and its two points: the shell's, then the wall's.
    """
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[:] = scene.qpos(np.zeros(3))
    mujoco.mj_kinematics(model, data)
    spec = mujoco.MjSpec()
    spec.option.ccd_tolerance, spec.option.ccd_iterations = TOLERANCE, ITERATIONS
    for geom in np.flatnonzero(walls(model)).tolist():
        shape = _SHAPE(model.geom_type[geom])
        if shape not in MEASURED:
            name = shape.name.removeprefix("mjGEOM_").lower()
            raise UserError(
                f"arena '{scene.arena}': no clearance to a wall that is a {name}; "
                "expected plane, box, cylinder, capsule, ellipsoid, sphere or mesh"
            )
        _copy(spec, spec.worldbody, model, data, geom)
    robot = spec.worldbody.add_body(name=_ROBOT)
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for kind, axis in zip((slide, slide, hinge), np.eye(3), strict=True):
        robot.add_joint(type=kind, axis=axis)
    _copy(spec, robot, model, data, model.geom(SHELL).id)
    for kind in (_SENSOR.mjSENS_GEOMDIST, _SENSOR.mjSENS_GEOMFROMTO):
        # between bodies: the nearest of all pairs of their geoms
        spec.add_sensor(
            type=kind,
            objtype=_OBJECT.mjOBJ_BODY,
            objname=_ROBOT,
            reftype=_OBJECT.mjOBJ_BODY,
            refname="world",
            cutoff=CLEARANCE_MAX,
        )
    return spec.compile()


def _copy(spec, body, model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> None:
    """Add a compiled geom to a body at the origin; it collides with nothing."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, data.geom_xmat[geom])
    copy = body.add_geom(
        type=model.geom_type[geom],
        size=model.geom_size[geom],
        pos=data.geom_xpos[geom],
        quat=quaternion,
        contype=0,
        conaffinity=0,
    )
    if model.geom_type[geom] == _SHAPE.mjGEOM_MESH:
        vertices, _ = mesh(model, geom)
        copy.meshname = f"mesh of geom {geom}"
        spec.add_mesh(name=copy.meshname, uservert=vertices.ravel())
