"""Champion: the best individual of a run on held-out starts.

An optimiser that never re-evaluates keeps its luckiest draws. So the candidates are
compared on validation starts and the winner is reported on test starts; both sets are
fixed, the same for all runs, and never used in evolution.
"""

import math
from dataclasses import dataclass

import numpy as np

from epuck_mj.scene.model_files import is_kinematic
from evolution.judging.evaluation import Engine, evaluate
from evolution.judging.held_out_starts import (
    held_out_disturbances,
    starts_for_validation,
)
from evolution.run.generation_loop import Evolution
from evolution.settings.randomness import Purpose

LATEST_BEST = 20
"""Number of the latest best-so-far individuals that are candidates."""

SCREENED = 10
"""Number of candidates that are left after the first round."""

N_SCREENING = 1000
"""Number of starts of their second round on the kinematic robot."""

FIRST_SHARE = 0.1
"""Share of the starts of the first round in MuJoCo, where all have to be simulated."""


@dataclass(frozen=True)
class Champion:
    """The champion of a run.

    Attributes:
        genome: its weights, `(genes,)`.
        stored_fitness: what evolution stored for it.
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
        climbed: whether that was on wheels, after the run had climbed.
    """

    population: np.ndarray
    fitness: np.ndarray
    best_genomes: np.ndarray
    best: np.ndarray
    climbed: bool = False


def stored_by(evolution: Evolution) -> Stored:
    """What a run has stored so far; if it has climbed, since the climb."""
    same = [record.climbed == evolution.climbed for record in evolution.records]
    first = same.index(True)
    return Stored(
        evolution.optimizer.population,
        evolution.optimizer.fitness,
        np.array(evolution.best_genomes[first:]),
        np.array([record.best for record in evolution.records[first:]]),
        evolution.climbed,
    )


def candidates(stored: Stored) -> tuple[np.ndarray, np.ndarray]:
    """Genomes `(n, genes)` of the candidates and their stored fitness `(n,)`.

    The whole final population, the best first, and the latest of the best so far.
    """
    population, fitness, best = stored.population, stored.fitness, stored.best
    order = np.argsort(-fitness, kind="stable")
    # the generations that raised the run's best
    before = np.concatenate([[-np.inf], np.maximum.accumulate(best)[:-1]])
    raised = np.flatnonzero(best > before)[-LATEST_BEST:]
    genomes = np.concatenate([population[order], stored.best_genomes[raised]])
    stored_fitness = np.concatenate([fitness[order], best[raised]])
    _, first = np.unique(genomes, axis=0, return_index=True)
    first.sort()
    return genomes[first], stored_fitness[first]


def best_stored(stored: Stored) -> tuple[np.ndarray, float]:
    """The genome `(genes,)` with the highest stored fitness, and that fitness.

    What a run without held-out starts would show as its best.
    """
    generation = int(stored.best.argmax())
    return stored.best_genomes[generation], float(stored.best[generation])


def choose_champion(
    engine: Engine, evolution: Evolution, stored: Stored, wheels: Engine | None = None
) -> Champion:
    """The candidate with the highest mean on validation starts.

    All candidates have a first round, and the best of them a second one: the same for
    every algorithm. On the kinematic robot, where trials cost next to nothing, that is
    on more starts, and the best few of these are compared on wheels.

    Args:
        engine: of the robot that evolution began with.
        evolution: whose setting is that of the trials.
        stored: whose candidates they are.
        wheels: engine of the robot on wheels, for finalists; None if there are none.
    """
    config = evolution.config
    n = config.validation_starts
    if is_kinematic(config.robot):
        second = max(n, N_SCREENING)
        rounds = [(engine, n, SCREENED), (engine, second, config.finalists)]
        if config.has_finalists and wheels is not None:
            rounds.append((wheels, n, 1))
    else:
        rounds = [(engine, math.ceil(n * FIRST_SHARE), SCREENED), (engine, n, 1)]
    genomes, stored_fitness = candidates(stored)
    fitness = stored_fitness
    for judge, starts, kept in rounds:
        fitness = _validated(judge, evolution, genomes, starts)
        order = np.argsort(-fitness, kind="stable")[: max(kept, 1)]
        genomes, stored_fitness = genomes[order], stored_fitness[order]
        fitness = fitness[order]
    return Champion(genomes[0], float(stored_fitness[0]), float(fitness[0]))


def _validated(
    engine: Engine, evolution: Evolution, genomes: np.ndarray, n: int
) -> np.ndarray:
    """Mean fitness of genomes `(k, genes)` on `n` validation starts, `(k,)`."""
    config = evolution.config
    starts = starts_for_validation(evolution.space, n)
    # with the disturbances of evolution
    met = held_out_disturbances(
        config.conditions, Purpose.VALIDATION, len(starts), config.steps
    )
    return evaluate(engine, config.topology, genomes, starts, disturbances=met).fitness
