"""The figure of margins: champions on robots that differ in one number."""

from matplotlib.figure import Figure

from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.margins.margins_figure import margins_figure
from evolution.margins.margins_table import FILE, read_margins
from evolution.pages.words import YARDSTICK_LABEL, label
from evolution.study.data import StudyData


def margins_of_study_figure(data: StudyData) -> tuple[Figure, str] | None:
    """Fitness and crash rate against each change; None if that was not measured."""
    margins = read_margins(data.path / FILE)
    if margins is None:
        return None
    names = {name: label(data, name) for name in data.configs}
    names[YARDSTICK] = YARDSTICK_LABEL
    caption = (
        "Champions on the kinematic robot when one number of the robot is changed: "
        "medians over runs, with the quartiles of fitness shaded. Dotted: the robot "
        "on which they evolved."
    )
    return margins_figure(margins, names, data.steps), caption
