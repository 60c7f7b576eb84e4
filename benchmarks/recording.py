"""What a recording costs: `python -m benchmarks.recording`, `make recording`.

Time of writing one beside that of the simulation it shows, sizes, and the time of a
whole `evolution.replay` from its start to the written file.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.figures import write_figures
from epuck_mj.host.command_line import main, parse
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.model_files import WHEELED_ROBOT
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.show.recording import Trial, save_recording
from epuck_mj.trials.recorder import record
from evolution.judging.held_out_starts import starts_for_test
from evolution.named_policies import named_policies

RUN = "results/paper/de-best/seed-1"
MANY = 10


@dataclass(frozen=True)
class Options:
    """Measure what a recording of a champion costs.

    Attributes:
        json: file for the figures.
        repeats: of each measurement; medians are reported.
    """

    json: Path | None = None
    repeats: int = 9


def measure(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.recording", argv, Options())
    (policy,) = named_policies(RUN)
    scene = load_scene(WHEELED_ROBOT, policy.arena, policy.task.control_step)
    starts = starts_for_test(FreeSpace(scene, policy.start_clearance), MANY)
    trials = [
        Trial(
            f"start {i}", record(scene, policy.policy, start, policy.task), policy.task
        )
        for i, start in enumerate(starts)
    ]
    with tempfile.TemporaryDirectory() as folder:
        one, many = Path(folder, "one.rrd"), Path(folder, "many.rrd")

        def simulate() -> None:
            record(scene, policy.policy, starts[0], policy.task)

        def replay() -> None:
            command = [sys.executable, "-m", "evolution.replay", RUN, "--save", one]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)

        figures = {
            "simulated_s": float(trials[0].trajectory.time[-1]),
            "simulation_s": _seconds(simulate, options.repeats),
            "recording_s": _seconds(
                lambda: save_recording(one, scene, trials[:1], "", ""), options.repeats
            ),
            "recording_bytes": one.stat().st_size,
            "recording_of_ten_s": _seconds(
                lambda: save_recording(many, scene, trials, "", ""), options.repeats
            ),
            "recording_of_ten_bytes": many.stat().st_size,
            "replay_s": _seconds(replay, options.repeats),
        }
    for name, value in figures.items():
        print(f"{name:24} {value:12,.4g}")
    write_figures(options.json, figures)
    return 0


def _seconds(work: Callable[[], None], repeats: int) -> float:
    """Median time of some work [s]; what it does first only is not counted."""
    work()
    taken = []
    for _ in range(repeats):
        before = time.perf_counter()
        work()
        taken.append(time.perf_counter() - before)
    return statistics.median(taken)


if __name__ == "__main__":
    main(measure)
