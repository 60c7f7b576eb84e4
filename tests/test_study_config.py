"""Studies: what they are read from, how they are stored, and what joins them."""

import shutil
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml

from epuck_mj.host import files
from epuck_mj.scene.model_files import MODELS
from evolution.run.lock import locked
from evolution.settings.comparison import differences
from evolution.settings.config_files import find_config, load_config
from evolution.study.config import (
    SEEDS_MAX,
    SEEDS_OF_STUDY_MAX,
    StudyConfig,
    find_study,
    parse_seeds,
)
from evolution.study.data import load_study
from evolution.study.directory import StudyDirectory
from tests.processes import PATIENCE
from tests.refusals import refused
from tests.shipped import HYBRIDS, OPTIMIZERS, PAPERS

ROBOTS = {"paper": "epuck_kinematic", "quick": "epuck_kinematic", "wheels": "epuck"}
GA = "optimizer: {algorithm: genetic_algorithm}\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty directory that is the working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def study(text: str) -> StudyConfig:
    """A study of that text, from a file in the working directory."""
    Path("study.yaml").write_text(text)
    return StudyConfig.load(Path("study.yaml"))


# seeds


@pytest.mark.parametrize(
    ("text", "seeds"),
    [
        ("7", [7]),
        ("0", [0]),
        ("1-3", [1, 2, 3]),
        ("4-4", [4]),
        ("1,3,5-8", [1, 3, 5, 6, 7, 8]),
        ("9, 2-3 ,1", [1, 2, 3, 9]),
        ("007", [7]),
    ],
)
def test_seeds(text, seeds):
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "1-30 or 1,3,5-8, got ''"),
        ("-", "got '-'"),
        ("-1", "got '-1'"),
        ("1-", "got '1-'"),
        ("1--3", "got '1--3'"),
        ("1-2-3", "got '1-2-3'"),
        ("1,,2", "got '1,,2'"),
        ("1 2", "got '1 2'"),
        ("1.5", "got '1.5'"),
        ("one", "got 'one'"),
        ("²", "got '²'"),
        ("٣", "got '٣'"),
        ("3-1", "from a lower to a higher one, got '3-1'"),
        ("1-10001", "at most 10000 seeds, got '1-10001'"),
        ("1-10000,10001", "at most 10000 seeds, got '1-10000,10001'"),
        ("1-999999999999999999", "at most 10000"),
        (19 * "9", "expected seeds as "),
        (5000 * "9", "expected seeds"),
        ("1,2,1", "every seed once, got '1,2,1'"),
        ("1-5,3", "every seed once, got '1-5,3'"),
    ],
)
def test_other_seeds_are_refused(text, words):
    assert words in refused(parse_seeds, text)


# reading


@pytest.mark.parametrize("name", ROBOTS)
def test_shipped_studies_load(name):
    config = StudyConfig.load(find_study(name))
    assert list(config.experiments)[:3] == ["de-best", "de-rand", "ga"]
    for experiment, each in config.experiments.items():
        like = experiment.removesuffix("-37500")
        assert each.optimizer == load_config(find_config(like)).optimizer
        assert each.evaluations <= (30_000 if like == experiment else 37_500)
        assert each.robot == ROBOTS[name]


def test_the_papers_study_has_every_optimizer_and_one_rule_for_champions():
    experiments = StudyConfig.load(find_study("paper")).experiments
    assert set(OPTIMIZERS) - set(HYBRIDS) < set(experiments)
    for name, each in experiments.items():
        assert (each.climb, each.finalists, each.validation_starts) == (1, 0, 200)
        assert each.test_starts == (1000 if name in PAPERS else 200)


@pytest.mark.parametrize("study", ["variations", "steps-150", "steps-500"])
def test_a_variation_differs_in_one_thing_from_its_algorithm(study):
    experiments = StudyConfig.load(find_study(study)).experiments
    # for all of the study
    how = {"climb": 1.0, "finalists": 0, "test_starts": 200}
    together = [
        {"weight_bound", "weight_init"},
        {"trials", "evaluations"},
        # what is varied is the grid of the two
        {"optimizer.scale", "optimizer.crossover"},
        {"optimizer.bits", "optimizer.coding"},
    ]
    for name, varied in experiments.items():
        like = next(each for each in PAPERS if name.startswith(each))
        config = load_config(find_config(like)).model_copy(update=how)
        keys = set(differences({"it": config, "varied": varied}))
        if name == like:
            assert not keys
        else:
            assert len(keys) == 1 or keys in together, (name, keys)
        assert varied.budget == config.budget
    names = set(experiments) - set(PAPERS)
    assert study != "variations" or len(names) >= 60


def test_hybrids_cost_the_same_and_are_tested_alike():
    experiments = StudyConfig.load(find_study("hybrids")).experiments
    assert {config.budget for config in experiments.values()} == {150_000}
    assert {config.setting for config in experiments.values()} == {
        experiments["de-best"].setting
    }
    # a rule and the control of it differ in nothing else
    for share in ("", "-10", "-60"):
        control = experiments[f"perturbation{share}"]
        learnt = experiments[f"imitation{share}"]
        assert set(differences({"a": control, "b": learnt})) == {"optimizer.rule"}


def test_climbing_is_de_best():
    de_best = load_config(find_config("de-best"))
    for each in StudyConfig.load(find_study("climbing")).experiments.values():
        assert set(differences({"it": de_best, "varied": each})) <= {
            "climb",
            "finalists",
        }


def test_transfer_is_about_real_sensors_and_motors():
    config = StudyConfig.load(find_study("transfer"))
    for each in config.experiments.values():
        assert each.noise == "calibrated"
        assert each.robot == "epuck_kinematic"
    assert any(each.randomise for each in config.experiments.values())


def test_what_experiments_share_wins(here):
    (here / "mine.yaml").write_text("steps: 7\ntrials: 3\n" + GA)
    config = study("experiments: [ga, mine.yaml]\ncommon: {steps: 9}")
    assert list(config.experiments) == ["ga", "mine"]
    shipped = load_config(find_config("ga")).model_dump()
    assert config.experiments["ga"].model_dump() == shipped | {"steps": 9}
    assert (config.experiments["mine"].steps, config.experiments["mine"].trials) == (
        9,
        3,
    )


def test_an_experiment_may_differ_from_another_in_some_keys(here):
    config = study(
        "experiments: [ga, {small: {like: ga, trials: 2, optimizer: {bits: 4}}}, "
        "{other: {like: ga, optimizer: {algorithm: random_search, population: 9}}}]"
    )
    ga, small, other = (each.model_dump() for each in config.experiments.values())
    assert list(config.experiments) == ["ga", "small", "other"]
    optimizer = ga["optimizer"]
    assert small == ga | {"trials": 2, "optimizer": optimizer | {"bits": 4}}
    mine = {"algorithm": "random_search", "population": 9}
    assert other == ga | {"optimizer": mine}


def test_order_is_kept(here):
    config = study("experiments: [ga, de-rand, de-best]")
    assert list(config.experiments) == ["ga", "de-rand", "de-best"]
    assert list(StudyConfig.load(Path("study.yaml")).experiments) == list(
        config.experiments
    )


def test_an_own_robot_means_the_same_from_anywhere(here):
    shutil.copy(MODELS / "epuck.xml", here / "mine.xml")
    config = study("experiments: [ga]\ncommon: {robot: mine.xml}")
    assert config.experiments["ga"].robot == str(here / "mine.xml")
    assert config.experiments["ga"].arena == "arena"


def test_a_run_has_its_own_seed_and_nothing_else(here):
    config = study("experiments: [ga]")
    one = config.with_seed("ga", 12)
    assert one.model_dump() == config.experiments["ga"].model_dump() | {"seed": 12}
    assert config.experiments["ga"].seed == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("experiments: [", ("study.yaml' is not YAML",)),
        ("", ("expected a mapping", "NoneType")),
        ("- ga\n", ("expected a mapping", "list")),
        ("experiment: [ga]", ("unknown key 'experiment'; available: experiments, c",)),
        ("{1: 2}", ("unknown key '1'",)),
        ("common: {steps: 3}", ("expected 'experiments', a list", "got None")),
        ("experiments: ga", ("expected 'experiments', a list", "got 'ga'")),
        ("experiments: []", ("expected 'experiments', a list", "got []")),
        ("experiments: [ga, nope]", ("no experiment 'nope'", "de-rand, ga")),
        ("experiments: [paper]", ("no experiment 'paper'",)),
        ("experiments: [study.yaml]", ("unknown key 'experiments'",)),
        ("experiments: [3]", ("a list of experiments", "differs from another, got 3")),
        ("experiments: [{a: {}, b: {}}]", ("a name with the keys", "got {'a'")),
        ("experiments: [{a/b: {like: ga}}]", ("a name of letters", "got 'a/b'")),
        ("experiments: [{a: {steps: 3}}]", ("study.yaml', a: expected 'like'",)),
        ("experiments: [{a: ga}]", ("study.yaml', a: expected 'like'", "got 'ga'")),
        ("experiments: [{a: {like: nope}}]", ("no experiment 'nope'",)),
        ("experiments: [{a: {like: ga, stps: 3}}]", ("', a: unknown key 'stps'",)),
        ("experiments: [{a: {like: ga, steps: x}}]", ("', a: steps: ", "got 'x'")),
        ("experiments: [{a: {like: ga, seed: 2}}]", ("a: 'seed' has no effect",)),
        (
            "experiments: [{a: {like: ga, optimizer: 3}}]",
            ("a: expected 'optimizer', a mapping, got 3",),
        ),
        (
            "experiments: [{a: {like: ga, optimizer: {tournment: 3}}}]",
            ("', a: unknown key 'optimizer.tournment'",),
        ),
        ("experiments: [ga, {ga: {like: ga}}]", ("two experiments are called 'ga'",)),
        ("experiments: [ga, ga]", ("two experiments are called 'ga'",)),
        ("experiments: [ga, ga.yaml]", ("two experiments are called 'ga'",)),
        ("experiments: [ga]\ncommon: []", ("expected 'common', a mapping, got []",)),
        ("experiments: [ga]\ncommon: {seed: 7}", ("'seed' has no effect here",)),
        ("experiments: [ga]\nexperiments: [ga]", ("appears twice, in line 1 and 2",)),
        ("experiments: [ga]\ncommon: 3", ("expected 'common', a mapping, got 3",)),
        ("experiments: [ga]\ncommon: {stps: 3}", ("', common: unknown key 'stps'",)),
        ("experiments: [ga]\ncommon: {steps: x}", ("common: steps: ", "got 'x'")),
        ("experiments: [ga]\ncommon: {1: 2}", ("', common: ",)),
        (
            "experiments: [ga]\ncommon: {optimizer: {population: 10}}",
            ("', common: optimizer: expected a mapping with 'algorithm'",),
        ),
    ],
)
def test_a_bad_study_is_refused(text, words, here):
    (here / "ga.yaml").write_text(GA)
    message = refused(study, text)
    for word in words:
        assert word in message


def test_a_study_is_shipped_or_a_file(here):
    (here / "mine.yaml").write_text("experiments: [ga]")
    assert find_study("mine.yaml") == Path("mine.yaml")
    for name in ("nope", "ga", "", ".", 300 * "a", "a\0b"):
        message = refused(find_study, name)
        assert message.startswith(f"no study '{name}'")
        assert message.endswith(
            "one of climbing, good-robot, hybrids, paper, quick, real-robots, "
            "steps-150, steps-500, transfer, variations, wheels"
        )


# choosing and joining


def test_some_of_the_experiments(here):
    config = study("experiments: [ga, de-rand, de-best]")
    some = config.only(["de-best", "ga"])
    assert list(some.experiments) == ["de-best", "ga"]
    assert some.experiments["ga"] == config.experiments["ga"]
    message = refused(config.only, ["ga", "gb"])
    assert message == (
        "no experiment 'gb' in the study; available: ga, de-rand, de-best"
    )


def test_more_experiments_join(here):
    stored = study("experiments: [de-rand, ga]")
    both = stored.merged(study("experiments: [ga, de-best]"), Path("out"))
    assert list(both.experiments) == ["de-rand", "ga", "de-best"]
    assert both.experiments["de-best"] == load_config(find_config("de-best"))
    # a study that has them all says the order
    whole = study("experiments: [ga, de-best, de-rand]")
    assert list(stored.merged(whole, Path("out")).experiments) == list(
        whole.experiments
    )


@pytest.mark.parametrize(
    ("key", "values"),
    [("steps", (300, 60)), ("robot", ("epuck_kinematic", "epuck"))],
)
def test_experiments_that_no_report_compares_are_refused(key, values, here):
    """At the start of the study, and by the rule of the report."""
    for name, value in zip(("a", "b"), values, strict=True):
        Path(f"{name}.yaml").write_text(f"{key}: {value}\n{GA}")
    message = (
        f"experiments of one study have to have the same {key}, "
        f"got a {values[0]}, b {values[1]}"
    )
    assert refused(study, "experiments: [a.yaml, b.yaml]") == message
    # what all of them share decides
    study(f"experiments: [a.yaml, b.yaml]\ncommon: {{{key}: {values[0]}}}")
    # one after the other
    directory = StudyDirectory(here / "out")
    directory.open(study("experiments: [a.yaml]"), [1])
    before = directory.config.read_bytes(), directory.asked.read_bytes()
    assert refused(directory.open, study("experiments: [b.yaml]"), [1]) == message
    assert (directory.config.read_bytes(), directory.asked.read_bytes()) == before
    # and one of an earlier version
    fields = {
        name: load_config(Path(f"{name}.yaml")).model_dump() for name in ("a", "b")
    }
    directory.config.write_text(yaml.safe_dump(fields))
    assert message in refused(load_study, directory.path)


def test_an_experiment_that_has_changed_does_not(here):
    stored = study("experiments: [de-best, ga]\ncommon: {steps: 5}")
    other = study("experiments: [ga, de-rand]\ncommon: {steps: 6, trials: 2}")
    assert refused(stored.merged, other, Path("out")) == (
        "'out' is a study of another config; experiment 'ga' differs in: "
        "trials (stored 5, got 2), steps (stored 5, got 6)"
    )


def test_stored_and_read_back(here):
    config = study("experiments: [ga, de-best, cma-es]\ncommon: {steps: 5}")
    Path("stored.yaml").write_text(config.to_yaml())
    back = StudyConfig.from_yaml(Path("stored.yaml"))
    assert list(back.experiments.items()) == list(config.experiments.items())
    assert back.to_yaml() == config.to_yaml()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot read"),
        ("", "expected a mapping"),
        ("{}", "expected experiments, got none"),
        ("ga: 3", "stored.yaml', ga: "),
        ("ga: {steps: 3}", "stored.yaml', ga: key 'optimizer' is missing"),
        ("ga: {stps: 3, " + GA.strip() + "}", "stored.yaml', ga: unknown key 'stps'"),
        ("ga: [", "is not YAML"),
    ],
)
def test_a_damaged_one_is_refused(content, words, here):
    if content is not None:
        Path("stored.yaml").write_text(content)
    assert words in refused(StudyConfig.from_yaml, Path("stored.yaml"))


# the directory


def test_a_new_directory_holds_the_study(here):
    config = study("experiments: [ga, de-best]")
    directory = StudyDirectory(here / "deep" / "out")
    directory.open(config, [3, 1, 2])
    names = sorted(path.name for path in directory.path.iterdir())
    assert names == [".lock", "seeds.yaml", "study.yaml"]
    assert directory.stored_config() == config
    assert directory.run("ga", 3).path == directory.path / "running" / "ga" / "seed-3"
    before = directory.config.read_bytes()
    # again, and with less
    directory.open(config.only(["de-best"]), [2, 7])
    assert directory.config.read_bytes() == before
    directory.open(study("experiments: [de-rand]"), [1])
    assert list(directory.stored_config().experiments) == ["ga", "de-best", "de-rand"]
    asked = {"ga": [1, 2, 3], "de-best": [1, 2, 3, 7], "de-rand": [1]}
    assert directory.asked_seeds() == asked


def test_two_that_open_a_study_at_once_both_have_their_say(here):
    """One is about to write when the other comes, and waits."""
    directory = StudyDirectory(here / "out")
    with ThreadPoolExecutor() as pool:
        with locked(directory.path):
            both = [
                pool.submit(directory.open, study(f"experiments: [{name}]"), [seed])
                for name, seed in (("ga", 1), ("de-best", 2))
            ]
            time.sleep(0.2)
            assert not any(each.done() for each in both)
        for each in both:
            each.result(timeout=PATIENCE)
    assert set(directory.stored_config().experiments) == {"ga", "de-best"}
    assert directory.asked_seeds() == {"ga": [1], "de-best": [2]}


def test_more_seeds_than_one_command_takes(here):
    directory, config = StudyDirectory(here / "out"), study("experiments: [ga]")
    directory.open(config, range(1, SEEDS_MAX + 1))
    directory.open(config, [SEEDS_MAX + 1])
    assert directory.asked_seeds() == {"ga": [*range(1, SEEDS_MAX + 2)]}
    directory.open(config, [1])
    # there is an end, on writing as on reading
    before = directory.asked.read_bytes()
    many = range(SEEDS_OF_STUDY_MAX + 1)
    assert refused(directory.open, config, many) == (
        f"expected at most {SEEDS_OF_STUDY_MAX} seeds in '{directory.path}', got "
        f"{SEEDS_OF_STUDY_MAX + 1} of ga"
    )
    assert directory.asked.read_bytes() == before
    directory.asked.write_text(f"ga: 0-{SEEDS_OF_STUDY_MAX}\n")
    assert "seeds.yaml': expected at most" in refused(directory.asked_seeds)


def test_an_older_study_was_asked_for_what_it_has(here):
    directory = StudyDirectory(here / "out")
    directory.open(study("experiments: [ga, de-best]"), [1])
    directory.asked.unlink()
    (directory.path / "ga" / "seed-4").mkdir(parents=True)
    directory.open(study("experiments: [ga]"), [7])
    assert directory.asked_seeds() == {"ga": [4, 7]}


@pytest.mark.parametrize("content", ["ga: 1-x", "[ga]", "ga: {1: 2}"])
def test_damaged_seeds_are_refused(content, here):
    directory = StudyDirectory(here)
    directory.asked.write_text(content)
    assert refused(directory.asked_seeds)


def test_an_empty_directory_is_as_good_as_none(here):
    (here / "out").mkdir()
    StudyDirectory(Path("out")).open(study("experiments: [ga]"), [1])
    assert files.is_file(here / "out" / "study.yaml")


def test_what_a_killed_writer_left_is_in_nobodys_way(here):
    (here / "out").mkdir()
    (here / "out" / ".study.yaml-b2q7x_1c.tmp").write_text("ga:")
    StudyDirectory(Path("out")).open(study("experiments: [ga]"), [1])
    assert files.is_file(here / "out" / "study.yaml")


def test_seeds_are_those_of_which_there_is_a_directory(here):
    for name in ("seed-10", "seed-2", "seed-x", "seed-", "other", "seed-3.failure.txt"):
        (here / "ga" / name).mkdir(parents=True)
    (here / "ga" / "seed-4").write_text("")
    assert StudyDirectory(here).seeds("ga") == [2, 10]
    assert StudyDirectory(here).seeds("de-best") == []


def test_what_is_no_study_is_refused_and_left_alone(here):
    config = study("experiments: [ga]")
    (here / "file").write_text("years of work")
    (here / "thesis").mkdir()
    (here / "thesis" / "thesis.tex").write_text("years of work")
    for name, words in [
        ("file", "output 'file' is not a directory"),
        ("file/deeper", "cannot write"),
        ("thesis", "output 'thesis' is not empty and holds no study"),
        (300 * "a", "cannot write"),
    ]:
        assert words in refused(StudyDirectory(Path(name)).open, config, [1])
    assert (here / "file").read_text() == "years of work"
    assert [path.name for path in (here / "thesis").iterdir()] == ["thesis.tex"]


def test_another_study_is_refused_and_left_alone(here):
    directory = StudyDirectory(Path("out"))
    directory.open(study("experiments: [ga, de-best]"), [1])
    before = directory.config.read_bytes()
    other = study("experiments: [de-best, de-rand]\ncommon: {v_max: 0.1}")
    message = refused(directory.open, other, [2])
    assert message.startswith("'out' is a study of another config")
    assert "experiment 'de-best' differs in: v_max (stored " in message
    assert directory.config.read_bytes() == before
    assert directory.asked_seeds() == {"ga": [1], "de-best": [1]}


def test_a_directory_without_a_study_has_none_to_read(here):
    message = refused(StudyDirectory(here).stored_config)
    assert "is not a study" in message
    assert "python -m evolution.study" in message


@pytest.mark.parametrize("content", ["", "ga: [", "ga: {steps: many}"])
def test_a_damaged_study_is_refused_and_kept(content, here):
    (here / "out").mkdir()
    (here / "out" / "study.yaml").write_text(content)
    message = refused(StudyDirectory(Path("out")).open, study("experiments: [ga]"), [1])
    assert "out/study.yaml" in message
    assert (here / "out" / "study.yaml").read_text() == content


def test_the_stored_study_is_plain_yaml(here):
    content = yaml.safe_load(study("experiments: [ga]").to_yaml())
    assert content["ga"]["optimizer"]["algorithm"] == "genetic_algorithm"
