"""REPRODUCTION.md: the paper's claims, luck in stored fitness, differences."""

from collections.abc import Sequence

import numpy as np

from epuck_mj.policies.wall_follower import YARDSTICK
from epuck_mj.scene.model_files import WHEELED_ROBOT
from evolution.pages.blocks import (
    Block,
    Code,
    Heading,
    Listing,
    Paragraph,
    Table,
    to_markdown,
)
from evolution.pages.words import (
    PAPERS,
    REPLICATES,
    SPREAD,
    label,
    median_and_quartiles,
    spread,
)
from evolution.report.measures import shown_robots
from evolution.report.samples import best_stored_fitness, best_stored_robot, kept
from evolution.reproduce.claim import Claim
from evolution.reproduce.claims import (
    claims,
    held_out_order,
    held_out_pairs,
    tally,
    unlike,
)
from evolution.reproduce.differences_from_paper import differences_from_paper
from evolution.reproduce.first_generation import FirstGeneration
from evolution.reproduce.settled import settled_blocks
from evolution.reproduce.verdicts import fewest_to_contradict
from evolution.study.data import StudyData


def reproduction(
    study: StudyData,
    wheels: StudyData | None,
    unevolved: Sequence[FirstGeneration],
    made_by: str,
) -> str:
    """The text of REPRODUCTION.md.

    Args:
        study: not evolved on wheels from the start.
        wheels: evolved on wheels from the start, if there is one.
        unevolved: the first generation by each reading of the fitness equation.
        made_by: the command that wrote it.
    """
    found = claims(study)
    counts = "; ".join(f"{n} {verdict}" for verdict, n in tally(found).items())
    blocks: list[Block] = [
        Heading("Reproduction", 1),
        Paragraph(
            "A replication, with another simulator and our own code, of a study that "
            "is probably Cruz-Alvarez, Montes-Gonzalez, Mezura-Montes and Santos "
            "(MICAI 2012). This page was written by"
        ),
        Code([made_by]),
        *_provisional(study),
        *settled_blocks(study, held_out_pairs(study, WHEELED_ROBOT), found),
        Heading("What there is"),
        *_there(study),
        Heading("How verdicts are given"),
        Paragraph(
            "n is the number of runs; with fewer than 10 there is no verdict. An order "
            "is decided if a Mann-Whitney p is below 0.05, Holm-adjusted for the three "
            "pairs of the paper's algorithms. The difference of medians and A12 are "
            "given with 95 % bounds. A statement about runs is decided if both of "
            "Wilson's 95 % bounds are on the same side of one half. A maximum of the "
            "paper is taken for the best of three runs. It is inconsistent if the best "
            "of three of our own runs would have so extreme a rank among ours with "
            "p < 0.05, two-sided. Otherwise nothing contradicts it. This is weaker "
            "than what other claims have to show: a maximum above all of ours stays "
            f"undecided, and with fewer than {fewest_to_contradict(REPLICATES)} runs "
            "no maximum can be shown to be too high."
        ),
        Heading("The paper's claims"),
        Paragraph(
            f"Of {len(found)} claims: {counts}. Fitness is stored fitness here, as the "
            "paper measured it. DE keeps the stored fitness of its individuals, so "
            "lucky values stay in its population mean. The GA's mean is over new "
            "evaluations. So part of the difference between their means is luck. "
            "Behaviour is that of the champion, which was chosen on "
            "validation starts. It is better than the individual with the highest "
            "stored fitness (see the section What stored fitness hides)."
        ),
        _claims(found),
        Heading("The same order by fresh starts"),
        Paragraph(
            "The paper did not measure this: the fitness of champions on 1,000 starts "
            "that evolution never used. Verdicts are given as in the report."
        ),
        *(_claims(held_out_order(study, robot)) for robot in shown_robots(study)),
        Heading("What stored fitness hides"),
        *_hidden(study),
        Heading("From one robot to the other"),
        *_rungs(study),
    ]
    blocks.append(Heading("Evolved on wheels from the start"))
    if wheels is None:
        blocks.append(Paragraph("Missing: no such study was given."))
    else:
        blocks += _there(wheels)
        for robot in shown_robots(wheels):
            blocks.append(_claims(held_out_order(wheels, robot)))
    if unevolved:
        blocks += [
            Heading("Why equation (2) is not taken as printed"),
            *_unevolved(unevolved, study.steps),
        ]
    blocks += [
        Heading("What differs from the original"),
        *differences_from_paper(study),
    ]
    return to_markdown(blocks)


PLANNED = 100
"""Runs of each of the paper's algorithms that docs/method.md plans."""


def _provisional(study: StudyData) -> list[Block]:
    """Note about a study of the paper with fewer runs than planned."""
    fewest = min(len(study.runs.get(name, ())) for name in PAPERS)
    if fewest >= PLANNED or unlike(study):
        return []
    return [
        Paragraph(
            f"Provisional: there are {fewest} of the {PLANNED} runs of each algorithm "
            "that docs/method.md plans. Verdicts may change until all are there."
        )
    ]


def runs_table(study: StudyData) -> Table:
    """Table of held-out and best stored fitness of every experiment with runs."""
    robots = shown_robots(study)
    columns = ["algorithm", "n", "evaluations"]
    columns += [f"held-out, {robot}" for robot in robots]
    rows = [
        [
            label(study, name),
            str(len(runs)),
            f"{study.configs[name].evaluations:,}",
            *(spread(study.held_out(name, robot)) for robot in robots),
            spread(study.best_stored(name)),
        ]
        for name, runs in study.runs.items()
        if runs
    ]
    if study.yardstick:
        means = [f"{study.yardstick[robot].mean:.1f}" for robot in robots]
        rows.append([f"{YARDSTICK}, written by hand", "", "", *means, ""])
    return Table([*columns, "best stored"], rows)


def medians_table(study: StudyData, robot: str) -> Table:
    """Medians over the runs of every experiment with runs, in few columns."""
    rows = [
        [
            label(study, name),
            str(len(runs)),
            f"{np.median(study.held_out(name, robot)):.0f}",
            f"{np.median(study.best_stored(name)):.0f}",
        ]
        for name, runs in study.with_runs.items()
    ]
    if study.yardstick:
        mean = study.yardstick[robot].mean
        rows.append([f"{YARDSTICK}, written by hand", "", f"{mean:.0f}", ""])
    columns = ["algorithm", "runs", "fitness on new starts", "best training fitness"]
    return Table(columns, rows)


def _there(study: StudyData) -> list[Block]:
    blocks: list[Block] = [
        runs_table(study),
        Paragraph(
            f"{SPREAD}. Held-out: the champion's mean on fresh starts. Best stored: "
            "the highest fitness that a run stored."
        ),
    ]
    if study.missing:
        blocks += [Paragraph("Missing:"), Listing(study.missing)]
    return blocks


def _claims(found: Sequence[Claim]) -> Table:
    rows = [[claim.text, claim.ours, claim.n, claim.verdict] for claim in found]
    return Table(["claim", "here", "n", "verdict"], rows, texts=4)


def _hidden(study: StudyData) -> list[Block]:
    """Blocks about the individuals with the highest stored fitness."""
    robot, rows = best_stored_robot(study), []
    for name, runs in study.runs.items():
        stored, held_out = best_stored_fitness(study, name)
        if stored.size:
            rows.append(
                [
                    label(study, name),
                    str(len(runs)),
                    spread(stored),
                    spread(held_out),
                    f"{held_out.min():.1f}",
                    spread(study.stored(name)),
                    spread(study.held_out(name, robot)),
                ]
            )
    return [
        Paragraph(
            "Of each run: the individual with the highest stored fitness, which the "
            f"paper reports, and its fitness on fresh starts on {robot}; then the same "
            f"of the champion, which was chosen on validation starts. {SPREAD}."
        ),
        Table(
            [
                *("algorithm", "n", "highest stored", "its held-out", "worst run"),
                *("champion's stored", "champion's held-out"),
            ],
            rows,
        ),
    ]


def _rungs(study: StudyData) -> list[Block]:
    """Blocks about how much of their fitness champions keep on the other robot."""
    if study.rungs is None:
        return [Paragraph("Champions were tested on one robot only.")]
    first, last = study.rungs
    shares = {
        name: kept(study.held_out(name, last), study.held_out(name, first))
        for name, runs in study.runs.items()
        if runs
    }
    return [
        Listing(
            [
                f"{label(study, name)}: {median_and_quartiles(100 * share, ' %')} of "
                f"the held-out fitness on {first} is kept on {last}, "
                f"n = {share.size}."
                for name, share in shares.items()
                if share.size
            ]
        )
    ]


def _unevolved(found: Sequence[FirstGeneration], steps: int) -> list[Block]:
    rows = [
        [
            each.fitness,
            str(each.individuals),
            f"{each.best:.1f}",
            f"{each.held_out:.1f}",
            ", ".join(
                f"{name} {share:.0%}"
                for name, share in sorted(each.behaviour.items(), key=lambda i: -i[1])
                if share >= 0.01
            ),
        ]
        for each in found
    ]
    return [
        Paragraph(
            "The best individual of a first generation, drawn at random, by the "
            "equation as printed (literal) and by the paper's prose (product). Fitness "
            f"is at most {steps}. The last column says how the individual behaves. In "
            "the paper, fitness rises during evolution. By the printed equation, the "
            "first generation is almost at the maximum, so fitness could hardly rise."
        ),
        Table(["fitness", "individuals", "best", "on fresh starts", "behaviour"], rows),
    ]
