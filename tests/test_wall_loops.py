"""Wall loops: their lengths by hand, laps by angle, ways that are none."""

import numpy as np
import pytest

from epuck_mj.constants import BODY_RADIUS, PROXIMITY_RANGE
from epuck_mj.errors import UserError
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.wall_loops import (
    ABSENCE_MAX,
    LOOP_CLEARANCE,
    WallLoops,
    wall_loops,
    way_driven,
)

AXIS = BODY_RADIUS + LOOP_CLEARANCE
"""From a wall to its loop [m]."""

SQUARE_LENGTH = 8 * (0.5 - AXIS)
"""Of the loop in the paper's arena [m]: 3.56."""

GRID = 0.005
"""By how much a loop may be shorter, relatively: the grid cuts its corners."""


def arena(tmp_path, *geoms: str) -> str:
    floor = '<geom type="plane" size="2 2 1" contype="2" conaffinity="2"/>'
    path = tmp_path / "arena.xml"
    path.write_text(
        f'<mujoco><option timestep="0.01"/><worldbody>{floor}{"".join(geoms)}'
        "</worldbody></mujoco>"
    )
    return str(path)


def wall(x: float, y: float, half_x: float, half_y: float, degrees: float = 0) -> str:
    return (
        f'<geom type="box" pos="{x} {y} 0.03" size="{half_x} {half_y} 0.03" '
        f'euler="0 0 {degrees}"/>'
    )


def room(half: float = 0.5) -> list[str]:
    """Four walls around a square."""
    return [
        wall(half + 0.01, 0, 0.01, half + 0.02),
        wall(-half - 0.01, 0, 0.01, half + 0.02),
        wall(0, half + 0.01, half, 0.01),
        wall(0, -half - 0.01, half, 0.01),
    ]


def pillar(x: float, y: float, radius: float) -> str:
    return f'<geom type="cylinder" pos="{x} {y} 0.03" size="{radius} 0.03"/>'


def loops_of(path: str) -> tuple[WallLoops, ClearanceProbe]:
    scene = load_scene("epuck", path)
    probe = ClearanceProbe(scene)
    return wall_loops(scene), probe


@pytest.fixture(scope="module")
def square() -> WallLoops:
    return loops_of("arena")[0]


def on_square(way: np.ndarray, clearance: float) -> np.ndarray:
    """Poses `(rows, 3)` on a square at a clearance, at ways of that square's sides.

    Way 0 is the middle of the east side, 8 is once round; yaw is 0.
    """
    half = 0.5 - BODY_RADIUS - clearance
    corner = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1]])
    corner = np.concatenate([corner, [[1, -1], [1, 0]]])
    xy = [np.interp(way % 8, np.arange(9), half * axis) for axis in corner.T]
    return np.stack([*xy, np.zeros(way.size)], axis=1)


def progress(loops: WallLoops, *poses: np.ndarray, near: bool = True):
    """Progress of robots that are near a wall all the time, or never."""
    batch = np.array(poses)
    return loops.progress(batch, np.full(batch.shape[:2], near))


def test_in_the_square_there_is_one_along_the_walls(square):
    assert square.length.shape == (1,)
    assert square.length[0] == pytest.approx(SQUARE_LENGTH, rel=GRID)
    assert square.length[0] < SQUARE_LENGTH
    apart = np.hypot(*np.diff(square.points, axis=0).T)
    assert np.median(apart) == pytest.approx(0.002, rel=0.01)
    assert apart.max() <= 0.002
    assert np.abs(square.points).max() == pytest.approx(0.5 - AXIS, abs=1e-6)


def test_both_robots_have_the_same_loops():
    wheeled = load_scene("epuck", "arena")
    other = wall_loops(wheeled)
    np.testing.assert_allclose(other.points, loops_of("arena")[0].points, atol=1e-9)


@pytest.mark.parametrize("clearance", [0.001, LOOP_CLEARANCE, PROXIMITY_RANGE])
@pytest.mark.parametrize("quarters", [1, 2, 4, 5, -3, -8])
def test_laps_are_those_of_the_polar_angle(square, clearance, quarters):
    """From the middle of a side to the middle of a side, with a way back halfway."""
    steps = 60 * abs(quarters)
    there = np.linspace(0, 2 * quarters, steps)
    back = np.linspace(2 * quarters, quarters, steps)
    again = np.linspace(quarters, 2 * quarters, steps)
    poses = on_square(np.concatenate([there, back, again]), clearance)
    angle = np.unwrap(np.arctan2(poses[:, 1], poses[:, 0]))
    laps = progress(square, poses).net[0, 0] / square.length[0]
    expected = (angle[-1] - angle[0]) / (2 * np.pi)
    assert abs(laps) == pytest.approx(abs(expected), abs=0.003)
    # there and back differ in sign
    mirrored = progress(square, poses[::-1]).net[0, 0] / square.length[0]
    assert mirrored == pytest.approx(-laps, abs=1e-9)


@pytest.mark.parametrize("laps", [0.25, 0.5, 1, 2])
def test_share_of_the_perimeter(square, laps):
    poses = on_square(np.linspace(0, 8 * laps, 2000), LOOP_CLEARANCE)
    bins = round(square.length[0] / 0.05)
    share = progress(square, poses).perimeter_share[0]
    # the first bin and the last count as a whole
    assert min(laps, 1) <= share <= min(laps + 2 / bins, 1)


def test_robots_do_not_mix(square):
    """Many at once, each with its own way, are each of them alone."""
    ways = np.linspace(0, np.linspace(-9, 9, 7), 400).T
    poses = [on_square(way, 0.01) for way in ways]
    together = progress(square, *poses)
    for i, alone in enumerate(poses):
        one = progress(square, alone)
        np.testing.assert_allclose(together.net[i], one.net[0], rtol=1e-12)
        assert together.perimeter_share[i] == one.perimeter_share[0]


def test_who_is_never_near_gets_nowhere(square):
    poses = on_square(np.linspace(0, 8, 100), 0.3)
    away = progress(square, poses, poses, near=False)
    np.testing.assert_array_equal(away.net, np.zeros((2, 1)))
    np.testing.assert_array_equal(away.perimeter_share, [0, 0])


@pytest.mark.parametrize(("absence", "counts"), [(0.1, True), (0.2, False)])
def test_a_short_way_off_the_walls_belongs_to_following(square, absence, counts):
    """Along a wall for 0.4 m, of which the middle part does not count as near."""
    y = np.linspace(-0.2, 0.2, 41)
    poses = np.stack([np.full(41, 0.44), y, np.zeros(41)], axis=1)
    near = np.abs(y) >= absence / 2 - 1e-9
    assert (absence <= ABSENCE_MAX) == counts
    net = np.abs(square.progress(poses[None], near[None]).net[0, 0])
    assert net == pytest.approx(0.4 if counts else 0.4 - absence, abs=0.003)


def test_from_side_to_side_is_no_way_along_the_walls(square):
    """Billiards from middle to middle of the sides: round, but not along."""
    half = 0.5 - BODY_RADIUS
    middles = half * np.array([[1, 0], [0, 1], [-1, 0], [0, -1], [1, 0]])
    way = np.linspace(0, 4, 400)
    xy = [np.interp(way, np.arange(5), axis) for axis in middles.T]
    poses = np.stack([*xy, np.zeros(400)], axis=1)
    near = np.abs(poses[:, :2]).max(axis=1) >= half - PROXIMITY_RANGE
    net = square.progress(poses[None], near[None]).net
    # what the visits themselves cover, at a right angle to the wall at most
    assert np.abs(net).max() < 8 * PROXIMITY_RANGE + 0.01


def test_nearest_points_that_jump_are_no_way(square):
    poses = np.zeros((1, 100, 3))
    poses[0, :, 0] = 0.44 * (-1.0) ** np.arange(100)
    # as if it had hardly moved: the way is what was driven
    small = poses * np.array([1e-3, 1, 1])
    both = square.progress(np.concatenate([poses, small]), np.ones((2, 100), bool))
    np.testing.assert_array_equal(both.net[0], [0.0])


def test_an_l_shape_has_its_inner_corner_round(tmp_path):
    loops, _ = loops_of(
        arena(
            tmp_path,
            wall(-0.51, 0, 0.01, 0.52),
            wall(0, -0.51, 0.52, 0.01),
            wall(0.51, -0.25, 0.01, 0.26),
            wall(-0.25, 0.51, 0.26, 0.01),
            wall(0.25, 0.01, 0.25, 0.01),
            wall(0.01, 0.25, 0.01, 0.25),
        )
    )
    # each outer corner takes AXIS off both of its walls
    expected = 4 - 5 * 2 * AXIS + np.pi / 2 * AXIS
    assert loops.length == pytest.approx([expected], rel=GRID)


def test_a_round_arena_has_a_round_one(tmp_path):
    """24 walls around a circle of 0.5 m."""
    sides = 24
    angles = 2 * np.pi * np.arange(sides) / sides
    walls = [
        wall(0.51 * np.cos(a), 0.51 * np.sin(a), 0.01, 0.08, np.degrees(a))
        for a in angles
    ]
    loops, _ = loops_of(arena(tmp_path, *walls))
    expected = 2 * sides * (0.5 - AXIS) * np.tan(np.pi / sides)
    assert loops.length == pytest.approx([expected], rel=GRID)
    around = np.linspace(0, 2.5 * 2 * np.pi, 900)
    poses = 0.45 * np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    got = progress(loops, poses)
    assert abs(got.net[0, 0]) / expected == pytest.approx(2.5, abs=0.01)
    assert got.perimeter_share == 1


def test_islands_have_their_own(tmp_path):
    path = arena(tmp_path, *room(), pillar(0.1, 0.1, 0.08), pillar(-0.2, -0.2, 0.03))
    loops, probe = loops_of(path)
    expected = [SQUARE_LENGTH, 2 * np.pi * (0.08 + AXIS), 2 * np.pi * (0.03 + AXIS)]
    np.testing.assert_allclose(np.sort(loops.length)[::-1], expected, rtol=GRID)
    # all of them at the clearance they stand for, but for what the grid cuts
    poses = np.pad(loops.points, ((0, 0), (0, 1)))
    distance = probe.measure(poses).distance
    assert np.abs(np.median(distance) - LOOP_CLEARANCE) < 1e-6
    assert np.abs(distance - LOOP_CLEARANCE).max() < 0.005
    around = np.linspace(0, 2 * 2 * np.pi, 400)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)
    poses = np.pad((0.08 + AXIS) * circle + 0.1, ((0, 0), (0, 1)))
    net = progress(loops, poses).net[0]
    big = np.argsort(loops.length)[1]
    assert abs(net[big]) == pytest.approx(2 * expected[1], rel=0.01)
    assert np.count_nonzero(net) == 1


def test_rooms_within_walls_have_none(tmp_path):
    inner = [wall(0, 0.05, 0.05, 0.01), wall(0, -0.05, 0.05, 0.01)]
    inner += [wall(0.05, 0, 0.01, 0.05), wall(-0.05, 0, 0.01, 0.05)]
    loops, _ = loops_of(arena(tmp_path, *room(), *inner))
    assert loops.length.size == 2
    assert np.hypot(*loops.points.T).min() > 0.06


def test_an_arena_that_is_open_is_refused(tmp_path):
    with pytest.raises(UserError, match="has no room"):
        loops_of(arena(tmp_path, *room()[:3]))


def test_way_driven_ends_with_the_trial():
    poses = np.zeros((2, 5, 3))
    poses[:, :, 0] = [0, 3, 3, 6, 6]
    poses[:, :, 1] = [0, 4, 4, 8, 7]
    poses[1, 3:] = np.nan
    np.testing.assert_allclose(way_driven(poses), [[0, 5, 5, 10, 11], [0, 5, 5, 5, 5]])
