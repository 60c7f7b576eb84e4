"""The table of what evaluations on wheels are worth."""

from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT
from evolution.pages.blocks import Table
from evolution.pages.words import label, percent, percent_median, spread
from evolution.report.samples import crash_rates, tests_of
from evolution.study.data import StudyData

COLUMNS = (
    "experiment",
    "n",
    "evaluations on wheels",
    "champion chosen on",
    "held-out, epuck",
    "crash, epuck [%]",
    "of the worst run [%]",
    "held-out, epuck_kinematic",
)


def climbing_table(study: StudyData) -> Table:
    """Held-out fitness and crashes by the share of evaluations on wheels."""
    rows = []
    for name, runs in study.with_runs.items():
        config = study.configs[name]
        crashes = crash_rates(tests_of(study, name, WHEELED_ROBOT))
        rows.append(
            (
                label(study, name),
                str(len(runs)),
                f"{1 - config.climb:.0%}",
                WHEELED_ROBOT if config.finalists else KINEMATIC_ROBOT,
                spread(study.held_out(name, WHEELED_ROBOT)),
                percent_median(crashes),
                percent(float(crashes.max())),
                spread(study.held_out(name, KINEMATIC_ROBOT)),
            )
        )
    return Table(COLUMNS, rows)
