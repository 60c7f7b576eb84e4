"""Everything that a study has found, as JSON values."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from epuck_mj.policies.wall_follower import YARDSTICK
from epuck_mj.trials.behaviour_classes import HUG
from evolution.pages.words import command_line, label
from evolution.report.pairs import pair_rows
from evolution.report.samples import (
    class_means,
    clearances,
    crash_rates,
    disturbed,
    kept,
    most_believed,
    tests_of,
)
from evolution.report.successes import success_rows
from evolution.report.tables import provenance, run_rows, shown_robots, target_rows
from evolution.run.directory import RunDirectory
from evolution.settings.config import ExperimentConfig, flat
from evolution.statistics.samples import quartiles, rank_correlation
from evolution.study.data import StudyData


def config_differences(data: StudyData) -> dict[str, dict[str, Any]]:
    """Keys in which the experiments differ, and the value of each that has it."""
    each = {name: _keys(config) for name, config in data.configs.items()}
    keys = dict.fromkeys(key for fields in each.values() for key in fields)
    found = {
        key: {name: fields[key] for name, fields in each.items() if key in fields}
        for key in keys
    }
    return {
        key: values
        for key, values in found.items()
        if len(values) < len(each) or len(set(map(repr, values.values()))) > 1
    }


def commands(data: StudyData, output: str, ioh: bool) -> dict[str, str]:
    """What to type to get every number again, by what it gives."""
    study = data.path.as_posix()
    run = next(run for runs in data.runs.values() for run in runs)
    again = ["--ioh"] if ioh else []
    return {
        "this report": command_line(
            "evolution.report", study, "--output", output, *again
        ),
        "held-out fitness and behaviour of every champion": command_line(
            "evolution.evaluate", study
        ),
        "whether every champion scores the same on this machine": command_line(
            "evolution.verify", study
        ),
        "the hand-written wall follower": command_line("evolution.evaluate", YARDSTICK),
        "one run, byte for byte (any other likewise)": command_line(
            "evolution.run",
            RunDirectory(run.path).config.as_posix(),
            "--output",
            f"runs/again-{run.path.parent.name}-{run.seed}",
        ),
    }


def summary(data: StudyData, output: str, ioh: bool) -> dict[str, Any]:
    """Everything as JSON values; null is what is not known, or not finite.

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
            "config_differences": config_differences(data),
            "configs": {name: _keys(config) for name, config in data.configs.items()},
            "yardstick": {
                robot: test.to_dict() for robot, test in data.yardstick.items()
            },
            "runs": run_rows(data),
            "pairwise": list(map(asdict, pair_rows(data))),
            "success": list(map(asdict, success_rows(data))),
            "targets": list(map(asdict, target_rows(data))),
            "provenance": provenance(data),
            "commands": commands(data, output, ioh),
        }
    )


def summary_text(summary: dict[str, Any]) -> str:
    """The text of summary.json."""
    return json.dumps(summary, indent=1, allow_nan=False) + "\n"


def _experiment(data: StudyData, name: str) -> dict[str, Any]:
    found: dict[str, Any] = {
        "label": label(name),
        "n": len(data.runs[name]),
        "seeds": [run.seed for run in data.runs[name]],
    }
    if name not in data.with_runs:
        return found
    first, last = data.robots[0], data.robots[-1]
    stored, evolved_on = data.stored(name), data.held_out(name, first)
    rank = rank_correlation(evolved_on, data.held_out(name, last))
    return found | {
        "held_out": {
            robot: {
                "fitness": _described(data.held_out(name, robot)),
                "crash_rate": _described(crash_rates(tests_of(data, name, robot))),
                # of experiments with noise, stored fitness is another quantity
                "share_of_stored": None
                if disturbed(data, name)
                else _described(kept(data.held_out(name, robot), stored)),
                "behaviour": class_means(data, name, robot),
                "clearance": _described(clearances(data, name, robot)),
                "champions_that_hug": int((clearances(data, name, robot) < HUG).sum()),
            }
            for robot in shown_robots(data)
        },
        "stored": _described(stored),
        "most_believed": dict(
            zip(
                ("stored", "held_out"),
                map(_described, most_believed(data, name)),
                strict=True,
            )
        ),
        "share_kept_between_robots": _described(
            kept(data.held_out(name, last), evolved_on)
        ),
        "rank_correlation_between_robots": rank if first != last else None,
    }


def _keys(config: ExperimentConfig) -> dict[str, Any]:
    return {key: value for key, value in flat(config).items() if key != "seed"}


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
