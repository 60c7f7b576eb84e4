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


@dataclass(frozen=True, eq=False)
class Stored:
    """What a run stored of its individuals.

    Attributes:
        population: genomes of the final population, `(n, genes)`.
        fitness: of the final population, `(n,)`.
        best_genomes: the best individual of each generation, `(generations, genes)`.
        best: its fitness, `(generations,)`.
    """

    population: np.ndarray
    fitness: np.ndarray
    best_genomes: np.ndarray
    best: np.ndarray


def stored_by(evolution: Evolution) -> Stored:
    """What a run has stored by now."""
    return Stored(
        evolution.optimizer.population,
        evolution.optimizer.fitness,
        np.array(evolution.best_genomes),
        np.array([record.best for record in evolution.records]),
    )


def candidates(stored: Stored) -> tuple[np.ndarray, np.ndarray]:
    """Genomes `(n, genes)` of the candidates and their stored fitness `(n,)`."""
    population, fitness, best = stored.population, stored.fitness, stored.best
    n_best = max(1, round(BEST_OF_POPULATION * len(population)))
    order = np.argsort(-fitness, kind="stable")[:n_best]
    # the generations that raised the run's best
    before = np.concatenate([[-np.inf], np.maximum.accumulate(best)[:-1]])
    raised = np.flatnonzero(best > before)[-LATEST_BEST:]
    genomes = np.concatenate([population[order], stored.best_genomes[raised]])
    believed = np.concatenate([fitness[order], best[raised]])
    _, first = np.unique(genomes, axis=0, return_index=True)
    first.sort()
    return genomes[first], believed[first]


def most_believed(stored: Stored) -> tuple[np.ndarray, float]:
    """The genome `(genes,)` with the highest stored fitness, and that fitness.

    What a run without held-out starts would show as its best.
    """
    generation = int(stored.best.argmax())
    return stored.best_genomes[generation], float(stored.best[generation])


def choose_champion(engine: Engine, evolution: Evolution, stored: Stored) -> Champion:
    """The candidate with the highest mean on the validation starts.

    Args:
        engine: what runs the trials.
        evolution: whose setting is that of the trials.
        stored: whose candidates they are.
    """
    config = evolution.config
    genomes, believed = candidates(stored)
    starts = starts_for_validation(evolution.space, config.validation_starts)
    # as it was evolved: robots that are disturbed alike
    met = held_out_disturbances(
        config.conditions, Purpose.VALIDATION, len(starts), config.steps
    )
    fitness = evaluate(
        engine, config.topology, genomes, starts, disturbances=met
    ).fitness
    best = int(fitness.argmax())
    return Champion(genomes[best], float(believed[best]), float(fitness[best]))
