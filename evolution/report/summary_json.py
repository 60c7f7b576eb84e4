"""summary.json: everything that a study has found; each run is in runs.csv."""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from epuck_mj.trials.behaviour_classes import HUG
from evolution.pages.words import label
from evolution.report.measures import shown_robots
from evolution.report.samples import (
    best_stored_fitness,
    class_means,
    clearances,
    crash_rates,
    kept,
    tests_of,
    with_noise,
)
from evolution.report.sections.comparisons import pair_rows
from evolution.report.sections.cost_of_targets import target_rows
from evolution.report.sections.how_to_get_every_number_again import commands, origins
from evolution.report.sections.success import success_rows
from evolution.settings.comparison import differences, flat
from evolution.statistics.estimates import quartiles, rank_correlation
from evolution.study.data import StudyData


def summary_fields(data: StudyData, output: str, ioh: bool) -> dict[str, Any]:
    """What was found as JSON values; null is what is not known, or not finite.

    Args:
        data: the study.
        output: directory of the report, as it was asked for.
        ioh: whether the IOHprofiler export was asked for.
    """
    return _plain(
        {
            "study": data.path.as_posix(),
            "steps": data.steps,
            "robots": list(shown_robots(data)),
            "missing": list(data.missing),
            "experiments": {name: _experiment(data, name) for name in data.configs},
            "config_differences": differences(data.configs, ("seed",)),
            "configs": {
                name: {key: each for key, each in flat(config).items() if key != "seed"}
                for name, config in data.configs.items()
            },
            "yardstick": {
                robot: test.to_dict() for robot, test in data.yardstick.items()
            },
            "pairwise": pair_rows(data),
            "success": success_rows(data),
            "targets": target_rows(data),
            "provenance": origins(data),
            "commands": commands(data, output, ioh),
        }
    )


def summary_text(fields: dict[str, Any]) -> str:
    """The text of summary.json."""
    return json.dumps(fields, indent=1, allow_nan=False) + "\n"


def _experiment(data: StudyData, name: str) -> dict[str, Any]:
    found: dict[str, Any] = {
        "label": label(data, name),
        "n": len(data.runs[name]),
        "seeds": [run.seed for run in data.runs[name]],
    }
    if name not in data.with_runs:
        return found
    first, last = data.rungs or (data.robots[0], data.robots[0])
    stored, begun_on = data.stored(name), data.held_out(name, first)
    stored_fitness, worth = best_stored_fitness(data, name)
    rank = rank_correlation(begun_on, data.held_out(name, last))
    return found | {
        "held_out": {
            robot: {
                "fitness": _described(data.held_out(name, robot)),
                "crash_rate": _described(crash_rates(tests_of(data, name, robot))),
                # with noise, stored fitness cannot be compared with tests without noise
                "share_of_stored": None
                if with_noise(data, name)
                else _described(kept(data.held_out(name, robot), stored)),
                "behaviour": class_means(data, name, robot),
                "clearance": _described(clearances(data, name, robot)),
                "champions_that_hug": int((clearances(data, name, robot) < HUG).sum()),
            }
            for robot in shown_robots(data)
        },
        "stored": _described(stored),
        "best_stored": {
            "fitness": _described(stored_fitness),
            "held_out": _described(worth),
        },
        "share_kept_between_robots": _described(
            kept(data.held_out(name, last), begun_on)
        ),
        "rank_correlation_between_robots": rank if first != last else None,
    }


def _described(sample: np.ndarray) -> dict[str, float] | None:
    """A sample `(n,)` in numbers, None if it is empty."""
    if not sample.size:
        return None
    found = quartiles(sample)
    return {
        "n": sample.size,
        "mean": float(sample.mean()),
        "lower_quartile": found.lower,
        "median": found.median,
        "upper_quartile": found.upper,
        "lowest": float(sample.min()),
        "highest": float(sample.max()),
    }


def _plain(value: Any) -> Any:
    """The value without what JSON has no word for."""
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
