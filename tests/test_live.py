"""Live view: what a viewer gets, and that a run does not care."""

import os
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from epuck_mj.errors import UserError
from evolution.replay.viewer import viewer_binary
from evolution.replay.web import free_ports
from evolution.run import live
from evolution.run.__main__ import evolve
from evolution.run.directory import RunDirectory
from tests.no_pictures import draw_nothing
from tests.processes import PATIENCE

FEW = ("--validation-starts", "5", "--test-starts", "5", "--threads", "1")
ARGUMENTS = ("ga", "--evaluations", "500", "--steps", "15", "--trials", "2", *FEW)
SAME = ("history.csv", "champion.json", "best_individuals.npz", "trajectory.npz")


@pytest.fixture(autouse=True)
def quiet(monkeypatch, tmp_path):
    """Errors of rerun raise, and nothing calls home."""
    home = {name: str(tmp_path) for name in ("HOME", "XDG_RUNTIME_DIR")}
    settings = {"CI": "1", "RERUN_STRICT": "1", "RUST_LOG": "error", **home}
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("RERUN", raising=False)


@pytest.fixture(autouse=True)
def few_pictures(monkeypatch):
    """Runs are finished without pictures and a recording, which take their time."""
    draw_nothing(monkeypatch)


@pytest.fixture
def viewer(monkeypatch, tmp_path):
    """A viewer without a window that keeps what it gets in a file."""
    (port,) = free_ports(1)
    monkeypatch.setattr(live, "PORT", port)
    path = tmp_path / "got.rrd"
    process = subprocess.Popen(
        [viewer_binary(), "--save", path, "--bind", "127.0.0.1", "--port", str(port)],
        env=os.environ | {"HTTPS_PROXY": "http://127.0.0.1:9"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    until(lambda: live.viewer_there(port))
    yield process, path
    process.kill()
    process.wait()


def until(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.05)


def entities(path):
    """Batches in time of every entity."""
    found = {}
    for chunk in RrdReader(path).stream().to_chunks():
        if not chunk.is_static:
            found.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
    return found


def column(batches, name):
    (field,) = {f for b in batches for f in b.schema.names if f.endswith(name)}
    return [row for batch in batches for row in batch.column(field).to_pylist()]


def written(path: Path) -> dict[str, bytes]:
    return {name: (path / name).read_bytes() for name in SAME}


# what is still being streamed has none
@pytest.mark.filterwarnings("ignore:RRD file has no footer")
@pytest.mark.slow
def test_a_viewer_sees_all_generations_and_changes_nothing(viewer, tmp_path):
    process, path = viewer
    assert evolve([*ARGUMENTS, "--output", str(tmp_path / "plain")]) == 0
    assert evolve([*ARGUMENTS, "--output", str(tmp_path / "live"), "--live"]) == 0
    assert written(tmp_path / "live") == written(tmp_path / "plain")

    process.terminate()
    process.wait(PATIENCE)
    got = entities(path)
    history = np.genfromtxt(
        RunDirectory(tmp_path / "live").history, delimiter=",", names=True
    )
    assert sorted(column(got["/run/fitness"], "evaluations")) == list(
        history["evaluations"]
    )
    fitness = sorted(map(tuple, column(got["/run/fitness"], "Scalars:scalars")))
    expected = sorted(zip(history["best"], history["mean"], strict=True))
    np.testing.assert_allclose(fitness, expected)
    assert len(column(got["/run/crash_rate"], "Scalars:scalars")) == len(history)
    # of the last generation at least, there is time for a trial
    strips = column(got["/trials/best/path"], "LineStrips3D:strips")
    assert strips
    assert all(1 <= len(strip) <= 15 for strip in strips)
    texts = column(got["/run/summary"], "TextDocument:text")
    assert any(f"Generation {len(history) - 1}:" in text for (text,) in texts)
    assert "/trials/best/robot/epuck" in got


@pytest.mark.slow
def test_a_viewer_that_goes_away_stops_nothing(viewer, tmp_path, monkeypatch, capfd):
    process, path = viewer
    empty = path.stat().st_size if path.exists() else 0
    update = live.Live.update

    def updated(self) -> None:
        update(self)
        # in the middle, once it has got something
        if len(self._evolution.records) == 3:
            until(lambda: path.exists() and path.stat().st_size > empty)
            process.kill()
            process.wait()

    monkeypatch.setattr(live.Live, "update", updated)
    output = tmp_path / "live"
    assert evolve([*ARGUMENTS, "--output", str(output), "--live"]) == 0
    assert process.returncode is not None
    assert RunDirectory(output).finished
    assert len((output / "history.csv").read_text().splitlines()) == 6
    assert "Traceback" not in capfd.readouterr().err


def test_without_a_viewer_one_line_and_no_directory(monkeypatch, tmp_path):
    (port,) = free_ports(1)
    monkeypatch.setattr(live, "PORT", port)
    output = tmp_path / "live"
    with pytest.raises(UserError, match=r"no rerun viewer at 127\.0\.0\.1.*rerun"):
        evolve([*ARGUMENTS, "--output", str(output), "--live"])
    assert not output.exists()


@pytest.mark.slow
def test_somebody_else_at_the_port_does_not_stop_a_run(monkeypatch, tmp_path, capfd):
    """It accepts, and then says nothing at all."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        monkeypatch.setattr(live, "PORT", listener.getsockname()[1])
        before = time.monotonic()
        output = tmp_path / "live"
        assert evolve([*ARGUMENTS, "--output", str(output), "--live"]) == 0
        assert RunDirectory(output).finished
        assert time.monotonic() - before < PATIENCE
    assert "Traceback" not in capfd.readouterr().err
