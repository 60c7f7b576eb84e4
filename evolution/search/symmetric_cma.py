"""CMA-ES of the package `cmaes`, sampled with the symmetric root of its covariance."""

import numpy as np
from cmaes import CMA


class SymmetricCma(CMA):
    """A `cmaes.CMA` that samples by B D Bᵀ z, not by B D z.

    The columns of B are eigenvectors: their signs, and their directions where
    eigenvalues are equal, are the choice of the linear algebra library. B D Bᵀ is the
    same for each choice, so another library changes last digits, and no longer all
    samples. A sample has the same distribution in either way.
    """

    def _sample_solution(self) -> np.ndarray:
        axes, lengths = self._eigen_decomposition()
        z = self._rng.randn(self._n_dim)
        return self._mean + self._sigma * ((axes * lengths) @ (axes.T @ z))
