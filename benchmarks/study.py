"""What a study costs beside evaluation: `python -m benchmarks.study --json FILE`.

The share of a run's processor time in a study that is not spent on evaluating
controllers, with what it costs the study's own process. And how much faster two runs
are side by side, or with a thread per core, than on one core; this needs a machine with
two idle cores.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.figures import write_figures
from epuck_mj.host.command_line import main, parse
from evolution.judging.evaluation import BatchEngine
from evolution.judging.held_out import Judge
from evolution.run.means import Means
from evolution.settings.config_files import find_config, load_config
from evolution.study.config import StudyConfig, find_study
from evolution.study.jobs import Job, carry_out, carry_out_side_by_side

STUDY, EXPERIMENTS = "paper", ("de-best", "one-plus-one-es")
"""Experiments whose overhead is measured: the second has the shortest generations."""


@dataclass(frozen=True)
class Options:
    """Measure what a study costs beside evaluation.

    Attributes:
        runs: of each experiment whose overhead is measured; 0 leaves that out.
        short: budget of the runs side by side; 0 leaves them out.
        json: also write the figures to this file; those left out stay as they were.
    """

    runs: int = 2
    short: int = 1500
    json: Path | None = None


def job(folder: Path, seed: int, evaluations: int) -> Job:
    """A run of DE/best."""
    config = load_config(find_config("de-best")).model_copy(
        update={"seed": seed, "evaluations": evaluations}
    )
    return Job("de-best", config, folder / f"seed-{seed}", ())


def overhead(name: str, runs: int) -> float:
    """Share of what further runs of a study cost on one core that is not evaluation.

    Without what a study costs once: imports, and the test of the hand-written follower.
    """
    config = StudyConfig.load(find_study(STUDY))
    with tempfile.TemporaryDirectory() as folder:
        jobs = [
            Job(name, config.with_seed(name, seed), Path(folder, str(seed)), ())
            for seed in range(2, runs + 2)
        ]
        evaluating = sum(map(evaluation_seconds, jobs))
    return 1 - evaluating / (study_seconds(name, runs + 1) - study_seconds(name, 1))


def study_seconds(name: str, runs: int) -> float:
    """Processor time of a study with its first seeds on one core, all of it [s]."""
    with tempfile.TemporaryDirectory() as folder:
        before = children_seconds()
        command = [
            *(sys.executable, "-m", "evolution.study", STUDY),
            *("--experiments", name, "--seeds", f"1-{runs}"),
            *("--jobs", "1", "--output", str(Path(folder, "study"))),
        ]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return children_seconds() - before


def children_seconds() -> float:
    """Processor time of all processes that this one has waited for, and theirs [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def evaluation_seconds(job: Job) -> float:
    """Processor time of the evaluations of a run, done in this process [s]."""
    spent = 0.0

    def timed(function: Callable) -> Callable:
        def run(*arguments, **keywords):
            nonlocal spent
            started = time.process_time()
            try:
                return function(*arguments, **keywords)
            finally:
                spent += time.process_time() - started

        return run

    kept = BatchEngine.run, Judge.test
    BatchEngine.run, Judge.test = map(timed, kept)
    try:
        carry_out(job, Means(threads=1), lambda _: None)
    finally:
        BatchEngine.run, Judge.test = kept
    return spent


def side_by_side(evaluations: int) -> dict[str, float]:
    """Time of two runs one after the other on one core, by other ways on two cores."""
    seconds = {}
    for n_processes, threads in ((1, 1), (2, 1), (1, 2)):
        with tempfile.TemporaryDirectory() as folder:
            jobs = [job(Path(folder), seed, evaluations) for seed in (1, 2)]
            started = time.monotonic()
            means = Means(threads=threads)
            for event in carry_out_side_by_side(jobs, means, n_processes):
                if event.failure is not None:
                    raise RuntimeError(event.failure)
            seconds[n_processes, threads] = time.monotonic() - started
    return {
        "evaluations_side_by_side": evaluations,
        "two_side_by_side": seconds[1, 1] / seconds[2, 1],
        "two_threads_each": seconds[1, 1] / seconds[1, 2],
    }


def study(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.study", argv, Options())
    found: dict[str, float] = {}
    if options.json is not None and options.json.exists():
        found = json.loads(options.json.read_text(encoding="utf-8"))
    if options.short:
        found |= side_by_side(options.short)
        print(
            f"two runs side by side: {found['two_side_by_side']:.2f}x; one after the "
            f"other on two threads: {found['two_threads_each']:.2f}x",
            flush=True,
        )
    if options.runs:
        for name in EXPERIMENTS:
            found[f"overhead of {name}"] = share = overhead(name, options.runs)
            print(f"{name}: {share:.1%} of a run is not evaluation")
    write_figures(options.json, found)
    return 0


if __name__ == "__main__":
    main(study)
