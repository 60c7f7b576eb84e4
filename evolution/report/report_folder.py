"""The folder of a report: its page, tables, figures and summary."""

from dataclasses import replace
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.csv_text import csv_text
from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.pages.blocks import FIGURES_FOLDER, Picture
from evolution.pages.figure_files import write_page
from evolution.report.ioh import export_histories
from evolution.report.page import report_blocks
from evolution.report.run_table import described_columns, run_rows
from evolution.report.sections.comparisons import PAIR_COLUMNS, pair_rows
from evolution.report.sections.cost_of_targets import TARGET_COLUMNS, target_rows
from evolution.report.sections.success import SUCCESS_COLUMNS, success_rows
from evolution.report.summary_json import summary_fields, summary_text
from evolution.study.data import StudyData, load_study


def write_report(study: Path, output: Path, ioh: bool = False) -> tuple[str, ...]:
    """Write the whole report of a study; what is missing in it, a line each.

    Args:
        study: study directory.
        output: directory to write to.
        ioh: also export the histories for IOHanalyzer, to `ioh` in the output.

    Raises:
        UserError: if the study cannot be read, or a file not be written.
    """
    data = load_study(study)
    with files.writing():
        (output / FIGURES_FOLDER).mkdir(parents=True, exist_ok=True)
        pictures, lacking = draw_figures(data, output)
        if not data.yardstick:
            where = "not tested in the setting of the runs"
            lacking.append(f"{YARDSTICK}: {where}, so nothing can be compared with it")
        data = replace(data, missing=(*data.missing, *lacking))
        for name, text in tables(data).items():
            files.write_text(output / name, text)
        found = summary_fields(data, output.as_posix(), ioh)
        files.write_text(output / "summary.json", summary_text(found))
        blocks = report_blocks(data, pictures, output.as_posix(), ioh)
        write_page(output, "report", f"Report of {data.path.as_posix()}", blocks)
        if ioh:
            export_histories(data, output / "ioh")
    return data.missing


def tables(data: StudyData) -> dict[str, str]:
    """Texts of the CSV files by name."""
    runs, described = run_rows(data), described_columns(data)
    return {
        "runs.csv": csv_text(list(runs[0]), runs),
        "runs-columns.csv": csv_text(list(described[0]), described),
        "pairwise.csv": csv_text(["measure", *PAIR_COLUMNS], pair_rows(data)),
        "success.csv": csv_text(SUCCESS_COLUMNS, success_rows(data)),
        "targets.csv": csv_text(list(TARGET_COLUMNS), target_rows(data)),
    }


def draw_figures(data: StudyData, output: Path) -> tuple[dict[str, Picture], list[str]]:
    """Write the figures; each by name, and why others could not be drawn.

    Raises:
        UserError: if one cannot be written.
    """
    from evolution.pages.figure_files import write_figure
    from evolution.report.figures import drawn_figures

    folder = output / FIGURES_FOLDER
    found: dict[str, Picture] = {}
    drawn = drawn_figures(data)
    while True:
        try:
            name, figure, caption = next(drawn)
        except StopIteration:
            return found, []
        except UserError as error:
            # the arena may be on another machine; everything else can be shown
            return found, [f"not all figures could be drawn: {error}"]
        write_figure(figure, folder, name)
        found[name] = Picture(name, caption, (folder / f"{name}.svg").read_bytes())
