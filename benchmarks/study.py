"""What a study costs beside evaluation: `python -m benchmarks.study --json FILE`.

Two figures: the share of a run's wall time that is not spent on evaluating controllers,
at the full budget, interpreter and imports included; and how much faster two runs are
side by side, or with a thread per core, than on one core. The second needs a machine
with two idle cores.
"""

import json
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
from evolution.study.jobs import Job, carry_out, carry_out_side_by_side

IMPORTS = "import evolution.study.jobs"


@dataclass(frozen=True)
class Options:
    """Measure what a study costs beside evaluation.

    Attributes:
        evaluations: budget of the run whose overhead is measured; 0 leaves that out.
        short: budget of the runs side by side; 0 leaves them out.
        json: also write the figures to this file; those left out stay as they were.
    """

    evaluations: int = 30_000
    short: int = 1500
    json: Path | None = None


def job(folder: Path, seed: int, evaluations: int) -> Job:
    """A run of DE/best."""
    config = load_config(find_config("de-best")).model_copy(
        update={"seed": seed, "evaluations": evaluations}
    )
    return Job("de-best", config, folder / f"seed-{seed}", ())


def overhead(evaluations: int) -> dict[str, float]:
    """Share of the wall time of a run on one core that is not evaluation."""
    spent = 0.0

    def timed(function: Callable) -> Callable:
        def run(*arguments, **keywords):
            nonlocal spent
            started = time.monotonic()
            try:
                return function(*arguments, **keywords)
            finally:
                spent += time.monotonic() - started

        return run

    for kind, name in ((BatchEngine, "run"), (Judge, "test")):
        setattr(kind, name, timed(getattr(kind, name)))
    with tempfile.TemporaryDirectory() as folder:
        started = time.monotonic()
        subprocess.run([sys.executable, "-c", IMPORTS], check=True)
        carry_out(job(Path(folder), 1, evaluations), Means(threads=1), lambda _: None)
        total = time.monotonic() - started
    return {"evaluations": evaluations, "overhead": 1 - spent / total}


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
    if options.evaluations:
        found |= overhead(options.evaluations)
        print(f"overhead: {found['overhead']:.1%} of the wall time")
    write_figures(options.json, found)
    return 0


if __name__ == "__main__":
    main(study)
