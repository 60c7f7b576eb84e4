"""Rerun's viewer in a window that stays open after this process."""

import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from epuck_mj.errors import UserError

SETTLING_TIME = 2.0
"""Time in which a viewer that cannot open its window ends [s]."""


BINARIES = ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun")
"""Paths of the viewer's program in rerun's package.

Not the package's Python script, which starts this program but does not stop it.
"""


def viewer_binary() -> Path:
    """The viewer's program.

    Raises:
        UserError: if it is not there.
    """
    package = importlib.util.find_spec("rerun_cli")
    folder = Path(package.origin or "").parent if package else Path("rerun_cli")
    for name in BINARIES:
        if (folder / name).is_file():
            return folder / name
    raise UserError(f"no rerun viewer: expected '{folder / BINARIES[0]}'")


def display_there() -> bool:
    """Whether there is a display for a window, as far as the environment says."""
    if sys.platform in ("darwin", "win32"):
        return "SSH_CONNECTION" not in os.environ
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_viewer(recording: Path) -> str | None:
    """Show a recording in the viewer; None, or why the viewer did not open."""
    with tempfile.TemporaryFile() as output:
        try:
            viewer = subprocess.Popen(
                # no other computer can connect
                [viewer_binary(), "--bind", "127.0.0.1", recording],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        except (OSError, UserError) as error:
            return str(error)
        until = time.monotonic() + SETTLING_TIME
        while time.monotonic() < until:
            status = viewer.poll()
            # 0: another viewer was there and took the recording
            if status is not None:
                return None if status == 0 else _last_line(output)
            time.sleep(0.05)
    # python would warn of a child that is left running
    viewer.returncode = 0
    return None


def _last_line(output) -> str:
    """The last line that a process wrote."""
    output.seek(0)
    lines = output.read().decode(errors="replace").strip().splitlines()
    return lines[-1].strip() if lines else "it ended without a word"
