"""Margins: champions on robots that differ in one number."""

import numpy as np
import pytest

from epuck_mj.constants import BODY_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.policies.network import Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.kinematic.plan import plan_of
from epuck_mj.rungs.kinematic.whole_trial import FITNESS
from epuck_mj.rungs.late import with_late_commands
from epuck_mj.rungs.table import robots_in
from epuck_mj.scene.changed_robots import (
    with_body_margin,
    with_body_radius,
    with_sensors_set_back,
)
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.robot_parts import SHELL
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.control import TaskParameters, run_trials
from evolution.judging.evaluation import BatchEngine, Work, evaluate
from evolution.judging.held_out import Judges
from evolution.judging.held_out_starts import starts_for_validation
from evolution.judging.scores import read_champion
from evolution.margins.__main__ import measure_margins
from evolution.margins.changes import CHANGES
from evolution.margins.margins_table import (
    FILE,
    Margins,
    read_margins,
    rows_of,
    write_margins,
)
from evolution.margins.measuring import Margin, margins_of_genomes, margins_of_policy
from evolution.report.figures.margins import margins_figure
from evolution.run.directory import RunDirectory
from evolution.run.execution import Run
from evolution.run.generation_loop import Evolution
from evolution.run.means import Means
from evolution.settings.config_files import find_config, load_config
from evolution.settings.setting import Setting
from tests.no_pictures import draw_nothing

ROBOT = "epuck_kinematic"


@pytest.fixture(scope="module")
def square():
    return load_scene(ROBOT, "arena")


def some(n: int) -> np.ndarray:
    return np.random.default_rng(3).uniform(-5, 5, (n, Network().n_genes))


# changed robots


def test_another_radius_changes_the_shell_and_nothing_else(square):
    changed = with_body_radius(square, 0.037)
    before, after = (plan_of(each, 0.04, 0.1) for each in (square, changed))
    assert after.body == before.body._replace(shell=0.037)
    np.testing.assert_array_equal(after.rays, before.rays)
    # the scene itself is as it was
    assert square.model.geom_size[square.model.geom(SHELL).id, 0] == BODY_RADIUS


def test_a_margin_widens_the_body_on_every_robot(scene):
    wider = with_body_margin(scene, 0.0005)
    shell = wider.model.geom(SHELL)
    np.testing.assert_allclose(shell.size[0], BODY_RADIUS + 0.0005)
    assert with_body_margin(scene, 0.0) is scene
    # as heavy as before
    np.testing.assert_array_equal(wider.model.body_mass, scene.model.body_mass)


def test_champions_keep_off_walls_by_the_margin_of_their_bodies():
    config = load_config(find_config("de-best")).model_copy(
        update={"body_margin": 0.002, "climb": 0.5, "evaluations": 900, "steps": 20}
        | {"trials": 1}
    )
    evolution = Evolution(config, threads=1)
    # what is tested is the robot itself
    assert evolution.scene.model.geom(SHELL).size[0] == BODY_RADIUS
    list(evolution.run())
    assert evolution.climbed
    again = Evolution(config.model_copy(update={"body_margin": 0.0}), threads=1)
    list(again.run())
    assert again.history() != evolution.history()


def test_a_champion_is_chosen_with_the_margin_and_tested_without(tmp_path, monkeypatch):
    draw_nothing(monkeypatch)
    config = load_config(find_config("de-best")).model_copy(
        update={
            "body_margin": 0.005,
            "climb": 1.0,
            "finalists": 0,
            "evaluations": 900,
            "steps": 100,
            "validation_starts": 20,
            "test_starts": 30,
        }
    )
    run = Run(config, RunDirectory(tmp_path / "run"), Means(threads=1), [])
    run.start()
    for _ in run.evolve():
        pass
    scores = run.finish()
    judge = Judges(1).of("epuck_kinematic", config.setting)
    champion, _ = read_champion(tmp_path / "run" / "champion.json")
    test = judge.test(champion.controller, 30)
    assert scores.held_out["epuck_kinematic"].mean == test.mean
    wider = with_body_margin(judge.scene, 0.005)
    starts = starts_for_validation(FreeSpace(judge.scene, 0.01), 1000)
    engine = BatchEngine(wider, config.task, 1)
    genome = champion.genome[None]
    again = evaluate(engine, config.topology, genome, starts).fitness[0]
    assert scores.validation == pytest.approx(again, abs=1e-9)


def test_sensors_are_set_back_along_their_rays(square):
    changed = with_sensors_set_back(square, 0.002)
    before, after = (plan_of(each, 0.04, 0.1) for each in (square, changed))
    assert after.body == before.body
    np.testing.assert_allclose(after.rays[2:], before.rays[2:])
    np.testing.assert_allclose(
        after.rays[:2], before.rays[:2] - 0.002 * before.rays[2:]
    )


def test_what_is_set_back_sees_everything_that_much_later(square):
    starts = np.array([[0.455, 0.0, 0.0], [0.0, 0.45, 1.0], [0.2, -0.46, -2.0]])
    seen = [
        robots_in(scene, 3, 1).reset(starts).distance
        for scene in (square, with_sensors_set_back(square, 0.002))
    ]
    hit = (seen[0] > 0) & (seen[0] < 0.1)
    assert hit.sum() > 3
    np.testing.assert_allclose(seen[1][hit], seen[0][hit] + 0.002, atol=1e-12)


@pytest.mark.parametrize("late", [0, 1, 3])
@pytest.mark.parametrize("fitness", FITNESS)
def test_late_commands_have_the_same_bits_compiled_and_step_by_step(
    square, late, fitness
):
    task, n = TaskParameters(steps=60, fitness=fitness), 30
    starts = FreeSpace(square, 0.01).sample(np.random.default_rng(0), n)
    policy = Network().decode(some(n))
    compiled = BatchEngine(square, task, 2, late).run(Work(policy, starts))
    robots = with_late_commands(robots_in(square, n, 1), late)
    slow = run_trials(robots, policy, starts, task)
    for name in ("fitness", "steps", "crashed"):
        np.testing.assert_array_equal(getattr(compiled, name), getattr(slow, name))
    assert compiled.fitness.max() > 1


def test_a_late_robot_first_stands_still_and_then_does_as_it_was_told(square):
    commands = np.random.default_rng(1).uniform(0, 6, (7, 2, 2))
    starts = np.array([[0.0, 0.0, 0.0], [0.1, 0.1, 2.0]])
    late = with_late_commands(robots_in(square, 2, 1), 2)
    late.reset(starts)
    poses = []
    for command in commands:
        late.step(command)
        poses.append(late.poses().copy())
    np.testing.assert_array_equal(poses[1], starts)
    prompt = robots_in(square, 2, 1)
    prompt.reset(starts)
    for k, command in enumerate(commands[:-2]):
        prompt.step(command)
        np.testing.assert_array_equal(prompt.poses(), poses[k + 2])


# measuring


def test_the_unchanged_robot_earns_what_it_always_earns(square):
    task, genomes = TaskParameters(steps=80), some(6)
    found = list(
        margins_of_genomes(Setting("arena", task, 0.01), Network(), genomes, 40)
    )
    assert [(each.change, each.amount) for each in found] == [
        (name, amount) for name, change in CHANGES.items() for amount in change.amounts
    ]
    own = [each for each in found if each.amount == CHANGES[each.change].own]
    assert len(own) == 3
    for each in own:
        np.testing.assert_array_equal(each.fitness, own[0].fitness)
        np.testing.assert_array_equal(each.crash_rate, own[0].crash_rate)
    changed = [each for each in found if each.change == "body_radius"]
    # whoever is wider touches sooner
    crashes = np.array([each.crash_rate for each in changed])
    assert (np.diff(crashes, axis=0) >= 0).all()
    assert crashes[-1].sum() > crashes[0].sum()


def test_the_hand_written_follower_is_measured_alike():
    setting = Setting("arena", TaskParameters(steps=300), 0.01)
    found = list(margins_of_policy(setting, WallFollower(), 30))
    crashes = {(each.change, each.amount): each.crash_rate.item() for each in found}
    assert crashes["body_radius", 35] == 0
    # it keeps 8 mm, and a wider body by 3 mm is too much for it
    assert crashes["body_radius", 38] > 0.5
    assert all(each.fitness.shape == (1,) for each in found)


# table and figure


def margins() -> list[Margin]:
    rng = np.random.default_rng(0)
    return [
        Margin(name, amount, rng.uniform(0, 300, 4), rng.uniform(0, 1, 4))
        for name, change in CHANGES.items()
        for amount in change.amounts
    ]


def written(path) -> Margins:
    parts = [rows_of("ga", [1, 2, 5, 9], each) for each in margins()]
    write_margins(path, parts)
    found = read_margins(path)
    assert found is not None
    return found


def test_a_table_reads_back_exactly(tmp_path):
    found = written(tmp_path / FILE)
    assert found.experiments == ["ga"]
    for name in CHANGES:
        expected = [each for each in margins() if each.change == name]
        for (amount, fitness, crashes), each in zip(
            found.of("ga", name), expected, strict=True
        ):
            assert amount == each.amount
            np.testing.assert_array_equal(fitness, each.fitness)
            np.testing.assert_array_equal(crashes, each.crash_rate)
    before = (tmp_path / FILE).read_bytes()
    written(tmp_path / FILE)
    assert (tmp_path / FILE).read_bytes() == before


def test_what_is_no_table_is_refused(tmp_path):
    assert read_margins(tmp_path / FILE) is None
    (tmp_path / FILE).write_text("experiment,seed\n")
    with pytest.raises(UserError, match=r"cannot read '.*margins.parquet': "):
        read_margins(tmp_path / FILE)


def test_the_figure_has_a_line_for_each_experiment_and_change(tmp_path):
    figure = margins_figure(written(tmp_path / FILE), {"ga": "GA"}, 300)
    assert len(figure.axes) == 2 * len(CHANGES)
    upper, lower = figure.axes[: len(CHANGES)], figure.axes[len(CHANGES) :]
    for above, below, (name, change) in zip(upper, lower, CHANGES.items(), strict=True):
        own = [each for each in margins() if each.change == name]
        for axes, values in (
            (above, [np.median(each.fitness) for each in own]),
            (below, [np.median(each.crash_rate) for each in own]),
        ):
            line = axes.lines[0]
            np.testing.assert_array_equal(line.get_xdata(), change.amounts)
            np.testing.assert_array_equal(line.get_ydata(), values)


def test_the_command_refuses_what_it_cannot_do(tmp_path):
    with pytest.raises(UserError, match="is not a study"):
        measure_margins([str(tmp_path)])
    with pytest.raises(UserError, match="--starts: expected a whole number from 2"):
        measure_margins([str(tmp_path), "--starts", "1"])
