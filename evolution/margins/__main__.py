"""Champions on robots that differ a little: `python -m evolution.margins STUDY`."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.host.command_line import check_threads, main, parse, word
from epuck_mj.host.files import check_writable
from epuck_mj.host.limits import check_flag

EXAMPLES = (
    "python -m evolution.margins results/paper",
    "python -m evolution.margins runs/mine --starts 1000",
)


@dataclass(frozen=True)
class MarginsOptions:
    """Test the champions of a study on robots that differ in one number.

    The numbers are the radius of the body, how far the sensors are set back, and by
    how many control steps commands come late. Trials are on the kinematic robot.
    Writes margins.parquet to the study; the report of the study shows it.

    Attributes:
        study: study directory.
        starts: number of test starts.
        threads: threads that step the robots; 0 is one per core. Changes no result.
    """

    study: tyro.conf.Positional[Annotated[Path, word("STUDY")]]
    starts: int = 200
    threads: int = 0


def measure_margins(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(
        MarginsOptions, "python -m evolution.margins", argv, examples=EXAMPLES
    )
    check_flag("starts", options.starts)
    check_threads(options.threads)
    # slow to import
    import numpy as np
    from tqdm import tqdm

    from epuck_mj.policies.wall_follower import YARDSTICK, WallFollower
    from epuck_mj.scene.model_files import without_physics
    from evolution.margins.margins_table import FILE, rows_of, write_margins
    from evolution.margins.measuring import margins_of_genomes, margins_of_policy
    from evolution.study.data import load_study

    data = load_study(options.study)
    path = options.study / FILE
    check_writable(path)
    n, threads, parts = options.starts, options.threads, []
    kinematic = without_physics(data.wheels)
    bar = tqdm(
        data.with_runs.items(), unit="experiment", disable=not sys.stderr.isatty()
    )
    for name, runs in bar:
        config = data.configs[name]
        genomes = np.array([run.champion.genome for run in runs])
        seeds = [run.seed for run in runs]
        found = margins_of_genomes(
            config.setting, config.topology, genomes, n, threads, kinematic
        )
        parts += [rows_of(name, seeds, margin) for margin in found]
    setting = next(iter(data.configs.values())).setting
    by_hand = margins_of_policy(setting, WallFollower(), n, threads, kinematic)
    parts += [rows_of(YARDSTICK, [0], margin) for margin in by_hand]
    write_margins(path, parts)
    print(f"Margins: {path}")
    return 0


if __name__ == "__main__":
    main(measure_margins)
