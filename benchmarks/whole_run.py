"""How long the parts of a run take: `python -m benchmarks.whole_run`.

Runs an experiment with each seed, as `python -m evolution.run` does, and takes the time
of its parts by the clock and by the CPU. It also lists the champions' fitness on wheels
and their share of crashes.
"""

import itertools
import resource
import statistics
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from benchmarks.figures import write_figures
from epuck_mj.host.command_line import main, parse
from epuck_mj.scene.model import Scene
from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.judging.evaluation import BatchEngine
from evolution.run.directory import RunDirectory
from evolution.run.execution import Run
from evolution.run.means import Means
from evolution.settings.config_files import find_config, load_config
from evolution.study.config import parse_seeds

LOADING, CHEAP, WHEELS = "loading", "evolving, before the climb", "evolving on wheels"


@dataclass(frozen=True)
class Options:
    """Time the parts of runs.

    Attributes:
        experiment: a shipped experiment or a YAML file.
        seeds: as 1-5 or 1,3.
        climb: share of the evaluations before the climb; the experiment's if not given.
        threads: threads that step the robots; 0 is one per core.
        json: also write everything to this file.
    """

    experiment: tyro.conf.Positional[str] = "de-best"
    seeds: str = "1-10"
    climb: float | None = None
    threads: int = 0
    json: Path | None = None


class Clock:
    """Seconds of each part, by the clock and by the CPU."""

    def __init__(self) -> None:
        """Begin the first part."""
        self.parts: dict[str, list[float]] = {}
        """By part, in the order of their begins: by the clock and by the CPU [s]."""
        self.part = LOADING
        self._before = time.perf_counter(), time.process_time()

    def begin(self, part: str) -> None:
        """End a part and begin the next."""
        now = time.perf_counter(), time.process_time()
        spent = self.parts.setdefault(self.part, [0.0, 0.0])
        for i in range(2):
            spent[i] += now[i] - self._before[i]
        self.part, self._before = part, now


def timed(options: Options, seed: int, folder: Path) -> dict:
    """Seconds of a run's parts, and its champion's scores on wheels."""
    clock = Clock()
    update: dict = {"seed": seed}
    if options.climb is not None:
        update["climb"] = options.climb
    config = load_config(find_config(options.experiment)).model_copy(update=update)

    def engine(scene: Scene) -> BatchEngine:
        # the second one of a run is that of its climb
        if clock.part == CHEAP:
            clock.begin(WHEELS)
        return BatchEngine(scene, config.task, options.threads)

    means = Means(engine, options.threads)
    run = Run(config, RunDirectory(folder / str(seed)), means, [])
    run.start()
    clock.begin(CHEAP)
    for _ in run.evolve():
        pass
    scores = run.finish(lambda text, _number, _stages: clock.begin(text))
    clock.begin("")
    test = scores.held_out[WHEELED_ROBOT]
    return {
        "seed": seed,
        "seconds": clock.parts,
        "mean": test.mean,
        "crash_rate": test.crash_rate,
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def whole_runs(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.whole_run", argv, Options())
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in parse_seeds(options.seeds):
            runs.append(timed(options, seed, Path(folder)))
            clock, cpu = (
                sum(part[i] for part in runs[-1]["seconds"].values()) for i in range(2)
            )
            print(
                f"seed {seed}: {runs[-1]['mean']:.1f} of 300 on wheels, "
                f"{runs[-1]['crash_rate']:.1%} crashed, {clock:.0f} s, {cpu:.0f} CPU-s",
                flush=True,
            )
    parts = dict.fromkeys(itertools.chain(*(run["seconds"] for run in runs)))
    medians = {
        part: [
            statistics.median(run["seconds"].get(part, [0, 0])[i] for run in runs)
            for i in range(2)
        ]
        for part in parts
    }
    print("\nmedian seconds by the clock, and by the CPU")
    for part, (clock, cpu) in medians.items():
        print(f"{clock:8.2f} {cpu:8.2f}  {part}")
    means = [run["mean"] for run in runs]
    # later runs keep what earlier ones have loaded
    megabytes = runs[0]["megabytes"]
    print(f"\nmedian {statistics.median(means):.1f} of 300; {megabytes:.0f} MB")
    found = {"medians": medians, "megabytes": megabytes, "runs": runs}
    write_figures(options.json, found)
    return 0


if __name__ == "__main__":
    main(whole_runs)
