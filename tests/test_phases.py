"""Phases: what a robot is about, on paths drawn by hand and on real ones."""

import numpy as np
import pytest

from epuck_mj.constants import N_PROXIMITY, PROXIMITY_RANGE
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import RUNGS
from epuck_mj.scene.clearance import ClearanceProbe
from epuck_mj.scene.model import load_scene
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.phases import (
    CORNERING,
    CORNERING_TIME,
    CORNERING_TURN,
    CRASHED,
    FOLLOWING,
    SEARCHING,
    phases,
)
from epuck_mj.trials.recorder import record
from epuck_mj.trials.trajectory import Trajectory

CONTROL_STEP = 0.1
HALF = round(CORNERING_TIME / CONTROL_STEP / 2)
"""Rows on either side that a turn is looked at over."""

NEAR, FAR = PROXIMITY_RANGE / 2, 2 * PROXIMITY_RANGE


def drawn_by_hand(yaw, crashed=False):
    """A trajectory of those headings [rad], `(T + 1,)`; all else is nothing."""
    rows = len(yaw)
    contact = np.zeros(rows, bool)
    contact[-1] = crashed
    pose = np.zeros((rows, 3))
    pose[:, 2] = yaw
    sensed, acted = np.zeros((rows, N_PROXIMITY)), np.zeros((rows - 1, 2))
    return Trajectory(
        time=np.arange(rows) * CONTROL_STEP,
        pose=pose,
        distance=sensed,
        proximity=sensed,
        observation=sensed,
        contact=contact,
        hidden=np.zeros((rows - 1, 0)),
        action=acted,
        command=acted,
        fitness=np.zeros(rows - 1),
    )


def oracle(trajectory, clearance):
    """Row by row, for evenly spaced rows."""
    found, yaw = [], np.unwrap(trajectory.pose[:, 2])
    last = len(yaw) - 1
    for k in range(last + 1):
        turn = yaw[min(k + HALF, last)] - yaw[max(k - HALF, 0)]
        if trajectory.contact[k]:
            found.append(CRASHED)
        elif clearance[k] > PROXIMITY_RANGE:
            found.append(SEARCHING)
        else:
            found.append(CORNERING if abs(turn) >= CORNERING_TURN else FOLLOWING)
    return found


def test_far_from_walls_is_searching_however_it_turns():
    for yaw in (np.zeros(30), np.arange(30) * 0.3):
        phase = phases(drawn_by_hand(yaw), np.full(30, FAR))
        assert set(phase) == {SEARCHING}


def test_straight_on_near_a_wall_is_following_up_to_the_sensors_range():
    trajectory = drawn_by_hand(np.zeros(4))
    clearance = np.array([0.0, NEAR, PROXIMITY_RANGE, np.nextafter(PROXIMITY_RANGE, 1)])
    assert phases(trajectory, clearance).tolist() == [*[FOLLOWING] * 3, SEARCHING]


@pytest.mark.parametrize("side", [-1, 1])
def test_a_corner_is_where_the_turn_is_and_around_it(side):
    # a quarter turn, in the four steps to row 22
    yaw = side * np.clip(np.arange(41) - 18, 0, 4) * np.pi / 8
    phase = phases(drawn_by_hand(yaw), np.full(41, NEAR))
    corner = np.flatnonzero(phase == CORNERING)
    # a third of the turn lies in the second around its first row and its last
    assert corner.tolist() == list(range(18 - HALF + 2, 22 + HALF - 1))
    assert set(phase) == {FOLLOWING, CORNERING}
    # the same corner seen across the heading at which angles jump
    wrapped = (yaw + np.pi) % (2 * np.pi) - np.pi
    shifted = (wrapped + 2.0 + np.pi) % (2 * np.pi) - np.pi
    again = phases(drawn_by_hand(shifted), np.full(41, NEAR))
    np.testing.assert_array_equal(again, phase)


@pytest.mark.parametrize(("share", "expected"), [(0.99, FOLLOWING), (1.01, CORNERING)])
def test_a_curve_is_a_corner_from_a_turn_on(share, expected):
    rate = share * CORNERING_TURN / CORNERING_TIME
    trajectory = drawn_by_hand(np.arange(41) * CONTROL_STEP * rate)
    phase = phases(trajectory, np.full(41, NEAR))
    assert set(phase[HALF:-HALF]) == {expected}
    # the ends stand still: half a turn there
    assert phase[0] == phase[-1] == FOLLOWING


def test_a_wiggle_is_no_corner():
    yaw = np.where(np.arange(40) % 2, CORNERING_TURN * 0.9, 0)
    phase = phases(drawn_by_hand(yaw), np.full(40, NEAR))
    assert set(phase) == {FOLLOWING}


def test_a_crash_is_a_crash_whatever_else():
    for yaw in (np.zeros(20), np.arange(20) * 0.3):
        for clearance in (-1e-4, 1e-4):
            trajectory = drawn_by_hand(yaw, crashed=True)
            phase = phases(trajectory, np.full(20, clearance))
            assert phase[-1] == CRASHED
            assert CRASHED not in phase[:-1]


def test_a_trial_of_one_row_has_a_phase():
    assert phases(drawn_by_hand(np.zeros(1)), np.array([FAR])).tolist() == [SEARCHING]


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.5), (0.3, 0.2, 0.5), (-0.4, 0.0, 3.0)])
def test_a_follower_searches_follows_and_takes_corners(start):
    scene = load_scene("epuck_kinematic", "arena", CONTROL_STEP)
    trajectory = record(scene, WallFollower(), np.array(start), TaskParameters())
    clearance = ClearanceProbe(scene, 1).measure(trajectory.pose).distance
    phase = phases(trajectory, clearance)
    assert phase.shape == (trajectory.steps + 1,)
    assert phase.tolist() == oracle(trajectory, clearance)
    assert set(phase) == {SEARCHING, FOLLOWING, CORNERING}
    begins = phase[np.flatnonzero(np.r_[True, phase[1:] != phase[:-1]])]
    assert begins[0] == SEARCHING
    # at a corner the robot is beside a corner of the arena
    corner = np.abs(trajectory.pose[phase == CORNERING, :2])
    assert (corner[:, 0] > 0.2).mean() > 0.9


@pytest.mark.parametrize("robot", RUNGS)
def test_who_drives_on_crashes(robot):
    def straight_on(observation):
        return np.broadcast_to([1.0, 0.0], (*observation.shape[:-1], 2)).copy()

    scene = load_scene(robot, "arena", CONTROL_STEP)
    trajectory = record(scene, straight_on, np.zeros(3), TaskParameters())
    clearance = ClearanceProbe(scene, 1).measure(trajectory.pose).distance
    phase = phases(trajectory, clearance)
    begins = phase[np.flatnonzero(np.r_[True, phase[1:] != phase[:-1]])]
    assert begins.tolist() == [SEARCHING, FOLLOWING, CRASHED]
    assert (phase == CRASHED).sum() == 1
