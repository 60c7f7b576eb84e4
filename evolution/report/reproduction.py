"""REPRODUCTION.md: the paper's claims, what stored fitness hides, what differs."""

from collections.abc import Sequence

from evolution.report.blocks import (
    Block,
    Code,
    Heading,
    Listing,
    Paragraph,
    Table,
    to_markdown,
)
from evolution.report.claims import Claim, claims, held_out_order, verdicts
from evolution.report.first_generation import FirstGeneration
from evolution.report.samples import kept, most_believed
from evolution.report.tables import labels_of, shown_robots
from evolution.report.words import spread
from evolution.study_data import YARDSTICK, StudyData

DIFFERENCES = (
    ("simulator", "Player/Stage, 2D", "MuJoCo, 3D; planar robot, tested on wheels"),
    ("steps of a trial", "not legible", "{steps} of {control_step} s"),
    ("arena", "square, as in their laboratory", "1.0 m square"),
    (
        "speeds",
        "not said",
        "{v_max:.4g} m/s and {w_max:.4g} rad/s, the hardware's limits",
    ),
    ("sensors", "0 near to 1 free, 4 cm", "the same, linear, without noise"),
    (
        "fitness",
        "equation (2), which as printed rewards circles in the open",
        "its prose: fast, straight and near a wall, multiplied",
    ),
    ("weights", "range not said", "within +-{weight_bound}, no biases"),
    ("DE outside the bounds", "not said", "midpoint between parent and bound"),
    ("GA coding", "binary; tournament size not legible", "8 bits, tournament of 5"),
    (
        "budget",
        "30,000 evaluations, though 250 generations of 150 are 37,500",
        "{evaluations:,} evaluations for every algorithm",
    ),
    (
        "starts",
        "random",
        "fresh for every generation, the same for all its individuals",
    ),
    ("replicates", '"at least three"', "n as stated beside each number"),
    ("the best", "highest stored fitness", "chosen on 200 starts, reported on 1,000"),
    ("robot", "a physical e-puck", "none"),
)
"""What, in the paper, here."""


def reproduction(
    study: StudyData,
    wheels: StudyData | None,
    unevolved: Sequence[FirstGeneration],
    made_by: str,
) -> str:
    """The text of REPRODUCTION.md.

    Args:
        study: evolved on the plane.
        wheels: evolved on wheels from the start, if there is one.
        unevolved: the first generation by each reading of the fitness equation.
        made_by: the command that wrote it.
    """
    found = claims(study)
    counts = ", ".join(f"{n} {verdict}" for verdict, n in verdicts(found).items())
    blocks: list[Block] = [
        Heading("Reproduction", 1),
        Paragraph(
            "A replication with another simulator and our own code of a study that is "
            "probably Cruz-Alvarez, Montes-Gonzalez, Mezura-Montes and Santos (MICAI "
            "2012). Made by"
        ),
        Code([made_by]),
        Paragraph(
            "Brackets behind medians hold quartiles, all others 95 % confidence "
            "bounds; n counts runs. An order is decided by a Mann-Whitney p below "
            "0.05, a statement about runs by Wilson bounds on one side of one half, a "
            "maximum outside the range of our runs only where one more of them would "
            "be there with a chance of at most 0.1. Claims are not adjusted for their "
            "number."
        ),
        Heading("What there is"),
        *_there(study),
        Heading("The paper's claims"),
        Paragraph(
            f"Of {len(found)}: {counts}. They are about stored fitness, as the paper "
            "measured it."
        ),
        _claims(found),
        Heading("The same order by fresh starts"),
        Paragraph(
            "What the paper could not see: champions on 1,000 starts that evolution "
            "never met."
        ),
        *(_claims(held_out_order(study, robot)) for robot in shown_robots(study)),
        Heading("What stored fitness hides"),
        *_hidden(study),
        Heading("From the plane to wheels"),
        *_rungs(study),
    ]
    if wheels is not None:
        blocks += [
            Heading("Evolved on wheels from the start"),
            *_there(wheels),
            *(_claims(held_out_order(wheels, robot)) for robot in shown_robots(wheels)),
        ]
    if unevolved:
        blocks += [
            Heading("Why equation (2) is not taken as printed"),
            *_unevolved(unevolved, study.steps),
        ]
    blocks += [
        Heading("What differs from the original"),
        _differences(study),
    ]
    return to_markdown(blocks)


def runs_table(study: StudyData) -> Table:
    """Held-out fitness first, then stored, of every experiment with runs."""
    labels, robots = labels_of(study), shown_robots(study)
    columns = ["algorithm", "n", "evaluations"]
    columns += [f"held-out, {robot}" for robot in robots]
    rows = [
        [
            labels[name],
            str(len(runs)),
            f"{study.configs[name].evaluations:,}",
            *(spread(study.held_out(name, robot)) for robot in robots),
            spread(study.stored(name)),
        ]
        for name, runs in study.runs.items()
        if runs
    ]
    if study.yardstick:
        means = [f"{study.yardstick[robot]['mean']:.1f}" for robot in robots]
        rows.append([f"{YARDSTICK}, written by hand", "", "", *means, ""])
    return Table([*columns, "stored"], rows)


def _there(study: StudyData) -> list[Block]:
    missing = [Paragraph("Missing:"), Listing(study.missing)] if study.missing else []
    return [runs_table(study), *missing]


def _claims(found: Sequence[Claim]) -> Table:
    rows = [[claim.text, claim.ours, claim.n, claim.verdict] for claim in found]
    return Table(["claim", "here", "n", "verdict"], rows, texts=4)


def _hidden(study: StudyData) -> list[Block]:
    """What whoever trusts stored fitness would have taken home."""
    robot, labels, rows = study.robots[0], labels_of(study), []
    for name, runs in study.runs.items():
        stored, held_out = most_believed(study, name)
        if stored.size:
            rows.append(
                [
                    labels[name],
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
            "The individual with the highest stored fitness of each run, which is what "
            f"the paper reports, and what 1,000 fresh starts on {robot} say of it; "
            "then the champion, chosen on validation starts."
        ),
        Table(
            [
                "algorithm",
                "n",
                "highest stored",
                "its held-out",
                "worst run",
                "champion's stored",
                "champion's held-out",
            ],
            rows,
        ),
    ]


def _rungs(study: StudyData) -> list[Block]:
    """How much of the planar fitness champions keep on wheels."""
    if len(study.robots) < 2:
        return [Paragraph("Both rungs are the same robot here.")]
    first, last = study.robots[0], study.robots[-1]
    labels = labels_of(study)
    shares = {
        name: kept(study.held_out(name, last), study.held_out(name, first))
        for name, runs in study.runs.items()
        if runs
    }
    return [
        Listing(
            [
                f"{labels[name]}: {spread(share, 100)} % of the held-out fitness on "
                f"{first} is kept on {last}, n = {len(study.runs[name])}."
                for name, share in shares.items()
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
            "The best of a first generation, drawn at random, by the fitness as "
            f"printed (literal) and by the prose (product), of {steps}, and what it "
            "does. The paper's curves rise; by the printed equation there is next to "
            "nothing left to evolve."
        ),
        Table(
            ["fitness", "individuals", "best", "on fresh starts", "behaviour"],
            rows,
        ),
    ]


def _differences(study: StudyData) -> Table:
    config = next(iter(study.configs.values())).model_dump()
    rows = [[what, paper, here.format(**config)] for what, paper, here in DIFFERENCES]
    return Table(["", "paper", "here"], rows, texts=3)
