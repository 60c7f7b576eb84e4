"""CMA-ES of the package `cmaes`, sampled with the symmetric root of its covariance."""

import numpy as np
from cmaes import CMA


class SymmetricCma(CMA):
    """A `cmaes.CMA` that samples by B D Bᵀ z, not by B D z.

    The columns of B are eigenvectors: their signs, and their directions where
    eigenvalues are equal, are the choice of the linear algebra library. B D Bᵀ is the
    same for each choice, so another library changes last digits, and no longer all
    samples. A sample has the same distribution in either way.

    A wide search draws 100 samples for each individual, nearly all outside the bounds.
    So what is the same for all samples of a generation is computed once.
    """

    _axes: np.ndarray | None = None
    """Eigenvectors that the two below were made of."""

    def _sample_solution(self) -> np.ndarray:
        axes, lengths = self._eigen_decomposition()
        if axes is not self._axes:
            self._axes, self._stretched, self._turned = axes, axes * lengths, axes.T
        z = self._rng.randn(self._n_dim)
        return self._mean + self._sigma * (self._stretched @ (self._turned @ z))

    def _is_feasible(self, param: np.ndarray) -> bool:
        if self._bounds is None:
            return True
        lower, upper = self._bounds.T
        return bool((param >= lower).all() and (param <= upper).all())
