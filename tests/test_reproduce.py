"""`evolution.reproduce`: study, report and claims by one command, and again."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from epuck_mj.errors import UserError
from evolution.reproduce import __main__ as module
from evolution.reproduce.__main__ import reproduce_paper
from evolution.reproduce.verdicts import OTHER_STUDY
from evolution.run.means import Means
from evolution.study.columns import table_of
from evolution.study.directory import StudyDirectory
from evolution.study.jobs import Event, Job, carry_out
from evolution.study.table_files import write_table
from tests.no_pictures import draw_nothing

TINY = """
experiments: [ga.yaml, de-best.yaml]
common:
  {evaluations: 20, steps: 20, trials: 2, validation_starts: 10, test_starts: 30}
"""
EXPERIMENT, SEED = ("experiment",), ("seed",)

EXPERIMENTS = {
    "ga": "optimizer: {algorithm: genetic_algorithm, population: 10}",
    "de-best": "optimizer: {algorithm: differential_evolution, population: 10, "
    "strategy: best, scale: 0.8, crossover: 1.0}",
}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A working directory with a study of a second as the quick one."""
    monkeypatch.chdir(tmp_path)
    Path("tiny").write_text(TINY)
    for name, text in EXPERIMENTS.items():
        Path(f"{name}.yaml").write_text(text)
    monkeypatch.setattr(module, "QUICK", ("tiny", "1-2"))
    return tmp_path


def carry_out_here(patch: pytest.MonkeyPatch) -> None:
    """Have studies do their runs in this process, without pictures."""

    def here(jobs: Sequence[Job], means: Means, n_processes: int) -> Iterator[Event]:
        for job in jobs:
            carry_out(job, means, lambda evaluations: None)
            yield Event(job, ended=True)

    draw_nothing(patch)
    patch.setattr("evolution.study.__main__.carry_out_side_by_side", here)


@pytest.mark.slow
def test_one_command_runs_reports_and_judges_and_goes_on(here, monkeypatch, capfd):
    # what figures show is for their own tests
    monkeypatch.setattr("evolution.report.figures.drawn_figures", lambda data: iter(()))
    with monkeypatch.context() as patch:
        carry_out_here(patch)
        assert reproduce_paper(["--quick", "--output", "out"]) == 0
    first = (here / "out" / "REPRODUCTION.md").read_text()
    assert "python -m evolution.reproduce --quick --output out" in first
    # it is another study than the paper's, and says so
    assert first.count(OTHER_STUDY) > 16
    assert "evaluations 20 (shipped 30000)" in first
    assert "Missing: no such study was given." in first
    for name in ("report.md", "report.html", "summary.json", "pairwise.csv"):
        assert (here / "out" / "report-tiny" / name).is_file()
    tables = StudyDirectory(here / "out" / "tiny").tables
    assert len(tables.packed()) == 4
    # again: what is done is not done once more
    before = [path.stat().st_mtime_ns for path in (tables.champions, tables.history)]
    assert reproduce_paper(["--quick", "--output", "out"]) == 0
    assert before == [
        path.stat().st_mtime_ns for path in (tables.champions, tables.history)
    ]
    assert (here / "out" / "REPRODUCTION.md").read_text() == first
    # in processes, as ever: a run that cannot be done, somebody's own files are there,
    # stops nothing else
    thesis = here / "out" / "tiny" / "running" / "ga" / "seed-2" / "thesis.tex"
    kept = [row for row in tables.rows() if (row[EXPERIMENT], row[SEED]) != ("ga", 2)]
    write_table(tables.champions, table_of(kept))
    thesis.parent.mkdir(parents=True)
    thesis.write_text("years of work")
    assert reproduce_paper(["--quick", "--output", "out"]) == 1
    assert "ga seed 2 failed" in capfd.readouterr().err
    text = (here / "out" / "REPRODUCTION.md").read_text()
    assert "- ga seed 2: not finished" in text
    assert thesis.read_text() == "years of work"


ONE_OF = "expected one of --quick .*, --full .* and --study "


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--quick", "--full"], ONE_OF),
        (
            ["--full", "--study", "x"],
            ONE_OF,
        ),
        ([], ONE_OF),
        (["--wheels", "x"], "expected --study with --wheels"),
        (["--study", "nowhere"], "'nowhere' is not a study"),
        (["--study", "a/x", "--wheels", "b/x"], "expected studies in folders of diff"),
    ],
)
def test_bad_input(here, arguments, message):
    with pytest.raises(UserError, match=message) as caught:
        reproduce_paper(arguments)
    assert "\n" not in str(caught.value)
