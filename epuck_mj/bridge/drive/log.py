"""Log of a real robot: a trajectory, as of a simulated robot, and its pictures."""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from epuck_mj.bridge.drive.session import Session
from epuck_mj.errors import UserError
from epuck_mj.host.files import check_writable, writing
from epuck_mj.step.control import Policy
from epuck_mj.trials.trajectory import Trajectory

FOLDER = Path("runs")

ENDINGS = (".npz", ".rrd", ".png")
"""Of the files of a log: arrays, recording, picture."""

Show = Callable[[Path, Trajectory, str], list[Path]]
"""Writes the pictures of a log by its name, its trajectory and a summary; the files."""


def log_name(name: Path | None, kind: str = "robot") -> Path:
    """Path of a log without its endings, or of a folder of logs.

    Args:
        name: as a person gave it; None makes one of the time.
        kind: beginning of such a name.

    Raises:
        UserError: if it is no name.
    """
    if name is None:
        name = FOLDER / f"{kind}-{datetime.now():%Y%m%d-%H%M%S}"
    elif name.suffix in ENDINGS:
        name = name.with_suffix("")
    if not name.name:
        raise UserError(f"expected --log with the name of a file, got '{name}'")
    return name


def prepare(name: Path) -> Path:
    """The name of a log that can be written there; makes its folder.

    Raises:
        UserError: if nothing can be written there.
    """
    with writing():
        name.parent.mkdir(parents=True, exist_ok=True)
    for ending in ENDINGS:
        check_writable(log_file(name, ending))
    return name


def log_file(name: Path, ending: str) -> Path:
    """A file of a log, whose name may have dots of its own."""
    return name.with_name(f"{name.name}{ending}")


def save_arrays(name: Path, session: Session, policy: Policy) -> Trajectory | None:
    """Write the arrays of a log; None and no file if nothing was read.

    Args:
        name: of the files without their endings.
        session: what happened.
        policy: that was at the wheel.

    Raises:
        UserError: if they cannot be written.
    """
    trajectory = session.trajectory(policy)
    if trajectory is not None:
        trajectory.save(log_file(name, ".npz"))
    return trajectory


def show_log(
    name: Path, trajectory: Trajectory | None, show: Show, facts: str
) -> tuple[list[Path], UserError | None]:
    """Have the pictures of a log written.

    Args:
        name: of the files without their endings.
        trajectory: that was written; None if none was.
        show: writes them.
        facts: summary of the drive.

    Returns:
        The files of the log, and why some are missing.
    """
    if trajectory is None:
        return [], None
    arrays = log_file(name, ".npz")
    if not trajectory.steps:
        return [arrays], None
    try:
        summary = f"# A real robot\n\n```\n{facts}\n```\n"
        return [arrays, *show(name, trajectory, summary)], None
    except UserError as error:
        return [arrays], UserError(f"{error}; '{arrays}' was written")
