"""Replays as people see them: rerun's viewer without a window, and the web page."""

import io
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb
from matplotlib.image import imread
from rerun.experimental import ViewerClient

from epuck_mj.errors import UserError
from evolution.replay.__main__ import replay
from evolution.replay.viewer_picture import headless_viewer, viewer_screenshot
from tests.browser import MISSING, browser, until
from tests.processes import PATIENCE, python_process
from tests.shipped import champion_file

CHAMPION = champion_file()


@pytest.fixture
def here(alone):
    return alone


@contextmanager
def window(recording: Path, size: tuple[int, int]) -> Iterator[ViewerClient]:
    """A viewer of a recording; a reason to skip where no Vulkan driver is."""
    with ExitStack() as stack:
        try:
            client = stack.enter_context(headless_viewer(recording, size))
        except UserError as error:
            if "Vulkan" not in str(error):
                raise
            pytest.skip(str(error))
        yield client


def seen(client: ViewerClient, seconds: float) -> np.ndarray:
    """The whole window at a time, once it no longer changes."""
    return imread(io.BytesIO(viewer_screenshot(client, seconds)))


def seen_of(client: ViewerClient, view: str) -> np.ndarray | None:
    """A view; None if it is behind a tab."""
    try:
        return imread(io.BytesIO(client.take_screenshot(view)))
    except Exception as error:  # rerun's own have no common base
        if "not found" not in str(error):
            raise
        return None


BLANK = 12
"""Colours of a view without content, at most: its title, axes and grid have 9."""


def colours(picture: np.ndarray) -> int:
    """How many there are, roughly."""
    eighths = np.round(picture[..., :3] * 8).astype(int)
    return len(np.unique(eighths.reshape(-1, 3), axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("trials", [1, 4])
def test_the_window_shows_a_robot_that_moves(here, trials):
    path = here / "replay.rrd"
    assert replay([str(CHAMPION), "--trials", str(trials), "--save", str(path)]) == 0
    with window(path, (1600, 1000)) as client:
        state = client.get_state()
        assert {"Arena", "Phase", "Summary"} <= {view.name for view in state.views}
        pictures = [seen(client, seconds) for seconds in (6.0, 24.0)]
        for whole in pictures:
            assert colours(whole) > 100
        changed = np.abs(pictures[1] - pictures[0]).max(axis=-1) > 0.1
        assert changed.sum() > 1000
        shown = []
        for view in client.get_state().views:
            assert not view.reports, f"{view.name}: {view.reports}"
            found = seen_of(client, view.view_id)
            if found is not None:
                shown.append(view.name)
                assert colours(found) > BLANK, f"{view.name} is blank"
        assert {"Arena", "Phase", "Clearance [mm]", "Cumulative fitness"} <= set(shown)


@pytest.mark.slow
@pytest.mark.parametrize("trials", [1, 4])
def test_every_view_shows_something_and_reports_nothing(here, trials, monkeypatch):
    """Those in tabs as well: a viewer looks after what is in front only."""
    monkeypatch.setattr(rrb, "Tabs", rrb.Grid)
    path = here / "replay.rrd"
    assert replay([str(CHAMPION), "--trials", str(trials), "--save", str(path)]) == 0
    with window(path, (1600, 1000) if trials == 1 else (2400, 1500)) as client:
        seen(client, 24.0)
        views = client.get_state().views
        # two of all trials, and of each trial its plots
        assert len(views) == (11 if trials == 1 else 3 + 3 + 8 * trials)
        for view in views:
            assert not view.reports, f"{view.name}: {view.reports}"
            if trials == 1:
                found = seen_of(client, view.view_id)
                assert found is not None, f"{view.name} is not there"
                if view.name == "Summary":
                    # black on white, and a lot of it
                    assert (found[..., :3].max(axis=-1) < 0.7).mean() > 0.005
                    continue
                assert colours(found) > BLANK, f"{view.name} is blank"


@contextmanager
def served(*argv: str) -> Iterator[tuple[subprocess.Popen, str]]:
    """A process that serves a page, and the address that it says."""
    module = ("-W", "error", "-m", "evolution.replay")
    with python_process(*module, *argv) as process:
        assert process.stdout is not None
        for line in process.stdout:
            found = re.search(r"served at (http://\S+/) until Ctrl-C$", line.rstrip())
            if found:
                yield process, found[1]
                break
        else:
            pytest.fail(f"it serves nothing: {process.communicate()[1]}")


def listeners(port: int) -> set[str]:
    """Local addresses on which somebody listens on a port, as in /proc/net."""
    found = set()
    for name in ("tcp", "tcp6"):
        place = Path("/proc/net") / name
        rows = place.read_text().splitlines()[1:] if place.exists() else []
        for row in rows:
            _, local, _, state, *_ = row.split()
            address, number = local.split(":")
            if int(number, 16) == port and state == "0A":
                found.add(address)
    return found


@pytest.mark.slow
def test_the_page_is_served_to_this_machine_until_ctrl_c(here):
    with served(str(CHAMPION), "--web", "pages/mine") as (process, address):
        names = {path.name for path in (here / "pages/mine").iterdir()}
        viewers = {"re_viewer.js", "re_viewer_bg.wasm"}
        assert names == {"index.html", "page.js", "replay.rrd"} | viewers
        host, port = re.findall(r"//(.*):(\d+)/", address)[0]
        assert host == "127.0.0.1"
        if sys.platform == "linux":
            assert listeners(int(port)) == {"0100007F"}
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=PATIENCE)
        assert (process.returncode, stderr) == (0, "")
        assert stdout.strip() == ""
        # the folder stays, and can be published
        assert {path.name for path in (here / "pages/mine").iterdir()} == names


LOADED = """
try {
  const state = window.viewer.viewer_state();
  return new TextDecoder("latin1").decode(state).includes("Recording:");
} catch (error) {
  return false;
}
"""


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")
def test_the_page_shows_the_recording_and_calls_nobody(here):
    with (
        served(str(CHAMPION), "--trials", "2", "--web", "page") as (_, address),
        browser(here / "profile") as window,
    ):
        window.open(f"{address}?renderer=webgl")
        until(lambda: window.run(LOADED), PATIENCE)
        assert window.run("return document.getElementById('status').textContent") == ""
        assert not window.run("return window.viewer.has_panicked()")

        def drawn():
            return colours(imread(io.BytesIO(window.screenshot()))) > 20

        until(drawn, PATIENCE)
        asked = {url for url in window.requests() if url.startswith("http")}
        assert {url.split("?")[0] for url in asked} == {
            address + name
            for name in (
                "",
                "re_viewer.js",
                "re_viewer_bg.wasm",
                "page.js",
                "replay.rrd",
            )
        }


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")
def test_the_page_keeps_the_viewer_from_calling(here):
    """Not the browser's settings do: whatever tries to call is stopped by the page."""
    with (
        served(str(CHAMPION), "--web", "page") as (_, address),
        browser(here / "profile") as window,
    ):
        window.open(address)
        script = """
        window.stopped = [];
        addEventListener("securitypolicyviolation",
                         event => window.stopped.push(event.blockedURI));
        for (const url of ["https://tel.rerun.io/", "http://127.0.0.1:9/"])
          fetch(url).catch(() => null);
        """
        window.run(script)
        stopped = until(
            lambda: (
                len(set(window.run("return window.stopped"))) >= 2
                and window.run("return window.stopped")
            ),
            PATIENCE,
        )
        assert "http://127.0.0.1:9/" in stopped
