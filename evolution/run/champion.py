"""Champion: the best individual of a run on held-out starts.

An optimiser that never re-evaluates keeps its luckiest draws. So the candidates are
compared on validation starts and the winner is reported on test starts; both sets are
fixed, the same for all runs, and never used in evolution.
"""

from dataclasses import dataclass

import numpy as np

from evolution.judging.evaluation import Engine, evaluate
from evolution.judging.held_out_starts import (
    held_out_disturbances,
    starts_for_validation,
)
from evolution.run.generation_loop import Evolution
from evolution.settings.randomness import Purpose

BEST_OF_POPULATION = 0.1
"""Share of the final population whose members are candidates."""

LATEST_BEST = 20
"""Number of the latest best-so-far individuals that are candidates."""


@dataclass(frozen=True)
class Champion:
    """The champion of a run.

    Attributes:
        genome: its weights, `(genes,)`.
        stored_fitness: what evolution believed of it.
        validation_fitness: its mean on the validation starts.
    """

    genome: np.ndarray
    stored_fitness: float
    validation_fitness: float


def candidates(evolution: Evolution) -> tuple[np.ndarray, np.ndarray]:
    """Genomes `(n, genes)` of the candidates and their stored fitness `(n,)`."""
    population, fitness = evolution.optimizer.population, evolution.optimizer.fitness
    n_best = max(1, round(BEST_OF_POPULATION * len(population)))
    order = np.argsort(-fitness, kind="stable")[:n_best]
    # the generations that raised the run's best
    best = np.array([record.best for record in evolution.records])
    before = np.concatenate([[-np.inf], np.maximum.accumulate(best)[:-1]])
    raised = np.flatnonzero(best > before)[-LATEST_BEST:]
    genomes = [population[order], np.array(evolution.best_genomes)[raised]]
    genomes, stored = (
        np.concatenate(genomes),
        np.concatenate([fitness[order], best[raised]]),
    )
    _, first = np.unique(genomes, axis=0, return_index=True)
    first.sort()
    return genomes[first], stored[first]


def most_believed(evolution: Evolution) -> tuple[np.ndarray, float]:
    """The genome `(genes,)` with the highest stored fitness, and that fitness.

    What a run without held-out starts would show as its best.
    """
    best = [record.best for record in evolution.records]
    generation = int(np.argmax(best))
    return evolution.best_genomes[generation], best[generation]


def choose_champion(engine: Engine, evolution: Evolution) -> Champion:
    """The candidate with the highest mean on the validation starts."""
    config = evolution.config
    genomes, stored = candidates(evolution)
    starts = starts_for_validation(evolution.space, config.validation_starts)
    # as it was evolved: robots that are disturbed alike
    met = held_out_disturbances(
        config.conditions, Purpose.VALIDATION, len(starts), config.steps
    )
    fitness = evaluate(
        engine, config.topology, genomes, starts, disturbances=met
    ).fitness
    best = int(fitness.argmax())
    return Champion(genomes[best], float(stored[best]), float(fitness[best]))
