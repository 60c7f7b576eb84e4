"""Signals at random moments: whatever ends a run or a study, it is gone on with.

`SIGNALS=100 python -m pytest tests/test_signals.py` sends that many, and compares
pictures as well: about ten minutes.
"""

import os
import random
import signal
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from evolution.run.__main__ import evolve
from evolution.run.directory import RunDirectory
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

N = int(os.environ.get("SIGNALS", "6"))
THOROUGH = N > 6

ENDINGS = [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP]
STATUS = {
    signal.SIGKILL: (-signal.SIGKILL,),
    signal.SIGHUP: (-signal.SIGHUP,),
    # by Python, or before it runs and after it has ended
    signal.SIGTERM: (143, -signal.SIGTERM),
    signal.SIGINT: (130, -signal.SIGINT),
}

SIZE = "steps: 20\ntrials: 2\nevaluations: 240\nvalidation_starts: 5\ntest_starts: 5\n"
EXPERIMENTS = {
    "one": "{algorithm: genetic_algorithm, population: 10}",
    "two": "{algorithm: differential_evolution, strategy: best, population: 10, "
    "scale: 0.8, crossover: 1.0}",
}
SEEDS = (1, 2)

SAME = ["config.yaml", "history.csv", "best_individuals.npz", "checkpoint.npz"]
SAME += ["champion.json"]
PICTURES = ["fitness.png", "trajectory.png", "trajectory.npz"]
"""Files whose bytes are promised: rerun gives its recordings random identities."""


@pytest.fixture(scope="module")
def references(tmp_path_factory):
    """The same runs, which nothing interrupts, and how long a process takes [s]."""
    folder = tmp_path_factory.mktemp("references")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        if not THOROUGH:
            draw_nothing(patch)
        write_study(folder)
        for name in EXPERIMENTS:
            for seed in SEEDS:
                output = ["--output", f"{name}-{seed}"]
                assert evolve([f"{name}.yaml", "--seed", str(seed), *output]) == 0
    return folder


def write_study(folder: Path) -> None:
    for name, optimizer in EXPERIMENTS.items():
        (folder / f"{name}.yaml").write_text(f"{SIZE}optimizer: {optimizer}\n")
    (folder / "both.yaml").write_text("experiments: [one.yaml, two.yaml]\n")


def assert_reproduced(run: Path, reference: Path) -> None:
    assert RunDirectory(run).finished
    for name in SAME + THOROUGH * PICTURES:
        assert (run / name).read_bytes() == (reference / name).read_bytes(), (run, name)


def interrupted(argv: list[str], cwd: Path, rng: random.Random, longest: float) -> bool:
    """Start a command and end it by a signal; whether that came before its end."""
    signum = rng.choice(ENDINGS)
    moment = rng.uniform(0, longest)
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
    print(argv[0], argv[1], signum.name, f"{moment:.2f} s", process.returncode)
    return process.returncode != 0


def test_runs_and_studies_are_gone_on_with(references, tmp_path, monkeypatch):
    rng, left, case = random.Random(f"signals {N}"), N, 0
    # the slower the machine, the later are the moments
    begun = time.monotonic()
    with python_process("-m", "evolution.run", "-h", cwd=tmp_path) as process:
        process.communicate(timeout=PATIENCE)
    loading = time.monotonic() - begun
    monkeypatch.chdir(tmp_path)
    write_study(tmp_path)
    while left > 0:
        case += 1
        output = tmp_path / f"{case}"
        if case % 3:
            name = rng.choice(list(EXPERIMENTS))
            new = ["evolution.run", f"{name}.yaml", "--output", str(output)]
            again = ["evolution.run", "--resume", str(output)]
            runs = {output: references / f"{name}-1"}
            longest = 6 * loading
        else:
            new = ["evolution.study", "both.yaml", "--jobs", "2"]
            new += ["--seeds", "1-2", "--output", str(output)]
            again = new
            runs = {
                output / name / f"seed-{seed}": references / f"{name}-{seed}"
                for name in EXPERIMENTS
                for seed in SEEDS
            }
            longest = 15 * loading
        # while it loads, evolves, and tests its champion
        for _ in range(min(left, rng.randint(1, 3))):
            argv = again if RunDirectory(output).begun else new
            if not interrupted(argv, tmp_path, rng, longest):
                break
            left -= 1
        finish(again if RunDirectory(output).begun else new, tmp_path, monkeypatch)
        for run, reference in runs.items():
            assert_reproduced(run, reference)


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
