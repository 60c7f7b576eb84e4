"""Scenes: a robot put into an arena, checked, compiled, names turned into indices.

An arena is any MJCF with walls. It may include a robot, so that MuJoCo's viewer shows
the whole scene; `load_scene` puts the robot asked for in that one's place. Robots
differ in their base and nothing else: everybody else calls `Scene.qpos` and friends.
"""

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from epuck_mj.constants import N_PROXIMITY
from epuck_mj.errors import UserError
from epuck_mj.files import is_file
from epuck_mj.sensors import Reading

_HERE = Path(__file__).resolve().parent
# beside the package in a checkout, inside it where the wheel is installed
MODELS = next(
    folder for folder in (_HERE / "models", _HERE.parent / "models") if folder.is_dir()
)
SHIPPED_ROBOTS = ("epuck.xml", "epuck_planar.xml")
ADDED_ROBOT = "robot added to the arena.xml"
ROBOT_BODY = "epuck"
SHELL = "shell"
TIMESTEP = "timestep"
WHEELS = ("wheel_left", "wheel_right")
PROXIMITY = tuple(f"ps{i}" for i in range(N_PROXIMITY))

_JOINT, _SENSOR = mujoco.mjtJoint, mujoco.mjtSensor


@dataclass(frozen=True, eq=False)
class Scene:
    """A compiled scene and where its robot's parts are.

    Attributes:
        model: the compiled model.
        n_substeps: physics steps in a control step.
        wheels: indices of the wheels' actuators, left and right, `(2,)`.
        robot: path of the robot's MJCF.
        arena: path of the arena's MJCF.
        sha256: of each text compiled: `arena`, `robot`, and every include by name.
    """

    model: mujoco.MjModel
    n_substeps: int
    wheels: np.ndarray
    robot: Path
    arena: Path
    sha256: Mapping[str, str]
    _distance: np.ndarray
    _contact: int

    @cached_property
    def _base(self) -> tuple[int, bool]:
        """First index of the base in qpos, and whether it is a free joint."""
        joint = self.model.body(ROBOT_BODY).jntadr[0]
        free = self.model.jnt_type[joint] == _JOINT.mjJNT_FREE
        return int(self.model.jnt_qposadr[joint]), bool(free)

    def qpos(self, poses: np.ndarray) -> np.ndarray:
        """Positions `(..., nq)` with the robot on `(..., 3)`: x, y [m], yaw [rad]."""
        poses = np.asarray(poses, float)
        base, free = self._base
        qpos = np.broadcast_to(
            self.model.qpos0, (*poses.shape[:-1], self.model.nq)
        ).copy()
        if free:
            qpos[..., base : base + 2] = poses[..., :2]
            qpos[..., base + 3] = np.cos(poses[..., 2] / 2)
            qpos[..., base + 4 : base + 6] = 0.0
            qpos[..., base + 6] = np.sin(poses[..., 2] / 2)
        else:
            qpos[..., base : base + 3] = poses
        return qpos

    def poses(self, qpos: np.ndarray) -> np.ndarray:
        """Where the robot is, `(..., 3)`: x, y [m], yaw [rad], from `(..., nq)`."""
        base, free = self._base
        if not free:
            return qpos[..., base : base + 3].copy()
        w, x, y, z = np.moveaxis(qpos[..., base + 3 : base + 7], -1, 0)
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        return np.concatenate([qpos[..., base : base + 2], yaw[..., None]], axis=-1)

    def reading(self, sensordata: np.ndarray) -> Reading:
        """What the robot reports, from MuJoCo's `(..., nsensordata)`."""
        return Reading(
            sensordata[..., self._distance], sensordata[..., self._contact] > 0
        )


def load_scene(robot: str, arena: str, control_step: float = 0.1) -> Scene:
    """Put a robot into an arena.

    Args:
        robot: name of a shipped robot, or path of an MJCF with the same interface.
        arena: name of a shipped arena, or path of an MJCF with walls.
        control_step: its duration [s], a multiple of the physics step.

    Raises:
        UserError: if a file is missing or broken, or a part of the robot is.
    """
    robot_path, arena_path = find_robot(robot), find_arena(arena)
    # compiled alone first: errors in an included file have no line number
    _compile(mujoco.MjSpec.from_file, str(robot_path), source=robot_path)
    text, files = with_robot(arena_path, robot_path)
    robot_text = _read(robot_path).encode()
    texts = {"arena": text.encode(), "robot": robot_text}
    texts |= {name: file for name, file in files.items() if file != robot_text}
    model = _compile(
        lambda: mujoco.MjSpec.from_string(text, include=files), source=arena_path
    )
    sha256 = {
        name: hashlib.sha256(content).hexdigest() for name, content in texts.items()
    }
    return _index(model, robot_path, arena_path, sha256, control_step)


def absolute(name: str) -> str:
    """The name of a robot or arena; if it is a path, from the root on."""
    path = Path(name)
    shipped = {file.stem for file in MODELS.rglob("*.xml")}
    return name if name in shipped or not is_file(path) else str(path.resolve())


def find_robot(name: str) -> Path:
    """The file of a shipped robot, or the user's own.

    Raises:
        UserError: if there is none.
    """
    return _find(name, "robot", [MODELS / robot for robot in SHIPPED_ROBOTS])


def find_arena(name: str) -> Path:
    """The file of a shipped arena, or the user's own.

    Raises:
        UserError: if there is none.
    """
    arenas = [MODELS / "arena.xml", *sorted(MODELS.glob("arenas/*.xml"))]
    return _find(name, "arena", arenas)


def _find(name: str, kind: str, shipped: list[Path]) -> Path:
    """The file of a shipped model, or the user's own."""
    by_name = {path.stem: path for path in shipped}
    path = by_name.get(name, Path(name))
    if is_file(path):
        return path.resolve()
    available = ", ".join(by_name)
    raise UserError(
        f"no {kind} '{name}': expected the path of an MJCF file or one of {available}"
    )


def with_robot(arena: Path, robot: Path) -> tuple[str, dict[str, bytes]]:
    """The arena's text and the files it includes, the robot among them replaced.

    Raises:
        UserError: if a file is missing or no XML, includes what MuJoCo would not find,
            or the arena is a robot itself.
    """
    text = _read(arena)
    files, found = {}, False
    _refuse_includes(robot)
    for name in _includes(text, arena):
        path = arena.parent / name
        # a copied arena may name a robot that it left behind
        if path.name in SHIPPED_ROBOTS or _has_robot(_read(path), path):
            found, path = True, robot
        _refuse_includes(path)
        files[name] = _read(path).encode()
    if found:
        return text, files
    if _has_robot(text, arena):
        raise UserError(
            f"arena '{arena}' defines its own body '{ROBOT_BODY}': expected walls "
            "only, or a robot by <include>"
        )
    # walls only: the robot goes last, so line numbers stay
    files[ADDED_ROBOT] = _read(robot).encode()
    head, _, tail = text.rpartition("</mujoco>")
    return f'{head}<include file="{ADDED_ROBOT}"/></mujoco>{tail}', files


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"cannot read '{path}': {error}") from None


def _parse(text: str, path: Path) -> ET.Element:
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise UserError(f"'{path}' is not well-formed XML: {error}") from None


def _includes(text: str, path: Path) -> list[str]:
    return [e.get("file", "") for e in _parse(text, path).iter("include")]


def _refuse_includes(path: Path) -> None:
    """Refuse a file to be included that includes others: nobody would hash those."""
    inner = _includes(_read(path), path)
    if inner:
        raise UserError(
            f"'{path}' includes '{inner[0]}': an included file cannot include others, "
            "nor can a robot; expected it in the arena"
        )


def _has_robot(text: str, path: Path) -> bool:
    return _parse(text, path).find(f".//body[@name='{ROBOT_BODY}']") is not None


def _compile(make_spec, *args, source: Path) -> mujoco.MjModel:
    """Compile, with MuJoCo's complaint about `source` on one line."""
    try:
        spec = make_spec(*args)
        # meshes and textures are looked for beside the file
        spec.modelfiledir = str(source.parent)
        # a robot that brings its converged step wants no other from the arena
        step = spec.numeric(TIMESTEP)
        if step is not None:
            spec.option.timestep = step.data[0]
        return spec.compile()
    except ValueError as error:
        message = " ".join(str(error).split())
        raise UserError(f"MuJoCo cannot compile '{source}': {message}") from None


def _index(
    model: mujoco.MjModel,
    robot: Path,
    arena: Path,
    sha256: Mapping[str, str],
    control_step: float,
) -> Scene:
    """The scene of a compiled model that has all of the robot's parts."""
    _check_base(model, robot)
    _id(model, mujoco.mjtObj.mjOBJ_GEOM, SHELL, robot)
    _check_floor(model, arena)
    wheels = [_id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name, robot) for name in WHEELS]
    distance = [
        _sensor(model, name, _SENSOR.mjSENS_RANGEFINDER, robot) for name in PROXIMITY
    ]
    contact = _sensor(model, SHELL, _SENSOR.mjSENS_CONTACT, robot)
    if model.opt.timestep <= 0:
        raise UserError(
            f"arena '{arena}': expected a physics step above 0 s, "
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
        robot,
        arena,
        sha256,
        np.array(distance),
        contact,
    )


def _check_base(model: mujoco.MjModel, robot: Path) -> None:
    """Refuse a base on which no pose can be set."""
    body = _id(model, mujoco.mjtObj.mjOBJ_BODY, ROBOT_BODY, robot)
    first, count = model.body_jntadr[body], model.body_jntnum[body]
    types = tuple(model.jnt_type[first : first + count])
    planar = (_JOINT.mjJNT_SLIDE, _JOINT.mjJNT_SLIDE, _JOINT.mjJNT_HINGE)
    axes = model.jnt_axis[first : first + count]
    at_origin = not model.body_pos[body, :2].any()
    if types == (_JOINT.mjJNT_FREE,):
        return
    if types == planar and np.array_equal(axes, np.eye(3)) and at_origin:
        return
    raise UserError(
        f"robot '{robot}': expected body '{ROBOT_BODY}' at the origin with a free "
        "joint or with slides along x and y and a hinge about z"
    )


def _check_floor(model: mujoco.MjModel, arena: Path) -> None:
    """Refuse a floor that the shell would hit, and wheels with nothing to drive on."""
    shell, ground = model.geom(SHELL).id, static(model)
    planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    for geom in np.flatnonzero(ground & planes & can_touch(model, shell)).tolist():
        raise UserError(
            f"arena '{arena}': the robot's shell would hit the plane "
            f"'{model.geom(geom).name or geom}'; expected a floor with "
            'contype="2" conaffinity="2", which wheels meet and shells do not'
        )
    base = model.body_jntadr[model.body(ROBOT_BODY).id]
    if model.jnt_type[base] != _JOINT.mjJNT_FREE:
        return
    others = (geom for geom in np.flatnonzero(~ground).tolist() if geom != shell)
    if not any((ground & can_touch(model, geom)).any() for geom in others):
        raise UserError(
            f"arena '{arena}' has no floor for the robot's wheels: expected a plane "
            'with contype="2" conaffinity="2"'
        )


def static(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms are fixed to the world, `(ngeom,)`."""
    return model.body_weldid[model.geom_bodyid] == 0


def can_touch(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Which geoms a geom can touch, by their collision bits, `(ngeom,)`."""
    bits, masks = model.geom_contype, model.geom_conaffinity
    return ((bits[geom] & masks) | (bits & masks[geom])) != 0


def _sensor(model: mujoco.MjModel, name: str, kind: int, robot: Path) -> int:
    """Address of a sensor of that kind in sensordata."""
    sensor = _id(model, mujoco.mjtObj.mjOBJ_SENSOR, name, robot)
    if model.sensor_type[sensor] != kind:
        raise UserError(
            f"robot '{robot}': expected sensor '{name}' to be a "
            f"{_SENSOR(kind).name.removeprefix('mjSENS_').lower()}"
        )
    return int(model.sensor_adr[sensor])


def _id(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str, robot: Path) -> int:
    """Index of a named part of the robot."""
    index = mujoco.mj_name2id(model, kind.value, name)
    if index >= 0:
        return index
    label = kind.name.removeprefix("mjOBJ_").lower()
    count = {
        "body": model.nbody,
        "geom": model.ngeom,
        "actuator": model.nu,
        "sensor": model.nsensor,
    }[label]
    names = [mujoco.mj_id2name(model, kind.value, i) or "" for i in range(count)]
    available = ", ".join(filter(None, names)) or "none"
    raise UserError(f"robot '{robot}' has no {label} '{name}'; available: {available}")
