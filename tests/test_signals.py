"""Signals at random moments: whatever ends a run or a study, it is gone on with.

More of them, and others, with pictures, by hand; 100 take about ten minutes:

    SIGNALS=100 SIGNALS_SEED=2 python -m pytest -s tests/test_signals.py
"""

import os
import random
import signal
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from evolution.run.__main__ import evolve
from evolution.run.directory import RunDirectory
from evolution.run.history import Record
from evolution.run.means import Means
from evolution.study import __main__ as study_command
from evolution.study.__main__ import study
from evolution.study.jobs import Event, Job, carry_out
from tests.no_pictures import draw_nothing
from tests.processes import PATIENCE, python_process

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="signals of POSIX"),
]

N = int(os.environ.get("SIGNALS", "4"))
SEED = int(os.environ.get("SIGNALS_SEED", "1"))
THOROUGH = N > 4

ENDINGS = [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP]
STATUS = {
    signal.SIGKILL: (-signal.SIGKILL,),
    signal.SIGHUP: (-signal.SIGHUP,),
    # by Python, or before it runs and after it has ended
    signal.SIGTERM: (143, -signal.SIGTERM),
    signal.SIGINT: (130, -signal.SIGINT),
}

EVALUATIONS = 1000 if THOROUGH else 120
SIZE = f"steps: 20\ntrials: 2\nevaluations: {EVALUATIONS}\n"
SIZE += "validation_starts: 5\ntest_starts: 5\n"
DE = "optimizer: {algorithm: differential_evolution, strategy: best, population: 10, "
DE += "scale: 0.8, crossover: 1.0}\n"
GA = "optimizer: {algorithm: genetic_algorithm, population: 10}\n"
CLIMB = "robot: epuck_kinematic\nclimb: 0.5\n"
EXPERIMENTS = {
    "wheels": SIZE + "robot: epuck\n" + GA,
    "climb": SIZE + CLIMB + DE,
    "climb_ga": SIZE + CLIMB + GA,
}
OF_STUDY = ("climb", "climb_ga")
SEEDS = (1, 2) if THOROUGH else (1,)

COMMANDS = ("wheels", "climb", "study", "climb")
"""What is interrupted, in turn."""

LATEST = {name: 5.0 if THOROUGH else 0.6 for name in EXPERIMENTS}
LATEST["study"] = 12.0 if THOROUGH else 1.0
"""Latest moment after a run has begun, in times that it needs until then."""

SAME = ["config.yaml", "history.csv", "best_individuals.npz", "checkpoint.npz"]
SAME += ["champion.json"]
SAME += THOROUGH * ["fitness.png", "trajectory.png", "trajectory.npz"]
"""Files whose bytes are promised: rerun gives parts of recordings random identities."""

SAME_STUDY = ["study.yaml", "seeds.yaml", *THOROUGH * ["wall-follower.json"]]
SAME_STUDY += ["champions.parquet", "history.parquet"]


@pytest.fixture(scope="module")
def references(tmp_path_factory):
    """The same study, and the same run on wheels, which nothing interrupts."""
    folder = tmp_path_factory.mktemp("references")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write_experiments(folder)
        for name in ("study", "climb", "wheels"):
            finish(command(name, folder / name), folder, patch)
    return folder


def write_experiments(folder: Path) -> None:
    for name, text in EXPERIMENTS.items():
        (folder / f"{name}.yaml").write_text(text)
    both = ", ".join(f"{name}.yaml" for name in OF_STUDY)
    (folder / "both.yaml").write_text(f"experiments: [{both}]\n")


def command(name: str, output: Path) -> list[str]:
    """What begins one of `COMMANDS`, or goes on with it."""
    if name == "study":
        seeds = ",".join(map(str, SEEDS))
        argv = ["evolution.study", "both.yaml", "--jobs", "2", "--seeds", seeds]
        return [*argv, "--output", str(output)]
    if RunDirectory(output).begun:
        return ["evolution.run", "--resume", str(output)]
    return ["evolution.run", f"{name}.yaml", "--output", str(output)]


def runs(name: str, output: Path) -> dict[Path, str]:
    """Run directories of a command, with the references that are the same.

    Those of a study, whose references are its tables, are there until they are packed.
    """
    if name == "study":
        each = [f"{name}/seed-{seed}" for name in OF_STUDY for seed in SEEDS]
        return dict.fromkeys((output / "running" / name for name in each), name)
    return {output: name}


def assert_reproduced(name: str, output: Path, references: Path) -> None:
    for run, same in runs(name, output).items() if name != "study" else ():
        assert RunDirectory(run).finished
        for file in SAME:
            expected = (references / same / file).read_bytes()
            assert (run / file).read_bytes() == expected, (run, file)
    for file in SAME_STUDY * (name == "study"):
        expected = (references / "study" / file).read_bytes()
        assert (output / file).read_bytes() == expected, (output, file)


def stage(run: Path) -> str:
    """How far a run has come, by what is on disk."""
    directory = RunDirectory(run)
    if directory.finished:
        return "finished"
    if directory.champion.is_file():
        return "showing"
    if not directory.checkpoint.is_file():
        return "begun" if directory.begun else "nothing"
    with np.load(directory.checkpoint) as state:
        last = dict(zip(Record.__dataclass_fields__, state["records"][-1], strict=True))
    if last["evaluations"] > EVALUATIONS - 20:
        return "judging"
    if not directory.stored_config().climbs:
        return "evolving"
    if last["climbed"]:
        return "climbed"
    at = last["evaluations"] >= EVALUATIONS / 2
    return "at the climb" if at else "before the climb"


def moment(rng: random.Random, loading: float, latest: float) -> float:
    """When a signal comes [s]: a third while modules load, then rather early."""
    if rng.random() < 0.3:
        return rng.uniform(0, loading)
    return loading * (0.9 + latest * 10 ** rng.uniform(-2, 0))


def interrupted(
    argv: list[str], cwd: Path, signum: signal.Signals, moment: float
) -> bool:
    """Start a command and end it by a signal; whether that came before its end."""
    with python_process("-m", *argv, cwd=cwd) as process:
        begun = time.monotonic()
        try:
            stdout, stderr = process.communicate(timeout=moment)
        except subprocess.TimeoutExpired:
            process.send_signal(signum)
            stdout, stderr = process.communicate(timeout=PATIENCE)
        # whoever asks it to end waits no longer than that
        assert time.monotonic() - begun < moment + 60
    case = (argv, signum.name, moment, process.returncode, stdout, stderr)
    assert process.returncode in (0, *STATUS[signum]), case
    # python itself may be interrupted before it knows whose command it runs
    if "evolution" in stderr or moment > 0.2:
        assert "Traceback" not in stderr, case
        assert "Exception ignored" not in stderr, case
    return process.returncode != 0


def time_to_begin(output: Path) -> float:
    """Time until a run has begun [s]: the slower the machine, the later are signals."""
    started = time.monotonic()
    with python_process("-m", *command("wheels", output), cwd=output.parent):
        while not RunDirectory(output).begun:
            assert time.monotonic() < started + PATIENCE
            time.sleep(0.01)
        return time.monotonic() - started


def test_runs_and_studies_are_gone_on_with(references, tmp_path, monkeypatch):
    rng, n, case = random.Random(f"signals {SEED}"), 0, 0
    monkeypatch.chdir(tmp_path)
    write_experiments(tmp_path)
    # the first may compile something, and the machine may have been busy
    loading = min(time_to_begin(tmp_path / name) for name in ("first", "second"))
    while n < N:
        # most signals come before the end
        assert case < 10 * N
        name = COMMANDS[case % len(COMMANDS)]
        case += 1
        output = tmp_path / f"{case}-{name}"
        for _ in range(min(N - n, rng.randint(1, 3) if THOROUGH else 1)):
            signum, when = ENDINGS[n % 4], moment(rng, loading, LATEST[name])
            if not interrupted(command(name, output), tmp_path, signum, when):
                break
            n += 1
            stages = "; ".join(stage(run) for run in runs(name, output))
            print(f"| {n} | {name} | {signum.name} | {when:.2f} s | {stages} |")
        finish(command(name, output), tmp_path, monkeypatch)
        assert_reproduced(name, output, references)


def finish(argv: list[str], cwd: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Go on with it until its end, in this process unless pictures are of interest."""
    module, *arguments = argv
    if THOROUGH:
        with python_process("-m", *argv, cwd=cwd) as process:
            _, stderr = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, stderr
        return
    with monkeypatch.context() as patch:
        draw_nothing(patch)
        if module == "evolution.run":
            assert evolve(arguments) == 0
        else:
            patch.setattr(study_command, "_measure_yardstick", lambda *_: None)
            patch.setattr(study_command, "carry_out_side_by_side", one_by_one)
            assert study(arguments) == 0


def one_by_one(jobs: Sequence[Job], means: Means, n: int) -> Iterator[Event]:
    """As `carry_out_side_by_side`, without other processes."""
    for job in jobs:
        carry_out(job, means, lambda _: None)
        yield Event(job, ended=True)
