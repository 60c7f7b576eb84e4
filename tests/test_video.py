"""Videos: the .mp4 read back shows what happened, for as long as it took."""

import ctypes.util
import importlib
import re
import subprocess
import sys

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.scene.model import load_scene
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.recorder import record

TASK = TaskParameters(steps=20)
SIZE = (160, 112)
RAW = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-fps_mode", "passthrough", "-")

needs_opengl = pytest.mark.skipif(
    not (ctypes.util.find_library("EGL") or ctypes.util.find_library("OSMesa")),
    reason="no library of EGL or OSMesa to draw with",
)


def ahead(observation):
    """Full speed straight on."""
    return np.broadcast_to([1.0, 0.0], (*observation.shape[:-1], 2)).copy()


@pytest.fixture(scope="module")
def scene():
    return load_scene("epuck_kinematic", "arena", TASK.control_step)


def film(path, scene, trajectories, **named):
    pytest.importorskip("imageio_ffmpeg", reason="the extra 'video' is not installed")
    from epuck_mj.show.video import save_video

    save_video(path, scene, trajectories, *SIZE, **named)


def frames(path):
    """What ffmpeg says of a video, and its pictures `(n, height, width, 3)`."""
    import imageio_ffmpeg

    # its own reader leaves pipes open when a video is shorter than their buffer
    result = subprocess.run(
        [imageio_ffmpeg.get_ffmpeg_exe(), "-i", path, *RAW], capture_output=True
    )
    assert result.returncode == 0, result.stderr
    pictures = np.frombuffer(result.stdout, np.uint8)
    return result.stderr.decode(), pictures.reshape(-1, *SIZE[::-1], 3).astype(int)


@needs_opengl
def test_a_video_takes_as_long_as_the_trial_and_the_robot_moves(scene, tmp_path):
    long = record(scene, ahead, np.array([-0.3, 0.0, 0.0]), TASK)
    short = record(scene, ahead, np.array([-0.3, 0.3, 0.0]), TaskParameters(steps=10))
    path, told = tmp_path / "trial.mp4", []
    film(path, scene, [short, long], progress=lambda *each: told.append(each))
    about, pictures = frames(path)
    # any player can show it
    assert re.search(r"Video: h264 .*, yuv420p\b.*, 160x112\b.*, 25 fps", about)
    # 2 s, and 1 s to look at the end
    assert pictures.shape == (75, 112, 160, 3)
    assert told == [(i + 1, 75) for i in range(75)]
    assert list(tmp_path.iterdir()) == [path]
    # it moves while the longer trial lasts, and then no more
    moved = np.abs(np.diff(pictures, axis=0)).max(axis=(1, 2, 3))
    assert np.median(moved[:48]) > 20
    assert moved[-15:].max() < 20
    assert np.abs(pictures[49] - pictures[0]).max() > 60


@needs_opengl
def test_a_video_that_cannot_be_written_is_one_line(scene, tmp_path):
    trajectory = record(scene, ahead, np.zeros(3), TaskParameters(steps=1))
    with pytest.raises(UserError, match="cannot write") as error:
        film(tmp_path / "no" / "trial.mp4", scene, [trajectory])
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


@needs_opengl
def test_a_video_that_ffmpeg_cannot_finish_is_one_line(scene, tmp_path):
    """As where the folder for temporary files is full; ffmpeg's status is 0."""
    resource = pytest.importorskip("resource", reason="limits of POSIX")
    trajectory = record(scene, ahead, np.zeros(3), TaskParameters(steps=1))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(UserError, match="ffmpeg could not finish it") as error:
            film(tmp_path / "trial.mp4", scene, [trajectory])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_without_the_extra_one_line_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.delitem(sys.modules, "epuck_mj.show.video", raising=False)
    with pytest.raises(UserError, match=r"pip install 'epuck-mj\[video\]'") as error:
        importlib.import_module("epuck_mj.show.video")
    assert "\n" not in str(error.value)
    assert "imageio_ffmpeg" in str(error.value)
