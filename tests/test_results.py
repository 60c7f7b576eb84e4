"""The shipped evidence: it belongs to the shipped models, and to what is said of it."""

import functools
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from epuck_mj.errors import UserError
from epuck_mj.scene.model_files import MODELS
from evolution.gap.gap_document import gap_document, gap_summary
from evolution.gap.groups import experiments, peers
from evolution.gap.slowed import with_slowed
from evolution.gap.transfer import Gap, Transfer
from evolution.judging.held_out import Judges
from evolution.named_policies import NamedPolicy, named_policies
from evolution.pages.blocks import to_markdown
from evolution.reproduce.champions_table import champions_table
from evolution.reproduce.publish import PAGES, pages_with_tables, ship, shipped
from evolution.run.directory import RunDirectory
from evolution.study import data
from evolution.study.addresses import run_at, runs_at
from evolution.study.config import StudyConfig, find_study
from evolution.study.directory import StudyDirectory
from evolution.study.finished_run import FinishedRun

ROOT = MODELS.parent
RESULTS = ROOT / "results"
STUDIES = shipped(RESULTS)
SIZE_MAX = 20e6


def test_runs_are_of_code_in_git_and_finished():
    runs = [
        run
        for table in RESULTS.glob("*/champions.parquet")
        for run in runs_at(table.parent)
        if not isinstance(run, RunDirectory)
    ]
    strays = [stray for run in runs for stray in strays_of(run)]
    assert len(runs) > 80
    assert not strays, f"{len(strays)} strays: {strays}"


load_study = functools.cache(data.load_study)
"""Nothing in results/ changes while tests run."""


def strays_of(run: FinishedRun) -> list[str]:
    """What is wrong with a shipped run, a line each."""
    provenance = run.provenance
    # however often it was gone on with
    parts = [provenance, *provenance.get("resumed", ())]
    sound = {
        # of those that made it: the models of today may be others
        "models": set(provenance["mjcf_sha256"]) >= {"arena", "robot"},
        "code": not any(part["git"]["modified"] for part in parts),
        "end": bool(provenance["finished"]),
    }
    place = run.path.relative_to(RESULTS).as_posix()
    return [f"{place}: {what}" for what, is_so in sound.items() if not is_so]


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.name)
def test_a_study_is_sound_and_spent_the_whole_budget(path: Path):
    study = load_study(path)
    assert study.steps == 300
    assert study.robots[0] == "epuck"
    assert not [line for line in study.missing if "not finished" in line]
    for name, runs in study.runs.items():
        budget = study.configs[name].evaluations
        for run in runs:
            spent = run.history["evaluations"][-1]
            assert budget - 1000 < spent <= budget, name
            assert run.history["best"].max() >= run.scores.stored


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.name)
def test_a_study_is_the_shipped_config(path: Path):
    now = StudyConfig.load(find_study(path.name))
    assert StudyConfig.from_yaml(path / "study.yaml").experiments == now.experiments


@pytest.mark.parametrize(
    "name", ["hybrids", "good-robot", "variations", "real-robots", "climbing"]
)
def test_further_studies_are_shipped_configs(name: str):
    study = load_study(RESULTS / name)
    now = StudyConfig.load(find_study(name)).experiments
    assert study.configs == {each: now[each] for each in study.configs}
    assert not [line for line in study.missing if "not finished" in line]


def test_the_main_experiment_finds_wall_followers():
    study = load_study(RESULTS / "paper")
    # one run in some dozens stays far behind
    kinematic = study.held_out("de-best", "epuck_kinematic")
    assert np.quantile(kinematic, 0.05) >= 150
    # chosen on the kinematic robot, some fail on wheels
    assert np.median(study.held_out("de-best", "epuck")) >= 200


def test_a_shipped_champion_scores_the_same_on_every_machine():
    """To the last bit on the kinematic robot; `evolution.verify` tests wheels, too."""
    run = run_at(RESULTS / "paper" / "random-search" / "seed-3")
    assert not isinstance(run, RunDirectory)
    written = run.scores.held_out["epuck_kinematic"]
    judge = Judges().of("epuck_kinematic", run.config.setting)
    test = judge.test(run.champion.controller, written.starts)
    assert test.mean == written.mean
    assert test.crash_rate == written.crash_rate
    assert test.starts == written.starts == 200


def test_the_pages_show_what_is_shipped():
    pages = pages_with_tables(ROOT)
    assert set(pages) == {ROOT / name for name in PAGES}
    for path, text in pages.items():
        assert path.read_text() == text, path.name


def test_the_card_s_champions_were_chosen_by_validation():
    table = champions_table(
        [load_study(RESULTS / "paper"), load_study(RESULTS / "wheels")]
    )
    assert len(table.rows) > 10
    beside = functools.cache(runs_at)
    for address, _, n, validation, wheels, *_ in table.rows:
        runs = runs_at(RESULTS / address)
        (chosen,) = (run for run in runs if not isinstance(run, RunDirectory))
        scores = chosen.champion.scores
        assert validation == f"{scores['validation']:.0f}"
        assert wheels == f"{scores['held_out']['epuck']['mean']:.0f}"
        others = beside((RESULTS / address).parent.parent)
        all_of_them = [
            run.champion.scores["validation"]
            for run in others
            if not isinstance(run, RunDirectory)
            and run.path.parent.name == chosen.path.parent.name
        ]
        assert len(all_of_them) == int(n)
        assert scores["validation"] == max(all_of_them)


def test_a_page_without_its_markers_is_refused(tmp_path):
    (tmp_path / "results").symlink_to(RESULTS)
    (tmp_path / "README.md").write_text("no table")
    with pytest.raises(UserError, match="expected '<!-- medians -->' and '<!-- end of"):
        pages_with_tables(tmp_path)


def test_what_is_shipped_is_small():
    assert sum(p.stat().st_size for p in RESULTS.rglob("*") if p.is_file()) < SIZE_MAX


@pytest.mark.parametrize("folder", ["gap", "gap-calibrated"])
def test_the_gap_s_documents_say_what_was_measured(folder, monkeypatch):
    monkeypatch.chdir(ROOT)
    record = json.loads((RESULTS / folder / "gap.json").read_text())
    first_robot = next(iter(record["robots"].values()))
    names = list(next(iter(first_robot.values())))
    policies = named_again(names)
    outcomes = pd.read_parquet(RESULTS / folder / "gap.parquet")
    measures = ("reference", "fitness", "collisions_per_minute", "crash_rate")
    gaps = []
    for kind, worlds in record["worlds"].items():
        transfers = {}
        for robot, kinds in record["robots"].items():
            nominal = np.array([policy["nominal"] for policy in kinds[kind].values()])
            own = outcomes[outcomes.robot.eq(robot) & outcomes.kind.eq(kind)]
            there = (
                own.pivot(index="number", columns="policy", values=measure)[names]
                for measure in measures
            )
            transfers[robot] = Transfer(nominal, *(each.to_numpy() for each in there))
        gap = Gap(
            kind,
            names,
            transfers,
            experiments(policies),
            peers(policies),
            record["starts"],
            np.array([world["latency"] for world in worlds]),
        )
        gaps.append(gap)
    document = to_markdown(gap_document(gaps))
    assert (RESULTS / folder / "gap.md").read_text() == document
    table = to_markdown([gap_summary(gaps)])
    assert (RESULTS / folder / "summary.md").read_text() == table


def named_again(names: list[str]) -> list[NamedPolicy]:
    """The policies of names that a gap's record gives, slowed ones as well."""
    found = []
    for name in names:
        path, _, speed = name.partition(" at ")
        speeds = [float(speed.split()[0])] if speed else []
        found.append(with_slowed(named_policies(path), speeds)[-1])
    return found


def test_a_study_begun_with_some_experiments_keeps_the_others(tmp_path):
    shutil.copytree(RESULTS / "transfer", tmp_path / "copies")
    shutil.copytree(RESULTS / "transfer", tmp_path / "again")
    copies = StudyDirectory(tmp_path / "copies")
    before = copies.stored_config()
    some = StudyDirectory(tmp_path / "again")
    only = StudyConfig({"ga-randomised": before.experiments["ga-randomised"]})
    some.config.write_text(only.to_yaml())
    some.asked.write_text("ga-randomised: 1-5\n")
    ship(some.path, copies.path)
    assert list(copies.stored_config().experiments) == list(before.experiments)
    assert copies.asked_seeds()["ga-randomised"] == [1, 2, 3, 4, 5]
    assert copies.asked_seeds()["de-best-randomised"] == [1, 2, 3]
    assert len(copies.tables.runs(before)) == 9
