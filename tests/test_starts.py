"""Starts: free, inside, everywhere, and the same for the same seed."""

import mujoco
import numpy as np
import pytest
import scipy.stats

from epuck_mj.constants import BODY_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.host.limits import LIMITS
from epuck_mj.rungs.table import RUNGS
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace, survey

CLEARANCE = 0.01


def arena(tmp_path, *geoms: str, name: str = "arena.xml") -> str:
    floor = '<geom type="plane" size="2 2 1" contype="2" conaffinity="2"/>'
    path = tmp_path / name
    path.write_text(
        f'<mujoco><option timestep="0.01"/><worldbody>{floor}{"".join(geoms)}'
        "</worldbody></mujoco>"
    )
    return str(path)


def wall(x: float, y: float, half_x: float, half_y: float) -> str:
    return f'<geom type="box" pos="{x} {y} 0.03" size="{half_x} {half_y} 0.03"/>'


def room(half: float = 0.5) -> list[str]:
    """Four walls around a square."""
    return [
        wall(half + 0.01, 0, 0.01, half + 0.02),
        wall(-half - 0.01, 0, 0.01, half + 0.02),
        wall(0, half + 0.01, half, 0.01),
        wall(0, -half - 0.01, half, 0.01),
    ]


def sample(robot: str, path: str, n: int = 500, seed: int = 0) -> np.ndarray:
    space = FreeSpace(load_scene(robot, path), CLEARANCE)
    return space.sample(np.random.default_rng(seed), n)


def test_the_square_is_filled_evenly(scene):
    starts = FreeSpace(scene, CLEARANCE).sample(np.random.default_rng(0), 4000)
    reach = 0.5 - BODY_RADIUS - CLEARANCE
    for values, end in zip(starts.T, (reach, reach, np.pi), strict=True):
        assert np.abs(values).max() <= end + 1e-6
        uniform = scipy.stats.uniform(-end, 2 * end)
        assert scipy.stats.kstest(values, uniform.cdf).pvalue > 0.01


def test_spread_starts_are_more_even_than_random_ones(scene):
    """Means over 200 of them are nearer to the means over all starts."""
    space, reach = FreeSpace(scene, CLEARANCE), 0.5 - BODY_RADIUS - CLEARANCE

    def errors(draw) -> np.ndarray:
        each = np.array([draw(np.random.default_rng(i), 200) for i in seeds])
        x, y, yaw = np.moveaxis(each, 2, 0)
        # way to the nearest wall, and to the wall at x = reach straight ahead
        nearest = reach - np.maximum(abs(x), abs(y))
        facing = np.where(abs(yaw) < np.pi / 3, reach - x, 0)
        off = [np.mean(nearest, 1) - reach / 3, np.mean(facing, 1) - reach / 3]
        return np.sqrt(np.mean(np.square(off), 1))

    seeds = range(20)
    assert (errors(space.spread) < 0.5 * errors(space.sample)).all()


def test_a_longer_list_of_spread_starts_begins_with_the_shorter(scene):
    space = FreeSpace(scene, CLEARANCE)
    long, short = (space.spread(np.random.default_rng(5), n) for n in (300, 70))
    np.testing.assert_array_equal(long[:70], short)
    assert not np.array_equal(short, space.spread(np.random.default_rng(6), 70))


@pytest.mark.parametrize("draw", [FreeSpace.sample, FreeSpace.spread])
def test_no_start_touches_anything(scene, draw):
    """MuJoCo's own distance from the shell to each wall, one by one."""
    starts = draw(FreeSpace(scene, CLEARANCE), np.random.default_rng(1), 200)
    model, data = scene.model, mujoco.MjData(scene.model)
    walls = [g for g in range(model.ngeom) if model.geom(g).name.startswith("wall")]
    shell = model.geom("epuck/shell").id
    for start in starts:
        data.qpos[:] = scene.qpos(start)
        mujoco.mj_kinematics(model, data)
        distances = [
            mujoco.mj_geomDistance(model, data, shell, g, 1, None) for g in walls
        ]
        assert min(distances) >= CLEARANCE - 1e-6


def test_seed_decides_and_a_longer_list_begins_with_the_shorter(scene):
    space = FreeSpace(scene, CLEARANCE)
    long = space.sample(np.random.default_rng(5), 100)
    short = space.sample(np.random.default_rng(5), 7)
    np.testing.assert_array_equal(long[:7], short)
    other = space.sample(np.random.default_rng(6), 7)
    assert not np.array_equal(short, other)


def test_each_rung_gets_the_same_starts():
    first, *others = (sample(robot, "arena") for robot in RUNGS)
    for other in others:
        np.testing.assert_array_equal(first, other)


def test_an_l_shape_is_filled_and_never_left(tmp_path):
    """The bounding box has a quarter that lies outside."""
    path = arena(
        tmp_path,
        wall(-0.51, 0, 0.01, 0.52),
        wall(0, -0.51, 0.52, 0.01),
        wall(0.51, -0.25, 0.01, 0.26),
        wall(-0.25, 0.51, 0.26, 0.01),
        wall(0.25, 0.01, 0.26, 0.01),
        wall(0.01, 0.25, 0.01, 0.26),
    )
    starts = sample("epuck", path, 2000)
    x, y = starts[:, 0], starts[:, 1]
    assert not ((x > 0) & (y > 0)).any()
    shares = [((x < 0) & (y > 0)).mean(), ((x < 0) & (y < 0)).mean()]
    assert min(*shares, ((x > 0) & (y < 0)).mean()) > 0.25


def test_pillars_and_round_walls_are_kept_clear_of(tmp_path):
    pillar = '<geom type="cylinder" pos="0.1 0.1 0.03" size="0.08 0.03"/>'
    starts = sample("epuck", arena(tmp_path, *room(), pillar), 2000)
    gap = np.hypot(starts[:, 0] - 0.1, starts[:, 1] - 0.1) - 0.08 - BODY_RADIUS
    assert CLEARANCE - 1e-6 <= gap.min() < CLEARANCE + 0.01


def test_a_room_within_walls_only(tmp_path):
    """A closed box in the middle is outside for a robot too big for it."""
    inner = [wall(0, 0.05, 0.05, 0.01), wall(0, -0.05, 0.05, 0.01)]
    inner += [wall(0.05, 0, 0.01, 0.05), wall(-0.05, 0, 0.01, 0.05)]
    starts = sample("epuck", arena(tmp_path, *room(), *inner))
    assert np.abs(starts[:, :2]).max(axis=1).min() > 0.06


@pytest.mark.parametrize(
    ("geoms", "expected"),
    [
        ([], "has no walls"),
        (room(0.04), "has no room for a start"),
        (room()[:3], "has no room for a start"),
        (['<geom type="box" size="9 9 9" contype="4" conaffinity="4"/>'], "no walls"),
    ],
)
def test_arenas_without_a_place_are_refused(tmp_path, geoms, expected):
    scene = load_scene("epuck", arena(tmp_path, *geoms))
    with pytest.raises(UserError, match=expected):
        FreeSpace(scene, CLEARANCE)


def test_scenes_that_are_compiled_alike_are_surveyed_once(tmp_path):
    path = arena(tmp_path, *room())
    first = survey(load_scene("epuck", path), CLEARANCE)
    assert survey(load_scene("epuck", path), CLEARANCE) is first
    assert survey(load_scene("epuck", path), 0.02) is not first
    # a wall moves in the file, or in the model itself
    arena(tmp_path, *room(0.4))
    edited = load_scene("epuck", path)
    smaller = survey(edited, CLEARANCE)
    assert smaller.inside.sum() < 0.8 * first.inside.sum()
    edited.model.geom_pos[edited.model.ngeom - 1, 0] += 0.1
    assert survey(edited, CLEARANCE) is not smaller


def test_as_many_starts_as_are_allowed_are_found(kinematic):
    """Not only those that a fixed number of candidates holds."""
    n = int(LIMITS["starts"].most)
    starts = FreeSpace(kinematic, 0.01).sample(np.random.default_rng(0), n)
    assert starts.shape == (n, 3)
