"""Metrics of trials, from true geometry, not from sensors.

A robot is near a wall if its shell has at most the proximity range to it. Shares and
means are over the control steps lived, each with the pose at its end; NaN where there
are no steps to average.
"""

from dataclasses import dataclass, fields

import numpy as np

from epuck_mj.constants import PROXIMITY_RANGE, SPEED_MAX, TRACK, WHEEL_RADIUS
from epuck_mj.scene.clearance import Clearance
from epuck_mj.scene.wall_loops import WallLoops, way_driven
from epuck_mj.step.control import TaskParameters
from epuck_mj.trials.tracks import Tracks

SUCCESS_LAPS = 1.0
"""Least laps of a success. Source: our reading of the paper, behaviour metrics."""

FOLLOWING_SHARE = 0.7
"""Least share of time near walls since the first wall, of followers and successes.

Source: as of SUCCESS_LAPS.
"""

FOLLOWING_SPEED = 0.25
"""Least mean net progress along walls since the first one, as a share of top speed.

In place of a lap, which 30 s in the paper's arena hardly have room for. A follower that
turns about once on its way still has it; random controllers have a tenth.
"""

FOLLOWING_TIME = 3.0
"""Least time since the first wall [s]: less is a touch of a wall, not following."""

LEAVING_CLEARANCE = 0.06
"""Clearance that ends a visit to a wall [m], above the range to avoid flicker."""

LAST_TIME = 5.0
"""Duration of the end of a trial, in which it is seen whether robots still move [s]."""


@dataclass(frozen=True, eq=False)
class Behaviour:
    """Metrics of `(n,)` trials, each `(n,)`.

    Attributes:
        time: lived [s].
        crashed: whether a crash ended the trial.
        share_near_wall: share of the steps near a wall.
        clearance_mean: over the steps near a wall [m].
        clearance_sd: likewise, the standard deviation [m].
        clearance_min: over all steps [m].
        time_to_first_wall: until first near a wall [s]; NaN if never.
        share_since_first_wall: share of the steps near a wall, from the first on.
        visits: times that a wall was met, left for good in between.
        laps: net progress along a loop per its length, where that is largest.
        wall_speed: net progress along all loops per time since the first wall [m/s].
        perimeter_share: share of all walls' length that was visited.
        heading_error: mean angle between heading and wall near a wall [rad], 0 to pi/2.
        turn_change: mean |change of the yaw rate commanded| [rad/s^2].
        path_length: driven [m].
        mean_speed: the same per time [m/s].
        turn: net change of the heading [rad], left positive.
        turn_in_open: the part of it away from walls [rad].
        reach: farthest from the start [m].
        reach_at_end: farthest from the last pose in the last LAST_TIME [m].
        follows: whether it followed walls without crash, for FOLLOWING_TIME or longer.
        success: whether it did not crash, made a lap and stayed near walls.
    """

    time: np.ndarray
    crashed: np.ndarray
    share_near_wall: np.ndarray
    clearance_mean: np.ndarray
    clearance_sd: np.ndarray
    clearance_min: np.ndarray
    time_to_first_wall: np.ndarray
    share_since_first_wall: np.ndarray
    visits: np.ndarray
    laps: np.ndarray
    wall_speed: np.ndarray
    perimeter_share: np.ndarray
    heading_error: np.ndarray
    turn_change: np.ndarray
    path_length: np.ndarray
    mean_speed: np.ndarray
    turn: np.ndarray
    turn_in_open: np.ndarray
    reach: np.ndarray
    reach_at_end: np.ndarray
    follows: np.ndarray
    success: np.ndarray

    @property
    def collisions_per_minute(self) -> float:
        """Crashes of all trials per minute lived in them."""
        return float(self.crashed.sum() / (self.time.sum() / 60))

    @property
    def means(self) -> dict[str, float]:
        """Mean of each metric over the trials that have it; NaN if none has."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: _mean_of(value) for name, value in values.items()}


def behaviour_of(
    tracks: Tracks, clearance: Clearance, loops: WallLoops, task: TaskParameters
) -> Behaviour:
    """Metrics of trials.

    Args:
        tracks: the trials, at least one step each.
        clearance: on `tracks.pose`.
        loops: of the same scene.
        task: what a trial was.
    """
    lived, time = tracks.lived, tracks.steps * task.control_step
    near = clearance.distance <= PROXIMITY_RANGE
    near_steps, distance = near[:, 1:], clearance.distance[:, 1:]
    # from the first time near a wall on
    met = np.any(near, axis=1)
    first = near.argmax(axis=1)
    since = lived & met[:, None] & (np.arange(lived.shape[1]) >= first[:, None])
    time_since = since.sum(axis=1) * task.control_step
    share_since = _mean(near_steps, since)
    # along the walls
    progress = loops.progress(tracks.pose, near)
    laps = np.abs(progress.net / loops.length).max(axis=1)
    wall_speed = _ratio(np.abs(progress.net).sum(axis=1), time_since)
    # the heading against the wall's, whichever way round
    to_wall = clearance.direction - tracks.pose[..., 2]
    heading_error = np.arcsin(np.minimum(np.abs(np.cos(to_wall)), 1.0))[:, 1:]
    # turns and ways
    turns = np.diff(tracks.pose[..., 2], axis=1)
    turns -= 2 * np.pi * np.round(turns / (2 * np.pi))
    left, right = np.moveaxis(tracks.command, -1, 0)
    yaw_rate = (right - left) * (WHEEL_RADIUS / TRACK)
    changes = np.abs(np.diff(yaw_rate, axis=1)) / task.control_step
    path_length = way_driven(tracks.pose)[:, -1]
    clearance_mean = _mean(distance, near_steps)
    spread = _mean((distance - clearance_mean[:, None]) ** 2, near_steps)
    stayed = ~tracks.crashed & (share_since >= FOLLOWING_SHARE)
    top_speed = min(task.speeds.forward, SPEED_MAX)
    return Behaviour(
        time=time,
        crashed=tracks.crashed,
        share_near_wall=_mean(near_steps, lived),
        clearance_mean=clearance_mean,
        clearance_sd=np.sqrt(spread),
        clearance_min=np.where(lived, distance, np.inf).min(axis=1),
        time_to_first_wall=np.where(met, first * task.control_step, np.nan),
        share_since_first_wall=share_since,
        visits=_visits(clearance.distance),
        laps=laps,
        wall_speed=wall_speed,
        perimeter_share=progress.perimeter_share,
        heading_error=_mean(heading_error, near_steps),
        turn_change=_mean(changes, lived[:, 1:]),
        path_length=path_length,
        mean_speed=path_length / time,
        turn=_sum(turns, lived),
        turn_in_open=_sum(turns, lived & ~near_steps),
        reach=_farthest(tracks.pose, tracks.pose[:, :1]),
        reach_at_end=_reach_at_end(tracks, round(LAST_TIME / task.control_step)),
        follows=stayed
        & (time_since >= FOLLOWING_TIME)
        & (wall_speed >= FOLLOWING_SPEED * top_speed),
        success=stayed & (laps >= SUCCESS_LAPS),
    )


def _sum(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Sum over the steps of a mask, `(n,)`; both are `(n, steps)`."""
    return np.where(where, values, 0.0).sum(axis=1)


def _mean(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Mean over the steps of a mask, `(n,)`; both are `(n, steps)`."""
    return _ratio(_sum(values, where), where.sum(axis=1))


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quotients `(n,)`, NaN by zero."""
    return np.divide(a, b, out=np.full(len(a), np.nan), where=b > 0)


def _mean_of(values: np.ndarray) -> float:
    there = values[~np.isnan(values)]
    return float(there.mean()) if there.size else float("nan")


def _visits(distance: np.ndarray) -> np.ndarray:
    """Number of visits `(n,)` to walls, from clearance `(n, rows)`."""
    near = distance <= PROXIMITY_RANGE
    decided = near | (distance >= LEAVING_CLEARANCE)
    # between the two limits, the last decision holds
    last = np.maximum.accumulate(np.where(decided, np.arange(near.shape[1]), 0), axis=1)
    visiting = np.take_along_axis(near, last, axis=1)
    return visiting[:, 0] + (visiting[:, 1:] & ~visiting[:, :-1]).sum(axis=1)


def _farthest(poses: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Largest distance of poses `(n, rows, 3)` from an origin `(n, 1, 3)` [m]."""
    offset = (poses - origin)[..., :2]
    return np.nan_to_num(np.hypot(offset[..., 0], offset[..., 1])).max(axis=1)


def _reach_at_end(tracks: Tracks, n_last: int) -> np.ndarray:
    """Largest distance from the last pose in the last `n_last` steps [m], `(n,)`."""
    rows = np.maximum(tracks.steps[:, None] - np.arange(n_last + 1), 0)
    last = np.take_along_axis(tracks.pose, rows[..., None], axis=1)
    return _farthest(last, last[:, :1])
