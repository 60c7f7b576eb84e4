"""best_individuals.npz: what a run keeps of the best of every generation."""

import math
import shutil

import numpy as np
import pytest

from epuck_mj.errors import UserError
from epuck_mj.host import files
from evolution.named_policies import named_policies
from evolution.run import execution
from evolution.run.directory import RunDirectory
from evolution.run.execution import Run
from evolution.run.means import Means
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import find_config, load_config

EXPERIMENTS = ("cma-es", "de-best", "ga", "one-plus-one-es", "random-search")


@pytest.fixture(autouse=True)
def every_generation_saved(monkeypatch):
    """However short it is."""
    monkeypatch.setattr(execution, "SAVING_SHARE", math.inf)


def begun(path, experiment="ga", evaluations=40) -> Run:
    fields = load_config(find_config(experiment)).model_dump()
    fields |= {"evaluations": evaluations, "steps": 10, "trials": 1}
    if "population" in fields["optimizer"]:
        fields["optimizer"]["population"] = 10
    config = ExperimentConfig.parsed(fields, experiment)
    return Run(config, RunDirectory(path), Means(), ())


def assert_best_of_history(path) -> int:
    """The file says what history and checkpoint say; how many generations."""
    best = files.read_arrays(path / "best_individuals.npz")
    assert set(best) == {"genomes", "fitness"}
    history = np.genfromtxt(path / "history.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(best["fitness"], np.atleast_1d(history["best"]))
    checkpoint = files.read_arrays(path / "checkpoint.npz")
    np.testing.assert_array_equal(best["genomes"], checkpoint["best_genomes"])
    return len(best["fitness"])


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_it_grows_with_history(tmp_path, experiment):
    run = begun(tmp_path / "run", experiment)
    run.start()
    assert not (tmp_path / "run" / "best_individuals.npz").exists()
    generations = [assert_best_of_history(tmp_path / "run") for _ in run.evolve()]
    assert generations == list(range(1, len(generations) + 1))
    assert len(generations) >= 2


def test_its_individuals_are_worth_what_it_says(tmp_path):
    """Genomes and fitness belong together: asked again on the same starts."""
    from evolution.judging.evaluation import evaluate
    from evolution.settings.randomness import Purpose, random_generator

    run = begun(tmp_path / "run", "random-search")
    run.start()
    (first, *_) = run.evolve()
    best = files.read_arrays(tmp_path / "run" / "best_individuals.npz")
    experiment = run.evolution
    rng = random_generator(experiment.config.seed, Purpose.STARTS, 0)
    starts = experiment.space.sample(rng, 1)
    fitness = evaluate(
        experiment.engine, experiment.config.topology, best["genomes"][:1], starts
    ).fitness
    assert fitness[0] == best["fitness"][0] == first.best


def test_it_is_small(tmp_path):
    """A run of the paper's size has 500 generations of 40 genes."""
    rng = np.random.default_rng(0)
    arrays = {"genomes": rng.uniform(-5, 5, (500, 40)), "fitness": rng.random(500)}
    files.write_arrays(tmp_path / "best.npz", arrays)
    assert (tmp_path / "best.npz").stat().st_size < 200_000
    # elites live long: most rows repeat
    arrays["genomes"] = np.repeat(arrays["genomes"][:50], 10, axis=0)
    files.write_arrays(tmp_path / "best.npz", arrays)
    assert (tmp_path / "best.npz").stat().st_size < 50_000


@pytest.mark.parametrize("lost", ["half written", "older", "damaged"])
def test_a_resume_restores_it_after_a_kill_between_files(tmp_path, lost):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    run = begun(whole)
    run.start()
    generations = run.evolve()
    next(generations)
    older = (whole / "best_individuals.npz").read_bytes()
    next(generations)
    shutil.copytree(whole, killed)
    expected = (whole / "best_individuals.npz").read_bytes()
    assert older != expected
    file = killed / "best_individuals.npz"
    # the checkpoint is written first, then everything that follows from it
    if lost == "older":
        file.write_bytes(older)
    elif lost == "damaged":
        file.write_bytes(older[:100])
    else:
        file.unlink()
        with pytest.raises(UserError, match="saved its generations"):
            named_policies(str(killed), "0")
        (killed / ".best_individuals.npz-abcd1234").write_bytes(older[:100])
    again = begun(killed)
    again.resume()
    assert file.read_bytes() == expected
    assert not files.leftovers(killed)
    assert assert_best_of_history(killed) == 2
    assert len(named_policies(str(killed), "0,last")) == 2
    assert len(list(again.evolve())) == 2
    assert assert_best_of_history(killed) == 4
