"""Log of a real robot: a trajectory and a recording, as for a simulated robot."""

from datetime import datetime
from pathlib import Path

from epuck_mj.bridge.drive.session import Session
from epuck_mj.errors import UserError
from epuck_mj.host.files import check_writable, writing
from epuck_mj.scene.model import Scene
from epuck_mj.show.recording import Trial, save_recording
from epuck_mj.step.control import Policy

FOLDER = Path("runs")


def log_name(name: Path | None) -> Path:
    """Path of a log without its endings, where files can be written.

    Args:
        name: as a person gave it; None makes one of the time.

    Raises:
        UserError: if nothing can be written there.
    """
    if name is None:
        name = FOLDER / f"robot-{datetime.now():%Y%m%d-%H%M%S}"
    elif name.suffix in (".npz", ".rrd"):
        name = name.with_suffix("")
    if not name.name:
        raise UserError(f"expected --log with the name of a file, got '{name}'")
    with writing():
        name.parent.mkdir(parents=True, exist_ok=True)
    for path in _files(name):
        check_writable(path)
    return name


def save_log(
    name: Path, session: Session, policy: Policy, scene: Scene, summary: str
) -> list[Path]:
    """Write the log; the files written, none if nothing was read.

    Args:
        name: of the files without their endings.
        session: what happened.
        policy: that was at the wheel.
        scene: to show it in.
        summary: Markdown for the recording.

    Raises:
        UserError: if they cannot be written.
    """
    trajectory = session.trajectory(policy)
    if trajectory is None:
        return []
    arrays, recording = _files(name)
    trajectory.save(arrays)
    if not trajectory.steps:
        return [arrays]
    trial = Trial("robot", trajectory, session.task)
    try:
        save_recording(recording, scene, [trial], name.name, summary)
    except UserError as error:
        raise UserError(f"{error}; '{arrays}' was written") from None
    return [arrays, recording]


def _files(name: Path) -> tuple[Path, Path]:
    """Trajectory and recording of a log, whose name may have dots of its own."""
    return name.with_name(f"{name.name}.npz"), name.with_name(f"{name.name}.rrd")
