"""The page of a report: its sections in order, and the figures that belong there."""

from collections.abc import Callable, Mapping

from evolution.pages.blocks import Block, Heading, Picture, with_contents
from evolution.report.sections.behaviour import behaviour_section
from evolution.report.sections.comparisons import comparisons_section
from evolution.report.sections.cost_of_targets import cost_of_targets_section
from evolution.report.sections.from_rung_to_rung import from_rung_to_rung_section
from evolution.report.sections.held_out_fitness import held_out_fitness_section
from evolution.report.sections.how_to_get_every_number_again import (
    how_to_get_every_number_again_section,
)
from evolution.report.sections.margins import margins_section
from evolution.report.sections.success import success_section
from evolution.report.sections.what_stored_fitness_promised import (
    what_stored_fitness_promised_section,
)
from evolution.report.sections.what_was_run import what_was_run_section
from evolution.study.data import StudyData

SECTIONS: tuple[tuple[Callable[[StudyData], list[Block]], tuple[str, ...]], ...] = (
    (what_was_run_section, ()),
    (held_out_fitness_section, ("held-out",)),
    (comparisons_section, ()),
    (success_section, ()),
    (from_rung_to_rung_section, ("rungs",)),
    (what_stored_fitness_promised_section, ("stored-and-held-out",)),
    (behaviour_section, ("behaviour", "trajectories")),
    (margins_section, ("margins",)),
    (cost_of_targets_section, ("targets",)),
)
"""The sections in order, and the figures that belong there."""


def report_blocks(
    data: StudyData, pictures: Mapping[str, Picture], output: str, ioh: bool
) -> list[Block]:
    """The whole report, held-out fitness before stored."""
    left = dict(pictures)
    blocks: list[Block] = []
    for section, names in SECTIONS:
        blocks += section(data)
        blocks += [left.pop(name) for name in names if name in left]
    if left:
        blocks += [Heading("Fitness against evaluations"), *left.values()]
    last = how_to_get_every_number_again_section(data, output, ioh)
    return with_contents([*blocks, *last])
