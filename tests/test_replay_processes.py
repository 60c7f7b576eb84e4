"""`python -m evolution.replay` as a person starts it, mostly without a display."""

import ctypes.util
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock
from matplotlib.image import imread
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from epuck_mj.errors import UserError
from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.policies.network import Network
from epuck_mj.show import render
from epuck_mj.step.control import TaskParameters
from evolution.replay import output, viewer
from evolution.replay.__main__ import replay
from tests.browser import until
from tests.processes import PATIENCE

ROOT = Path(__file__).parent.parent
RERUN = Path(sys.executable).with_name("rerun")

VIEWER_PORT = 9876
"""Where rerun's viewer listens if nobody says otherwise."""

needs_opengl = pytest.mark.skipif(
    not (ctypes.util.find_library("EGL") or ctypes.util.find_library("OSMesa")),
    reason="no library of EGL or OSMesa to draw with",
)
needs_proc = pytest.mark.skipif(
    not Path("/proc/self/cmdline").exists(), reason="no /proc to find a viewer in"
)


@pytest.fixture
def here(alone, monkeypatch):
    """A champion in a working directory, without OpenGL."""
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    genome = np.random.default_rng(0).uniform(-5, 5, Network().n_genes)
    task, origin = TaskParameters(steps=8), Origin("epuck_kinematic", "arena")
    file = ControllerFile(Network(), genome, task, origin, {})
    (alone / "champion.json").write_text(file.to_json())
    return alone


def process(*argv):
    """The finished process of a command line."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "evolution.replay", *argv],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


def verify(path):
    result = subprocess.run(
        [RERUN, "rrd", "verify", path], capture_output=True, text=True, timeout=PATIENCE
    )
    assert result.returncode == 0, result.stderr


def test_without_a_display_a_file_is_written_and_how_to_watch_it(here):
    result = process("champion.json")
    assert (result.returncode, result.stderr) == (0, "")
    outcome, line = result.stdout.splitlines()
    assert outcome.startswith("champion.json: fitness ")
    assert re.fullmatch(
        r"replay\.rrd; there is no display here; "
        r"watch it: \S+ -m rerun replay\.rrd",
        line,
    )
    verify(here / "replay.rrd")
    # nobody has drawn or looked around
    names = {path.name for path in here.iterdir()} - {".config", ".cache"}
    assert names == {"champion.json", "replay.rrd"}


@pytest.fixture
def viewer_port():
    """The port of rerun's viewer, for one test at a time on this machine."""
    with FileLock(Path(tempfile.gettempdir()) / "epuck-mj-viewer.lock", PATIENCE):
        yield


@pytest.mark.usefixtures("viewer_port")
@pytest.mark.parametrize("display", [":4099", "nonsense"])
def test_a_display_that_does_not_work_costs_nothing(here, display, monkeypatch, capfd):
    monkeypatch.setenv("DISPLAY", display)
    # the viewer, a process, fails in the end, however long that takes
    monkeypatch.setattr(viewer, "SETTLING_TIME", 100)
    assert replay(["champion.json"]) == 0
    said = capfd.readouterr()
    assert said.err == ""
    _, line = said.out.splitlines()
    assert line.startswith("replay.rrd; the viewer did not open (")
    assert re.search(r"\); watch it: \S+ -m rerun replay\.rrd$", line)
    verify(here / "replay.rrd")


def viewers(recording):
    """Ids of the viewers that show a recording."""
    found = []
    for place in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = place.read_bytes().split(b"\0")
            folder = (place.parent / "cwd").resolve()
        except OSError:
            continue
        if recording.name.encode() in words and folder == recording.parent:
            found.append(int(place.parent.name))
    return found


@pytest.mark.usefixtures("viewer_port")
@needs_proc
def test_a_display_that_never_answers_holds_nobody_up(here, monkeypatch):
    """It accepts a connection and says nothing: the viewer waits, replay does not."""
    with socket.socket() as display:
        number = next(n for n in range(100, 1000) if _bound(display, 6000 + n))
        display.listen()
        monkeypatch.setenv("DISPLAY", f"127.0.0.1:{number}")
        try:
            result = process("champion.json")
            assert (result.returncode, result.stderr) == (0, "")
            assert result.stdout.splitlines()[1:] == ["replay.rrd, shown in the viewer"]
            # it lives on in a session of its own: Ctrl-C is not meant for it
            (shown,) = viewers(here / "replay.rrd")
            assert os.getsid(shown) == shown
        finally:
            for shown in viewers(here / "replay.rrd"):
                os.kill(shown, signal.SIGKILL)
    verify(here / "replay.rrd")


@pytest.mark.usefixtures("viewer_port")
@pytest.mark.slow
@needs_proc
@pytest.mark.skipif(not shutil.which("Xvfb"), reason="no Xvfb (Debian: xvfb)")
def test_a_window_opens_on_a_display(here, monkeypatch):
    """In a display of its own, and shows the recording after replay has gone."""
    with socket.socket() as place:
        if place.connect_ex(("127.0.0.1", VIEWER_PORT)) == 0:
            pytest.skip(f"somebody's viewer is there already, on port {VIEWER_PORT}")
    # without Composite: windows with alpha stay black in software
    display = ["Xvfb", "-displayfd", "1", "-extension", "Composite"]
    with subprocess.Popen(
        [*display, "-screen", "0", "800x600x24"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as server:
        assert server.stdout is not None
        try:
            monkeypatch.setenv("DISPLAY", f":{int(server.stdout.readline())}")
            result = process("champion.json")
            assert (result.returncode, result.stderr) == (0, "")
            line = result.stdout.splitlines()[-1]
            if "did not open" in line:
                assert line.startswith("replay.rrd; ")
                pytest.skip(f"no Vulkan driver for windows here: {line}")
            assert line == "replay.rrd, shown in the viewer"
            (shown,) = viewers(here / "replay.rrd")
            client = until(_client, PATIENCE)
            recording = until(lambda: client.get_state().active_recording, PATIENCE)
            saved = RrdReader(here / "replay.rrd").recordings()[0]
            assert saved.recording_id in str(recording)
            assert viewers(here / "replay.rrd") == [shown]
        finally:
            for shown in viewers(here / "replay.rrd"):
                os.kill(shown, signal.SIGKILL)
            server.terminate()


def _client():
    """Of the viewer in the window, as soon as it answers."""
    try:
        return ViewerClient.connect(f"rerun+http://127.0.0.1:{VIEWER_PORT}/proxy")
    except Exception:  # rerun's own have no common base
        return None


def _bound(display, port):
    try:
        display.bind(("127.0.0.1", port))
    except OSError:
        return False
    return True


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        ([], "expected what to replay"),
        (["champion.json", "--speed", "9"], "--speed"),
    ],
    ids=["nothing", "no option"],
)
def test_bad_input_is_one_line(here, argv, message):
    with pytest.raises(UserError) as error:
        replay(argv)
    assert "\n" not in str(error.value)
    assert message in str(error.value)


def test_a_process_with_bad_input_has_status_2(here):
    result = process("nowhere")
    assert (result.returncode, result.stdout) == (2, "")
    assert re.fullmatch(r"error: [^\n]*no champion in 'nowhere'[^\n]*\n", result.stderr)


@needs_opengl
def test_a_picture(here, capfd):
    comparison = ["champion.json", "--compare", "wall-follower"]
    assert replay([*comparison, "--image", "new/a.png"]) == 0
    said = capfd.readouterr()
    assert said.err == ""
    assert said.out.splitlines()[2:] == ["new/a.png"]
    picture = imread("new/a.png")
    assert picture.shape[:2] == (800, 1200)
    assert picture[..., :3].std() > 0.05
    # the recording was not asked for
    assert not list(here.rglob("*.rrd"))


@needs_opengl
def test_a_video_and_everything_else_at_once(here, monkeypatch, capsys):
    pytest.importorskip("imageio_ffmpeg", reason="the extra 'video' is not installed")
    monkeypatch.setattr(output, "VIDEO_SIZE", (96, 64))
    monkeypatch.setattr(output, "IMAGE_SIZE", (96, 64))
    everything = ("--save", "a.rrd", "--image", "a.png", "--video", "films/a.mp4")
    assert replay(["champion.json", *everything]) == 0
    said = capsys.readouterr()
    _, first, *others = said.out.splitlines()
    assert first.startswith("a.rrd; watch it: ")
    assert others == ["a.png", "films/a.mp4"]
    assert said.err == ""
    import imageio_ffmpeg

    frames, seconds = imageio_ffmpeg.count_frames_and_secs("films/a.mp4")
    # 0.8 s, and a second to look at the end
    assert (frames, seconds) == (45, pytest.approx(1.8, abs=0.05))


def test_without_opengl_only_pictures_are_missing(here, monkeypatch):
    monkeypatch.setattr(render, "find_library", lambda name: None)
    assert replay(["champion.json", "--save", "a.rrd"]) == 0
    for option, path in (("--image", "a.png"), ("--video", "a.mp4")):
        if option == "--video":
            pytest.importorskip("imageio_ffmpeg", reason="no extra 'video' here")
        with pytest.raises(UserError, match="no OpenGL to draw with") as error:
            replay(["champion.json", option, path])
        assert "\n" not in str(error.value)
        assert not Path(path).exists()


def test_without_the_video_extra_one_line_says_so(here, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.delitem(sys.modules, "epuck_mj.show.video", raising=False)
    with pytest.raises(UserError, match=r"pip install 'epuck-mj\[video\]'"):
        replay(["champion.json", "--video", "a.mp4"])
