"""What was run: title, what is missing, and the experiments."""

import math
from pathlib import Path

import numpy as np

from epuck_mj.scene.model_files import is_kinematic
from evolution.pages.blocks import Block, Heading, Listing, Paragraph, Table
from evolution.pages.words import (
    NOTHING,
    evaluations,
    label,
    numbered,
    robot_name,
    spread,
)
from evolution.report.measures import shown_robots
from evolution.report.samples import tests_of
from evolution.run.champion import (
    LATEST_BEST,
    N_SCREENING,
    SCREENED,
)
from evolution.run.history import CLIMBED
from evolution.study.config import seeds_text
from evolution.study.data import StudyData


def what_was_run_section(data: StudyData) -> list[Block]:
    """Title, what is missing, and the experiments."""
    return [
        Heading(f"Report of the study {data.path.as_posix()}", 1),
        Paragraph(
            "Evolution of wall following for an e-puck: a replication, with our own "
            "code and another simulator, of a comparison of a genetic algorithm "
            "with two variants of differential evolution."
        ),
        Heading("What is missing"),
        *_missing(data),
        Heading("What was run"),
        Paragraph(_tests_in_words(data)),
        *_experiments(data),
    ]


def _missing(data: StudyData) -> list[Block]:
    few = [label(data, name) for name, each in data.with_runs.items() if len(each) < 2]
    blocks: list[Block] = [
        Listing(data.missing)
        if data.missing
        else Paragraph("Nothing: all runs that were begun are finished.")
    ]
    if few:
        blocks.append(
            Paragraph(
                f"Only one run of {', '.join(few)}: one run does not show the spread "
                "between runs, so there is no verdict."
            )
        )
    return blocks


def _tests_in_words(data: StudyData) -> str:
    runs = data.with_runs
    starts = {
        test.starts
        for name in runs
        for robot in data.robots
        for test in tests_of(data, name, robot)
    }
    n_starts = " or ".join(f"{n:,}" for n in sorted(starts))
    return (
        f"{numbered(sum(map(len, runs.values())), 'finished run')} of "
        f"{numbered(len(runs), 'experiment')}. "
        f"Evolved on {evolved_on(data)}. "
        f"Each run's champion is tested on {n_starts} test starts, the same for "
        "all and never used by evolution, with ideal sensors and motors, on the "
        f"{' and the '.join(map(robot_name, shown_robots(data)))}. The unit is "
        f"the run; fitness is at most {data.steps}, the control steps of a trial."
    )


def _experiments(data: StudyData) -> list[Block]:
    """Table of the experiments, and what its columns mean."""
    taken = {name: _steps(data, name) for name in data.configs}
    scale, unit, units = scale_of(np.concatenate(list(taken.values())))
    return [
        Table(
            (
                *("experiment", "name", "seeds", "runs", "budget [evaluations]"),
                *("spent [evaluations]", "trials per evaluation"),
                f"control steps{f' [{unit}]' if unit else ''}",
            ),
            [
                (
                    label(data, name),
                    name,
                    seeds_text([run.seed for run in data.runs[name]]) or NOTHING,
                    str(len(data.runs[name])),
                    f"{config.evaluations:,}",
                    _spent(data, name),
                    str(config.trials),
                    spread(taken[name] / scale, form="z,.1f" if unit else "z,.0f"),
                )
                for name, config in data.configs.items()
            ],
            texts=3,
        ),
        Paragraph(
            "Budget and spent are numbers of individual evaluations; the next column "
            "says how many trials each has. A run spends whole generations only. "
            "Control steps are those of a run"
            f"{f', in {units}' if unit else ''}, median [quartiles]. A trial has at "
            f"most {data.steps}: fewer if the robot crashes, or if racing stops an "
            "individual that cannot win any more. The choice of the champion costs "
            f"extra, for every algorithm: {_validation_starts(data)} trials of each "
            f"candidate. Candidates are all of the last population and the last "
            f"{LATEST_BEST} individuals that raised the run's best; some of them are "
            f"the same.{_finalists(data)}"
        ),
    ]


def evolved_on(data: StudyData) -> str:
    """Text with the robot that all experiments have, and the one they climbed to."""
    config = next(iter(data.configs.values()))
    text = f"the {robot_name(Path(config.robot).name)}"
    runs = [run for each in data.runs.values() for run in each]
    if any(run.history[CLIMBED].any() for run in runs):
        text += f", then on the {robot_name(data.wheels)}"
    return text


def _kinematic(data: StudyData) -> bool:
    return is_kinematic(next(iter(data.configs.values())).robot)


def _finalists(data: StudyData) -> str:
    """Sentence about what follows for candidates on the kinematic robot."""
    if not _kinematic(data):
        return ""
    text = f" The best {SCREENED} have {N_SCREENING:,} trials"
    numbers = sorted({config.finalists for config in data.configs.values()} - {0})
    if numbers:
        text += (
            f", and the best {' or '.join(map(str, numbers))} of these are compared on "
            f"the {robot_name(data.wheels)}"
        )
    return f"{text}."


def _validation_starts(data: StudyData) -> str:
    """Text with the number of validation starts, of all experiments."""
    numbers = sorted({config.validation_starts for config in data.configs.values()})
    return " or ".join(map(str, numbers))


def _spent(data: StudyData, name: str) -> str:
    spent = [run.history["evaluations"][-1] for run in data.runs[name]]
    return evaluations(max(spent, default=None))


def _steps(data: StudyData, name: str) -> np.ndarray:
    """Control steps of the runs that counted them, `(n,)`."""
    counted = [run.control_steps for run in data.runs[name]]
    return np.array([steps for steps in counted if steps], float)


def scale_of(numbers: np.ndarray) -> tuple[float, str, str]:
    """Scale at which the smallest of `(n,)` is not rounded to 0, its sign and name."""
    smallest = numbers.min(initial=math.inf)
    if 1e5 <= smallest < math.inf:
        return 1e6, "M", "millions"
    return (1e3, "k", "thousands") if 1e3 <= smallest < math.inf else (1.0, "", "")
