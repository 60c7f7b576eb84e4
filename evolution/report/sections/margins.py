"""Margins: what champions keep on robots that differ a little from their own."""

import numpy as np

from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.margins.margins_table import FILE, Margins, read_margins
from evolution.pages.blocks import Block, Heading, Paragraph, Table
from evolution.pages.words import NOTHING, YARDSTICK_LABEL, label, spread
from evolution.study.data import StudyData

SHOWN: tuple[tuple[str, float, str], ...] = (
    ("body_radius", 35, "as evolved"),
    ("body_radius", 35.5, "body 35.5 mm"),
    ("body_radius", 36, "body 36 mm"),
    ("body_radius", 37, "body 37 mm"),
    ("sensors_set_back", 1, "sensors 1 mm back"),
    ("sensors_set_back", 2, "sensors 2 mm back"),
    ("latency", 1, "one step late"),
)
"""Changes and amounts of the table, and how they are called there."""


def margins_section(data: StudyData) -> list[Block]:
    """What champions keep on changed robots; nothing if that was not measured."""
    margins = read_margins(data.path / FILE)
    if margins is None:
        return []
    rows = []
    for name in margins.experiments:
        if name != YARDSTICK and name not in data.with_runs:
            continue
        title = YARDSTICK_LABEL if name == YARDSTICK else label(data, name)
        cells = [_cell(margins, name, change, amount) for change, amount, _ in SHOWN]
        rows.append((title, *cells))
    return [
        Heading("How close to the edge champions drive"),
        Paragraph(
            "Fitness of the champions on the kinematic robot with one number of the "
            "robot changed, then the median share of trials that crash. "
            "Published radii of the body differ by 1 to 4 mm. All sensors are set "
            "back together. Late commands arrive one control step later."
        ),
        Table(
            (
                "experiment",
                *(f"{title} [of {data.steps}]" for _, _, title in SHOWN),
            ),
            rows,
        ),
    ]


def _cell(margins: Margins, name: str, change: str, amount: float) -> str:
    """Fitness on one changed robot, and the median crash rate."""
    for found, fitness, crash_rates in margins.of(name, change):
        if found == amount:
            crashes = f"{np.median(crash_rates):.0%} crash"
            return f"{spread(fitness)}; {crashes}"
    return NOTHING
