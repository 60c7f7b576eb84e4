"""Runs on a Dask cluster: real schedulers and workers, some of which are killed."""

import json
import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import dask.config
import numpy as np
import pytest
import yaml
from distributed import Client

from epuck_mj.errors import UserError
from evolution.run.directory import RunDirectory
from evolution.run.means import Means
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.study.__main__ import study
from evolution.study.addresses import run_at
from evolution.study.cluster import carry_out_on_cluster, connection, requirements
from evolution.study.directory import StudyDirectory
from evolution.study.histories import history_of
from evolution.study.jobs import Event, Job, carry_out, generations
from tests.no_pictures import INSTEAD, draw_nothing
from tests.processes import PATIENCE, python_process

pytestmark = pytest.mark.slow


FEW = {"validation_starts": 10, "test_starts": 10}
# trials that are worth sending: on the kinematic robot they are run here
SMALL = {"robot": "epuck", "steps": 20, "trials": 2, "evaluations": 100} | FEW
LONG = SMALL | {"evaluations": 300}
ENDLESS = SMALL | {"evaluations": 1_000_000}

REPRODUCED = ("history.csv", "champion.json")

UNHURRIED = f"""
from evolution.run import results

results._draw_fitness = results._show = {INSTEAD}

import time
from evolution.judging.evaluation import BatchEngine

def slept(self, work, run=BatchEngine.run):
    time.sleep(0.05)
    return run(self, work)


# Dask loads it twice
if BatchEngine.run.__name__ != "slept":
    BatchEngine.run = slept
"""
"""What a worker runs first: its tasks leave time to kill it while it is at work."""


# jobs


def config(name: str, seed: int, **keys: Any) -> ExperimentConfig:
    fields: dict[str, Any] = load_config(find_config(name)).model_dump()
    fields |= {"seed": seed} | keys
    fields["optimizer"]["population"] = 10
    return ExperimentConfig.model_validate(fields)


def jobs(folder: Path, *configs: ExperimentConfig) -> list[Job]:
    argv = ("study", "--cluster")
    return [
        Job(str(c.optimizer.algorithm), c, folder / f"{i}", argv)
        for i, c in enumerate(configs)
    ]


@pytest.fixture(autouse=True, scope="module")
def quicker():
    """Runs in this process that take no longer than those of the workers."""
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch)
        yield


@pytest.fixture(scope="module")
def preload(tmp_path_factory) -> Path:
    """A script that a worker runs first."""
    path = tmp_path_factory.mktemp("preload") / "unhurried.py"
    path.write_text(UNHURRIED)
    return path


class References:
    """Runs on this machine, each done when it is first asked for."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.done: dict[str, Path] = {}

    def of(self, job: Job) -> Path:
        text = job.config.to_yaml()
        if text not in self.done:
            path = self.folder / str(len(self.done))
            carry_out(replace(job, directory=path), Means(threads=1), lambda _: None)
            self.done[text] = path
        return self.done[text]


@pytest.fixture(scope="module")
def references(tmp_path_factory) -> References:
    return References(tmp_path_factory.mktemp("references"))


def assert_as_here(job: Job, references: References) -> None:
    reference = references.of(job)
    for name in REPRODUCED:
        ours = (job.directory / name).read_bytes()
        assert ours == (reference / name).read_bytes(), name
    names, expected = (
        sorted(path.name for path in folder.iterdir())
        for folder in (job.directory, reference)
    )
    assert names == expected
    provenance = json.loads((job.directory / "provenance.json").read_text())
    assert provenance["finished"]
    assert provenance["argv"] == list(job.argv)


def assert_packed_as_here(job: Job, study: Path, references: References) -> None:
    reference = references.of(job)
    run = run_at(study / job.name / f"seed-{job.config.seed}")
    assert not isinstance(run, RunDirectory)
    assert run.champion.to_json() == (reference / "champion.json").read_text()
    tables = StudyDirectory(study).tables
    found = tables.histories()[job.name, job.config.seed]
    expected, _ = history_of(RunDirectory(reference), job.config.robot)
    for name, column in expected.items():
        assert np.array_equal(found[name], column), name
    assert run.provenance["finished"]
    assert run.provenance["commands"] == [shlex.join(job.argv)]
    assert not (study / "running").exists()


def failures(events: list[Event]) -> dict[str, str | None]:
    """Of the jobs that have ended, by the name of their directory."""
    return {event.job.directory.name: event.failure for event in events if event.ended}


# processes


class Fleet:
    """A scheduler and workers on this machine, each a process that can be killed."""

    def __init__(self, folder: Path, preload: Path):
        self.folder = folder
        self.preload = preload
        self.scheduler: subprocess.Popen | None = None
        self.workers: list[subprocess.Popen] = []

    @property
    def address(self) -> str:
        return json.loads((self.folder / "scheduler.json").read_text())["address"]

    def start(self, n_workers: int) -> str:
        """Have at least so many workers, ready; the scheduler's address."""
        file = self.folder / "scheduler.json"
        if self.scheduler is None or self.scheduler.poll() is not None:
            file.unlink(missing_ok=True)
            options = "--host 127.0.0.1 --port 0 --no-dashboard --idle-timeout 300"
            self.scheduler = self._started("scheduler", file, *options.split())
        self.workers = [w for w in self.workers if w.poll() is None]
        while len(self.workers) < n_workers:
            options = "--nthreads 1 --no-nanny --no-dashboard --death-timeout 60"
            preload = ["--preload", str(self.preload)]
            self.workers.append(
                self._started("worker", file, *options.split(), *preload)
            )
        wait_until(lambda: file.exists() and file.stat().st_size > 0)
        with self.client() as client:
            wait_until(lambda: len(client.nthreads()) == len(self.workers))
        return self.address

    def _started(self, what: str, file: Path, *options: str) -> subprocess.Popen:
        module = f"distributed.cli.dask_{what}"
        with (self.folder / "log.txt").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", module, "--scheduler-file", file, *options],
                cwd=self.folder,
                env=os.environ | {"DASK_TEMPORARY_DIRECTORY": str(self.folder)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    @contextmanager
    def client(self) -> Iterator[Any]:
        with Client(self.address, timeout=PATIENCE, set_as_default=False) as client:
            yield client

    def busy(self, client: Any) -> list[int]:
        """Process ids of the workers that are at work on a task."""
        tasks = client.run(lambda dask_worker: dask_worker.state.executing_count)
        pids = client.run(os.getpid)
        return [pids[address] for address, count in tasks.items() if count]

    def kill_workers(self) -> None:
        for worker in self.workers:
            worker.kill()
            worker.wait(PATIENCE)

    def stop(self) -> None:
        self.kill_workers()
        if self.scheduler is not None:
            self.scheduler.kill()
            self.scheduler.wait(PATIENCE)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory, preload):
    fleet = Fleet(tmp_path_factory.mktemp("fleet"), preload)
    yield fleet
    fleet.stop()


def wait_until(moment: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not moment():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@contextmanager
def meanwhile(act: Callable[[], None]) -> Iterator[None]:
    """Do something beside the block, which must have been done at its end."""
    errors: list[BaseException] = []

    def acting() -> None:
        try:
            act()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=acting, daemon=True)
    thread.start()
    yield
    thread.join(PATIENCE)
    assert not thread.is_alive()
    assert not errors


def kill_a_busy_worker(fleet: Fleet, pattern: str = "*") -> None:
    """Kill it when the workers have a file of that name."""
    with fleet.client() as client:
        wait_until(lambda: any(fleet.folder.rglob(pattern)))
        wait_until(lambda: fleet.busy(client))
        victim = fleet.busy(client)[0]
        os.kill(victim, signal.SIGKILL)
        wait_until(lambda: len(client.nthreads()) == len(fleet.workers) - 1)


# clusters that are of no use


def refusal(address: str, tmp_path: Path, split: bool = False) -> str:
    """What is said of a cluster that is of no use."""
    todo = jobs(tmp_path, config("ga", 1, **ENDLESS), config("ga", 2, **ENDLESS))
    started = time.monotonic()
    with pytest.raises(UserError) as info:
        list(carry_out_on_cluster(todo, address, split, racing=True))
    assert time.monotonic() - started < PATIENCE / 2
    assert "\n" not in str(info.value)
    return str(info.value)


@pytest.mark.parametrize("split", [False, True])
def test_a_scheduler_without_workers(split, fleet, tmp_path, monkeypatch):
    monkeypatch.setattr(connection, "WORKERS_PATIENCE", 1.0)
    fleet.kill_workers()
    address = fleet.start(0)
    message = refusal(address, tmp_path, split)
    assert "has had no worker for 1 s" in message
    assert f"dask worker {address}" in message


# results


def test_who_gives_up_frees_the_workers_and_keeps_what_is_done(
    fleet, references, tmp_path
):
    address = fleet.start(2)
    todo = jobs(tmp_path, config("ga", 1, **SMALL), config("ga", 2, **ENDLESS))
    events = carry_out_on_cluster(todo, address, split=False, racing=True)
    assert next(events) == Event(todo[0], ended=True)
    started = time.monotonic()
    assert hasattr(events, "close")
    events.close()  # pyright: ignore[reportAttributeAccessIssue]
    assert time.monotonic() - started < PATIENCE
    with fleet.client() as client:
        wait_until(lambda: not fleet.busy(client))
    assert_as_here(todo[0], references)
    assert not (todo[1].directory / "config.yaml").exists()


def test_whole_runs_are_as_here_though_a_worker_is_killed(fleet, references, tmp_path):
    address = fleet.start(2)
    todo = jobs(
        tmp_path,
        config("ga", 1, **LONG),
        config("ga", 1, **SMALL),
        config("de-rand", 3, **SMALL, arena="nowhere.xml"),
        config("ga", 4, **SMALL),
    )
    todo[3].directory.mkdir()
    (todo[3].directory / "notes.txt").write_text("somebody's")
    with meanwhile(lambda: kill_a_busy_worker(fleet, "checkpoint.npz")):
        events = list(carry_out_on_cluster(todo, address, split=False, racing=True))
    failed = failures(events)
    # those that cannot be done do not keep the others from it
    assert "no arena 'nowhere.xml'" in str(failed.pop("2"))
    assert "is not empty" in str(failed.pop("3"))
    assert failed == {"0": None, "1": None}
    for job in todo[:2]:
        assert_as_here(job, references)


def test_what_was_begun_is_gone_on_with(fleet, references, tmp_path):
    address = fleet.start(1)
    (job,) = jobs(tmp_path, config("ga", 1, **SMALL))
    steps = generations(job, Means(threads=1))
    assert [next(steps) for _ in range(3)] == [10, 20, 30]
    steps.close()
    checkpoint = (job.directory / "checkpoint.npz").read_bytes()
    assert checkpoint
    (event,) = carry_out_on_cluster([job], address, split=False, racing=True)
    assert (event.ended, event.failure) == (True, None)
    assert_as_here(job, references)
    provenance = json.loads((job.directory / "provenance.json").read_text())
    assert [entry["argv"] for entry in provenance["resumed"]] == [list(job.argv)]
    rows = (job.directory / "timing.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows[1:]] == [str(i) for i in range(10)]


# workers and schedulers that are of no use


@pytest.mark.parametrize("split", [False, True])
def test_a_worker_of_other_versions_refuses(split, fleet, tmp_path, monkeypatch):
    address = fleet.start(1)
    monkeypatch.setattr(
        requirements, "version", lambda name: "9.9" if name == "mujoco" else "0.1.0"
    )
    todo = jobs(tmp_path, config("ga", 1, **SMALL))
    (event,) = carry_out_on_cluster(todo, address, split, racing=True)
    assert "would give other results" in str(event.failure)
    assert "mujoco (there 3." in str(event.failure)
    assert "here 9.9)" in str(event.failure)
    assert "\n" not in str(event.failure)


def test_a_worker_of_other_code_refuses(monkeypatch):
    asked = requirements.Requirements.here("epuck_kinematic", "arena", 0.1)
    assert ("code of epuck-mj", requirements.code()) in asked.facts
    monkeypatch.setattr(requirements, "code", lambda: "edited")
    monkeypatch.setattr(requirements, "get_worker", lambda: SimpleNamespace(address=7))
    with pytest.raises(UserError, match=r"differ: code of epuck-mj \(there edited, "):
        asked.refuse_another()


def test_split_runs_are_as_here_though_a_worker_is_killed(fleet, references, tmp_path):
    address = fleet.start(2)
    todo = jobs(
        tmp_path,
        config("de-rand", 3, **SMALL, arena="nowhere.xml"),
        config("ga", 1, **LONG),
    )
    with meanwhile(lambda: kill_a_busy_worker(fleet)):
        events = list(carry_out_on_cluster(todo, address, split=True, racing=True))
    failed = failures(events)
    assert "no arena 'nowhere.xml'" in str(failed.pop("0"))
    assert failed == {"1": None}
    assert_as_here(todo[1], references)
    evaluations = [event.evaluations for event in events if not event.ended]
    assert evaluations == list(range(10, 301, 10))
    provenance = json.loads((todo[1].directory / "provenance.json").read_text())
    assert provenance["engine"] == "cluster"


def test_a_lost_scheduler_is_noticed(fleet, tmp_path, monkeypatch):
    """By who sends whole runs and who sends trials, both of one scheduler."""
    monkeypatch.setattr(connection, "SCHEDULER_PATIENCE", 3.0)
    address = fleet.start(1)

    def lost(split: bool) -> None:
        message = refusal(address, tmp_path / str(split), split)
        assert f"lost the scheduler at '{address}'" in message

    def tasks(dask_scheduler: Any) -> str:
        return " ".join(dask_scheduler.tasks)

    with meanwhile(lambda: lost(split=False)), meanwhile(lambda: lost(split=True)):
        with fleet.client() as client:
            for name in ("seed-1-", "trials-"):
                wait_until(lambda name=name: name in client.run_on_scheduler(tasks))
            wait_until(lambda: fleet.busy(client))
        fleet.scheduler.kill()
    fleet.kill_workers()


def test_nobody_or_a_stranger_at_the_address(tmp_path, monkeypatch):
    monkeypatch.setattr(connection, "SCHEDULER_PATIENCE", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as mute:
        port = mute.getsockname()[1]
        address = f"tcp://127.0.0.1:{port}"
        assert f"no Dask scheduler at '{address}'" in refusal(address, tmp_path)
    assert f"no Dask scheduler at '{address}'" in refusal(address, tmp_path)
    assert "TLS" in refusal(f"tls://127.0.0.1:{port}", tmp_path)


@pytest.mark.parametrize(
    "address",
    [
        "",
        "local",
        "local:",
        "local:0",
        "local:1000",
        "host:8786",
        "tcp://host",
        "tcp:/",
    ],
)
def test_what_is_no_address_is_refused_before_anything_is_written(address, tmp_path):
    output = tmp_path / "study"
    with pytest.raises(UserError, match="expected --cluster tcp://host:8786") as info:
        study(["quick", "--cluster", address, "--output", str(output)])
    assert str(info.value).endswith(f"got '{address}'")
    assert not output.exists()


def test_nothing_to_do_needs_no_cluster():
    assert not list(carry_out_on_cluster([], "tcp://127.0.0.1:9", False, True))


def test_without_the_extra_there_is_one_clear_line(monkeypatch):
    for name in [
        name for name in sys.modules if name.startswith("evolution.study.cluster")
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UserError, match=r"pip install 'epuck-mj\[cluster\]'$"):
        __import__("evolution.study.cluster")


# the command line


def test_ctrl_c_ends_workers_of_its_own(preload, tmp_path):
    (tmp_path / "mine.yaml").write_text(config("ga", 1, **ENDLESS).to_yaml())
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump({"experiments": ["mine.yaml"]}))
    options = "tiny.yaml --seeds 1-2 --output out --cluster local:1 --split"
    process = subprocess.Popen(
        [sys.executable, "-W", "error", "-m", "evolution.study", *options.split()],
        cwd=tmp_path,
        env=os.environ
        | {"DASK_DISTRIBUTED__WORKER__PRELOAD": repr([str(preload)])}
        | {"DASK_TEMPORARY_DIRECTORY": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        wait_until((tmp_path / "out/running/mine/seed-1/history.csv").exists)
        # as a terminal does: to everybody
        os.killpg(process.pid, signal.SIGINT)
        _, stderr = process.communicate(timeout=PATIENCE)
        assert process.returncode == 130
        assert len(stderr.splitlines()) == 1
        assert stderr.startswith("Interrupted; continue with: ")

        def nobody_left() -> bool:
            try:
                os.killpg(process.pid, 0)
            except ProcessLookupError:
                return True
            return False

        wait_until(nobody_left)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_worker_and_then_the_scheduler_of_a_study_are_killed(
    preload, references, tmp_path, monkeypatch, capfd
):
    """The first is replaced; the other is the study, whose next call ends it."""
    (tmp_path / "mine.yaml").write_text(config("ga", 1, **LONG).to_yaml())
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump({"experiments": ["mine.yaml"]}))
    argv = ["tiny.yaml", "--seeds", "1-2", "--output", "out", "--cluster", "local:1"]
    settings = {
        "DASK_DISTRIBUTED__WORKER__PRELOAD": repr([str(preload)]),
        "DASK_TEMPORARY_DIRECTORY": str(tmp_path),
    }
    options = {"cwd": tmp_path, "env": os.environ | settings}
    command = ("-m", "evolution.study", *argv)
    with python_process(*command, **options) as process:
        wait_until(lambda: any(tmp_path.rglob("checkpoint.npz")))
        before = workers_of(process.pid)
        os.kill(before[0], signal.SIGKILL)
        wait_until(lambda: len(set(workers_of(process.pid)) - set(before)) == 1)
        process.kill()
        process.communicate(timeout=PATIENCE)
    monkeypatch.chdir(tmp_path)
    settings = {
        "distributed.worker.preload": [str(preload)],
        "temporary-directory": str(tmp_path),
    }
    with dask.config.set(settings):
        assert study(argv) == 0
    stdout, stderr = capfd.readouterr()
    assert stderr == ""
    assert "2 of 2 runs are finished" in stdout
    assert len(stdout.splitlines()) == 4
    for seed in (1, 2):
        folder = tmp_path / "out" / "running" / "mine" / f"seed-{seed}"
        job = Job("mine", config("ga", seed, **LONG), folder, tuple(argv))
        assert_packed_as_here(job, tmp_path / "out", references)


def workers_of(pid: int) -> list[int]:
    """Process ids of a local cluster's workers, which its process has started."""
    threads = Path(f"/proc/{pid}/task").iterdir()
    children = ""
    for thread in threads:
        # it may have ended meanwhile
        with suppress(OSError):
            children += f" {(thread / 'children').read_text()}"
    found = []
    for child in children.split():
        with suppress(OSError):
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(int(child))
    return found
