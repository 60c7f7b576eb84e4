"""Scenes: a robot put into an arena, checked, compiled, names turned into indices.

An arena is any MJCF with walls. It may include a robot, so that MuJoCo's viewer shows
the whole scene; `load_scene` replaces that robot by the one asked for. The robot has
the same physics in every arena: see `mjcf`.
"""

import copy
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from pathlib import Path
from typing import Any, Self, TypeVar, cast

import mujoco
import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.cones import cosines_of, ray_names
from epuck_mj.scene.floor import check_floor
from epuck_mj.scene.mjcf import compiled
from epuck_mj.scene.model_files import find_arena, find_robot
from epuck_mj.scene.robot_parts import (
    ROBOT_BODY,
    SHELL,
    WHEELS,
    check_base,
    index_of,
    sensor_address,
)
from epuck_mj.step.cones import cone_distance
from epuck_mj.step.sensors import Reading

_OBJECT, _SENSOR = mujoco.mjtObj, mujoco.mjtSensor
_DISABLE = mujoco.mjtDisableBit

FEW_GEOMS = 64
"""Below this number, geoms are faster compared one by one than in a tree of boxes."""

Measure = TypeVar("Measure", bound=Callable[..., Any])


@dataclass(frozen=True, eq=False)
class Scene:
    """A compiled scene and where its robot's parts are.

    Attributes:
        model: the compiled model.
        n_substeps: physics steps in a control step.
        wheels: indices of the wheels' actuators, left and right, `(2,)`.
        name: of the robot, which says how it is simulated; see `rungs.table`.
        robot: path of the robot's MJCF.
        arena: path of the arena's MJCF.
        sha256: of each file compiled: `arena`, `robot`, and all others by path.
        floor: indices of geoms that were made a floor, whatever their bits were.
        height: of the floor that the robot stands on [m].
        rays: indices of the sites of the proximity sensors' rays, `(8,)`; of sensors
            that see cones `(24,)`: middle rays, those to the left, those to the right.
        cosines: of the angles between middle and outer rays, `(8,)`; `(0,)` of sensors
            with one ray.
    """

    model: mujoco.MjModel
    n_substeps: int
    wheels: np.ndarray
    name: str
    robot: Path
    arena: Path
    sha256: Mapping[str, str]
    floor: tuple[int, ...]
    height: float
    rays: np.ndarray
    cosines: np.ndarray
    _distance: np.ndarray
    _contact: int
    _touches: slice

    @cached_property
    def _base(self) -> int:
        """First index of the robot's free joint in qpos."""
        return int(self.model.jnt_qposadr[self.model.body(ROBOT_BODY).jntadr[0]])

    def qpos(self, poses: np.ndarray) -> np.ndarray:
        """Positions `(..., nq)` with the robot on `(..., 3)`: x, y [m], yaw [rad]."""
        poses = np.asarray(poses, float)
        base = self._base
        qpos = np.broadcast_to(
            self.model.qpos0, (*poses.shape[:-1], self.model.nq)
        ).copy()
        qpos[..., base : base + 2] = poses[..., :2]
        qpos[..., base + 3] = np.cos(poses[..., 2] / 2)
        qpos[..., base + 4 : base + 6] = 0.0
        qpos[..., base + 6] = np.sin(poses[..., 2] / 2)
        return qpos

    def poses(self, qpos: np.ndarray) -> np.ndarray:
        """Poses of the robot, `(..., 3)`: x, y [m], yaw [rad], from `(..., nq)`."""
        base = self._base
        w, x, y, z = np.moveaxis(qpos[..., base + 3 : base + 7], -1, 0)
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        return np.concatenate([qpos[..., base : base + 2], yaw[..., None]], axis=-1)

    def sparing(self) -> mujoco.MjModel:
        """The model for a robot that is read only at the end of each control step.

        It costs less: rays are computed only then. The robot moves and senses as in
        `model`, to the bit.
        """
        model = copy.copy(self.model)
        rays = model.sensor_type == _SENSOR.mjSENS_RANGEFINDER
        # a little less, for the rounding of MuJoCo's time
        model.sensor_interval[rays, 0] = (
            self.n_substeps * model.opt.timestep * (1 - 1e-7)
        )
        model.opt.disableflags |= int(_DISABLE.mjDSBL_ISLAND)
        if model.ngeom < FEW_GEOMS:
            model.opt.disableflags |= int(_DISABLE.mjDSBL_MIDPHASE)
        return model

    def reading(
        self, sensordata: np.ndarray, history: np.ndarray | None = None
    ) -> Reading:
        """Reading of the robot.

        Args:
            sensordata: MuJoCo's, `(..., nsensordata)`.
            history: MuJoCo's, `(..., nhistory)`: touches in any physics step of the
                last control step count; if None, only those of now.
        """
        contact = sensordata[..., self._contact] > 0
        if history is not None:
            contact |= (history[..., self._touches] > 0).any(axis=-1)
        distance = sensordata[..., self._distance]
        if self.cosines.size:
            middle, left, right = np.split(distance, 3, axis=-1)
            distance = cone_distance(middle, left, right, self.cosines)
        return Reading(distance, contact)

    def touched_at_end(self) -> Self:
        """The same, where a touch that is over when a control step ends is no crash."""
        return replace(self, _touches=slice(0))


def once_per_model(measure: Measure) -> Measure:
    """Compute a function of a scene only once for scenes that are compiled alike.

    Its result depends on the model and on arguments behind the scene that can be
    compared. Callers must not change the result.
    """
    known: dict[object, Any] = {}

    @wraps(measure)
    def remembered(scene: Scene, *others: Any) -> Any:
        buffer = np.empty(mujoco.mj_sizeModel(scene.model), np.uint8)
        mujoco.mj_saveModel(scene.model, None, buffer)
        key = hashlib.sha256(buffer.tobytes()).digest(), *others
        if key not in known:
            found = measure(scene, *others)
            # a study meets few arenas; a long session may meet many
            if len(known) == REMEMBERED:
                known.clear()
            known[key] = found
        return known[key]

    return cast(Measure, remembered)


REMEMBERED = 32
"""Number of results of each function that are kept in memory."""


def load_scene(
    robot: str,
    arena: str,
    control_step: float = 0.1,
    physics_step: float | None = None,
) -> Scene:
    """Put a robot into an arena.

    Args:
        robot: name of a shipped robot, or path of an MJCF with the same interface.
        arena: name of a shipped arena, or path of an MJCF with walls.
        control_step: its duration [s], a multiple of the physics step.
        physics_step: its duration [s]; None is the robot's own.

    Raises:
        UserError: if a file is missing or broken, or a part of the robot is.
    """
    robot_path, arena_path = find_robot(robot), find_arena(arena)
    made = compiled(arena_path, robot_path, control_step, physics_step)
    model = made.model
    check_base(model, robot_path)
    index_of(model, _OBJECT.mjOBJ_GEOM, SHELL, robot_path)
    check_floor(model, made.height, arena_path)
    wheels = [
        index_of(model, _OBJECT.mjOBJ_ACTUATOR, name, robot_path) for name in WHEELS
    ]
    names = ray_names(model, robot_path)
    distance = [
        sensor_address(model, name, _SENSOR.mjSENS_RANGEFINDER, robot_path)
        for name in names
    ]
    contact = sensor_address(model, SHELL, _SENSOR.mjSENS_CONTACT, robot_path)
    if model.opt.timestep <= 0:
        raise UserError(
            f"robot '{robot_path}': expected a physics step above 0 s, "
            f"got {model.opt.timestep:g} s"
        )
    ratio = control_step / model.opt.timestep
    n_substeps = round(ratio)
    if n_substeps < 1 or abs(ratio - n_substeps) > 1e-8:
        raise UserError(
            f"expected a control step that is a multiple of the physics step, "
            f"{model.opt.timestep:g} s, got {control_step:g} s"
        )
    return Scene(
        model,
        n_substeps,
        np.array(wheels),
        Path(robot).stem,
        robot_path,
        arena_path,
        made.sha256,
        made.floor,
        made.height,
        np.array([model.sensor(name).objid[0] for name in names]),
        cosines_of(model, names, robot_path),
        np.array(distance),
        contact,
        _samples(model, SHELL),
    )


def _samples(model: mujoco.MjModel, sensor: str) -> slice:
    """Indices in MuJoCo's history of the values that a sensor remembers.

    A sensor's part of it is two numbers of MuJoCo's own, the times, then the values.
    """
    index = model.sensor(sensor).id
    n = int(model.sensor_history[index, 0])
    first = int(model.sensor_historyadr[index]) + 2 + n
    return slice(first, first + n * int(model.sensor_dim[index]))
