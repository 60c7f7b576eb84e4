"""Differences between the paper and the shipped experiments."""

from evolution.pages.blocks import Block, Listing, Paragraph, Table
from evolution.report.sections.what_was_run import evolved_on
from evolution.reproduce.claims import papers_experiments, unlike
from evolution.study.data import StudyData

DIFFERENCES = (
    (
        "simulator",
        "Player/Stage, 2D",
        "{evolved_on}; champions are tested on wheels in MuJoCo, 3D",
    ),
    ("drive", "not said", "wheels follow a command with a time constant of 17 ms"),
    ("steps of a trial", "not legible", "{base.steps} of {base.control_step} s"),
    ("arena", "square, as in their laboratory", "1.0 m square"),
    (
        "speeds",
        "not said",
        "{base.v_max:.4g} m/s and {base.w_max:.4g} rad/s, the hardware's limits",
    ),
    (
        "sensors",
        "0 near to 1 free, 4 cm",
        "the same, linear along eight rays at the angles Player has, without noise",
    ),
    (
        "crash",
        "not said what counts",
        "any touch of the shell on a wall, however short",
    ),
    (
        "fitness",
        "equation (2), which as printed rewards circles in the open",
        "its prose: fast, straight and near a wall, multiplied",
    ),
    ("weights", "range not said", "within +-{base.weight_bound}, no biases"),
    ("first weights", "random", "uniform within +-{base.weight_init}"),
    (
        "DE outside the bounds",
        "not said",
        "{best.bounds_rule} between parent and bound",
    ),
    ("DE's r1, r2, r3", "random", "different from each other and from the parent"),
    (
        "GA",
        "binary; tournament size not legible, operators not said",
        "{ga.bits} bits a weight, tournament of {ga.tournament}, one-point crossover, "
        "{ga.elites} elites",
    ),
    (
        "budget",
        '"until an optimal level is reached"; 30,000 evaluations, though the 250 '
        "generations of DE/best are 37,500",
        "{base.evaluations:,} evaluations for every algorithm; 37,500 for DE/best, too",
    ),
    (
        "starts",
        "random",
        "fresh for every generation, the same for all its individuals",
    ),
    ("replicates", '"at least three"', "n as stated beside each number"),
    (
        "the best",
        "highest stored fitness",
        "chosen on 200 starts, the best ten on 1,000; reported on 1,000 others",
    ),
    ("robot", "a physical e-puck", "none"),
)
"""Each difference: its name, the paper, and the shipped experiments."""


def differences_from_paper(study: StudyData) -> list[Block]:
    """Table of the differences, and differences of a study from the shipped one."""
    shipped = papers_experiments()
    best, ga = shipped["de-best"], shipped["ga"]
    values = {"base": best, "best": best.optimizer, "ga": ga.optimizer}
    values["evolved_on"] = evolved_on(study)
    rows = [[what, paper, here.format(**values)] for what, paper, here in DIFFERENCES]
    blocks: list[Block] = [Table(["", "paper", "shipped experiments"], rows, texts=3)]
    if further := unlike(study):
        blocks += [
            Paragraph("The experiments of this study differ from the shipped ones in"),
            Listing(further),
        ]
    return blocks
