"""Normal equations of poses that follow one another, and of parameters of all.

A pose meets only its neighbours and the parameters: the matrix is a band with a border.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

from epuck_mj.calibrate.parameters import N_PARAMETERS


@dataclass(frozen=True, eq=False)
class Solution:
    """A solution of normal equations.

    Attributes:
        pose_step: by which poses change, `(T + 1, 3)`.
        step: by which parameters change, `(12,)`.
        errors: standard errors of the parameters, 0 of those held, `(12,)`.
        log_determinant: logarithm of the matrix's determinant.
    """

    pose_step: np.ndarray
    step: np.ndarray
    errors: np.ndarray
    log_determinant: float


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations: a band of poses with a border of parameters.

    Attributes:
        diagonal: `(T + 1, 3, 3)`.
        beside: of a pose and the next one, `(T, 3, 3)`.
        border: of poses and free parameters, `(3 (T + 1), f)`.
        corner: of the parameters, `(f, f)`.
        pose_slope: `(3 (T + 1),)`.
        slope: of the free parameters, `(f,)`.
        free: which parameters those are, `(12,)`.
    """

    diagonal: np.ndarray
    beside: np.ndarray
    border: np.ndarray
    corner: np.ndarray
    pose_slope: np.ndarray
    slope: np.ndarray
    free: np.ndarray

    def solved(self, damping: float) -> Solution:
        """The least squares step.

        Args:
            damping: of the diagonal, relative to it.

        Raises:
            LinAlgError: if the matrix is not positive.
        """
        band = _band(self.diagonal, self.beside)
        band[0] *= 1 + damping
        factor = cholesky_banded(band, lower=True)
        right = np.column_stack([self.border, self.pose_slope])
        inverse = cho_solve_banded((factor, True), right)
        by_border, by_slope = inverse[:, :-1], inverse[:, -1]
        corner = self.corner + damping * np.diag(np.diag(self.corner))
        schur = corner - self.border.T @ by_border
        sign, log_corner = np.linalg.slogdet(schur)
        if sign <= 0:
            raise LinAlgError("not positive")
        covariance = np.linalg.inv(schur)
        step = np.zeros(N_PARAMETERS)
        step[self.free] = -covariance @ (self.slope - self.border.T @ by_slope)
        poses = -(by_slope + by_border @ step[self.free])
        errors = np.zeros(N_PARAMETERS)
        errors[self.free] = np.sqrt(np.diag(covariance))
        determinant = 2 * float(np.log(factor[0]).sum()) + float(log_corner)
        return Solution(poses.reshape(-1, 3), step, errors, determinant)


def _band(diagonal: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Lower band `(6, 3 n)` of a block-tridiagonal matrix, as LAPACK wants it."""
    n = len(diagonal)
    band = np.zeros((6, n, 3))
    for column in range(3):
        for row in range(column, 3):
            band[row - column, :, column] = diagonal[:, row, column]
        for row in range(3):
            # the block below the diagonal is the transpose of that beside it
            band[3 + row - column, :-1, column] = beside[:, column, row]
    return band.reshape(6, 3 * n)
