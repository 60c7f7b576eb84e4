"""`evolution.verify` on tables: rows are scored again, and what differs is named."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pytest

from evolution.run.directory import RunDirectory
from evolution.run.execution import Run
from evolution.run.means import Means
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config
from evolution.study.columns import Row, rows_of, table_of
from evolution.study.config import StudyConfig
from evolution.study.directory import StudyDirectory
from evolution.study.packing import pack
from evolution.study.table_files import read_table, write_table
from evolution.verify.__main__ import verify

EXPERIMENTS = {"de-best": {"climb": 0.5}, "ga": {}}


@pytest.fixture(scope="module")
def packed(tmp_path_factory) -> Path:
    """A study of two tiny runs in tables, of which the first has climbed."""
    path = tmp_path_factory.mktemp("verify") / "study"
    configs = {}
    for name, keys in EXPERIMENTS.items():
        fields = load_config(find_config(name)).model_dump() | keys
        fields |= {"evaluations": 50, "steps": 20, "trials": 2}
        fields |= {"validation_starts": 4, "test_starts": 4}
        fields["optimizer"]["population"] = 10
        configs[name] = ExperimentConfig.parsed(fields, name)
    study = StudyDirectory(path)
    study.open(StudyConfig(configs), [1])
    for name, config in configs.items():
        directory = RunDirectory(study.run(name, 1).path, drawn=False)
        run = Run(config, directory, Means(threads=1), ())
        run.start()
        assert list(run.evolve())
        run.finish()
        assert run.evolution.climbed == (name == "de-best")
    assert pack(study).packed == 2
    return path


def edited(
    packed: Path, place: Path, change: Callable[[Row], object], row: int = 0
) -> Path:
    """A copy of the study of which a row was edited, the first one."""
    shutil.copytree(packed, place / "copy")
    tables = StudyDirectory(place / "copy").tables
    rows = rows_of(read_table(tables.champions))
    change(rows[row])
    write_table(tables.champions, table_of(rows))
    return place / "copy"


def test_what_nobody_edited_is_the_same(packed, capsys):
    assert verify([str(packed)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{packed}/de-best/seed-1: the same to the last bit",
        f"{packed}/ga/seed-1: the same to the last bit",
        "2 of 2 runs are the same to the last bit",
    ]
    assert verify([str(packed / "ga" / "seed-1")]) == 0
    assert "1 of 1 runs are the same" in capsys.readouterr().out


def adding(*place: str) -> Callable[[Row], object]:
    def change(row: Row) -> None:
        row[place] += 1e-9

    return change


def gene(*place: str) -> Callable[[Row], object]:
    def change(row: Row) -> None:
        row[place] = [row[place][0] + 0.1, *row[place][1:]]

    return change


EDITS = {
    "stored": (adding("stored"), "champions.parquet, scores: stored"),
    "validation": (adding("validation"), "champions.parquet, scores: validation"),
    "a test": (
        adding("held_out", "epuck", "mean"),
        "champions.parquet, scores.held_out.epuck: mean",
    ),
    "a bound": (
        adding("held_out", "epuck_kinematic", "interval", "high"),
        "champions.parquet, scores.held_out.epuck_kinematic: interval.1",
    ),
    "genome": (gene("genome"), "champions.parquet, scores"),
    "best stored": (
        adding("best_stored", "fitness"),
        "champions.parquet, fitness: 0",
    ),
}


@pytest.mark.parametrize("what", EDITS)
def test_an_edited_row_is_named(what, packed, tmp_path, capsys):
    change, words = EDITS[what]
    study = edited(packed, tmp_path, change)
    assert verify([str(study)]) == 1
    first, *lines, total = capsys.readouterr().out.splitlines()
    assert first == f"{study}/de-best/seed-1: not the same"
    assert any(words in line for line in lines), lines
    assert lines[-1] == f"{study}/ga/seed-1: the same to the last bit"
    assert total == "1 of 2 runs are the same to the last bit"


def test_the_individual_that_is_best_stored_is_tested_again(packed, tmp_path, capsys):
    def change(row: Row) -> None:
        assert row["genome",] != row["best_stored", "genome"]
        row["best_stored", "genome"] = row["genome",]

    study = edited(packed, tmp_path, change, 1)
    assert verify([str(study / "ga" / "seed-1")]) == 1
    assert "scores.best_stored: held_out" in capsys.readouterr().out


@pytest.mark.parametrize("column", ["best", "mean", "std", "robot"])
def test_an_edited_history_is_named(column, packed, tmp_path, capsys):
    study = edited(packed, tmp_path, lambda row: None)
    path = StudyDirectory(study).tables.history
    table = read_table(path)
    values = table[column].to_pylist()
    # the second generation of the last run
    at = table["experiment"].to_pylist().index("ga") + 1
    values[at] = "epuck" if column == "robot" else values[at] + 1e-9
    i, kind = table.column_names.index(column), table.schema.field(column).type
    write_table(path, table.set_column(i, column, pa.array(values, kind)))
    assert verify([str(study / "ga" / "seed-1")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{study}/ga/seed-1: not the same"
    assert any(f"history.parquet, {column}: 1 " in line for line in lines), lines


def test_what_the_tables_do_not_say_is_named(packed, tmp_path, capsys):
    study = edited(packed, tmp_path, lambda row: row.pop(("best_stored", "genome")))
    assert verify([str(study)]) == 0
    assert capsys.readouterr().out.splitlines()[0] == (
        f"{study}/de-best/seed-1: the same to the last bit; champions.parquet does not "
        "say best_stored_genome"
    )
