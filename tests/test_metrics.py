"""Metrics and classes: trials drawn by hand, with numbers worked out by hand."""

import dataclasses

import numpy as np
import pytest

from epuck_mj.constants import BODY_RADIUS, SPEED_MAX, TRACK, WHEEL_RADIUS
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.mujoco_batch import MujocoRobots
from epuck_mj.scene.clearance import CLEARANCE_MAX, ClearanceProbe
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.scene.wall_loops import WallLoops, wall_loops
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.motors import Speeds
from epuck_mj.trials.behaviour_classes import (
    CLASSES,
    HUG,
    MEANINGS,
    OTHER,
    behaviour_classes,
    class_shares,
)
from epuck_mj.trials.metrics import Behaviour, behaviour_of
from epuck_mj.trials.recorder import record_tracks
from epuck_mj.trials.tracks import Tracks

STEP = 0.01
"""Way of a control step in trials drawn by hand [m]: 0.1 m/s."""

TASK = TaskParameters()


class Arena:
    """Measures trials in one arena."""

    def __init__(self, robot: str = "epuck_kinematic", arena: str = "arena"):
        self.scene = load_scene(robot, arena)
        self.probe = ClearanceProbe(self.scene)
        self.loops: WallLoops = wall_loops(self.scene)

    def measure(self, tracks: Tracks, task: TaskParameters = TASK) -> Behaviour:
        return behaviour_of(tracks, self.probe.measure(tracks.pose), self.loops, task)


@pytest.fixture(scope="module")
def square() -> Arena:
    return Arena()


def trials(*poses: np.ndarray, crashed: bool = False) -> Tracks:
    """Trials of given poses, NaN after the end of the shorter ones."""
    steps = np.array([len(rows) - 1 for rows in poses])
    pose = np.full((len(poses), steps.max() + 1, 3), np.nan)
    for i, rows in enumerate(poses):
        pose[i, : len(rows)] = rows
    earned = np.where(np.isnan(pose[:, 1:, 0]), np.nan, 0.0)
    command = np.repeat(earned[..., None], 2, axis=-1)
    return Tracks(pose, command, earned, steps, np.full(len(poses), crashed))


def along(*corners: tuple[float, float]) -> np.ndarray:
    """Poses every STEP of the way from corner to corner, headed where it leads."""
    points = np.array(corners, float)
    sides = np.diff(points, axis=0)
    ends = np.concatenate([[0.0], np.cumsum(np.hypot(*sides.T))])
    way = np.arange(0.0, ends[-1] + 1e-9, STEP)
    side = np.clip(np.searchsorted(ends, way, "right") - 1, 0, len(sides) - 1)
    xy = [np.interp(way, ends, axis) for axis in points.T]
    return np.stack([*xy, np.arctan2(sides[side, 1], sides[side, 0])], axis=1)


def round_the_square(clearance: float, laps: float) -> np.ndarray:
    """Along the walls, from the middle of the south side on; no pose in a corner."""
    half = 0.5 - BODY_RADIUS - clearance
    corner = [(half, -half), (half, half), (-half, half), (-half, -half)]
    whole = along((0, -half), *corner * 3, (0, -half))
    return whole[: round(laps * 8 * half / STEP) + 1]


def circle(center: tuple[float, float], radius: float, turns: float) -> np.ndarray:
    """Poses every STEP of the way around a circle."""
    n = round(2 * np.pi * radius * abs(turns) / STEP)
    angle = 2 * np.pi * turns * np.arange(n + 1) / n
    heading = angle + np.sign(turns) * np.pi / 2
    # as a free joint gives it: within half a turn
    yaw = np.angle(np.exp(1j * heading))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([x + center[0], y + center[1], yaw], axis=1)


def standing(x: float, y: float, turns: float = 0.0, steps: int = 300) -> np.ndarray:
    poses = np.full((steps + 1, 3), [x, y, 0.0])
    poses[:, 2] += np.linspace(0, 2 * np.pi * turns, steps + 1)
    return poses


def only(values: np.ndarray) -> float:
    assert values.shape == (1,)
    return float(values[0])


def class_of(found: Behaviour) -> str:
    return str(behaviour_classes(found)[0])


def test_a_lap_at_2_cm(square):
    poses = round_the_square(0.02, laps=1.02)
    found = square.measure(trials(poses))
    # the step at each corner cuts it, from half a step before to half a step after
    steps = len(poses) - 1
    way = STEP * (steps - 4 * (1 - np.sqrt(0.5)))
    assert only(found.time) == pytest.approx(steps * 0.1)
    assert only(found.path_length) == pytest.approx(way)
    assert only(found.mean_speed) == pytest.approx(way / (steps * 0.1))
    assert only(found.share_near_wall) == only(found.share_since_first_wall) == 1
    assert only(found.clearance_mean) == pytest.approx(0.02, abs=1e-8)
    assert only(found.clearance_sd) == pytest.approx(0, abs=1e-7)
    assert only(found.clearance_min) == pytest.approx(0.02, abs=1e-8)
    assert only(found.time_to_first_wall) == 0
    assert only(found.laps) == pytest.approx(1.02, abs=0.005)
    assert only(found.perimeter_share) == 1
    assert only(found.heading_error) == pytest.approx(0, abs=1e-5)
    assert only(found.visits) == 1
    assert only(found.turn) == pytest.approx(2 * np.pi)
    assert only(found.turn_in_open) == 0
    assert only(found.wall_speed) == pytest.approx(0.1, rel=0.01)
    assert found.success.all()
    assert class_of(found) == "wall follower"


@pytest.mark.parametrize("mirror", [1, -1])
def test_half_a_lap_follows_but_is_no_success(square, mirror):
    poses = round_the_square(0.03, laps=0.5) * [mirror, 1, 1]
    poses[:, 2] = np.where(mirror > 0, poses[:, 2], np.pi - poses[:, 2])
    found = square.measure(trials(poses))
    assert only(found.laps) == pytest.approx(0.5, abs=0.01)
    assert only(found.perimeter_share) == pytest.approx(0.5, abs=0.03)
    assert only(found.heading_error) == pytest.approx(0, abs=1e-5)
    assert only(found.turn) == pytest.approx(mirror * np.pi)
    assert not found.success.any()
    assert class_of(found) == "wall follower"


def test_a_slanted_heading_is_an_error_of_that_angle(square):
    poses = round_the_square(0.01, laps=0.4)
    poses[:, 2] += 0.3
    found = square.measure(trials(poses))
    assert only(found.heading_error) == pytest.approx(0.3, abs=1e-5)


def test_a_search_counts_from_the_first_wall(square):
    """2.5 s towards the east wall, turn, then along it; 4 cm off after 1.5 s."""
    poses = along((0.275, 0), (0.445, 0), (0.445, 0.445), (-0.2, 0.445))
    found = square.measure(trials(poses))
    near_at = 15  # 0.275 + 0.15 = 0.5 - 0.035 - 0.04
    steps = len(poses) - 1
    assert only(found.time_to_first_wall) == pytest.approx(near_at * 0.1)
    assert only(found.share_near_wall) == pytest.approx((steps - near_at + 1) / steps)
    assert only(found.share_since_first_wall) == 1
    assert class_of(found) == "wall follower"


def test_riding_at_2_mm_is_hugging(square):
    found = square.measure(
        trials(round_the_square(0.002, 0.8), round_the_square(HUG + 1e-4, 0.8))
    )
    assert found.follows.all()
    assert behaviour_classes(found).tolist() == ["hugger", "wall follower"]
    np.testing.assert_allclose(found.clearance_mean, [0.002, HUG + 1e-4], atol=1e-8)


@pytest.mark.parametrize("turns", [4, -4])
def test_a_circle_in_the_open(square, turns):
    found = square.measure(trials(circle((0.05, 0.0), 0.1, turns)))
    assert only(found.turn) == pytest.approx(2 * np.pi * turns)
    assert only(found.turn_in_open) == pytest.approx(2 * np.pi * turns)
    assert only(found.reach) == pytest.approx(0.2, rel=1e-3)
    assert only(found.path_length) == pytest.approx(4 * 2 * np.pi * 0.1, rel=2e-3)
    assert only(found.share_near_wall) == only(found.visits) == 0
    assert only(found.laps) == only(found.perimeter_share) == 0
    # no wall as far as one looks
    assert only(found.clearance_min) == CLEARANCE_MAX
    for name in ("clearance_mean", "clearance_sd", "time_to_first_wall"):
        assert np.isnan(only(getattr(found, name)))
    assert np.isnan(only(found.heading_error))
    assert class_of(found) == "circler"


def test_a_circle_that_grazes_a_wall_is_still_one(square):
    found = square.measure(trials(circle((0.33, 0.0), 0.1, 4.5)))
    assert only(found.visits) == 5
    assert class_of(found) == "circler"


def test_turning_on_the_spot(square):
    found = square.measure(trials(standing(0.1, 0.2, turns=-5)))
    assert only(found.path_length) == only(found.reach) == 0
    assert only(found.turn) == pytest.approx(-10 * np.pi)
    assert class_of(found) == "spinner"


def test_standing_still(square):
    found = square.measure(trials(standing(0.1, 0.2), standing(0.44, 0.44)))
    np.testing.assert_array_equal(found.mean_speed, [0, 0])
    np.testing.assert_array_equal(found.share_near_wall, [0, 1])
    assert set(behaviour_classes(found)) == {"stuck"}


def test_a_follower_that_ends_in_a_corner_is_stuck(square):
    way = round_the_square(0.02, laps=0.6)
    rest = np.repeat(way[-1:], 60, axis=0)
    found = square.measure(trials(np.concatenate([way, rest])))
    assert found.follows.all()
    assert only(found.reach_at_end) == 0
    assert class_of(found) == "stuck"


def test_from_wall_to_wall_is_bouncing(square):
    ends = [(0.45, 0.1), (-0.45, 0.1)]
    found = square.measure(trials(along(*ends * 2)))
    assert only(found.visits) == 4
    assert only(found.heading_error) == pytest.approx(np.pi / 2, abs=1e-4)
    assert only(found.laps) < 0.01
    # of 91 steps across, 2.5 cm in and 2.5 cm out
    assert only(found.share_near_wall) < 0.1
    assert class_of(found) == "bouncer"


def test_a_visit_ends_well_away_from_the_wall(square):
    """In and out of 4 cm, but never to 6 cm."""
    y = np.linspace(-0.3, 0.3, 61)
    x = 0.5 - BODY_RADIUS - 0.04 + 0.01 * (-1.0) ** np.arange(61)
    found = square.measure(trials(np.stack([x, y, 0 * y], axis=1)))
    assert only(found.visits) == 1
    assert only(found.share_near_wall) == pytest.approx(0.5)


def test_driving_into_a_wall(square):
    poses = along((0.366, 0.0), (0.466, 0.0))
    found = square.measure(trials(poses, crashed=True))
    assert only(found.clearance_min) == pytest.approx(-0.001, abs=1e-8)
    assert only(found.time) == pytest.approx(1.0)
    assert found.collisions_per_minute == pytest.approx(60)
    assert class_of(found) == "crashed"


def test_a_crash_after_a_lap_is_a_crash(square):
    found = square.measure(trials(round_the_square(0.01, 1.1), crashed=True))
    assert only(found.laps) > 1
    assert not found.follows.any()
    assert not found.success.any()
    assert class_of(found) == "crashed"


def test_a_long_way_without_a_wall_is_a_search(square):
    zigzag = [(-0.3, -0.3), (0.3, -0.2), (-0.3, -0.1), (0.3, 0.1), (-0.3, 0.3)]
    late = along((-0.3, 0.0), (0.435, 0.0), (0.435, 0.05))
    found = square.measure(trials(along(*zigzag), late))
    assert np.isnan(found.time_to_first_wall[0])
    assert behaviour_classes(found).tolist() == ["searcher", "searcher"]


def test_to_and_fro_along_a_wall_is_something_else(square):
    ends = [(0.44, -0.1), (0.44, 0.1)]
    found = square.measure(trials(along(*ends * 5, ends[0])))
    assert only(found.share_near_wall) == 1
    assert only(found.laps) == pytest.approx(0, abs=0.001)
    assert class_of(found) == OTHER


def test_changes_of_the_turn(square):
    """Yaw rates of +-w in turn change by 2 w a step; the last trial has one step."""
    tracks = trials(*[standing(0, 0, steps=n) for n in (10, 10, 1)])
    command = tracks.command.copy()
    command[:2] = [2.0, 3.0]
    command[1, ::2] = [3.0, 2.0]
    found = square.measure(dataclasses.replace(tracks, command=command))
    change = 2 * WHEEL_RADIUS / TRACK / 0.1
    np.testing.assert_allclose(found.turn_change, [0, change, np.nan])


def test_trials_do_not_mix_and_control_steps_scale_time(square):
    poses = [
        round_the_square(0.02, 0.7),
        along((0.366, 0.0), (0.466, 0.0)),
        circle((0, 0), 0.15, 2.5),
        standing(0.2, 0.2, turns=3),
    ]
    together = square.measure(trials(*poses))
    slow = dataclasses.replace(TASK, control_step=0.2)
    for i, rows in enumerate(poses):
        alone = square.measure(trials(rows))
        for field in dataclasses.fields(Behaviour):
            one, all_of_them = (getattr(b, field.name) for b in (alone, together))
            np.testing.assert_allclose(all_of_them[i], one[0], rtol=1e-9)
        later = square.measure(trials(rows), slow)
        np.testing.assert_allclose(later.time, 2 * alone.time)
        np.testing.assert_allclose(later.wall_speed, alone.wall_speed / 2)


def test_following_is_judged_by_the_top_speed(square):
    tracks = trials(round_the_square(0.02, 0.7)[::5])
    slow = dataclasses.replace(TASK, control_step=5.0)
    assert not square.measure(tracks, slow).follows.any()
    crawler = dataclasses.replace(slow, speeds=Speeds(forward=SPEED_MAX / 10))
    assert square.measure(tracks, crawler).follows.all()


def test_shares_and_means_of_all(square):
    poses = [standing(0, 0), standing(0, 0, turns=4), standing(0.3, 0, turns=4)]
    found = square.measure(trials(*poses))
    shares = class_shares(found)
    assert list(shares) == [*CLASSES, OTHER] == list(MEANINGS)
    assert sum(shares.values()) == pytest.approx(1)
    assert shares["spinner"] == pytest.approx(2 / 3)
    assert shares["stuck"] == pytest.approx(1 / 3)
    means = found.means
    assert list(means) == [field.name for field in dataclasses.fields(Behaviour)]
    assert means["time"] == pytest.approx(30)
    # nobody was near a wall: no warning, no number
    assert np.isnan(means["clearance_mean"])
    assert found.collisions_per_minute == 0


def test_means_are_of_those_who_have_one(square):
    found = square.measure(trials(standing(0, 0), round_the_square(0.01, 0.4)))
    assert found.means["clearance_mean"] == pytest.approx(0.01, abs=1e-8)
    assert found.means["crashed"] == 0


def test_an_island_is_followed(tmp_path):
    """Once and a half around a pillar in the middle."""
    path = tmp_path / "island.xml"
    room = [(0.51, 0, 0.01, 0.5), (-0.51, 0, 0.01, 0.5)]
    room += [(0, 0.51, 0.52, 0.01), (0, -0.51, 0.52, 0.01)]
    walls = [
        f'<geom type="box" pos="{x} {y} 0.03" size="{half_x} {half_y} 0.03"/>'
        for x, y, half_x, half_y in room
    ]
    path.write_text(
        f"<mujoco><worldbody>{''.join(walls)}"
        '<geom type="plane" size="1 1 0.1"/>'
        '<geom type="cylinder" pos="0 0 0.03" size="0.1 0.03"/></worldbody></mujoco>'
    )
    island = Arena(arena=str(path))
    radius = 0.1 + BODY_RADIUS + 0.015
    found = island.measure(trials(circle((0, 0), radius, -1.5)))
    assert only(found.laps) == pytest.approx(1.5, abs=0.02)
    assert only(found.clearance_mean) == pytest.approx(0.015, abs=1e-8)
    assert only(found.heading_error) == pytest.approx(0, abs=1e-5)
    # one of two loops
    share = island.loops.length.min() / island.loops.length.sum()
    assert only(found.perimeter_share) == pytest.approx(share, rel=0.02)
    assert found.success.all()
    assert class_of(found) == "wall follower"


def test_the_wall_follower_by_hand_is_one(scene):
    probe = ClearanceProbe(scene)
    starts = FreeSpace(scene, 0.01).sample(np.random.default_rng(0), 50)
    robots = MujocoRobots(scene, len(starts))
    tracks = record_tracks(robots, WallFollower(), starts, TASK)
    loops = wall_loops(scene)
    found = behaviour_of(tracks, probe.measure(tracks.pose), loops, TASK)
    assert class_shares(found)["wall follower"] > 0.9
    # its target is about 7 mm; corners take it farther off
    assert 0.005 < found.means["clearance_mean"] < 0.01
    assert found.means["share_since_first_wall"] > 0.95
    assert 0.8 < found.means["laps"] < 1.1
