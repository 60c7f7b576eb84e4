"""The tables of a study: written whole, read back exactly, and found by address."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import evolution
from epuck_mj.errors import UserError
from epuck_mj.policies.file import load_controller
from evolution.export import export
from evolution.named_policies import named_policies
from evolution.run.directory import RunDirectory
from evolution.settings.config_files import load_config
from evolution.study import packing, table_files, tables
from evolution.study.addresses import champion_at, run_at, runs_at
from evolution.study.columns import rows_of, table_of
from evolution.study.data import load_study
from evolution.study.directory import StudyDirectory
from evolution.study.histories import history_table, merged
from evolution.study.pack import pack_studies
from evolution.study.packing import pack
from evolution.study.table_files import read_table, write_table
from evolution.study.thinning import thinned
from tests.study_on_disk import write_study

SEEDS = {"de-best": [1, 2, 10], "ga": [1, 2]}
TABLES = ("champions.parquet", "history.parquet")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Two equal studies, of which one is packed."""
    folder = tmp_path_factory.mktemp("studies")
    write_study(folder / "study", SEEDS, packed=False)
    write_study(folder / "packed", SEEDS)
    return folder


@pytest.fixture
def unpacked(made, tmp_path) -> StudyDirectory:
    """A study that was killed before it packed its finished runs."""
    return StudyDirectory(shutil.copytree(made / "study", tmp_path / "study"))


@pytest.fixture
def study(made, tmp_path) -> StudyDirectory:
    return StudyDirectory(shutil.copytree(made / "packed", tmp_path / "packed"))


def contents(study: StudyDirectory) -> dict[str, bytes]:
    """Everything in a study's directory that is no lock."""
    paths = [path for path in study.path.rglob("*") if path.name != ".lock"]
    return {
        path.relative_to(study.path).as_posix(): path.read_bytes()
        for path in paths
        if path.is_file()
    }


# packing


def test_packed_runs_are_what_their_directories_said(unpacked):
    before = load_study(unpacked.path)
    champions = {
        (name, seed): run.champion.read_text()
        for name in SEEDS
        for seed, run in unpacked.runs(name)
    }
    done = pack(unpacked)
    assert (done.packed, done.moved, done.left, done.notes) == (5, 0, (), ())
    after = load_study(unpacked.path)
    assert after.missing == before.missing
    for name, runs in before.runs.items():
        for one, other in zip(runs, after.runs[name], strict=True):
            assert one.seed == other.seed
            assert one.scores == other.scores
            assert one.champion.genome.tobytes() == other.champion.genome.tobytes()
            assert set(one.history) == set(other.history)
            for column in one.history:
                assert np.array_equal(
                    one.history[column],
                    other.history[column],
                    equal_nan=column in ("control_steps", "crash_rate"),
                )
            assert one.provenance["git"] == other.provenance["git"]
            assert one.control_steps == other.control_steps == 1900
            assert other.path == unpacked.path / name / f"seed-{one.seed}"
            # byte for byte, but for what made-up champions do not say
            written = json.loads(champions[name, one.seed])
            found = json.loads(other.champion.to_json())
            assert found["scores"] == written["scores"]
            assert found["genome"] == written["genome"]
    assert set(contents(unpacked)) == {
        *TABLES,
        *("study.yaml", "wall-follower.json", "provenance.json", "timing.csv"),
    }


def test_rows_stand_in_the_order_of_the_study(study):
    table = pq.read_table(study.tables.champions)
    runs = list(
        zip(*(table[n].to_pylist() for n in ("experiment", "seed")), strict=True)
    )
    assert runs == [(name, seed) for name in SEEDS for seed in SEEDS[name]]
    history = pq.read_table(study.tables.history).to_pandas()
    assert (
        list(dict.fromkeys(zip(history.experiment, history.seed, strict=True))) == runs
    )
    for _, each in history.groupby(["experiment", "seed"]):
        assert list(each.generation) == list(range(len(each)))


def test_the_order_of_packing_leaves_no_trace(unpacked, study):
    """One run after the other, the last one first."""
    aside = unpacked.path.parent / "aside"
    (unpacked.path / "running").rename(aside)
    for name in reversed(SEEDS):
        for seed in reversed(SEEDS[name]):
            target = unpacked.run(name, seed).path
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(aside / name / f"seed-{seed}", target)
            assert pack(unpacked).packed == 1
    shutil.rmtree(unpacked.path / "running", ignore_errors=True)
    assert contents(unpacked) == contents(study)


@pytest.mark.parametrize("moment", ["provenance", "seconds", "history", "champions"])
def test_a_kill_while_packing_loses_nothing(moment, unpacked, study, monkeypatch):
    class Killed(BaseException):
        pass

    def die(*_):
        raise Killed

    with monkeypatch.context() as patch:
        if moment in ("history", "champions"):
            write = table_files.write_table

            def write_or_die(path, table):
                if path.name.startswith(moment):
                    die()
                write(path, table)

            patch.setattr(tables, "write_table", write_or_die)
        else:
            name = {"provenance": "write_provenances", "seconds": "_write_seconds"}
            patch.setattr(tables, name[moment], die)
        with pytest.raises(Killed):
            pack(unpacked)
    assert len(load_study(unpacked.path).runs["ga"]) == 2
    # another run less was in the tables that were not completed
    shutil.rmtree(unpacked.run("ga", 1).path)
    assert pack(unpacked).packed == 4
    assert {seed for name, seed in unpacked.tables.packed() if name == "ga"} == {2}
    assert set(unpacked.tables.histories()) == unpacked.tables.packed()
    full = StudyDirectory(
        write_study(unpacked.path.parent / "again", SEEDS, packed=False)
    )
    shutil.copytree(full.run("ga", 1).path, unpacked.run("ga", 1).path)
    assert pack(unpacked).packed == 1
    for name in TABLES:
        assert contents(unpacked)[name] == contents(study)[name]


def test_a_directory_of_a_packed_run_is_only_removed(unpacked, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(packing, "_remove", lambda directory: None)
        assert pack(unpacked).packed == 5
    before = {name: contents(unpacked)[name] for name in TABLES}
    # half removed, and another one changed
    (unpacked.run("ga", 1).path / "champion.json").unlink()
    (unpacked.run("ga", 2).path / "history.csv").write_text("")
    assert pack(unpacked).packed == 0
    assert {name: contents(unpacked)[name] for name in TABLES} == before
    assert not [*(unpacked.path / "running").rglob("seed-*")]


def test_a_directory_in_which_somebody_works_stays(unpacked):
    run = unpacked.run("ga", 1)
    with run.locked():
        assert pack(unpacked).packed == 5
        assert run.finished
    assert pack(unpacked).packed == 0
    assert not run.path.exists()


def test_an_older_study_is_packed(unpacked, study, capsys):
    """Folders of runs beside study.yaml; a run that is not finished goes on later."""
    for folder in (unpacked.path / "running").iterdir():
        folder.rename(unpacked.path / folder.name)
    (unpacked.path / "running").rmdir()
    begun = unpacked.path / "ga" / "seed-3"
    begun.mkdir()
    config = unpacked.stored_config().with_seed("ga", 3)
    (begun / "config.yaml").write_text(config.to_yaml())
    (unpacked.path / "ga" / "notes.txt").write_text("of a person")
    assert {run.seed for run in load_study(unpacked.path).runs["ga"]} == {1, 2}
    assert pack_studies([str(unpacked.path)]) == 0
    said = "5 runs packed, 1 unfinished runs moved, 5 runs in the tables"
    assert capsys.readouterr() == (f"{unpacked.path}: {said}\n", "")
    for name in TABLES:
        assert contents(unpacked)[name] == contents(study)[name]
    assert load_config(unpacked.run("ga", 3).config) == config
    assert (unpacked.path / "ga" / "notes.txt").exists()
    assert not (unpacked.path / "de-best").exists()


def test_what_cannot_be_packed_is_named_and_stays(unpacked, capsys):
    run, other = unpacked.run("ga", 1), unpacked.run("ga", 2)
    run.config.write_text(run.config.read_text().replace("trials: 5", "trials: 6"))
    best = dict(np.load(other.best_individuals))
    np.savez(other.best_individuals, **{k: v[:3] for k, v in best.items()})
    assert pack_studies([str(unpacked.path)]) == 1
    note, left = capsys.readouterr().err.splitlines()
    assert "has 3 of 30 generations" in note
    assert "ga seed 1: of another config: trials (stored 6, got 5)" in left
    assert run.finished
    packed = unpacked.tables.runs(unpacked.stored_config())
    assert ("ga", 1) not in packed
    assert packed["ga", 2].best_stored is None
    assert packed["ga", 2].scores.best_stored is not None


# files


def test_a_thousand_runs_of_three_hundred_generations_are_small(tmp_path):
    rng, n = np.random.default_rng(1), 300
    histories = {
        ("de-best", seed): {
            "generation": np.arange(n),
            "evaluations": 100 * np.arange(1, n + 1),
            "best": rng.uniform(0, 300, n),
            "mean": rng.uniform(0, 300, n),
            "std": rng.uniform(0, 300, n),
            "robot": np.array(["epuck_kinematic"] * n),
            "control_steps": rng.integers(0, 200_000, n),
            "crash_rate": rng.integers(0, 301, n) / 300,
        }
        for seed in range(1000)
    }
    table = merged([history_table(histories)], list(histories), ["de-best"])
    table = thinned(table)
    write_table(tmp_path / "history.parquet", table)
    # random numbers are the worst that can be
    assert (tmp_path / "history.parquet").stat().st_size < 3.5e6
    assert read_table(tmp_path / "history.parquet").equals(table)


def test_names_of_columns_differ_whatever_robots_are_called(study):
    rows = rows_of(pq.read_table(study.tables.champions))
    odd = ["my robot.xml", "elsewhere/my_robot.xml", "§.xml", "epuck"]
    for row in rows:
        tests = {p: row.pop(p) for p in [*row] if p[0] == "held_out"}
        row["tested_on",] = odd
        for robot in odd:
            for place, value in tests.items():
                if place[1] == "epuck":
                    row["held_out", robot, *place[2:]] = value
    table = table_of(rows)
    assert len(set(table.column_names)) == len(table.column_names)
    assert {"my_robot_mean", "my_robot_1_mean", "robot_mean", "epuck_mean"} <= set(
        table.column_names
    )
    assert rows_of(table) == rows


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def without_column(path: Path) -> None:
    pq.write_table(pq.read_table(path).drop_columns(["seed"]), path)


def by_hand(path: Path) -> None:
    pq.write_table(pa.table({"experiment": ["ga"], "seed": [1]}), path)


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize(
    "damage",
    [lambda path: path.write_bytes(b""), cut, without_column, by_hand],
    ids=["empty", "cut", "without a column", "by hand"],
)
def test_a_damaged_table_is_named(name: str, damage: Callable, study):
    path = study.path / name
    damage(path)
    before = contents(study)
    for act in (load_study, runs_at_with_histories):
        with pytest.raises(UserError) as error:
            act(study.path)
        assert str(path) in str(error.value)
        assert "\n" not in str(error.value)
    assert contents(study) == before


def runs_at_with_histories(path: Path) -> None:
    runs_at(path, histories=True)


def test_a_damaged_row_takes_no_report_down(study):
    path = study.tables.champions
    rows = rows_of(pq.read_table(path))
    rows[1]["genome",] = [1.0, 2.0]
    rows[2]["stored",] = float("inf")
    del rows[3]["held_out", "epuck", "mean"]
    del rows[3]["held_out", "epuck", "interval", "low"]
    write_table(path, table_of(rows))
    data = load_study(study.path)
    assert {name: [run.seed for run in runs] for name, runs in data.runs.items()} == {
        "de-best": [1],
        "ga": [2],
    }
    said = "\n".join(data.missing)
    for words in ("de-best seed 2: ", "de-best seed 10: ", "ga seed 1: ", "genes"):
        assert words in said
    sound = run_at(study.path / "ga" / "seed-2")
    assert not isinstance(sound, RunDirectory)
    assert sound.seed == 2
    with pytest.raises(UserError, match=r"expected .* finite genes"):
        run_at(study.path / "de-best" / "seed-2")


# reading


def test_pandas_reads_the_tables(study):
    frame = pd.read_parquet(study.tables.champions)
    assert len(frame) == 5
    found = evolution.load(study.path)
    assert isinstance(found, evolution.Study)
    for name, seeds in SEEDS.items():
        for seed in seeds:
            run = study.tables.runs(study.stored_config())[name, seed]
            here = found.champions.experiment.eq(name) & found.champions.seed.eq(seed)
            assert here.sum() == 1
            row = found.champions[here].iloc[0]
            assert row["epuck_mean"] == run.scores.held_out["epuck"].mean
            assert row["stored"] == run.scores.stored
            assert list(row["genome"]) == run.champion.genome.tolist()
            shares = run.scores.held_out["epuck"].behaviour
            assert row["epuck_behaviour_wall_follower"] == shares["wall follower"]
            there = found.history.experiment.eq(name) & found.history.seed.eq(seed)
            assert found.history[there].best.tolist() == run.history["best"].tolist()
    ids = {each["id"] for each in found.provenance["provenances"]}
    assert set(found.champions.provenance) == ids
    with pytest.raises(UserError, match=r"champions\.parquet"):
        evolution.load(study.path / "nowhere")


def test_addresses_name_runs_wherever_they_are(study, unpacked):
    run = run_at(study.path / "de-best" / "seed-10")
    assert not isinstance(run, RunDirectory)
    assert (run.experiment, run.seed, run.config.seed) == ("de-best", 10, 10)
    (policy,) = named_policies(str(study.path / "de-best" / "seed-10"))
    assert policy.source == str(study.path / "de-best" / "seed-10")
    assert policy.config == run.config
    assert policy.scores.held_out == run.scores.held_out
    names = [f"{name}/seed-{seed}" for name in SEEDS for seed in SEEDS[name]]
    everything = [policy.source for policy in named_policies(str(study.path))]
    assert everything == [str(study.path / name) for name in names]
    # some in tables, and others not yet
    shutil.copytree(unpacked.path / "running/ga/seed-1", study.run("ga", 7).path)
    study.run("ga", 7).config.write_text(
        study.stored_config().with_seed("ga", 7).to_yaml()
    )
    assert len(runs_at(study.path)) == len(names) + 1
    assert isinstance(run_at(study.run("ga", 7).path), RunDirectory)
    huge = f"ga/seed-{'9' * 20}"
    for nothing in (huge, "ga/seed-3", "ga/seed-01", "nope/seed-1", "ga"):
        assert runs_at(study.path / nothing) == []
        with pytest.raises(UserError, match="STUDY/EXPERIMENT/seed-N"):
            named_policies(str(study.path / nothing))


def test_the_best_of_a_generation_are_in_no_table(study):
    address = str(study.path / "ga" / "seed-1")
    with pytest.raises(UserError, match=r"evolution\.export .* again|do the run again"):
        named_policies(address, "last")


@pytest.mark.parametrize("packed", [True, False])
def test_a_run_is_exported(packed, study, unpacked, tmp_path, capsys):
    place = study.path / "ga" / "seed-2" if packed else unpacked.run("ga", 2).path
    file, config = tmp_path / "champion.json", tmp_path / "again.yaml"
    assert export([str(place), str(file)]) == 0
    assert capsys.readouterr().out == f"Written: {file}\n"
    champion = load_controller(file)
    assert np.array_equal(champion.genome, champion_at(place).genome)
    assert champion.to_json() == champion_at(place).to_json()
    assert export([str(place), str(config)]) == 0
    assert load_config(config) == study.stored_config().with_seed("ga", 2)
    with pytest.raises(UserError, match="expected one run"):
        export([str(study.path), str(file)])


def test_who_needs_a_file_is_told_how_to_get_one(study, tmp_path):
    address = study.path / "ga" / "seed-2"
    with pytest.raises(UserError, match=r"evolution\.export .*seed-2 champion\.json"):
        load_controller(address)
    with pytest.raises(UserError, match="cannot read"):
        load_controller(tmp_path / "ga" / "seed-2")
