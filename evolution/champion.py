"""Champion: the best of a run by fresh starts, not by what the run believes.

An optimiser that never re-evaluates keeps its luckiest draws. So the candidates are
compared on validation starts and the winner is reported on test starts; both sets are
fixed, the same for all runs, and never used in evolution.
"""

from dataclasses import dataclass

import numpy as np

from epuck_mj.disturbances import Disturbances
from epuck_mj.starts import FreeSpace
from evolution.conditions import Conditions
from evolution.evaluation import Engine, evaluate
from evolution.experiment import Experiment, Purpose, disturbances, random_generator

HELD_OUT_SEED = 0
"""Seed of validation and test starts: no run's seed reaches their streams."""

N_VALIDATION = 200
N_TEST = 1000

BEST_OF_POPULATION = 0.1
"""Share of the final population that are candidates."""

LATEST_BEST = 20
"""Latest entries of the run's best-so-far list that are candidates."""


def starts_for_validation(space: FreeSpace) -> np.ndarray:
    """The starts on which champions are chosen, `(200, 3)`."""
    rng = random_generator(HELD_OUT_SEED, Purpose.VALIDATION)
    return space.sample(rng, N_VALIDATION)


def starts_for_test(space: FreeSpace, n: int = N_TEST) -> np.ndarray:
    """The first `n` of the starts on which champions are reported, `(n, 3)`."""
    return space.sample(random_generator(HELD_OUT_SEED, Purpose.TEST), n)


def held_out_disturbances(
    conditions: Conditions, purpose: Purpose, n: int, steps: int
) -> Disturbances | None:
    """What champions meet in `n` trials of `steps`; in fewer, something else."""
    return disturbances(conditions, n, steps, HELD_OUT_SEED, purpose)


@dataclass(frozen=True)
class Champion:
    """The winner of a run.

    Attributes:
        genome: its weights, `(genes,)`.
        stored_fitness: what evolution believed of it.
        validation_fitness: its mean on the validation starts.
    """

    genome: np.ndarray
    stored_fitness: float
    validation_fitness: float


def candidates(experiment: Experiment) -> tuple[np.ndarray, np.ndarray]:
    """Genomes `(n, genes)` that may be champion and their stored fitness `(n,)`."""
    population, fitness = experiment.optimizer.population, experiment.optimizer.fitness
    n_best = max(1, round(BEST_OF_POPULATION * len(population)))
    order = np.argsort(-fitness, kind="stable")[:n_best]
    # the generations that raised the run's best
    best = np.array([record.best for record in experiment.records])
    before = np.concatenate([[-np.inf], np.maximum.accumulate(best)[:-1]])
    raised = np.flatnonzero(best > before)[-LATEST_BEST:]
    genomes = [population[order], np.array(experiment.best_genomes)[raised]]
    genomes, stored = (
        np.concatenate(genomes),
        np.concatenate([fitness[order], best[raised]]),
    )
    _, first = np.unique(genomes, axis=0, return_index=True)
    first.sort()
    return genomes[first], stored[first]


def most_believed(experiment: Experiment) -> tuple[np.ndarray, float]:
    """The genome `(genes,)` with the highest stored fitness of the run, and that.

    What a run without held-out starts would show as its best.
    """
    best = [record.best for record in experiment.records]
    generation = int(np.argmax(best))
    return experiment.best_genomes[generation], best[generation]


def choose_champion(engine: Engine, experiment: Experiment) -> Champion:
    """The candidate with the highest mean on the validation starts."""
    genomes, stored = candidates(experiment)
    starts = starts_for_validation(experiment.space)
    network = experiment.config.network
    # as it was evolved: robots that are disturbed alike
    config = experiment.config
    met = held_out_disturbances(
        config.conditions, Purpose.VALIDATION, len(starts), config.steps
    )
    fitness = evaluate(engine, network, genomes, starts, disturbances=met).fitness
    best = int(fitness.argmax())
    return Champion(genomes[best], float(stored[best]), float(fitness[best]))
