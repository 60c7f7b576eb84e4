"""Sparse least squares of all poses of a drive and the parameters of its robot.

A pose meets only its neighbours and the parameters: the normal equations are a band
with a border. So a step costs as much as the drive is long, while the solvers of
mujoco.minimize and scipy.optimize would take its cube.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import LinAlgError

from epuck_mj.calibrate.drive_model import DriveModel, Linearised
from epuck_mj.calibrate.normal_equations import Normal
from epuck_mj.calibrate.parameters import GAINS, LAG, N_PARAMETERS

START_ERROR = np.array([0.01, 0.01, np.radians(5)])
"""Standard deviations of where a person puts a robot: x, y [m], yaw [rad]. Chosen."""

LIKELY = np.array([0.03, 0.03, 0.05, 1.0, *[0.4] * 8])
"""Standard deviations of parameters from their known values. Chosen: about as much as
robots differ (`RANGES`), and many times what a drive leaves open."""

OUTLIER = 3.0
"""Residual [standard deviations] from which one counts less than its square."""

PIECE = 5
PIECE_MAX, PIECE_SHARE = 40, 0.05
"""Readings by which a followed drive grows: its share, within these limits."""

PRECISION, GAIN = 1e-4, 1e-3
"""Part of its standard error by which a parameter may still change at the end, and what
that may still gain."""

DAMPING, DAMPING_MAX = 1e-6, 1e6
"""First and largest damping of steps, relative to the diagonal."""

ROUNDING = 1e-9
"""Part of a cost that is none."""

WINDOW = 600
"""Readings that are smoothed again as a followed drive grows."""

FEW_ITERATIONS, N_ITERATIONS = 3, 40
"""Most steps of a fit of a piece, and of a whole drive: most take 5 to 10."""


@dataclass(frozen=True)
class Loss:
    """What residuals cost, `(...)` in standard deviations, and how much they weigh."""

    cost: Callable[[np.ndarray], np.ndarray]
    weights: Callable[[np.ndarray], np.ndarray]


def _huber(residuals: np.ndarray) -> np.ndarray:
    size = np.abs(residuals)
    inside = np.minimum(size, OUTLIER)
    return inside * (size - inside / 2)


HUBER = Loss(_huber, lambda residuals: OUTLIER / np.maximum(np.abs(residuals), OUTLIER))
"""Outliers pull as hard as OUTLIER, wherever they are: for poses that are far off."""

CAUCHY = Loss(
    lambda residuals: OUTLIER**2 / 2 * np.log1p((residuals / OUTLIER) ** 2),
    lambda residuals: 1 / (1 + (residuals / OUTLIER) ** 2),
)
"""Outliers pull less the farther they are: for poses that are nearly right."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known before a drive.

    Attributes:
        start: pose `(3,)`.
        parameters: `(12,)`.
    """

    start: np.ndarray
    parameters: np.ndarray

    def of_start(self, poses: np.ndarray) -> np.ndarray:
        """Residuals of the start, `(3,)`."""
        return (poses[0] - self.start) / START_ERROR

    def of(self, parameters: np.ndarray) -> np.ndarray:
        """Residuals of the parameters, `(12,)`."""
        return (parameters - self.parameters) / LIKELY


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Poses and parameters that explain a drive best.

    Attributes:
        poses: at each reading, `(T + 1, 3)`.
        parameters: of the robot, `(12,)`.
        errors: their standard errors, 0 of those held, `(12,)`.
        evidence: logarithm of the likelihood of the drive with all poses and
            parameters integrated out (Laplace), up to a constant.
    """

    poses: np.ndarray
    parameters: np.ndarray
    errors: np.ndarray = field(default_factory=lambda: np.full(N_PARAMETERS, np.inf))
    evidence: float = -np.inf


def followed(model: DriveModel, known: np.ndarray, free: np.ndarray) -> Smoothed:
    """Smooth a drive from its start on, a few readings more at a time.

    The counters alone lead astray within a minute; from one piece to the next they do
    not.

    Args:
        model: of the drive.
        known: parameters that it begins with, `(12,)`.
        free: which of them are to be fitted, `(12,)`, bool.
    """
    last, first, end = len(model.drive.time) - 1, 0, PIECE
    begin, likely = model.drive.start, known
    part = model.part(first, end)
    poses = part.path(begin, known)
    parameters = known
    while True:
        window = Smoothed(poses[first:], parameters)
        found = smooth(part, window, Prior(begin, likely), free, FEW_ITERATIONS)
        poses = np.concatenate([poses[:first], found.poses])
        parameters = found.parameters
        if end == last:
            return Smoothed(poses, parameters)
        grown = min(last, end + max(PIECE, min(PIECE_MAX, int(end * PIECE_SHARE))))
        ahead = model.part(end, grown).path(poses[-1], parameters)
        poses, end = np.concatenate([poses, ahead[1:]]), grown
        if end - first > WINDOW:
            first = end - WINDOW
            begin, likely = poses[first], parameters
        part = model.part(first, end)


def smooth(
    model: DriveModel,
    begin: Smoothed,
    prior: Prior,
    free: np.ndarray,
    n_iterations: int = N_ITERATIONS,
    loss: Loss = HUBER,
) -> Smoothed:
    """Smooth a drive from a guess, by damped Gauss-Newton steps.

    Args:
        model: of the drive.
        begin: where to begin.
        prior: what is known before.
        free: which of them are to be fitted, `(12,)`, bool.
        n_iterations: most steps.
        loss: of residuals.
    """
    here = _at(model, prior, begin.poses, begin.parameters, loss)
    damping = DAMPING
    for _ in range(n_iterations):
        normal = _normal(here, prior, free, loss)
        there, damping, settled = _better(model, prior, here, normal, damping, loss)
        if there is None:
            break
        settled = settled and here.cost - there.cost < GAIN
        here = there
        if settled:
            break
    solution = _normal(here, prior, free, loss).solved(0.0)
    evidence = -here.cost - here.linear.log_scales - solution.log_determinant / 2
    return Smoothed(here.poses, here.parameters, solution.errors, evidence)


@dataclass(frozen=True, eq=False)
class _Place:
    """Poses and parameters, the model linearised there, and what they cost."""

    poses: np.ndarray
    parameters: np.ndarray
    linear: Linearised
    cost: float


def _at(
    model: DriveModel,
    prior: Prior,
    poses: np.ndarray,
    parameters: np.ndarray,
    loss: Loss,
) -> _Place:
    linear = model.linearised(poses, parameters)
    cost = 0.5 * float(
        (prior.of_start(poses) ** 2).sum() + (prior.of(parameters) ** 2).sum()
    )
    for residuals in (linear.motion, linear.seen):
        cost += float(loss.cost(residuals).sum())
    return _Place(poses, parameters, linear, cost)


def _better(
    model: DriveModel,
    prior: Prior,
    here: _Place,
    normal: Normal,
    damping: float,
    loss: Loss,
) -> tuple[_Place | None, float, bool]:
    """A better place, the next damping, and whether the parameters have settled.

    None if no step is better, however small.
    """
    while damping < DAMPING_MAX:
        try:
            solution = normal.solved(damping)
        except LinAlgError:
            damping *= 10
            continue
        parameters = here.parameters + solution.step
        parameters[LAG] = max(parameters[LAG], 0.0)
        there = _at(model, prior, here.poses + solution.pose_step, parameters, loss)
        if there.cost < here.cost + ROUNDING * abs(here.cost):
            settled = np.abs(solution.step) <= PRECISION * solution.errors
            return there, max(damping / 10, DAMPING / 1000), bool(settled.all())
        damping *= 10
    return None, damping, True


def _normal(here: _Place, prior: Prior, free: np.ndarray, loss: Loss) -> Normal:
    now, poses, parameters = here.linear, here.poses, here.parameters
    n = len(poses)
    moved, seen = loss.weights(now.motion), loss.weights(now.seen)
    a, b, c = now.motion_from, now.motion_to, now.motion_parameters[..., free]
    wa, wb = moved[..., None] * a, moved[..., None] * b
    diagonal = np.einsum("kip,kiq->kpq", seen[..., None] * now.seen_pose, now.seen_pose)
    diagonal[:-1] += np.einsum("kip,kiq->kpq", wa, a)
    diagonal[1:] += np.einsum("kip,kiq->kpq", wb, b)
    diagonal[0] += np.diag(START_ERROR**-2)
    beside = np.einsum("kip,kiq->kpq", wa, b)
    # each sensor meets its own gain only
    border = np.zeros((n, 3, N_PARAMETERS))
    border[:, :, GAINS] = np.einsum("kip,ki->kpi", now.seen_pose, seen * now.seen_gains)
    border = border[..., free]
    border[:-1] += np.einsum("kip,kiq->kpq", wa, c)
    border[1:] += np.einsum("kip,kiq->kpq", wb, c)
    corner = np.diag(LIKELY**-2)
    corner[GAINS, GAINS] += np.diag((seen * now.seen_gains**2).sum(axis=0))
    corner = corner[np.ix_(free, free)] + np.einsum(
        "kip,kiq->pq", moved[..., None] * c, c
    )
    pose_slope = np.einsum("kip,ki->kp", now.seen_pose, seen * now.seen)
    pose_slope[:-1] += np.einsum("kip,ki->kp", wa, now.motion)
    pose_slope[1:] += np.einsum("kip,ki->kp", wb, now.motion)
    pose_slope[0] += prior.of_start(poses) / START_ERROR
    slope = prior.of(parameters) / LIKELY
    slope[GAINS] += (now.seen_gains * seen * now.seen).sum(axis=0)
    slope = slope[free] + np.einsum("kip,ki->p", c, moved * now.motion)
    return Normal(
        diagonal,
        beside,
        border.reshape(3 * n, -1),
        corner,
        pose_slope.ravel(),
        slope,
        free,
    )
