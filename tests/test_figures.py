"""Figures: what is drawn is what was measured; files are sound and repeatable."""

import dataclasses
import io

import mujoco
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.image import imread
from matplotlib.legend import Legend
from matplotlib.patches import Polygon

from epuck_mj.errors import UserError
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.outline import _outline, shell_outline, wall_outlines
from epuck_mj.scene.robot_parts import SHELL
from epuck_mj.show.figures import fitness_figure, trajectory_figure
from epuck_mj.show.pictures import save_figure
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.recorder import record

TASK = TaskParameters(steps=40)
EVALUATIONS = np.arange(1, 11) * 100


def straight_on(observation):
    action = np.zeros((*observation.shape[:-1], 2))
    action[..., 0] = 1.0
    return action


@pytest.fixture(scope="module")
def scene():
    return load_scene("epuck_kinematic", "arena", TASK.control_step)


@pytest.fixture(scope="module")
def trajectories(scene):
    free = record(scene, straight_on, np.array([-0.4, 0.1, 0.4]), TASK)
    crash = record(scene, straight_on, np.array([0.4, 0.1, 0.4]), TASK)
    assert (free.crashed, crash.crashed) == (False, True)
    return [free, crash]


def collections(axes, kind):
    return [found for found in axes.collections if isinstance(found, kind)]


def legend_texts(figure):
    return [
        text.get_text()
        for legend in figure.legends
        if isinstance(legend, Legend)
        for text in legend.get_texts()
    ]


def test_fitness_figure_shows_best_and_mean():
    best, mean = np.linspace(10, 200, 10), np.linspace(5, 150, 10)
    figure = fitness_figure(EVALUATIONS, best, mean, "DE", steps=250)
    (axes,) = figure.axes
    for line, values in zip(axes.lines, (best, mean), strict=True):
        np.testing.assert_array_equal(line.get_xdata(), EVALUATIONS)
        np.testing.assert_array_equal(line.get_ydata(), values)
    assert axes.get_ylim() == (0, 250)
    assert axes.get_xlim()[0] == 0
    assert axes.get_xlabel() == "individual evaluations"
    assert axes.get_ylabel() == "stored fitness (max 250)"
    assert axes.get_title() == "DE"
    # beside the curves, never on them
    assert axes.get_legend() is None
    assert legend_texts(figure) == ["best of the generation", "mean of the population"]


def test_a_climb_is_marked():
    best = np.linspace(10, 200, 10)
    figure = fitness_figure(EVALUATIONS, best, best, "DE", climbed=700)
    *_, mark = figure.axes[0].lines
    assert np.unique(mark.get_xdata()).tolist() == [700]
    assert legend_texts(figure)[-1] == "then on wheels"


def test_one_generation_is_enough(tmp_path):
    save_figure(fitness_figure([100], [3.0], [1.0], "short"), tmp_path / "a.png")


def test_trajectory_figure_shows_paths_walls_and_ends(scene, trajectories):
    figure = trajectory_figure(scene, trajectories, TASK, ["free", "crash"])
    *panels, bar = figure.axes
    assert bar.get_ylabel() == "step fitness (product)"
    assert [axes.get_title() for axes in panels] == ["free", "crash"]
    assert legend_texts(figure) == ["start", "robot at the end", "crash"]
    for axes, trajectory in zip(panels, trajectories, strict=True):
        (path,) = collections(axes, LineCollection)
        points = trajectory.pose[:, :2]
        segments = np.stack([points[:-1], points[1:]], axis=1)
        np.testing.assert_array_equal(path.get_segments(), segments)
        np.testing.assert_array_equal(path.get_array(), trajectory.fitness)
        assert (path.norm.vmin, path.norm.vmax) == (0, 1)
        assert axes.get_aspect() == 1
        (walls,) = collections(axes, PolyCollection)
        assert len(walls.get_paths()) == 4
        (body,) = axes.patches
        assert isinstance(body, Polygon)
        center = body.get_xy()[:-1].mean(axis=0)
        np.testing.assert_allclose(center, trajectory.pose[-1, :2], atol=1e-9)
        crosses = [line for line in axes.lines if line.get_marker() == "x"]
        assert len(crosses) == trajectory.crashed


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
def test_any_number_of_panels(scene, trajectories, n):
    figure = trajectory_figure(scene, trajectories[:1] * n, TASK, ["a"] * n)
    assert len(figure.axes) == n + 1


def test_titles_and_trajectories_must_match(scene, trajectories):
    for some, titles in [([], []), (trajectories, ["one"])]:
        with pytest.raises(ValueError, match="one title per trajectory"):
            trajectory_figure(scene, some, TASK, titles)


def test_outlines_of_the_shipped_arena_and_robot(scene):
    walls = np.concatenate(wall_outlines(scene))
    inner = np.abs(walls).max(axis=1).min()
    assert 0.4 < inner < np.abs(walls).max() < 0.6
    radius = np.linalg.norm(shell_outline(scene), axis=1)
    np.testing.assert_allclose(radius, scene.model.geom(SHELL).size[0], rtol=1e-9)


SHAPES = """
<mujoco>
  <asset><mesh name="cube" vertex="0 0 0 1 0 0 0 2 0 1 2 0 0 0 3 1 0 3 0 2 3 1 2 3"/>
  </asset>
  <worldbody>
    <geom type="box" size="1 2 3" euler="10 20 30" pos="1 2 3"/>
    <geom type="sphere" size="0.5" pos="-1 0 0"/>
    <geom type="ellipsoid" size="0.5 1 2" euler="40 50 60"/>
    <geom type="capsule" size="0.5 1" euler="40 50 60"/>
    <geom type="cylinder" size="0.5 1" euler="40 50 60"/>
    <geom type="cylinder" size="0.5 1" euler="90 0 0"/>
    <geom type="mesh" mesh="cube" euler="10 20 30"/>
  </worldbody>
</mujoco>
"""


def surface(model, geom, rng):
    """Oracle: many points of a geom, in its own frame."""
    sphere = rng.normal(size=(20000, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    size, cube = model.geom_size[geom], np.sign(rng.uniform(-1, 1, (20000, 3)))
    match mujoco.mjtGeom(model.geom_type[geom]):
        case mujoco.mjtGeom.mjGEOM_BOX:
            return size * cube
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return size[0] * sphere
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return size * sphere
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return size[0] * sphere + cube * [0, 0, size[1]]
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            angle = rng.uniform(0, 2 * np.pi, 20000)
            rim = size[0] * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
            return rim + cube * [0, 0, size[1]]
        case _:
            return model.mesh_vert


def test_outlines_reach_as_far_as_the_shape_in_every_direction():
    model = mujoco.MjModel.from_xml_string(SHAPES)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    directions = np.stack([np.cos(angle), np.sin(angle)])
    for geom in range(model.ngeom):
        position = data.geom_xpos[geom]
        rotation = data.geom_xmat[geom].reshape(3, 3)
        points = surface(model, geom, np.random.default_rng(geom)) @ rotation.T
        reach = ((points + position)[:, :2] @ directions).max(axis=0)
        outline = _outline(model, geom, position, rotation)
        np.testing.assert_allclose(
            (outline @ directions).max(axis=0), reach, atol=0.01, err_msg=str(geom)
        )


def test_files_are_repeatable_and_complete(scene, trajectories, tmp_path):
    paths = [tmp_path / "a.png", tmp_path / "b.png"]
    for path in paths:
        save_figure(trajectory_figure(scene, trajectories, TASK, ["a", "b"]), path)
    first, second = (path.read_bytes() for path in paths)
    assert first == second
    assert b"Software" not in first
    assert sorted(tmp_path.iterdir()) == paths
    height, width, _ = imread(paths[0]).shape
    figure = trajectory_figure(scene, trajectories, TASK, ["a", "b"])
    np.testing.assert_allclose((width, height), figure.get_size_inches() * 150, atol=1)


def test_a_folder_that_is_not_there_is_the_users_error(tmp_path):
    figure = fitness_figure([1], [1], [1], "")
    with pytest.raises(UserError, match="cannot write"):
        save_figure(figure, tmp_path / "nowhere" / "a.png")


def test_literal_fitness_is_named(scene, trajectories):
    task = dataclasses.replace(TASK, fitness="literal")
    figure = trajectory_figure(scene, trajectories, task, ["a", "b"])
    assert figure.axes[-1].get_ylabel() == "step fitness (literal)"


def test_the_legend_of_a_run_that_climbed_is_whole():
    figure = fitness_figure([10, 20, 30], [1, 2, 3], [0, 1, 2], "a run", climbed=20)
    figure.savefig(io.BytesIO(), format="png")
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.x1
