"""Pictures in 3D: what MuJoCo draws without a window."""

import ctypes.util
import types
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread

from epuck_mj.errors import UserError
from epuck_mj.scene.model import load_scene
from epuck_mj.show import render
from epuck_mj.show import still as still_picture
from epuck_mj.show.colors import HIGH_FITNESS, LOW_FITNESS, TRIALS, VERMILION
from epuck_mj.show.pictures import save_below, save_figure
from epuck_mj.show.rays import FREE_COLOR, ray_lines
from epuck_mj.show.render import painter
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.recorder import record

TASK = TaskParameters(steps=40)
SIZE = (300, 200)

needs_opengl = pytest.mark.skipif(
    not (ctypes.util.find_library("EGL") or ctypes.util.find_library("OSMesa")),
    reason="no library of EGL or OSMesa to draw with",
)


def ahead(observation):
    """Full speed straight on."""
    return np.broadcast_to([1.0, 0.0], (*observation.shape[:-1], 2)).copy()


def still(observation):
    """Stays where it is."""
    return np.zeros((*observation.shape[:-1], 2))


@pytest.fixture(scope="module")
def scene():
    return load_scene("epuck", "arena", TASK.control_step)


@pytest.fixture(scope="module")
def trajectory(scene):
    trajectory = record(scene, ahead, np.array([-0.3, 0.0, 0.0]), TASK)
    return replace(trajectory, fitness=np.ones(TASK.steps))


@pytest.fixture(scope="module")
def other(scene):
    return record(scene, ahead, np.array([-0.3, 0.3, 0.0]), TASK)


def hue(picture, color):
    """Which pixels have a hue within 8 degrees of a colour's, and are no grey."""

    def chroma(rgb):
        r, g, b = np.moveaxis(np.asarray(rgb, float), -1, 0)
        return r - (g + b) / 2 + 1j * np.sqrt(3) / 2 * (g - b)

    wanted, got = chroma(color), chroma(picture)
    apart = np.abs(np.angle(got * np.conj(wanted)))
    return (np.abs(got) > 60) & (apart < np.radians(8))


def x_of(mask):
    """Mean column of what a mask shows [pixels]."""
    return np.nonzero(mask)[1].mean()


@needs_opengl
def test_a_picture_has_its_size_and_shows_the_arena(scene, trajectory):
    with painter(scene, [trajectory], *SIZE) as artist:
        picture = artist.picture()
    assert (picture.shape, picture.dtype) == ((200, 300, 3), np.uint8)
    # nothing but sky reaches the edges, and the floor fills the middle
    background = picture[0, 0].astype(int)
    edges = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
    np.testing.assert_allclose(edges, np.tile(background, (1000, 1)), atol=60)
    shown = np.abs(picture - background).max(axis=-1) > 30
    assert not shown[0].any()
    assert 0.3 < shown.mean() < 0.95
    # tiles of two colours
    assert shown[80:120, 120:180].mean() > 0.3


@needs_opengl
def test_an_arena_without_light_and_sky_is_on_white(tmp_path):
    walls = "".join(
        f'<geom type="box" pos="{x} {y} 0.05" size="{a} {b} 0.05"/>'
        for x, y, a, b in [
            (0.3, 0, 0.01, 0.3),
            (-0.3, 0, 0.01, 0.3),
            (0, 0.3, 0.3, 0.01),
            (0, -0.3, 0.3, 0.01),
        ]
    )
    arena = tmp_path / "bare.xml"
    floor = '<geom type="plane" size="0.3 0.3 1"/>'
    arena.write_text(f"<mujoco><worldbody>{floor}{walls}</worldbody></mujoco>")
    scene = load_scene("epuck", str(arena), TASK.control_step)
    trajectory = record(scene, ahead, np.zeros(3), TASK)
    with painter(scene, [trajectory], *SIZE) as artist:
        picture = artist.picture()
    assert (picture[:5] == 255).all()
    # its walls and the robot are no silhouettes
    assert np.ptp(picture[picture.max(axis=-1) < 255]) > 50
    assert hue(picture, HIGH_FITNESS).sum() + hue(picture, LOW_FITNESS).sum() > 20


@needs_opengl
@pytest.mark.parametrize(
    ("fitness", "color"), [(0.0, LOW_FITNESS), (1.0, HIGH_FITNESS)]
)
def test_a_path_has_the_colour_of_its_fitness(scene, trajectory, fitness, color):
    worth = replace(trajectory, fitness=np.full(trajectory.steps, fitness))
    with painter(scene, [worth], *SIZE) as artist:
        picture, start = artist.picture(), artist.picture(0)
    low, high = (int(hue(picture, each).sum()) for each in (LOW_FITNESS, HIGH_FITNESS))
    before = int(hue(start, color).sum())
    assert (high if fitness else low) > before + 40
    assert (low if fitness else high) < 40


@needs_opengl
def test_the_robot_is_where_it_was_at_that_time(scene, trajectory):
    with painter(scene, [trajectory], *SIZE) as artist:
        first, half, last = (artist.picture(time) for time in (0, 2.05, 4.0))
        again = artist.picture(2.05)
        np.testing.assert_array_equal(artist.picture(99), last)
    np.testing.assert_array_equal(half, again)
    trajectory_time = trajectory.time[-1]
    assert trajectory_time == pytest.approx(4.0)
    # to the right, and leaving more path behind
    drawn = [hue(each, HIGH_FITNESS) for each in (first, half, last)]
    lengths = [int(each.sum()) for each in drawn]
    assert lengths[0] < lengths[1] < lengths[2]
    changed = [np.ptp(each - first.astype(int), axis=-1) > 0 for each in (half, last)]
    reach = [np.nonzero(each)[1].max() for each in changed]
    assert reach[0] + 5 < reach[1]


@needs_opengl
def test_several_robots_have_marks_in_their_colours(scene, trajectory, other):
    with painter(scene, [trajectory], *SIZE) as artist:
        alone = artist.picture(0)
    with painter(scene, [trajectory, other], *SIZE) as artist:
        both, later = artist.picture(0), artist.picture(3.0)
    added = np.abs(both.astype(int) - alone).max(axis=-1) > 0
    first, second = (added & hue(both, color) for color in TRIALS[:2])
    assert first.sum() > 5
    assert second.sum() > 5
    # what is farther back in the arena is higher up in the picture
    assert np.nonzero(first)[0].mean() > np.nonzero(second)[0].mean() + 20
    moved = np.abs(later.astype(int) - both).max(axis=-1) > 0
    assert x_of(moved & hue(later, TRIALS[1])) > x_of(second) + 10


@needs_opengl
def test_a_draft_shows_the_same_but_rougher(scene, trajectory):
    pictures = []
    for draft in (False, True):
        with painter(scene, [trajectory], *SIZE, draft=draft) as artist:
            pictures.append(artist.picture().astype(int))
    fine, rough = pictures
    assert (fine != rough).any()
    assert np.abs(fine - rough).mean() < 5


@needs_opengl
def test_painting_leaves_the_scene_alone(scene, trajectory):
    before = scene.model.geom_group.copy(), scene.model.vis.quality.shadowsize
    with painter(scene, [trajectory], *SIZE, draft=True) as artist:
        artist.picture()
    np.testing.assert_array_equal(scene.model.geom_group, before[0])
    assert scene.model.vis.quality.shadowsize == before[1]


@needs_opengl
def test_a_trial_without_steps_can_be_drawn(scene):
    trajectory = record(scene, still, np.zeros(3), TaskParameters(steps=1))
    with painter(scene, [trajectory] * 2, *SIZE) as artist:
        assert artist.picture().std() > 10


@needs_opengl
def test_a_close_up_shows_the_rays_in_their_colours(scene):
    orange = []
    # 5 mm from a wall, and in the very middle
    for x in (0.46, 0.0):
        once = TaskParameters(steps=1)
        trajectory = record(scene, still, np.array([x, 0.0, np.pi / 2]), once)
        with painter(scene, [trajectory], *SIZE) as artist:
            before = artist.picture()
            orange.append(hue(artist.close_up(0.04), VERMILION).sum())
            np.testing.assert_array_equal(artist.picture(), before)
    assert orange[0] > orange[1] + 20


def test_rays_end_where_something_is_or_the_range_ends(scene):
    trajectory = record(scene, ahead, np.array([0.4, 0.0, 0.0]), TASK)
    lines, colors = ray_lines(scene, trajectory, 0.04)
    assert lines.shape == (trajectory.steps + 1, 8, 2, 3)
    length = np.linalg.norm(lines[:, :, 1] - lines[:, :, 0], axis=-1)
    hit = (trajectory.distance >= 0) & (trajectory.distance < 0.04)
    assert hit.any() and not hit.all()
    np.testing.assert_allclose(length, np.where(hit, trajectory.distance, 0.04))
    np.testing.assert_array_equal(colors[0, ~hit[0]], np.full((8, 3), FREE_COLOR))


@needs_opengl
def test_a_still_has_its_size_and_a_legend(scene, trajectory, other, tmp_path):
    for trajectories in ([trajectory], [trajectory, other]):
        figure = still_picture.still(scene, trajectories, 0.04, (600, 400))
        save_figure(figure, tmp_path / "a.png", still_picture.DPI)
        pixels = imread(tmp_path / "a.png")
        assert pixels.shape[:2] == (400, 600)
        save_below((tmp_path / "a.png").read_bytes(), 50, tmp_path / "b.png")
        np.testing.assert_array_equal(imread(tmp_path / "b.png"), pixels[50:])
        labels = {axes.get_xlabel() for axes in figure.axes} - {""}
        assert labels == {"path: step fitness", "rays: distance seen [cm]"}


def test_without_opengl_one_line_says_what_is_missing(scene, trajectory, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    monkeypatch.setattr(render, "find_library", lambda name: None)
    with (
        pytest.raises(UserError, match="no OpenGL") as error,
        painter(scene, [trajectory], *SIZE),
    ):
        pass
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["egl", "osmesa"])
@pytest.mark.parametrize("fails", ["import_module", "GLContext"])
def test_an_opengl_that_does_not_work_is_one_line(name, fails, monkeypatch):
    def missing(*arguments):
        raise OSError("no\nsuch library")

    library = types.SimpleNamespace(GLContext=missing)
    importing = missing if fails == "import_module" else lambda module: library
    monkeypatch.setenv("MUJOCO_GL", name)
    monkeypatch.setattr(render.importlib, "import_module", importing)
    with pytest.raises(UserError) as error, render.opengl(10, 10):
        pass
    other = {"egl": "osmesa", "osmesa": "egl"}[name]
    message = str(error.value)
    assert message.startswith(f"cannot draw with MUJOCO_GL={name} (no such library)")
    assert message.endswith(f"or MUJOCO_GL={other}")
