"""Rerun recordings: a trajectory to watch. Only this package imports rerun.

One .rrd per trial, blueprint inside: the scene in 3D, with the path that grows and
the eight proximity rays, beside plots of everything the trajectory holds. Poses are
logged in world coordinates, bodies flat under `world/`, geoms as their static children.
"""

import hashlib
import tempfile
from dataclasses import fields
from pathlib import Path

import numpy as np
import rerun as rr

from epuck_mj.colors import (
    BLUE,
    FAINT,
    GREEN,
    GREY,
    HIGH_FITNESS,
    LOW_FITNESS,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    YELLOW,
    blend,
)
from epuck_mj.control import TaskParameters
from epuck_mj.errors import UserError
from epuck_mj.files import write_bytes
from epuck_mj.geometry import kinematics, moving_bodies
from epuck_mj.model import PROXIMITY, ROBOT_BODY, Scene
from epuck_mj.recording.blueprint import TIMELINE, blueprint
from epuck_mj.recording.shapes import body_entity, log_geoms
from epuck_mj.trajectory import Trajectory

APPLICATION = "epuck_mj"

PATH_HEIGHT = 0.003
"""Height of the path above the robot's origin [m], to lie on the floor."""


def save_recording(
    path: str | Path,
    scene: Scene,
    trajectory: Trajectory,
    task: TaskParameters,
    title: str,
    summary: str,
) -> None:
    """Write a trial as .rrd.

    Args:
        path: of the file.
        scene: where the trajectory was recorded.
        trajectory: what happened.
        task: what the trial was.
        title: one line, the recording's name.
        summary: Markdown for the text panel.

    Raises:
        UserError: if it cannot be written.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "recording.rrd")
        with rr.RecordingStream(
            APPLICATION, recording_id=_identity(trajectory), send_properties=False
        ) as stream:
            stream.save(file, default_blueprint=blueprint(scene, task))
            stream.send_recording_name(title)
            document = rr.TextDocument(summary, media_type=rr.MediaType.MARKDOWN)
            stream.log("summary", document, static=True)
            log_geoms(stream, scene.model)
            _log_motion(stream, scene, trajectory, task)
            _log_plots(stream, trajectory)
        content = file.read_bytes() if file.exists() else b""
    # rerun only warns when it is switched off
    if not content:
        raise UserError(f"cannot write '{path}': rerun is off, see RERUN")
    try:
        write_bytes(Path(path), content)
    except OSError as error:
        raise UserError(f"cannot write '{path}': {error.strerror}") from None


def _identity(trajectory: Trajectory) -> str:
    """The same for the same trajectory, so that two files of it are one recording."""
    digest = hashlib.sha256()
    for field in fields(trajectory):
        digest.update(getattr(trajectory, field.name).tobytes())
    return digest.hexdigest()[:32]


def _columns(trajectory: Trajectory, rows: slice) -> list[rr.TimeColumn]:
    """Both timelines at those rows of what is sensed."""
    # rerun truncates seconds given as floats
    time = np.round(trajectory.time[rows] * 1e9).astype("timedelta64[ns]")
    step = np.arange(len(trajectory.time))[rows]
    return [
        rr.TimeColumn(TIMELINE, duration=time),
        rr.TimeColumn("step", sequence=step),
    ]


SENSED, DECIDED, EARNED = slice(None), slice(None, -1), slice(1, None)


def _log_motion(
    stream: rr.RecordingStream,
    scene: Scene,
    trajectory: Trajectory,
    task: TaskParameters,
) -> None:
    """Bodies, path, rays and crash."""
    model = scene.model
    now = _columns(trajectory, SENSED)
    position, quaternion, origin, direction = kinematics(scene, trajectory.pose)
    for body in moving_bodies(model):
        poses = rr.Transform3D.columns(
            translation=position[:, body],
            # MuJoCo says wxyz, rerun xyzw
            quaternion=quaternion[:, body][:, [1, 2, 3, 0]],
        )
        stream.send_columns(body_entity(model, body), now, poses)

    root = position[:, model.body(ROBOT_BODY).id] + [0, 0, PATH_HEIGHT]
    path = rr.LineStrips3D.columns(
        strips=np.stack([root[:-1], root[1:]], axis=1, dtype=np.float32),
        colors=blend(LOW_FITNESS, HIGH_FITNESS, trajectory.fitness),
        radii=np.full(trajectory.steps, 0.002),
    )
    stream.send_columns("trial/path", _columns(trajectory, EARNED), path)

    # a free ray ends where the sensor's range ends
    distance = trajectory.distance
    length = np.where(distance < 0, task.sensor_range, distance)
    length = np.minimum(length, task.sensor_range)[..., None]
    rays = np.stack([origin, origin + length * direction], axis=2, dtype=np.float32)
    ends = rr.LineStrips3D.columns(
        strips=rays.reshape(-1, 2, 3),
        colors=blend(VERMILION, FAINT, trajectory.observation.ravel()),
        radii=np.full(distance.size, 0.001),
    )
    counts = np.full(len(distance), len(PROXIMITY))
    stream.send_columns("trial/rays", now, ends.partition(counts))

    if trajectory.crashed:
        mark = rr.Points3D.columns(
            positions=root[-1:] + np.array([0, 0, 0.07]),
            radii=[0.012],
            colors=[VERMILION],
            labels=["crash"],
        )
        stream.send_columns("trial/crash", _columns(trajectory, slice(-1, None)), mark)


def _log_plots(stream: rr.RecordingStream, trajectory: Trajectory) -> None:
    """Everything that has no place in space."""
    rainbow = (GREY, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE)
    series = [
        ("observation", trajectory.observation, PROXIMITY, rainbow, SENSED),
        ("action", trajectory.action, ("v", "w"), (BLUE, VERMILION), DECIDED),
        ("command", trajectory.command, ("left", "right"), (BLUE, VERMILION), DECIDED),
        ("step_fitness", trajectory.fitness, ("step fitness",), (GREEN,), EARNED),
        (
            "cumulative_fitness",
            trajectory.cumulative_fitness,
            ("cumulative fitness",),
            (GREEN,),
            EARNED,
        ),
    ]
    for entity, values, names, colors, rows in series:
        style = rr.SeriesLines(names=names, colors=colors, widths=[1.5] * len(names))
        stream.log(f"plot/{entity}", style, static=True)
        scalars = rr.Scalars.columns(scalars=values.ravel())
        scalars = scalars.partition(np.full(len(values), len(names)))
        stream.send_columns(f"plot/{entity}", _columns(trajectory, rows), scalars)
