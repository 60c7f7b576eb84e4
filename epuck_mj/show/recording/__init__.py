"""Rerun recordings of trials. Only this package imports rerun.

One .rrd, blueprint inside: the arena in 3D with every trial's robot, the path that
grows and the eight proximity rays, beside plots of everything the trajectories hold.
Several trials share the arena and the clock; their robots do not meet. It makes no
difference whether a trajectory comes from a simulation or from a robot.

Entities: `arena/*`; per trial `trials/<name>/robot/*`, `path`, `rays`, `crash`, `phase`
and `signals/*`; `summary`. Timelines: `sim_time` since the start, and `step`.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import rerun as rr

from epuck_mj.errors import UserError
from epuck_mj.host.files import write_bytes, writing
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import Scene
from epuck_mj.show.recording.blueprint import blueprint
from epuck_mj.show.recording.entities import APPLICATION, entities
from epuck_mj.show.recording.motion import log_motion
from epuck_mj.show.recording.shapes import log_arena, log_robot
from epuck_mj.show.recording.signals import log_signals
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.trajectory import Trajectory


@dataclass(frozen=True)
class Trial:
    """A trial to be shown.

    Attributes:
        name: what a person calls it, short.
        trajectory: what happened.
        task: what the trial was.
    """

    name: str
    trajectory: Trajectory
    task: TaskParameters


def save_recording(
    path: str | Path, scene: Scene, trials: Sequence[Trial], title: str, summary: str
) -> None:
    """Write trials as .rrd.

    Args:
        path: of the file.
        scene: where the trajectories were recorded, or where they are to be seen.
        trials: at least one, all on one clock.
        title: one line, the recording's name.
        summary: Markdown for the text panel.

    Raises:
        UserError: if it cannot be written, or clearance cannot be measured here.
    """
    probe = ClearanceProbe(scene, 1)
    places = entities([trial.name for trial in trials])
    with rr.RecordingStream(
        APPLICATION,
        recording_id=_identity(trials),
        send_properties=False,
        # by default a chunk ends after 0.2 s: on a busy machine files would differ
        batcher_config=rr.ChunkBatcherConfig.NEVER(),
    ) as stream:
        # rerun only warns when it is switched off
        if not stream.is_enabled():
            raise UserError(
                f"cannot write '{path}': the variable RERUN switches rerun off"
            )
        # its own file could be written by halves
        memory = stream.memory_recording()
        stream.send_blueprint(blueprint(scene, trials, places), make_active=False)
        stream.send_recording_name(title)
        document = rr.TextDocument(summary, media_type=rr.MediaType.MARKDOWN)
        stream.log("summary", document, static=True)
        log_arena(stream, scene.model)
        for trial, place in zip(trials, places, strict=True):
            trajectory = trial.trajectory
            log_robot(stream, scene.model, place)
            log_motion(stream, scene, trajectory, trial.task.sensor_range, place)
            clearance = probe.measure(trajectory.pose).distance
            log_signals(stream, trajectory, clearance, place)
        content = memory.drain_as_bytes()
    with writing():
        write_bytes(Path(path), content)


def _identity(trials: Sequence[Trial]) -> str:
    """Identity of a recording, equal for equal trials."""
    digest = hashlib.sha256()
    for trial in trials:
        digest.update(trial.name.encode())
        for array in trial.trajectory.arrays.values():
            digest.update(array.tobytes())
    return digest.hexdigest()[:32]
