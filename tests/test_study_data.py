"""What a study has found, read back: damage is named, and never a traceback."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from epuck_mj.errors import UserError
from epuck_mj.host.csv_text import csv_columns
from evolution.pages.blocks import to_html
from evolution.report.page import report_blocks
from evolution.report.run_table import run_rows
from evolution.report.sections.how_to_get_every_number_again import origins
from evolution.reproduce.reproduction import reproduction
from evolution.run.history import Record, history_text, read_history
from evolution.study.data import load_study
from evolution.study.directory import StudyDirectory
from evolution.study.packing import pack
from evolution.study.tables import Tables
from tests.study_on_disk import write_study


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    seeds = {"de-best": [1, 2], "ga": [1, 2]}
    return write_study(tmp_path_factory.mktemp("whole") / "study", seeds, packed=False)


@pytest.fixture
def path(whole, tmp_path) -> Path:
    """A study that a test may damage."""
    return shutil.copytree(whole, tmp_path / "study")


def edit(file: Path, change: Callable[[dict], object]) -> None:
    fields = json.loads(file.read_text())
    change(fields)
    file.write_text(json.dumps(fields))


DAMAGE: dict[str, Callable[[dict], object]] = {
    "stored null": lambda f: f["scores"].update(stored=None),
    "held_out a list": lambda f: f["scores"].update(held_out=[1]),
    "held_out empty": lambda f: f["scores"].update(held_out={}),
    "test a number": lambda f: f["scores"]["held_out"].update(epuck=3),
    "mean NaN": lambda f: f["scores"]["held_out"]["epuck"].update(mean=float("nan")),
    "behaviour a list": lambda f: f["scores"]["held_out"]["epuck"].update(behaviour=[]),
    "interval of three": lambda f: f["scores"]["held_out"]["epuck"].update(
        interval=[1, 2, 3]
    ),
    "starts a text": lambda f: f["scores"]["held_out"]["epuck"].update(starts="9"),
    "no starts": lambda f: f["scores"]["held_out"]["epuck"].pop("starts"),
    "best_stored empty": lambda f: f["scores"].update(best_stored={}),
    "task empty": lambda f: f.update(task={}),
    "steps a text": lambda f: f["task"].update(steps="300"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_champion_is_missing_and_the_others_are_there(path, damage):
    edit(path / "running" / "ga" / "seed-2" / "champion.json", DAMAGE[damage])
    study = load_study(path)
    assert [run.seed for run in study.runs["ga"]] == [1]
    assert [run.seed for run in study.runs["de-best"]] == [1, 2]
    (line,) = [line for line in study.missing if line.startswith("ga seed 2: ")]
    assert "\n" not in line


@pytest.mark.parametrize(
    "text",
    ["{", '{"held_out": {}}', '{"held_out": {"epuck": {}}}', '{"held_out": 3}', "[]"],
)
def test_a_damaged_yardstick_is_missing_and_the_runs_are_there(path, text):
    (path / "wall-follower.json").write_text(text)
    study = load_study(path)
    assert study.yardstick == {}
    assert any(line.startswith("wall-follower: ") for line in study.missing)
    assert len(study.runs["ga"]) == 2


@pytest.mark.parametrize(
    "change",
    [
        {"git": "text"},
        {"versions": [1]},
        {"processor": 3},
        {"processor": {"flags": 5}},
        {"argv": [1]},
        {"resumed": [{"git": 3}]},
    ],
    ids=str,
)
def test_edited_provenance_is_named(path, change):
    file = path / "running" / "ga" / "seed-1" / "provenance.json"
    edit(file, lambda fields: fields.update(change))
    data = load_study(path)
    assert origins(data)["git"]
    line, _ = data.missing
    assert line.startswith(f"ga seed 1: '{file}' is damaged: {next(iter(change))}")


CONTENTS: dict[str, Callable[[bytes], bytes]] = {
    "emptied": lambda _: b"",
    "cut": lambda content: content[: len(content) // 2],
    "text": lambda _: b"hello\n",
    "bytes": lambda _: bytes(range(256)) * 20,
    "lines": lambda content: content.replace(b"\n", b"\r"),
    "a long line": lambda _: b"1," * 200_000,
    "deep": lambda _: b"[" * 100_000,
    "texts": lambda content: re.sub(rb"(?<=[ ,])([-\d.]+)(?=[,\n])", rb'"\1"', content),
}


@pytest.mark.parametrize("damage", [*CONTENTS, "missing", "a folder"])
@pytest.mark.parametrize(
    "name",
    [
        "config.yaml",
        "provenance.json",
        "champion.json",
        "history.csv",
        "best_individuals.npz",
        "timing.csv",
    ],
)
def test_one_damaged_file_takes_no_report_down(name, damage, path):
    """The run is named and left out, or it can be reported without the file."""
    file = path / "running" / "ga" / "seed-1" / name
    content = file.read_bytes()
    file.unlink()
    if damage == "a folder":
        file.mkdir()
    elif damage != "missing":
        file.write_bytes(CONTENTS[damage](content))
    data = load_study(path)
    assert [run.seed for run in data.runs["de-best"]] == [1, 2]
    assert run_rows(data)
    assert to_html("", report_blocks(data, {}, "out", False))
    assert reproduction(data, None, [], "")
    named = [line for line in data.missing if line.startswith("ga seed 1: ")]
    assert not any("\n" in line for line in named)
    there = 1 in [run.seed for run in data.runs["ga"]]
    # only times and counted steps are of no consequence
    assert len(named) == (not there)
    assert not there or name == "timing.csv" or damage in ("lines", "texts", "cut")


def test_seeds_that_were_asked_for_are_missed(path):
    assert load_study(path).missing == ()
    (path / "seeds.yaml").write_text("de-best: 1-30\nga: 1-3\nde-rand: '4'\n")
    (path / "running" / "ga" / "seed-3").mkdir()
    assert load_study(path).missing == (
        "de-best seeds 3-30: asked for, not there",
        "ga seed 3: not finished",
    )


@pytest.mark.parametrize("row", ["2,0,1.0,1.0,1.0", "2,450,inf,1.0,1.0", "2,450,1.0"])
def test_a_damaged_history_is_named(path, row):
    file = path / "running" / "ga" / "seed-1" / "history.csv"
    file.write_text(file.read_text() + row + "\n")
    with pytest.raises(UserError, match="is damaged"):
        read_history(file)


def test_a_robot_with_a_comma_keeps_its_name(path):
    file = path / "running" / "ga" / "seed-1" / "history.csv"
    record = Record(0, 150, 1.5, 0.1, 0.25, 1, 0.0)
    file.write_text(history_text([record], 'my "own", robot'))
    assert csv_columns(file.read_text())["robot"] == ['my "own", robot']
    assert read_history(file)["mean"] == [0.1]


def test_a_copied_run_does_not_count_twice(path):
    run = path / "running" / "ga" / "seed-1"
    for name in ("seed-01", "seed-²", "seed-"):
        (path / "running" / "ga" / name).mkdir()
        for file in run.iterdir():
            (path / "running" / "ga" / name / file.name).write_bytes(file.read_bytes())
    assert [run.seed for run in load_study(path).runs["ga"]] == [1, 2]


def test_nothing_finished_is_said_in_few_words(tmp_path):
    path = write_study(tmp_path / "study", {"ga": list(range(1, 13))}, packed=False)
    for champion in path.glob("running/*/*/champion.json"):
        champion.unlink()
    with pytest.raises(UserError, match="no finished run") as error:
        load_study(path)
    assert len(str(error.value)) < 1000


def test_a_study_can_be_read_while_its_runs_are_packed(tmp_path, monkeypatch):
    path = write_study(tmp_path / "study", {"ga": [1, 2, 3]}, packed=False)
    read = Tables.sound_runs

    def packed_after(tables: Tables, *arguments):
        monkeypatch.setattr(Tables, "sound_runs", read)
        found = read(tables, *arguments)
        pack(StudyDirectory(path))
        return found

    monkeypatch.setattr(Tables, "sound_runs", packed_after)
    with pytest.raises(UserError, match="no finished run") as caught:
        load_study(path)
    # they are where the tables were not looked for yet: named, and there next time
    assert "ga seed 1" in str(caught.value)
    assert len(load_study(path).runs["ga"]) == 3
