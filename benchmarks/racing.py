"""What racing saves: `python -m benchmarks.racing --json results/racing.json`.

Evolves with racing, as `evolution.run` does, and runs every tenth generation, the
first included, a second time without it: the same individuals on the same starts, one
right after the other, so that the machine's other work falls on both alike. In the
first nothing can be saved, and it counts ten times: the shares are a little too high.
Time is that of the trials.
"""

import statistics
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import tyro

from benchmarks.figures import write_figures
from epuck_mj.host.command_line import main, parse
from epuck_mj.scene.model import Scene
from epuck_mj.step.control import TaskParameters, Trials
from evolution.judging.evaluation import BatchEngine, Work
from evolution.run.generation_loop import Evolution
from evolution.settings.config_files import find_config, load_config
from evolution.study.config import parse_seeds

EVERY = 10
"""Number of generations of which one is run both ways."""


@dataclass(frozen=True)
class Options:
    """Measure the control steps and the time that racing saves.

    Attributes:
        experiment: a shipped experiment or a YAML file.
        seeds: as 1-5 or 1,3.
        threads: threads that step the robots; 0 is one per core.
        json: also write everything to this file.
    """

    experiment: tyro.conf.Positional[str] = "de-best"
    seeds: str = "1-5"
    threads: int = 0
    json: Path | None = None


class BothWays:
    """An engine that runs every tenth generation with and without racing."""

    def __init__(self, task: TaskParameters, threads: int):
        """Measure nothing yet."""
        self._task, self._threads = task, threads
        self._generation = 0
        self.steps = {True: 0, False: 0}
        self.seconds = {True: 0.0, False: 0.0}

    def __call__(self, scene: Scene) -> Self:
        """The engine for a scene; a run that climbs has two, one after the other."""
        self._engine = BatchEngine(scene, self._task, self._threads)
        return self

    def run(self, work: Work) -> Trials:
        """See `Engine.run`."""
        if work.race is None:
            # a population that is evaluated anew after the climb
            return self._engine.run(work)
        if self._generation == 0:
            # compile
            self._engine.run(work)
        sampled = self._generation % EVERY == 0
        self._generation += 1
        if sampled:
            self._timed(True, replace(work, race=None))
        return self._timed(sampled, work)

    def _timed(self, counted: bool, work: Work) -> Trials:
        started = time.perf_counter()
        trials = self._engine.run(work)
        if counted:
            raced = work.race is not None
            self.seconds[raced] += time.perf_counter() - started
            self.steps[raced] += int(trials.steps.sum())
        return trials


def racing(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.racing", argv, Options())
    config = load_config(find_config(options.experiment))
    runs = []
    for seed in parse_seeds(options.seeds):
        seeded = config.model_copy(update={"seed": seed})
        both = BothWays(seeded.task, options.threads)
        experiment = Evolution(seeded, both)
        for record in experiment.run():
            if record.generation % 50 == 0:
                print(f"seed {seed}: generation {record.generation}", file=sys.stderr)
        runs.append(
            {
                "seed": seed,
                "generations": len(experiment.records),
                "control_steps": sum(r.control_steps for r in experiment.records),
                "share_of_steps": both.steps[True] / both.steps[False],
                "share_of_time": both.seconds[True] / both.seconds[False],
            }
        )
        print(
            f"seed {seed}: {runs[-1]['share_of_steps']:.3f} of the control steps, "
            f"{runs[-1]['share_of_time']:.3f} of the time",
            flush=True,
        )
    result = {
        "experiment": options.experiment,
        "threads": options.threads,
        "every": EVERY,
        "median_share_of_steps": statistics.median(r["share_of_steps"] for r in runs),
        "median_share_of_time": statistics.median(r["share_of_time"] for r in runs),
        "runs": runs,
    }
    print(
        f"median: {result['median_share_of_steps']:.3f} of the control steps, "
        f"{result['median_share_of_time']:.3f} of the time"
    )
    write_figures(options.json, result)
    return 0


if __name__ == "__main__":
    main(racing)
