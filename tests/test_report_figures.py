"""Figures of a study: drawn is what the runs say, each n is there, files are sound."""

import itertools
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.image import imread
from matplotlib.legend import Legend
from matplotlib.patches import Rectangle

from epuck_mj.errors import UserError
from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.policies.network import Network
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.behaviour_classes import CLASSES
from evolution.judging.scores import HeldOut, Scores
from evolution.pages import figure_files
from evolution.pages.figure_files import write_figure
from evolution.pages.style import LOOKS, looks
from evolution.pages.words import experiment_label, label, robot_name
from evolution.report.figures import STUDY_FIGURES, drawn_figures
from evolution.report.figures.behaviour_bars import CLASS_LOOKS, behaviour_figure
from evolution.report.figures.champions import (
    held_out_figure,
    rungs_figure,
    stored_and_held_out_figure,
)
from evolution.report.figures.curves import (
    N_POINTS,
    RESTARTS_NOTE,
    common_grid,
    growth_figure,
    growths_figure,
    on_grid,
    targets_figure,
)
from evolution.report.figures.trajectories import median_run, trajectories_figure
from evolution.report.samples import TARGET_SHARES
from evolution.settings.config_files import load_config, shipped_experiments
from evolution.study.data import StudyData
from tests.finished_runs import finished_run

ROBOTS = ("epuck", "epuck_kinematic")
STEPS = 300
N_RUNS = {"de-best": 12, "ga": 2, "my own": 1, "cma-es": 0}
POPULATION = {"de-best": 150, "ga": 100, "my own": 30}
SHARES = {"crashed": 0.25, "wall follower": 0.5, "no known class": 0.25, "stuck": 0.0}


def a_test(mean, behaviour):
    return HeldOut(mean=mean, crash_rate=0.0, starts=1000, behaviour=behaviour)


def a_run(name, seed, robots=ROBOTS, evaluations=30_000):
    rng = np.random.default_rng([seed, POPULATION[name]])
    n = evaluations // POPULATION[name]
    best = rng.uniform(100, 260) * (1 - np.exp(-np.linspace(0, 4, n)))
    best += rng.uniform(0, 20, n)
    history = {
        "generation": np.arange(n, dtype=float),
        "evaluations": (1.0 + np.arange(n)) * POPULATION[name],
        "best": best,
        "mean": best * rng.uniform(0.2, 0.9),
        "std": np.ones(n),
        "climbed": np.zeros(n),
    }
    tests = {
        robot: a_test(float(best.max() * rng.uniform(0.3, 1)), SHARES)
        for robot in robots
    }
    scores = Scores(stored=float(best.max()), held_out=tests)
    genome = rng.uniform(-5, 5, Network().n_genes)
    champion = ControllerFile(
        Network(), genome, TaskParameters(STEPS), Origin("epuck", "arena"), {}
    )
    return finished_run(seed, history, scores, champion)


def a_study(n_runs=N_RUNS, robots=ROBOTS, yardstick=True):
    shipped = shipped_experiments()
    return StudyData(
        path=Path("nowhere"),
        configs={
            name: load_config(shipped.get(name, shipped["de-best"])).model_copy(
                update={"steps": 20}
            )
            for name in n_runs
        },
        runs={
            name: tuple(a_run(name, seed, robots) for seed in range(1, n + 1))
            for name, n in n_runs.items()
        },
        robots=robots,
        steps=STEPS,
        yardstick=dict.fromkeys(robots, a_test(200.0, {})) if yardstick else {},
        missing=(),
    )


@pytest.fixture(scope="module")
def data():
    return a_study()


def legend_texts(figure):
    legends = [found for found in figure.legends if isinstance(found, Legend)]
    return [
        text.get_text()
        for legend in legends
        for text in [legend.get_title(), *legend.get_texts()]
    ]


def drawn(captioned):
    """The figure, which is not left out, and its caption."""
    assert captioned is not None
    return captioned


def xy(line):
    """The points of a line, `(2, points)`."""
    return np.array(line.get_data(), float)


def collections(axes, kind):
    return [found for found in axes.collections if isinstance(found, kind)]


def dots(axes):
    """Offsets of the scatters of an axes, `(dots, 2)` each."""
    return [
        np.asarray(found.get_offsets()) for found in collections(axes, PathCollection)
    ]


# curves


def test_on_grid_holds_each_value_until_the_next():
    evaluations, values = np.array([10.0, 20, 40]), np.array([1.0, 5, 2])
    grid = np.array([10.0, 19, 20, 39, 40, 99])
    np.testing.assert_array_equal(
        on_grid(evaluations, values, grid), [1, 1, 5, 5, 2, 2]
    )


def test_a_common_grid_has_few_points_where_all_runs_have_begun():
    runs = [a_run("my own", 1, evaluations=90), a_run("ga", 1, evaluations=200)]
    np.testing.assert_array_equal(common_grid(runs), [100, 200])
    grid = common_grid([a_run("my own", 1)])
    assert (grid[0], grid[-1], grid.size) == (30, 30_000, N_POINTS)


@pytest.mark.parametrize("name", ["de-best", "ga", "my own"])
def test_fitness_shows_medians_bands_and_every_best(data, name):
    figure, caption = growth_figure(data, name)
    (axes,) = figure.axes
    runs, n = data.runs[name], N_RUNS[name]
    grid = common_grid(runs)
    thick = [line for line in axes.lines if line.get_linewidth() > 0.5]
    bands = collections(axes, PolyCollection)
    for i, column in enumerate(["best", "mean"]):
        # all runs of these experiments have the same generations
        rows = np.isin(runs[0].history["evaluations"], grid)
        values = np.array([run.history[column] for run in runs])
        if column == "best":
            values = np.maximum.accumulate(values, axis=1)
        values = values[:, rows]
        np.testing.assert_allclose(xy(thick[i]), [grid, np.median(values, axis=0)])
        if n > 1:
            edge = np.asarray(bands[i].get_paths()[0].vertices)
            low, high = np.quantile(values, [0.25, 0.75], axis=0)
            assert edge[:, 1].min() == pytest.approx(low.min())
            assert edge[:, 1].max() == pytest.approx(high.max())
    # best and mean, each run's best, and the yardstick's
    assert len(axes.lines) == 2 + (n if n > 1 else 0) + 1
    np.testing.assert_array_equal(axes.lines[-1].get_ydata(), [200, 200])
    assert (
        "Black and dashed: held-out fitness of the hand-written wall follower"
        in caption
    )
    assert len(bands) == (2 if n > 1 else 0)
    assert axes.get_ylabel() == "stored fitness (max 300)"
    assert f"{label(data, name)} (n = {n})" in legend_texts(figure)
    assert f"n = {n}" in caption and "stored fitness" in caption


def test_no_median_of_means_of_populations_that_begin_anew():
    runs = tuple(a_run("ga", seed) for seed in (1, 2))
    anew = replace(a_study({"cma-es": 0}), runs={"cma-es": runs})
    figure, caption = growth_figure(anew, "cma-es")
    assert "population mean" not in legend_texts(figure)
    assert RESTARTS_NOTE in caption
    # of one run it is no median
    figure, caption = growth_figure(replace(anew, runs={"cma-es": runs[:1]}), "cma-es")
    assert "population mean" in legend_texts(figure)
    assert RESTARTS_NOTE not in caption


def test_no_curve_of_an_experiment_without_runs(data):
    with pytest.raises(ValueError, match="cma-es"):
        growth_figure(data, "cma-es")


def test_fitness_all_shows_the_best_so_far_and_the_yardstick(data):
    figure, caption = growths_figure(data)
    (axes,) = figure.axes
    *curves, reference = axes.lines
    for line, name in zip(curves, ["de-best", "ga", "my own"], strict=True):
        runs = data.runs[name]
        rows = np.isin(runs[0].history["evaluations"], common_grid(runs))
        best = [np.maximum.accumulate(run.history["best"])[rows] for run in runs]
        np.testing.assert_allclose(xy(line)[1], np.median(best, axis=0))
        assert line.get_color() == looks(data.configs)[name].color
        assert line.get_marker() == looks(data.configs)[name].marker
    assert set(xy(reference)[1]) == {200}
    assert legend_texts(figure)[1:] == [
        "DE/best/1/bin (n = 12)",
        "GA (n = 2)",
        "my own (n = 1)",
        "hand-written, held-out",
    ]
    assert "DE/best/1/bin (n = 12); GA (n = 2); my own (n = 1)" in caption


def test_targets_shows_the_share_of_run_and_target_pairs_by_then(data):
    assert np.array(TARGET_SHARES) * 300 == pytest.approx(np.arange(50, 226, 25))
    figure, caption = targets_figure(data)
    (axes,) = figure.axes
    for line, name in zip(axes.lines, ["de-best", "ga", "my own"], strict=True):
        runs = data.runs[name]
        for budget, share in xy(line).T:
            reached = [
                (
                    run.history["best"][run.history["evaluations"] <= budget] >= target
                ).any()
                for run in runs
                for target in np.array(TARGET_SHARES) * STEPS
            ]
            assert share == pytest.approx(np.mean(reached))
    assert "50, 75, 100, 125, 150, 175, 200, 225 of 300" in caption
    assert "GA (n = 2)" in legend_texts(figure)


# champions


def test_stored_and_held_out_shows_every_run_in_order_of_stored_fitness(data):
    figure, caption = stored_and_held_out_figure(data)
    assert len(figure.axes) == 3
    for axes, name in zip(figure.axes, ["de-best", "ga", "my own"], strict=True):
        order = np.argsort(data.stored(name))
        stored, *tests = dots(axes)
        np.testing.assert_array_equal(stored[:, 1], data.stored(name)[order])
        for test, robot in zip(tests, reversed(ROBOTS), strict=True):
            np.testing.assert_array_equal(test[:, 0], stored[:, 0])
            np.testing.assert_array_equal(test[:, 1], data.held_out(name, robot)[order])
        (luck,) = collections(axes, LineCollection)
        assert len(luck.get_segments()) == N_RUNS[name]
        assert axes.get_title() == f"{label(data, name)} (n = {N_RUNS[name]})"
    assert "held-out, wheeled robot" in legend_texts(figure)
    assert "GA (n = 2)" in caption


def test_held_out_shows_every_run_the_quartiles_and_the_yardstick(data):
    figure, caption = held_out_figure(data)
    for axes, robot in zip(figure.axes, ROBOTS, strict=True):
        samples = [data.held_out(name, robot) for name in ["de-best", "ga", "my own"]]
        for row, (found, sample) in enumerate(zip(dots(axes), samples, strict=True)):
            np.testing.assert_array_equal(found[:, 0], sample)
            assert (np.abs(found[:, 1] - row) < 0.5).all()
        *quartiles, reference = [xy(line)[0] for line in axes.lines]
        # none of a single run
        expected = [
            value
            for sample in samples[:2]
            for value in (np.quantile(sample, [0.25, 0.75]), [np.median(sample)])
        ]
        for got, value in zip(quartiles, expected, strict=True):
            np.testing.assert_allclose(got, value)
        assert set(reference) == {200}
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert labels == ["DE/best/1/bin (n = 12)", "GA (n = 2)", "my own (n = 1)"]
    assert "hand-written wall follower" in caption


def test_rungs_shows_wheels_against_the_robot_that_evolution_began_on(data):
    assert data.rungs == ("epuck_kinematic", "epuck")
    figure, _ = drawn(rungs_figure(data))
    (axes,) = figure.axes
    for found, name in zip(dots(axes), ["de-best", "ga", "my own"], strict=True):
        expected = [data.held_out(name, robot) for robot in data.rungs]
        np.testing.assert_array_equal(found.T, expected)
    assert "GA (n = 2)" in legend_texts(figure)
    assert axes.get_xlim() == axes.get_ylim() == (0, STEPS)


# behaviour


def test_behaviour_shows_mean_shares(data):
    run = data.runs["ga"][0]
    tests = {
        "epuck": a_test(1.0, {"crashed": 1.0}),
        "epuck_kinematic": a_test(1.0, {"stuck": 1.0}),
    }
    other = replace(run, scores=Scores(stored=1.0, held_out=tests))
    runs = {**data.runs, "ga": (run, other)}
    figure, caption = drawn(behaviour_figure(replace(data, runs=runs)))
    first, second = (
        [bar.get_width() for bar in axes.patches if isinstance(bar, Rectangle)]
        for axes in figure.axes
    )
    whole = [0.25, 0.5, 0.25]
    assert first == pytest.approx([*whole, 0.625, 0.25, 0.125, *whole])
    assert second == pytest.approx([*whole, 0.125, 0.25, 0.125, 0.5, *whole])
    assert legend_texts(figure)[1:] == [*SHARES]
    assert "DE/best/1/bin (n = 12); GA (n = 2); my own (n = 1)" in caption


def test_behaviour_of_the_yardstick_is_the_last_row(data):
    yardstick = dict.fromkeys(ROBOTS, a_test(1.0, SHARES))
    figure, _ = drawn(behaviour_figure(replace(data, yardstick=yardstick)))
    assert figure.axes[0].get_yticklabels()[-1].get_text() == "hand-written"


def test_every_class_of_behaviour_has_its_own_look():
    assert set(CLASS_LOOKS) == set(CLASSES)
    assert len(set(CLASS_LOOKS.values())) == len(CLASSES)


def test_median_run_is_the_lower_of_two(data):
    for name in ["de-best", "ga", "my own"]:
        tests = np.sort(data.held_out(name, "epuck"))
        expected = tests[(len(tests) - 1) // 2]
        assert median_run(data, name).held_out("epuck") == expected


@pytest.fixture(scope="module")
def trajectories(data):
    """Figure and caption, where one experiment lives in another world."""
    other = data.configs["ga"].model_copy(update={"fitness": "literal"})
    return trajectories_figure(replace(data, configs=data.configs | {"ga": other}))


def test_trajectories_are_of_every_experiment_of_a_world(data, trajectories, tmp_path):
    figure, caption = trajectories
    *panels, _ = figure.axes
    seeds = {name: median_run(data, name).seed for name in ("de-best", "my own")}
    assert [axes.get_title().split("\n")[:2] for axes in panels] == [
        [name, f"seed {seeds[experiment]}, start {start}"]
        for name, experiment in [("DE/best/1/bin", "de-best"), ("my own", "my own")]
        for start in (0, 1)
    ]
    # the same two starts
    starts = [xy(axes.lines[0]) for axes in panels]
    np.testing.assert_array_equal(starts[:2], starts[2:])
    assert (starts[0] != starts[1]).all()
    assert f"seed {seeds['my own']} of my own (n = 1)" in caption
    assert "fitness differ: GA." in caption
    assert legend_texts(figure)[1:3] == ["start", "robot at the end"]
    figure.savefig(tmp_path / "trajectories.svg")
    assert (tmp_path / "trajectories.svg").stat().st_size < 300_000


# all of them


def words_of(figure):
    """Everything that a reader can read in a figure."""
    ticks = [
        text.get_text()
        for axes in figure.axes
        for text in [*axes.get_xticklabels(), *axes.get_yticklabels()]
    ]
    titles = [axes.get_title() for axes in figure.axes]
    return "\n".join([*titles, *ticks, *legend_texts(figure)])


def test_every_experiment_is_in_every_figure(data, trajectories):
    # which need a table that evolution.margins writes
    others = {name: draw for name, draw in STUDY_FIGURES.items() if name != "margins"}
    for name, draw in others.items():
        figure, _ = trajectories if name == "trajectories" else drawn(draw(data))
        for who in ("DE/best/1/bin", "my own"):
            assert who in words_of(figure), name


def test_an_experiment_is_called_as_its_user_calls_it(data):
    assert [label(data, name) for name in data.configs] == [
        "DE/best/1/bin",
        "GA",
        "my own",
        "CMA-ES",
    ]
    # another population makes it another one than the shipped
    parameters: Any = data.configs["ga"].optimizer
    optimizer = replace(parameters, population=30)
    own = data.configs["ga"].model_copy(update={"optimizer": optimizer})
    assert experiment_label("ga", own) == "ga"
    # who spends less is not
    short = data.configs["ga"].model_copy(update={"evaluations": 150})
    assert experiment_label("ga", short) == "GA"
    # unless the name says so
    assert experiment_label("ga-150", short) == "GA, 150 evaluations"
    assert experiment_label("ga-200", short) == "ga-200"
    assert robot_name("/a/my_robot.xml") == "my_robot"


def test_looks_are_fixed_and_all_different():
    names = [*LOOKS, *(f"mine {i}" for i in range(12))]
    found = looks(names)
    assert {name: found[name] for name in LOOKS} == dict(LOOKS)
    drawn = [(look.color, look.dashes, look.marker) for look in found.values()]
    assert all(a != b for a, b in itertools.combinations(drawn, 2))


@pytest.mark.parametrize("yardstick", [True, False])
@pytest.mark.parametrize("robots", [ROBOTS, ("epuck",)])
@pytest.mark.parametrize("n_runs", [N_RUNS, {"my own": 1}, {"ga": 0, "de-best": 2}])
def test_every_study_has_its_figures(n_runs, robots, yardstick, monkeypatch):
    monkeypatch.setattr(
        "evolution.report.figures.STUDY_FIGURES",
        {name: draw for name, draw in STUDY_FIGURES.items() if name != "trajectories"},
    )
    data = a_study(n_runs, robots, yardstick)
    found = {name: caption for name, _, caption in drawn_figures(data)}
    # margins were not measured
    left_out = {"trajectories", "margins"} | ({"rungs"} if len(robots) < 2 else set())
    own = [f"fitness-{name}" for name, n in n_runs.items() if n]
    assert list(found) == own + [name for name in STUDY_FIGURES if name not in left_out]
    assert all(re.search(r"n = \d", caption) for caption in found.values())


def test_no_behaviour_in_older_runs(data):
    older = Scores(stored=1.0, held_out=dict.fromkeys(ROBOTS, a_test(1.0, {})))
    runs = {"ga": tuple(replace(run, scores=older) for run in data.runs["ga"])}
    assert (
        behaviour_figure(replace(data, configs={"ga": data.configs["ga"]}, runs=runs))
        is None
    )


def test_one_generation_is_enough(tmp_path, monkeypatch):
    monkeypatch.setattr(figure_files, "FORMATS", {"png": figure_files.FORMATS["png"]})
    run = a_run("ga", 1, evaluations=100)
    data = replace(a_study({"ga": 1}), runs={"ga": (run,)})
    growth = growth_figure(data, "ga")
    for figure, caption in (growth, growths_figure(data), targets_figure(data)):
        write_figure(figure, tmp_path, "short")
        assert imread(tmp_path / "short.png").shape[1] == 700
        assert "n = 1" in caption


def test_files_are_repeatable_small_and_sound(tmp_path):
    folders = [tmp_path / "a", tmp_path / "b"]
    n_runs = {"de-best": 12, "ga": 2}
    for folder in folders:
        folder.mkdir()
        data = a_study(n_runs)
        write_figure(growth_figure(data, "de-best")[0], folder, "fitness")
        write_figure(drawn(behaviour_figure(data))[0], folder, "behaviour")
    names = sorted(path.name for path in folders[0].iterdir())
    assert names == [
        f"{name}.{form}"
        for name in ("behaviour", "fitness")
        for form in ("pdf", "png", "svg")
    ]
    for name in names:
        first, second = ((folder / name).read_bytes() for folder in folders)
        assert first == second
        assert len(first) < 300_000
        if name.endswith("png"):
            assert imread(folders[0] / name).shape[1] in (700, 1400)
        # nothing that a new version or another day would change
        assert not re.search(rb"Matplotlib v|Software|20\d\d-\d\d-\d\d", first)


def test_a_folder_that_is_not_there_is_the_users_error(data, tmp_path):
    with pytest.raises(UserError, match=r"cannot write .*/a\.svg'"):
        write_figure(growth_figure(data, "ga")[0], tmp_path / "nowhere", "a")
