"""Distances from a robot's shell to some of an arena's walls.

They are MuJoCo's own between convex shapes, measured in a separate model with only
these walls and the shell.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco.batch import Batch

from epuck_mj.scene.geometry import mesh
from epuck_mj.scene.model import Scene
from epuck_mj.scene.robot_parts import SHELL

CLEARANCE_MAX = 0.2
"""Clearance beyond which the nearest wall is not looked for, to save time [m]."""

TOLERANCE = 1e-9
"""Tolerance of distances [m]: with MuJoCo's 1e-6 directions are wrong near contact."""

ITERATIONS = 200
"""Most iterations of MuJoCo's distances; most shapes need ten."""

MEMORY = 1_000_000
"""Memory of a model of walls and shell [bytes]."""

_SHAPE, _SENSOR, _OBJECT = mujoco.mjtGeom, mujoco.mjtSensor, mujoco.mjtObj

_ROBOT = "robot"


class NearestWall:
    """Measures distances from the shell to the nearest of some walls."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        some: Sequence[int],
        size: int,
        threads: int,
    ):
        """Copy walls and shell.

        Args:
            model: robot and arena.
            data: where they are, the robot at the origin.
            some: indices of the walls.
            size: number of poses measured at once.
            threads: threads that measure; 0 is one per core.
        """
        self._size = size
        model = _walls_and_shell(model, data, some)
        self._batch = Batch(model, size, threads)
        self._qpos = self._batch.bind("qpos")
        self._sensordata = self._batch.bind("sensordata")

    def measure(self, poses: np.ndarray) -> np.ndarray:
        """Distance and direction `(2, n)` on `(n, 3)` poses."""
        starts = range(0, len(poses), self._size)
        found = [self._measure(poses[i : i + self._size]) for i in starts]
        return np.concatenate(found, axis=1) if found else np.empty((2, 0))

    def _measure(self, poses: np.ndarray) -> np.ndarray:
        ids = np.arange(len(poses), dtype=np.int32)
        self._qpos[ids] = poses
        self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)
        sensed = self._sensordata[ids]
        # from the axis: from the shell, it would have no direction at contact
        to_wall = sensed[:, 4:6] - poses[:, :2]
        direction = np.arctan2(to_wall[:, 1], to_wall[:, 0])
        direction[sensed[:, 0] >= CLEARANCE_MAX] = np.nan
        return np.stack([sensed[:, 0], direction])


def at_start(scene: Scene) -> mujoco.MjData:
    """State of a scene with the robot at the origin, upright on its floor."""
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.qpos(np.zeros(3))
    mujoco.mj_kinematics(scene.model, data)
    return data


def _walls_and_shell(
    model: mujoco.MjModel, data: mujoco.MjData, some: Sequence[int]
) -> mujoco.MjModel:
    """A model of some walls and of the shell on x, y and yaw, with two sensors.

    They give the least distance, and its two points: the shell's, then the wall's.
    """
    spec = mujoco.MjSpec()
    # MuJoCo's own choice is ten times what distances need
    spec.memory = MEMORY
    spec.option.ccd_tolerance, spec.option.ccd_iterations = TOLERANCE, ITERATIONS
    for geom in some:
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
