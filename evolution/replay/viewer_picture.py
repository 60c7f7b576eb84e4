"""A picture of a recording in rerun's viewer, for documents.

`python -m evolution.replay.viewer_picture RECORDING --output PICTURE`.
The viewer runs without a window; it needs a Vulkan driver, of which Mesa's for the
processor will do (Debian: mesa-vulkan-drivers).
"""

import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import tyro

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse, word
from evolution.replay.viewer import viewer_binary
from evolution.replay.web import free_ports

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

TOP_BAR = 36
"""Height of the viewer's menu [pixels], with its warnings of a computer without GPU."""

VIEWER_PATIENCE = 60.0
"""How long the viewer may take for each request [s]."""

Value = TypeVar("Value")


@dataclass(frozen=True)
class ViewerPictureOptions:
    """Write a picture of a recording in the rerun viewer, without opening a window.

    The bar with the viewer's menu is cut off.

    Attributes:
        recording: recording of trials (.rrd).
        output: picture to write (PNG).
        time: time of the trial that is shown [s].
        size: width and height of the viewer [pixels].
    """

    recording: tyro.conf.Positional[Annotated[Path, word("FILE")]]
    output: Annotated[Path, word("FILE")]
    time: float = 25.0
    size: tuple[int, int] = (1600, 1000)


@contextmanager
def headless_viewer(recording: Path, size: tuple[int, int]) -> Iterator["ViewerClient"]:
    """A viewer without a window that has loaded a recording.

    Raises:
        UserError: if it does not start, as without a Vulkan driver.
    """
    from rerun.experimental import ViewerClient

    (port,) = free_ports(1)
    with tempfile.TemporaryDirectory() as home:
        process = subprocess.Popen(
            [
                *(viewer_binary(), recording, "--headless"),
                *("--bind", "127.0.0.1", "--port", str(port)),
                *("--window-size", f"{size[0]}x{size[1]}"),
            ],
            # without the user's settings, and without analytics
            env={
                **os.environ,
                **{"HOME": home, "XDG_RUNTIME_DIR": home},
                **{"CI": "1", "RUST_LOG": "error"},
                **{"HTTPS_PROXY": "http://127.0.0.1:9", "NO_PROXY": "127.0.0.1"},
            },
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

        def connected() -> "ViewerClient | None":
            if process.poll() is not None:
                raise UserError(
                    f"the rerun viewer ended with status {process.returncode}: "
                    "expected a Vulkan driver (Debian: mesa-vulkan-drivers)"
                )
            try:
                client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
                # the viewer answers before it knows whether it can draw
                client.take_screenshot()
                state = client.get_state()
            except Exception:  # rerun's own have no common base
                return None
            there = state.active_recording and state.views and not state.loading
            return client if there else None

        try:
            yield _until(connected)
        finally:
            process.kill()
            process.wait()


def viewer_screenshot(client: "ViewerClient", time: float) -> bytes:
    """PNG of the viewer's window at a time of the trial [s], once it is at rest."""
    client.set_time("sim_time", duration=time, play_state="paused")
    shots = [client.take_screenshot()]

    def settled() -> bytes | None:
        shots.append(client.take_screenshot())
        return shots[-1] if shots[-1] == shots[-2] else None

    return _until(settled)


def _until(attempt: Callable[[], Value | None]) -> Value:
    """Repeat an attempt until it gives a result; that result."""
    end = time.monotonic() + VIEWER_PATIENCE
    while (value := attempt()) is None:
        if time.monotonic() > end:
            raise UserError(f"the rerun viewer took more than {VIEWER_PATIENCE:g} s")
        time.sleep(0.2)
    return value


def picture_viewer(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(
        ViewerPictureOptions, "python -m evolution.replay.viewer_picture", argv
    )
    # not for those who only ask for help
    from epuck_mj.show.pictures import save_below

    if not options.recording.is_file():
        raise UserError(f"no recording '{options.recording}'")
    with headless_viewer(options.recording, options.size) as client:
        shot = viewer_screenshot(client, options.time)
    save_below(shot, TOP_BAR, options.output)
    return 0


if __name__ == "__main__":
    main(picture_viewer)
