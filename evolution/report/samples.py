"""Samples of a report: what an experiment's champions show, one value per run."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from evolution.statistics.targets import evaluations_to_target
from evolution.study.data import RunData, StudyData

FOLLOWING = 0.9
"""Least share of a champion's trials that follow a wall without crashing."""

TARGET_SHARES: tuple[float, ...] = tuple(
    fitness / 300 for fitness in range(50, 250, 25)
)
"""Targets as shares of the highest fitness there is: 50, 75, ... 225 of 300."""


def tests_of(data: StudyData, name: str, robot: str) -> list[Mapping[str, Any]]:
    """The held-out evaluations of an experiment's champions on a robot."""
    return [run.champion.scores["held_out"][robot] for run in data.runs[name]]


def known(tests: Sequence[Mapping[str, Any]], key: str) -> np.ndarray:
    """A value of each held-out evaluation that has it, `(n,)`."""
    values = [test.get(key) for test in tests]
    return np.array([value for value in values if value is not None], float)


def following_share(test: Mapping[str, Any]) -> float:
    """Share of a champion's trials that followed walls, hugging them or not."""
    shares = test["behaviour"]
    return shares.get("wall follower", 0.0) + shares.get("hugger", 0.0)


def clearance(test: Mapping[str, Any]) -> float | None:
    """Mean clearance of a held-out evaluation [m], None if it does not say."""
    return _metric(test, "clearance_mean")


def whole_lap_share(test: Mapping[str, Any]) -> float | None:
    """Share of its trials with a whole lap, likewise."""
    return _metric(test, "success")


def _metric(test: Mapping[str, Any], name: str) -> float | None:
    return (test.get("metrics") or {}).get(name)


def clearances(data: StudyData, name: str, robot: str) -> np.ndarray:
    """Mean clearance of each champion that was near a wall [m], `(n,)`."""
    return _metrics(data, name, robot, clearance)


def whole_laps(data: StudyData, name: str, robot: str) -> np.ndarray:
    """Share of each champion's trials with a whole lap, `(n,)`."""
    return _metrics(data, name, robot, whole_lap_share)


def _metrics(
    data: StudyData,
    name: str,
    robot: str,
    metric: Callable[[Mapping[str, Any]], float | None],
) -> np.ndarray:
    values = [metric(test) for test in tests_of(data, name, robot)]
    return np.array([value for value in values if value is not None], float)


def class_means(data: StudyData, name: str, robot: str) -> dict[str, float]:
    """Mean share of each behaviour class over the runs that say; may be empty."""
    each = [test["behaviour"] for test in tests_of(data, name, robot) if _says(test)]
    classes = dict.fromkeys(name for shares in each for name in shares)
    return {
        name: float(np.mean([shares.get(name, 0.0) for shares in each]))
        for name in classes
    }


def _says(test: Mapping[str, Any]) -> bool:
    return bool(test.get("behaviour"))


def kept(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Share of `whole` that `part` still has, `(n,)`, of the runs that had any."""
    some = whole > 0
    return part[some] / whole[some]


def disturbed(data: StudyData, name: str) -> bool:
    """Whether an experiment evolved on robots with noise."""
    return data.configs[name].noise != "none"


def like_for_like(data: StudyData, name: str) -> np.ndarray:
    """Held-out fitness of champions as they evolved, `(n,)`; nan if not tested so."""
    robot = data.robots[0]
    if not disturbed(data, name):
        return data.held_out(name, robot)
    return np.array([run.held_out_as_evolved(robot) for run in data.runs[name]])


def most_believed(data: StudyData, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Stored and held-out fitness of each run's most believed individual, `(n,)`.

    Held-out on the robot evolved on; of the runs that say. None say of experiments with
    noise: theirs was tested on ideal robots only.
    """
    if disturbed(data, name):
        return np.empty(0), np.empty(0)
    found = [run.champion.scores.get("most_believed") for run in data.runs[name]]
    pairs = [(each["stored"], each["held_out"]) for each in found if each]
    stored, held_out = np.array(pairs, float).reshape(-1, 2).T
    return stored, held_out


def hits(runs: Sequence[RunData], steps: int) -> np.ndarray:
    """Evaluations until each run reached each target, `(runs, targets)`; nan: never."""
    return np.array(
        [
            [
                evaluations_to_target(
                    run.history["evaluations"], run.history["best"], share * steps
                )
                for share in TARGET_SHARES
            ]
            for run in runs
        ]
    )
