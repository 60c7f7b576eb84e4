"""Search space: bounds and initial range of genomes."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SearchSpace:
    """A box of genomes `(genes,)`, with the box in which the search begins.

    Attributes:
        genes: length of a genome.
        lower: smallest allowed value, the same for every gene.
        upper: largest allowed value, the same for every gene.
        init_lower: lower end of the initial uniform population.
        init_upper: upper end of the initial uniform population.

    Raises:
        ValueError: no genes, an empty or infinite box, or a beginning outside of it.
    """

    genes: int
    lower: float
    upper: float
    init_lower: float
    init_upper: float

    def __post_init__(self) -> None:
        """Refuse a box that cannot be searched."""
        if self.genes < 1:
            raise ValueError(f"expected at least 1 gene, got {self.genes}")
        if not -np.inf < self.lower < self.upper < np.inf:
            raise ValueError(
                f"expected finite bounds, lower < upper, got {self.lower}, {self.upper}"
            )
        if not self.lower <= self.init_lower <= self.init_upper <= self.upper:
            raise ValueError(
                f"expected an initial range inside [{self.lower}, {self.upper}], "
                f"got [{self.init_lower}, {self.init_upper}]"
            )


def refuse_wide_steps(sigma: float, space: SearchSpace, called: str = "sigma") -> None:
    """Refuse steps that are wider than the bounds.

    Raises:
        ValueError: `sigma` exceeds their width; it is `called` so in the message.
    """
    width = space.upper - space.lower
    if sigma > width:
        raise ValueError(
            f"{called}: expected at most {width}, the width of the bounds, got {sigma}"
        )
