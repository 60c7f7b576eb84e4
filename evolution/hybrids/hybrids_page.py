"""The page about evolution that learns: tables of what helps, and by how much."""

import math
from collections.abc import Sequence

from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT
from evolution.hybrids.compared import (
    BASE,
    USEFUL,
    Compared,
    against_base,
    against_control,
    crash_rates,
    means_so_far,
    median_with_never,
    sweep,
    trials_to_useful,
)
from evolution.pages.blocks import Block, Heading, Paragraph, Picture, Table
from evolution.pages.words import (
    NOTHING,
    SPREAD,
    label,
    percent_median,
    probability,
    spread,
)
from evolution.report.sections.margins import margins_section
from evolution.study.data import StudyData


def hybrids_page(data: StudyData, pictures: Sequence[Picture]) -> list[Block]:
    """The page's blocks."""
    runs = sum(len(each) for each in data.with_runs.values())
    first, *others = pictures
    return [
        Heading("Evolution that learns", 1),
        Paragraph(
            f"{len(data.with_runs)} experiments of {data.configs[BASE].budget:,} "
            f"trials a run, lessons included; {runs:,} runs. Held-out fitness is the "
            f"champion's mean on test starts. {SPREAD}."
        ),
        worth_table(data),
        first,
        Heading(f"Against {label(data, BASE)}"),
        verdicts_table(data, against_base(data)),
        Heading("Learning rules against their control"),
        Paragraph(
            "The control spends as many trials on random perturbations of the same "
            "length as the rules' steps, and keeps the better of each pair."
        ),
        verdicts_table(data, against_control(data)),
        Heading("How much of the budget for lessons"),
        sweep_table(data),
        *others,
        *margins_section(data),
    ]


def worth_table(data: StudyData) -> Table:
    """Held-out fitness on both robots, crashes, and trials to a useful robot."""
    return Table(
        (
            "experiment",
            "n",
            "held-out, epuck",
            "held-out, epuck_kinematic",
            "crash, epuck [%]",
            f"trials to {USEFUL:.0f} stored",
            "stored best so far, mean over the budget",
        ),
        [
            (
                label(data, name),
                str(len(runs)),
                spread(data.held_out(name, WHEELED_ROBOT)),
                spread(data.held_out(name, KINEMATIC_ROBOT)),
                percent_median(crash_rates(data, name)),
                _trials(data, name),
                spread(means_so_far(data, name)),
            )
            for name, runs in data.with_runs.items()
        ],
    )


def _trials(data: StudyData, name: str) -> str:
    median = median_with_never(trials_to_useful(data, name))
    return NOTHING if math.isinf(median) else f"{median:,.0f}"


def verdicts_table(data: StudyData, family: Sequence[Compared]) -> Table:
    """One row for each comparison of a family."""
    return Table(
        ("experiment", "against", "n", "shift", "Holm p", "equivalence p", "verdict"),
        [
            (
                label(data, each.name),
                label(data, each.other),
                str(each.runs),
                str(each.shift),
                probability(each.p).removeprefix("= "),
                probability(each.shift.p).removeprefix("= "),
                each.verdict,
            )
            for each in family
        ],
    )


def sweep_table(data: StudyData) -> Table:
    """Held-out fitness on wheels by rule and share of the budget."""
    found = sweep(data)
    shares = sorted({share for by_share in found.values() for share in by_share})
    return Table(
        ("rule", *(f"{share:.0%} lessons" for share in shares)),
        [
            (
                rule.replace("_", " "),
                *(
                    spread(by_share[share]) if share in by_share else NOTHING
                    for share in shares
                ),
            )
            for rule, by_share in found.items()
        ],
    )
