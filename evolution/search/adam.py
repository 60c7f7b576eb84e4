"""Adam: steps along noisy gradients, of a size that does not depend on theirs.

Source:
    D. Kingma and J. Ba, Adam, arXiv:1412.6980, algorithm 1.
"""

from collections.abc import Mapping

import numpy as np

BETAS = np.array([0.9, 0.999])
"""Adam's decay rates of its first and second moment."""

EPSILON = 1e-8
"""What Adam adds to a root that may be 0."""


class Adam:
    """Mean of the gradient and of its square, and both rates to the power of steps."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        """Begin with gradients of that shape."""
        self._moments = np.zeros((2, *shape))
        self._powers = np.ones(2)

    def step(self, gradient: np.ndarray) -> np.ndarray:
        """The step of size 1 `(...)`, up along the next gradient `(...)`."""
        each = (2, *[1] * gradient.ndim)
        betas = BETAS.reshape(each)
        new = np.stack([gradient, gradient * gradient])
        self._moments = betas * self._moments + (1 - betas) * new
        self._powers = self._powers * BETAS
        mean, square = self._moments / (1 - self._powers).reshape(each)
        return mean / (np.sqrt(square) + EPSILON)

    def load(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Continue where `arrays` were taken."""
        self._moments, self._powers = arrays["moments"], arrays["powers"]

    def arrays(self) -> dict[str, np.ndarray]:
        """Arrays of the state."""
        return {"moments": self._moments.copy(), "powers": self._powers.copy()}
