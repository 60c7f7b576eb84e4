"""Memory that an experiment needs: products of its keys that are too large together."""

import math
from collections.abc import Iterator
from typing import Any

from epuck_mj.host.memory import TRACK_BYTES, check_memory
from evolution.search.cma_es import CmaEsParameters
from evolution.search.differential_evolution import DifferentialEvolutionParameters
from evolution.search.genetic_algorithm import GeneticAlgorithmParameters
from evolution.search.l_shade import MIN_POPULATION, LShadeParameters
from evolution.search.table import searches
from evolution.settings.config import ExperimentConfig

COPIES = 8 * 8
"""Bytes of a float of an array of which several copies are made on the way."""

LESSON_BYTES = 11 * 8 * 2
"""Bytes of a control step of a lesson: observation, two outputs and reward, twice."""


def check_needs(config: ExperimentConfig) -> None:
    """Refuse an experiment that needs more memory than this computer has.

    Raises:
        UserError: naming the keys.
    """
    sizes = [
        (math.prod(factors.values()) * size, factors) for factors, size in needs(config)
    ]
    size, factors = max(sizes, key=lambda each: each[0])
    keys = " x ".join(f"{key} ({value:,})" for key, value in factors.items())
    check_memory(keys, size)


def needs(config: ExperimentConfig) -> Iterator[tuple[dict[str, int], int]]:
    """The largest arrays: numbers multiplied there, and bytes of each entry."""
    steps = {"steps": config.steps}
    trials = {"trials": config.trials}
    yield trials | steps, TRACK_BYTES
    yield {"test_starts": config.test_starts} | steps, TRACK_BYTES
    for search in searches(config.optimizer):
        yield from _needs_of_search(search, config)
        for key in ("batch", "demonstrations"):
            if lessons := getattr(search, key, 0):
                yield {key: lessons} | trials | steps, LESSON_BYTES


def _needs_of_search(
    optimizer: Any, config: ExperimentConfig
) -> Iterator[tuple[dict[str, int], int]]:
    # a user's optimiser may have none of these fields
    keys = [each for each in ("lineages", "pairs") if hasattr(optimizer, each)]
    key = keys[0] if keys else "population"
    individuals = getattr(optimizer, key, 1)
    if not isinstance(individuals, int) or individuals < 1:
        individuals = 1
    population, trials = {key: individuals}, {"trials": config.trials}
    weights = {"weights of the network": config.topology.n_genes}
    yield population | trials | weights, COPIES
    # genomes of all candidates, repeated for each start
    yield {"validation_starts": config.validation_starts} | population | weights, 8
    generations = {f"evaluations / {key}": config.evaluations // individuals}
    yield generations | weights, COPIES
    if isinstance(optimizer, DifferentialEvolutionParameters):
        # keys of the shuffle that chooses parents
        yield population | {"itself": individuals}, COPIES
    if isinstance(optimizer, GeneticAlgorithmParameters):
        yield population | {"bits": optimizer.bits} | weights, COPIES
        yield population | {"tournament": optimizer.tournament}, COPIES
    if isinstance(optimizer, LShadeParameters):
        # its population shrinks to MIN_POPULATION
        generations = {
            f"evaluations / {MIN_POPULATION}": config.evaluations // MIN_POPULATION
        }
        yield generations | weights, COPIES
    if isinstance(optimizer, CmaEsParameters):
        yield weights | {"itself": config.topology.n_genes}, COPIES
