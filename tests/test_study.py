"""`python -m evolution.study`: every run as if alone, whatever becomes of others."""

import json
import math
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.host import files
from evolution.run import execution
from evolution.run.__main__ import evolve
from evolution.run.directory import RunDirectory
from evolution.run.history import HISTORY, ROBOT
from evolution.run.lock import LOCK
from evolution.run.means import Means
from evolution.settings.config_files import load_config
from evolution.study import __main__ as module
from evolution.study import jobs
from evolution.study.__main__ import study
from evolution.study.config import StudyConfig
from evolution.study.directory import StudyDirectory
from evolution.study.finished_run import FinishedRun
from evolution.study.histories import history_of
from evolution.study.jobs import Event, Job, carry_out, failure_log, failure_of
from evolution.study.packing import Packer, pack
from tests.no_pictures import INSTEAD, draw_nothing
from tests.processes import PATIENCE, python_process

linux = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")

SMALL = """steps: 20
trials: 2
evaluations: 20
validation_starts: 5
test_starts: 5
"""
EXPERIMENTS = {
    "one": "{algorithm: differential_evolution, strategy: best, population: 10, "
    "scale: 0.8, crossover: 1.0}",
    "two": "{algorithm: genetic_algorithm, population: 10}",
}
SEEDS = (1, 2)
RUNS = [(name, seed) for seed in SEEDS for name in EXPERIMENTS]
TABLES = ("champions.parquet", "history.parquet")

LONG = 60
"""Evaluations of runs that are interrupted, in 6 generations."""

QUICK = f"""
from epuck_mj.host.command_line import main
from evolution.study import __main__ as study

# in the processes of the runs, which import this file
if __name__ != "__main__":
    from evolution.run import results

    results._draw_fitness = results._show = {INSTEAD}
"""
HALTING = """
    import math, time
    from pathlib import Path
    from evolution.run import execution
    from evolution.run.directory import RunDirectory

    save = RunDirectory.save

    def saved(self, evolution, seconds):
        save(self, evolution, seconds)
        while len(evolution.records) > 2 and not Path("go").exists():
            time.sleep(0.01)

    execution.SAVING_SHARE = math.inf
    RunDirectory.save = saved
else:
    study._measure_yardstick = lambda *_: None
"""
"""Every generation is saved, and from the third on a file is awaited."""

MAIN = """
if __name__ == "__main__":
    main(study.study)
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A working directory with the experiments and a study of them."""
    monkeypatch.chdir(tmp_path)
    write_study(tmp_path)
    return tmp_path


def write_study(folder: Path, evaluations: int = 20) -> None:
    for name, optimizer in EXPERIMENTS.items():
        (folder / f"{name}.yaml").write_text(f"{SMALL}optimizer: {optimizer}\n")
    (folder / "mine.yaml").write_text(
        f"experiments: [one.yaml, two.yaml]\ncommon: {{evaluations: {evaluations}}}\n"
    )
    (folder / "quick.py").write_text(QUICK + MAIN)
    (folder / "halting.py").write_text(QUICK + HALTING + MAIN)


def make_quick(patch: pytest.MonkeyPatch) -> None:
    """As in `QUICK`."""
    draw_nothing(patch)


def running(study: Path, name: str, seed: int) -> Path:
    """The directory of a run that is not in the tables yet."""
    return study / "running" / name / f"seed-{seed}"


def packed(study: Path, name: str, seed: int) -> FinishedRun:
    """A run in the tables."""
    directory = StudyDirectory(study)
    return directory.tables.runs(directory.stored_config())[name, seed]


def assert_reproduced(run: FinishedRun, reference: Path) -> None:
    """A run in the tables says what the directory of a run does."""
    assert run.champion.to_json() == (reference / "champion.json").read_text()
    history, _ = history_of(RunDirectory(reference), "epuck_kinematic")
    assert set(run.history) == set(history)
    for name, column in history.items():
        assert np.array_equal(run.history[name], column), name


def tables(study: Path) -> list[bytes]:
    return [(study / name).read_bytes() for name in TABLES]


def written(directory: Path) -> dict[str, int]:
    """When everything below was last written."""
    return {str(path): path.stat().st_mtime_ns for path in directory.rglob("*")}


def n_records(directory: Path) -> int:
    """Generations in the checkpoint, which can be read at any moment."""
    if not (directory / "checkpoint.npz").exists():
        return 0
    return len(files.read_arrays(directory / "checkpoint.npz")["records"])


def provenance(directory: Path) -> dict:
    return json.loads((directory / "provenance.json").read_text())


# in this process


class Carried:
    """Carries jobs out one after the other, here, and remembers which."""

    def __init__(self):
        self.jobs: list[Job] = []
        self.resumed: list[int] = []
        """How often each has been gone on with."""

    def __call__(
        self, jobs: Sequence[Job], means: Means, n_processes: int
    ) -> Iterator[Event]:
        for job in jobs:
            self.jobs.append(job)
            carry_out(job, means, lambda evaluations: None)
            self.resumed.append(len(provenance(job.directory).get("resumed", ())))
            yield Event(job, ended=True)


def carry_out_here(patch: pytest.MonkeyPatch) -> Carried:
    """No processes, pictures, or yardstick."""
    make_quick(patch)
    carried = Carried()
    patch.setattr(module, "carry_out_side_by_side", carried)
    patch.setattr(module, "_measure_yardstick", lambda *_: None)
    return carried


@pytest.fixture
def carried(monkeypatch) -> Carried:
    return carry_out_here(monkeypatch)


# processes


def finish(cwd: Path, *command: str) -> subprocess.CompletedProcess[str]:
    with python_process(*command, cwd=cwd) as process:
        stdout, stderr = process.communicate(timeout=PATIENCE)
    return subprocess.CompletedProcess(command, process.returncode, stdout, stderr)


def wait_for(moment: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not moment():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def command_line(pid: int) -> str:
    """Empty for a process that has ended, whether or not somebody asked for it."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


def run_processes(pid: int) -> list[int]:
    """The processes of the runs of a study's process."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(each) for each in children if "spawn_main" in command_line(int(each))]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """The folder of a study of which all is done, killed before it packed its runs."""
    cwd = tmp_path_factory.mktemp("done")
    write_study(cwd)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(cwd)
        carried = carry_out_here(patch)
        patch.setattr(Packer, "when_due", lambda self: None)
        patch.setattr(Packer, "finish", lambda self: None)
        assert study(["mine.yaml", "--seeds", "1-2", "--output", "out"]) == 0
    assert [(job.name, job.config.seed) for job in carried.jobs] == RUNS
    return cwd / "out"


@pytest.fixture
def finished(here, done, carried):
    """A copy of it beside the study's files."""
    return shutil.copytree(done, here / "out")


def unfinish(directory: Path) -> None:
    """As if the run had been killed before it chose its champion."""
    (directory / "champion.json").unlink()
    text = json.dumps({**provenance(directory), "finished": None})
    (directory / "provenance.json").write_text(text)


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """Longer runs of experiment one, each alone, that nothing interrupted."""
    cwd = tmp_path_factory.mktemp("reference")
    write_study(cwd)
    with pytest.MonkeyPatch.context() as patch:
        make_quick(patch)
        for seed in SEEDS:
            argv = [str(cwd / "one.yaml"), "--seed", str(seed)]
            output = ["--output", str(cwd / f"seed-{seed}")]
            assert evolve([*argv, "--evaluations", str(LONG), *output]) == 0
    return cwd


# what a study leaves behind


@pytest.mark.slow
def test_every_run_is_the_same_as_alone(here, done, monkeypatch):
    argv = ["mine.yaml", "--seeds", "1-2", "--output", "out", "--jobs", "2"]
    process = finish(here, "quick.py", *argv)
    assert (process.returncode, process.stderr) == (0, "")
    make_quick(monkeypatch)
    out = here / "out"
    for name, seed in RUNS:
        alone, there = running(done, name, seed), packed(out, name, seed)
        # of each experiment one by the command for a single run
        if (name, seed) in (("one", 1), ("two", 2)):
            alone = here / "alone" / name
            argv = [f"{name}.yaml", "--seed", str(seed), "--output", str(alone)]
            assert evolve(argv) == 0
            # what a run leaves by itself, but no pictures
            run = RunDirectory(alone)
            assert {path.name for path in running(done, name, seed).iterdir()} == {
                path.name for path in alone.iterdir() if path not in run.pictures
            }
        assert_reproduced(there, alone)
        assert there.config == load_config(alone / "config.yaml")
        assert there.provenance["finished"]
    assert not [path for path in out.rglob(".*") if path.name != LOCK]
    files = {".lock", "seeds.yaml", "study.yaml", "wall-follower.json"}
    files |= {*TABLES, "provenance.json", "timing.csv"}
    assert {path.name for path in out.iterdir()} == files
    # a line for every run
    *lines, summary, report = process.stdout.splitlines()
    pattern = r"(\d)/4 (\w+) seed (\d): held-out .* crash\); stored \d+\.\d"
    matches = [re.fullmatch(pattern, line) for line in lines]
    found = [match.groups() for match in matches if match]
    assert [count for count, _, _ in found] == ["1", "2", "3", "4"]
    assert sorted((name, int(seed)) for _, name, seed in found) == sorted(RUNS)
    assert re.fullmatch(r"4 of 4 runs are finished, \d+\.\d min", summary)
    assert report.startswith("Report: ")
    assert report.endswith(" -m evolution.report out")


def test_a_run_that_was_packed_at_once_has_its_scores_in_its_line(finished):
    path = running(finished, "one", 1)
    job = Job("one", load_config(path / "config.yaml"), path, (), finished)
    before = module._line(job)
    assert "held-out epuck " in before
    assert pack(StudyDirectory(finished)).packed
    assert not path.exists()
    assert module._line(job) == before


def test_what_is_done_is_skipped(finished, carried, capsys):
    path = running(finished, "one", 1)
    config = load_config(path / "config.yaml")
    assert study(["mine.yaml", "--seeds", "1-2", "--output", "out"]) == 0
    assert carried.jobs == []
    before = written(finished)
    # neither by who believes that it is not done yet
    job = Job("one", config, path, (), finished)
    carry_out(job, Means(), lambda _: pytest.fail("it was done again"))
    shutil.rmtree(finished / "running")
    assert {name: before[name] for name in written(finished)} == written(finished)
    first, summary, _ = capsys.readouterr().out.splitlines()
    assert first == "4 of 4 runs were finished already"
    assert summary.startswith("4 of 4 runs are finished, ")


def test_what_is_not_done_is(finished, done, carried, capsys):
    expected = [running(done, *run) for run in RUNS]
    unfinish(running(finished, "two", 1))
    assert study(["mine.yaml", "--seeds", "1-3", "--output", "out"]) == 0
    # all experiments of a seed before the next
    assert list(map(str, carried.jobs)) == ["two seed 1", "one seed 3", "two seed 3"]
    assert carried.resumed == [1, 0, 0]
    for run, alone in zip(RUNS, expected, strict=True):
        assert_reproduced(packed(finished, *run), alone)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "3 of 6 runs were finished already"
    assert [line.split(":")[0] for line in lines[1:4]] == [
        "4/6 two seed 1",
        "5/6 one seed 3",
        "6/6 two seed 3",
    ]


@pytest.mark.parametrize("damage", ["lost", "cut", "best"])
def test_a_run_that_has_lost_something_is_completed(damage, finished, done, carried):
    path = running(finished, "two", 1) / "champion.json"
    expected = path.read_bytes()
    if damage == "lost":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(expected[:100])
    else:
        path.with_name("best_individuals.npz").unlink()
    argv = ["mine.yaml", "--seeds", "1-2", "--output", "out"]
    assert study(argv) == 0
    assert list(map(str, carried.jobs)) == ["two seed 1"]
    assert_reproduced(packed(finished, "two", 1), running(done, "two", 1))
    assert study(argv) == 0
    assert len(carried.jobs) == 1


@pytest.mark.parametrize("name", ["config.yaml", "provenance.json", "checkpoint.npz"])
def test_a_damaged_run_does_not_stop_the_others(name, finished, carried, monkeypatch):
    """It fails with a line, as long as it is not finished without that file."""
    (running(finished, "two", 1) / name).write_text("[")
    (running(finished, "two", 1) / "champion.json").unlink()
    events: list[Event] = []

    def carry_all_out(jobs, means, n_processes):
        for job in jobs:
            try:
                carry_out(job, means, lambda _: None)
            except UserError as error:
                events.append(Event(job, ended=True, failure=failure_of(job, error)))
                yield events[-1]
            else:
                yield Event(job, ended=True)

    monkeypatch.setattr(module, "carry_out_side_by_side", carry_all_out)
    assert study(["mine.yaml", "--seeds", "1-3", "--output", "out"]) == 1
    assert [str(event.job) for event in events] == ["two seed 1"]
    assert name in str(events[0].failure)
    assert "\n" not in str(events[0].failure)
    assert packed(finished, "two", 3)


def test_a_lost_or_damaged_yardstick_is_measured_again(here, monkeypatch):
    config = load_config(here / "one.yaml")
    directory = StudyDirectory(here / "out")
    directory.open(StudyConfig({"one": config}), [1])
    module._measure_yardstick(directory)
    expected = directory.yardstick.read_bytes()
    directory.yardstick.write_bytes(expected[:50])
    module._measure_yardstick(directory)
    assert directory.yardstick.read_bytes() == expected


def test_some_experiments_now_and_the_others_later(here, carried):
    argv = ["mine.yaml", "--seeds", "4", "--output", "out"]
    assert study([*argv, "--experiments", "two"]) == 0
    assert study(argv) == 0
    assert list(map(str, carried.jobs)) == ["two seed 4", "one seed 4"]
    assert carried.jobs[0].argv == (*argv, "--experiments", "two")
    assert packed(here / "out", "one", 4).provenance["commands"] == [
        shlex.join(argv),
        shlex.join([*argv, "--experiments", "two"]),
    ]


def test_racing_changes_nothing(here, carried):
    argv = ["mine.yaml", "--seeds", "1", "--experiments", "one"]
    assert study([*argv, "--output", "with"]) == 0
    assert study([*argv, "--output", "without", "--no-racing"]) == 0
    one, other = (packed(here / name, "one", 1) for name in ("with", "without"))
    assert one.champion.to_json() == other.champion.to_json()
    for name in (*HISTORY, ROBOT):
        assert np.array_equal(one.history[name], other.history[name])


# bad input


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        ([], ("study",)),
        (["mine.yaml"], ("--output",)),
        (["nope", "--output", "out"], ("no study 'nope'", "paper")),
        (["one.yaml", "--output", "out"], ("unknown key 'steps'",)),
        (["mine.yaml", "--output", "out", "--seeds", "3-1"], ("'3-1'",)),
        (["mine.yaml", "--output", "out", "--jobs", "-1"], ("0 to 1,024, got -1",)),
        (["mine.yaml", "--output", "out", "--jobs", "many"], ("--jobs", "'many'")),
        (
            ["mine.yaml", "--output", "out", "--experiments", "one,three"],
            ("no experiment 'three'", "available: one, two"),
        ),
        (["mine.yaml", "--output", "out", "--split"], ("--cluster",)),
        (["mine.yaml", "--output", "one.yaml"], ("not a directory",)),
        (["mine.yaml", "--output", "."], ("holds no study",)),
    ],
)
def test_bad_arguments_are_refused(argv, words, here, capfd):
    before = written(here)
    with pytest.raises(UserError) as info:
        study(argv)
    message = str(info.value)
    assert "\n" not in message
    for word in words:
        assert word in message
    assert written(here) == before
    assert capfd.readouterr() == ("", "")


def test_bad_input_ends_a_process_with_one_line_and_status_2(here):
    process = finish(here, "-m", "evolution.study", "nope", "--output", "out")
    assert (process.returncode, process.stdout) == (2, "")
    assert re.fullmatch(r"error: no study 'nope'.*\n", process.stderr)
    assert not (here / "out").exists()


def test_another_study_is_refused(here, carried):
    argv = ["mine.yaml", "--seeds", "1", "--output", "out"]
    assert study([*argv, "--experiments", "two"]) == 0
    write_study(here, evaluations=30)
    before = written(here)
    with pytest.raises(UserError, match=r"'two' differs in: evaluations \(stored 20"):
        study(argv)
    assert written(here) == before


# failures


@pytest.mark.slow
def test_a_run_that_fails_does_not_stop_the_others(finished, here):
    # another config, a file, a damaged checkpoint, and one to be done
    other = running(finished, "one", 1)
    unfinish(other)
    text = (other / "config.yaml").read_text()
    (other / "config.yaml").write_text(text.replace("trials: 2", "trials: 3"))
    shutil.rmtree(running(finished, "two", 1))
    running(finished, "two", 1).write_text("years of work")
    damaged = running(finished, "one", 2) / "checkpoint.npz"
    unfinish(damaged.parent)
    damaged.write_bytes(damaged.read_bytes()[:-100])
    shutil.rmtree(running(finished, "two", 2))
    before = written(other) | written(damaged.parent)
    (here / "go").touch()
    argv = ["mine.yaml", "--seeds", "1-2", "--output", "out", "--jobs", "1"]
    process = finish(here, "halting.py", *argv)
    assert process.returncode == 1
    *failures, summary = process.stderr.splitlines()
    failed = {line.split(" failed: ")[0]: line for line in failures}
    assert set(failed) == {"one seed 1", "one seed 2", "two seed 1"}
    assert "another config; these keys differ: " in failed["one seed 1"]
    assert "trials (stored 3, got 2)" in failed["one seed 1"]
    assert "out/running/one/seed-2/checkpoint.npz" in failed["one seed 2"]
    assert "two/seed-1" in failed["two seed 1"]
    assert set(summary.removeprefix("failed: ").split(", ")) == set(failed)
    first, second, _ = process.stdout.splitlines()
    assert first.startswith("1/4 two seed 2: ")
    assert second.startswith("1 of 4 runs are finished, ")
    # what failed is as it was
    after = written(other) | written(damaged.parent)
    assert {path: after[path] for path in before} == before
    assert running(finished, "two", 1).read_text() == "years of work"


def test_what_is_nobodys_to_put_right_leaves_a_log(here):
    config = load_config(here / "one.yaml")
    job = Job("one", config, here / "one" / "seed-1", ())
    (here / "one").mkdir()
    assert failure_of(job, UserError("no room for a start")) == "no room for a start"
    assert not failure_log(job.directory).exists()
    try:
        raise ValueError("this\nand that")
    except ValueError as error:
        message = failure_of(job, error)
    log = here / "one" / "seed-1.failure.txt"
    assert message == f"ValueError: this and that (see {log})"
    assert log.read_text().startswith("Traceback")
    assert 'raise ValueError("this' in log.read_text()


@pytest.mark.slow
def test_a_worker_does_one_run_after_the_other(here, monkeypatch):
    workers: list[Any] = []
    worker = jobs._Worker
    monkeypatch.setattr(
        jobs, "_Worker", lambda means: workers.append(worker(means)) or workers[-1]
    )
    # runs that fail at once leave their worker as warm as others do
    config = load_config(here / "one.yaml").model_copy(update={"arena": "nowhere"})
    todo = [
        Job("one", config.model_copy(update={"seed": s}), here / f"{s}", ())
        for s in (1, 2, 3, 4)
    ]
    failures = []
    for event in jobs.carry_out_side_by_side(todo, Means(threads=1), 1):
        assert event.ended
        assert event.failure is not None
        failures.append(event.failure)
        if len(failures) == 2:
            assert len(workers) == 1
            # while it has nothing to do
            workers[0].process.kill()
            workers[0].process.join()
    ours, death = "no arena 'nowhere'", "its process was killed by SIGKILL"
    assert all(map(str.startswith, failures, (ours, ours, death, ours)))
    assert len(workers) == 2
    assert all(each.process.exitcode is not None for each in workers)


@linux
@pytest.mark.slow
def test_a_run_killed_alone_is_reported_and_the_next_call_completes_it(
    here, carried, reference
):
    write_study(here, evaluations=LONG)
    argv = ["mine.yaml", "--experiments", "one", "--seeds", "1-2", "--output", "out"]
    out, one = here / "out", running(here / "out", "one", 1)
    with python_process("halting.py", *argv, "--jobs", "1", cwd=here) as process:
        wait_for(lambda: n_records(one) > 2)
        (victim,) = run_processes(process.pid)
        os.kill(victim, signal.SIGKILL)
        (here / "go").touch()
        stdout, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert stderr.splitlines() == [
        "one seed 1 failed: its process was killed by SIGKILL",
        "failed: one seed 1",
    ]
    assert stdout.startswith("1/2 one seed 2: ")
    assert_reproduced(packed(out, "one", 2), reference / "seed-2")
    assert provenance(one)["finished"] is None
    assert n_records(one) > 2
    assert study(argv) == 0
    assert list(map(str, carried.jobs)) == ["one seed 1"]
    for seed in SEEDS:
        assert_reproduced(packed(out, "one", seed), reference / f"seed-{seed}")
    # gone on with, not begun again
    assert carried.resumed == [1]
    assert shlex.join(argv) in packed(out, "one", 1).provenance["commands"]
    assert not (out / "running").exists()


@contextmanager
def interrupted(
    here: Path, seeds: Sequence[int], begun: bool = True
) -> Iterator[tuple[subprocess.Popen[str], list[int], list[str]]]:
    """A study in the midst of its runs, their processes, and what was typed.

    Unless they have `begun`, the processes may be about to load what they need.
    """
    write_study(here, evaluations=LONG)
    argv = ["mine.yaml", "--experiments", "one", "--output", "out"]
    argv += ["--seeds", ",".join(map(str, seeds)), "--jobs", "2"]
    directories = [running(here / "out", "one", seed) for seed in seeds]
    with python_process("halting.py", *argv, cwd=here) as process:
        wait_for(lambda: len(run_processes(process.pid)) == len(seeds))
        if begun:
            wait_for(lambda: all(n_records(each) > 2 for each in directories))
        children = run_processes(process.pid)
        assert len(children) == len(seeds)
        yield process, children, argv


def assert_completed(
    here: Path,
    argv: Sequence[str],
    seeds: Sequence[int],
    reference: Path,
    carried: Carried,
) -> None:
    directories = [running(here / "out", "one", seed) for seed in seeds]
    assert all(n_records(each) < LONG // 10 for each in directories)
    assert study(argv) == 0
    for seed in seeds:
        run = packed(here / "out", "one", seed)
        assert_reproduced(run, reference / f"seed-{seed}")
    assert carried.resumed == [1] * len(seeds)
    assert not [*here.rglob("*.failure.txt")]


@linux
@pytest.mark.slow
@pytest.mark.parametrize(
    ("signum", "send", "status", "seeds", "begun"),
    [
        # a terminal sends it to all of them
        (signal.SIGINT, os.killpg, 130, (1, 2), True),
        (signal.SIGINT, os.kill, 130, (1,), False),
        (signal.SIGTERM, os.kill, 143, (2,), True),
    ],
    ids=["Ctrl-C", "SIGINT", "SIGTERM"],
)
def test_a_signal_ends_all_and_says_how_to_go_on(
    signum, send, status, seeds, begun, here, carried, reference
):
    with interrupted(here, seeds, begun) as (process, children, typed):
        send(process.pid, signum)
        stdout, stderr = process.communicate(timeout=PATIENCE)
        assert not any(map(command_line, children))
    assert process.returncode == status
    assert stdout == ""
    match = re.fullmatch(r"Interrupted; continue with: (.*)\n", stderr)
    assert match, stderr
    python, *arguments = shlex.split(match[1])
    assert Path(python).name.startswith("python")
    assert arguments == ["-m", "evolution.study", *typed]
    if begun:
        assert_completed(here, typed, seeds, reference, carried)


@linux
@pytest.mark.slow
def test_runs_end_when_their_study_is_killed(here, carried, reference):
    with interrupted(here, (1,)) as (process, children, typed):
        process.kill()
        wait_for(lambda: not any(map(command_line, children)))
        _, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == -signal.SIGKILL
    assert stderr == ""
    assert_completed(here, typed, (1,), reference, carried)


@linux
@pytest.mark.slow
def test_tables_have_the_same_bytes_after_any_kill(here, carried, capsys):
    """Killed after the first run has ended, and once more."""
    write_study(here, evaluations=LONG)
    (here / "go").touch()
    argv = ["mine.yaml", "--seeds", "1-3", "--jobs", "2", "--output"]
    assert study([*argv, "whole"]) == 0
    out = here / "killed"
    moments = (
        lambda: (out / "champions.parquet").exists(),
        lambda: len(StudyDirectory(out).tables.packed()) > 2,
    )
    for moment in moments:
        with python_process("halting.py", *argv, "killed", cwd=here) as process:
            wait_for(lambda moment=moment: moment() or process.poll() is not None)
            process.kill()
            process.communicate(timeout=PATIENCE)
    capsys.readouterr()
    assert study([*argv, "killed"]) == 0
    assert "6 of 6 runs are finished" in capsys.readouterr().out
    assert tables(out) == tables(here / "whole")
    assert not (out / "running").exists()


# one process in a directory

HOLD = """
import sys, time
from filelock import FileLock

with FileLock(sys.argv[1]):
    print("held", flush=True)
    time.sleep(float(sys.argv[2]))
"""


@contextmanager
def held(directory: Path, seconds: float = PATIENCE) -> Iterator[subprocess.Popen[str]]:
    """Another process works in the directory for so long."""
    arguments = (str(directory / LOCK), str(seconds))
    with python_process("-c", HOLD, *arguments, cwd=directory) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process


def test_a_second_process_in_a_run_directory_gets_one_line(here, carried, monkeypatch):
    argv = ["one.yaml", "--output", "run"]
    assert evolve(argv) == 0
    directory = here / "run"
    text = json.dumps({**provenance(directory), "finished": None})
    (directory / "provenance.json").write_text(text)
    config = load_config(directory / "config.yaml")
    job = Job("one", config, directory, ())
    monkeypatch.setattr(jobs, "PATIENCE", 0.2)
    with held(directory) as process:
        before = written(directory)
        for act in (
            lambda: evolve(["--resume", "run"]),
            lambda: carry_out(job, Means(), lambda evaluations: None),
        ):
            with pytest.raises(UserError) as info:
                act()
            message = str(info.value)
            assert message.startswith("another process is working in '")
            assert message.endswith("run': wait for it, or stop it")
        assert written(directory) == before
        # however it ends, the directory is free
        process.kill()
        process.wait(PATIENCE)
        assert evolve(["--resume", "run"]) == 0


def test_a_process_about_to_leave_is_waited_for(tmp_path):
    with held(tmp_path, 0.3), RunDirectory(tmp_path).locked(patience=PATIENCE):
        pass


# checkpoints


def test_checkpoints_take_a_small_share_of_the_time(here, carried, monkeypatch):
    """By a clock on which a generation takes 1 s and a checkpoint 2 s."""
    now, saves = 0.0, []

    class Clock:
        @staticmethod
        def monotonic() -> float:
            return now

    class Directory(RunDirectory):
        def save(self, evolution, seconds):
            nonlocal now
            super().save(evolution, seconds)
            saves.append((len(evolution.records), list(seconds)))
            now += 2

    config = load_config(here / "one.yaml").model_copy(
        # the engine of a climb would be another one
        update={"evaluations": 1000, "steps": 1, "trials": 1, "climb": 1.0}
    )
    evolution = execution.Run(config, Directory(here / "run"), Means(), ())
    monkeypatch.setattr(execution, "time", Clock)
    evaluate = evolution.evolution.engine.run

    def slow(*arguments):
        nonlocal now
        now += 1
        return evaluate(*arguments)

    monkeypatch.setattr(evolution.evolution.engine, "run", slow)
    evolution.start()
    assert len(list(evolution.evolve())) == 100
    # the first, so that there is one, and the last; 5 % of 41 s is more than 2 s
    assert [records for records, _ in saves] == [1, 42, 83, 100]
    assert [seconds for _, seconds in saves] == [
        [1.0],
        41 * [1.0],
        41 * [1.0],
        17 * [1.0],
    ]
    rows = (here / "run" / "timing.csv").read_text().splitlines()[1:]
    assert [row.split(",")[:2] for row in rows] == [
        [str(i), "1.000"] for i in range(100)
    ]
    assert math.isclose(execution.SAVING_SHARE, 0.05)
