"""Clearance: what geometry by hand says, for walls of every shape."""

import numpy as np
import pytest

from epuck_mj.constants import BODY_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.scene.clearance import CHUNK, CLEARANCE_MAX, ClearanceProbe
from epuck_mj.scene.model import load_scene

ACCURACY = 1e-8
"""Of distances [m]."""

BLUR = 1e-3
"""Of directions [rad] up to DEEP, where the nearest wall point is what is meant."""

DEEP = -0.01
"""Deeper in a wall than contacts get [m]."""


def arena(tmp_path, *geoms: str, assets: str = "") -> str:
    floor = '<geom type="plane" size="2 2 1" contype="2" conaffinity="2"/>'
    path = tmp_path / "arena.xml"
    path.write_text(
        f'<mujoco><option timestep="0.01"/><asset>{assets}</asset><worldbody>{floor}'
        f"{''.join(geoms)}</worldbody></mujoco>"
    )
    return str(path)


def poses(n: int, half: float, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform([-half, -half, -9], [half, half, 9], (n, 3))


def to_box(points: np.ndarray, half_x: float, half_y: float) -> np.ndarray:
    """Nearest points of a rectangle around the origin to points outside it."""
    return np.clip(points, [-half_x, -half_y], [half_x, half_y])


def check(probe: ClearanceProbe, at: np.ndarray, nearest: np.ndarray) -> None:
    """Clearance on poses `(n, 3)` whose nearest wall points `(n, 2)` are known."""
    offset = nearest - at[:, :2]
    expected = np.minimum(np.hypot(*offset.T) - BODY_RADIUS, CLEARANCE_MAX)
    got = probe.measure(at)
    np.testing.assert_allclose(got.distance, expected, rtol=0, atol=ACCURACY)
    far = expected >= CLEARANCE_MAX
    assert far.any()
    np.testing.assert_array_equal(np.isnan(got.direction), far)
    seen = ~far & (expected > DEEP)
    assert (expected[seen] < 0).any()
    turn = got.direction[seen] - np.arctan2(offset[seen, 1], offset[seen, 0])
    assert np.abs(np.angle(np.exp(1j * turn))).max() < BLUR


def test_in_the_square_it_is_the_nearest_side(scene):
    """From touching 5 mm deep to the middle, on any heading."""
    at = poses(5000, 0.47)
    assert len(at) < CHUNK
    x, y = at[:, 0], at[:, 1]
    beside = np.abs(x) > np.abs(y)
    nearest = np.where(
        beside[:, None],
        np.stack([0.5 * np.sign(x), y], axis=1),
        np.stack([x, 0.5 * np.sign(y)], axis=1),
    )
    # as near to two sides: either will do
    clear = np.abs(np.abs(x) - np.abs(y)) > 1e-6
    check(ClearanceProbe(scene), at[clear], nearest[clear])


@pytest.mark.parametrize("degrees", [0, 30, 135])
def test_of_a_box_that_is_turned(tmp_path, degrees):
    box = '<geom type="box" pos="0.1 0.2 0.03" size="0.2 0.05 0.03" euler="0 0 {}"/>'
    path = arena(tmp_path, box.format(degrees))
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    at = poses(3000, 0.6)
    local = (at[:, :2] - [0.1, 0.2]) @ turn
    nearest = to_box(local, 0.2, 0.05)
    outside = (np.abs(local) > [0.2, 0.05]).any(axis=1)
    probe = ClearanceProbe(load_scene("epuck", path))
    check(probe, at[outside], (nearest @ turn.T + [0.1, 0.2])[outside])


def test_of_a_pillar(tmp_path):
    path = arena(tmp_path, '<geom type="cylinder" pos="0.1 0 0.03" size="0.08 0.03"/>')
    at = poses(3000, 0.6)
    offset = at[:, :2] - [0.1, 0]
    distance = np.hypot(*offset.T)
    nearest = 0.08 * offset / distance[:, None] + [0.1, 0]
    outside = distance > 0.08
    probe = ClearanceProbe(load_scene("epuck", path))
    check(probe, at[outside], nearest[outside])


def test_of_a_mesh_that_is_moved_scaled_and_turned(tmp_path):
    """A box as a mesh, off its own centre, in a body that is off the world's."""
    corners = " ".join(f"{x} {y} {z}" for x in (0, 2) for y in (0, 1) for z in (0, 1))
    mesh = f'<mesh name="block" vertex="{corners}" scale="0.1 0.1 0.06"/>'
    body = (
        '<body pos="0.1 0.1 0" euler="0 0 90">'
        '<geom type="mesh" mesh="block" pos="-0.1 -0.05 0"/></body>'
    )
    scene = load_scene("epuck", arena(tmp_path, body, assets=mesh))
    at = poses(3000, 0.6)
    local = at[:, :2] - [0.1, 0.1]
    outside = (np.abs(local) > [0.05, 0.1]).any(axis=1)
    nearest = to_box(local, 0.05, 0.1) + np.array([0.1, 0.1])
    check(ClearanceProbe(scene), at[outside], nearest[outside])


def test_only_walls_count(tmp_path):
    """What the shell cannot touch is no wall."""
    ghost = '<geom type="box" size="0.1 0.1 0.1" contype="4" conaffinity="4"/>'
    wall = '<geom type="box" pos="1 0 0.03" size="0.01 1 0.03"/>'
    probe = ClearanceProbe(load_scene("epuck", arena(tmp_path, ghost, wall)), threads=1)
    got = probe.measure(np.array([[0.0, 0, 0], [0.9, 0, 0]]))
    np.testing.assert_allclose(got.distance, [CLEARANCE_MAX, 0.055], atol=ACCURACY)


def test_any_shape_of_poses_in_any_number(scene):
    at = poses(3 * CHUNK + 6, 0.45)
    whole = ClearanceProbe(scene, threads=2).measure(at)
    some = ClearanceProbe(scene, threads=1).measure(at[:6].reshape(2, 3, 3))
    np.testing.assert_array_equal(some.distance.ravel(), whole.distance[:6])
    np.testing.assert_array_equal(some.direction.ravel(), whole.direction[:6])
    assert ClearanceProbe(scene).measure(np.zeros((0, 4, 3))).distance.shape == (0, 4)


def test_no_pose_has_no_clearance(scene):
    at = poses(20, 0.45)
    probe = ClearanceProbe(scene)
    expected = probe.measure(at)
    at[3:7] = np.nan
    got = probe.measure(at)
    there = np.isfinite(at[:, 0])
    assert np.isnan(got.distance[~there]).all()
    np.testing.assert_array_equal(got.distance[there], expected.distance[there])


def test_walls_without_an_exact_distance_are_refused(tmp_path):
    heights = (
        '<hfield name="hills" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 1 0"/>'
    )
    path = arena(tmp_path, '<geom type="hfield" hfield="hills"/>', assets=heights)
    with pytest.raises(UserError, match="a wall that is a hfield"):
        ClearanceProbe(load_scene("epuck", path))


def test_of_many_walls_those_near_are_enough(tmp_path, monkeypatch):
    """Exactly, bit for bit, wherever a robot is and whichever walls are near."""
    rng = np.random.default_rng(0)
    kinds = (
        'box" size=".05 .01 .03',
        'cylinder" size=".02 .03',
        'capsule" size=".01 .04',
    )
    geoms = "".join(
        f'<geom type="{kinds[i % 3]}" pos="{x:.3f} {y:.3f} .03" euler="0 0 {40 * i}"/>'
        for i, (x, y) in enumerate(rng.uniform(-1, 1, (60, 2)))
    )
    geoms += '<geom type="plane" size="1 1 1" pos="-1 0 0" zaxis="1 0 0"/>'
    scene = load_scene("epuck", arena(tmp_path, geoms))
    poses = np.append(rng.uniform(-1.4, 1.4, (400, 3)), [[9, 9, 0]], axis=0)
    some = ClearanceProbe(scene, 1).measure(poses)
    monkeypatch.setattr("epuck_mj.scene.clearance.WALLS_MAX", 100)
    every = ClearanceProbe(scene, 1).measure(poses)
    np.testing.assert_array_equal(some.distance, every.distance)
    np.testing.assert_array_equal(some.direction, every.direction)
    assert (some.distance == 0.2).any()
    assert (some.distance < 0).any()
