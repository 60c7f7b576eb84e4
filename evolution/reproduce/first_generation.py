"""First generations by each fitness: why equation (2) is not taken as printed.

As printed, turning costs nothing away from walls, so a robot that drives circles in the
open is near the maximum before evolution has begun.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from evolution.judging.held_out import Judge
from evolution.run.generation_loop import Evolution
from evolution.settings.config import ExperimentConfig

FRESH_STARTS = 100
"""Number of starts on which the best individual is tested."""


@dataclass(frozen=True)
class FirstGeneration:
    """The best individual of a first population by one fitness function.

    Attributes:
        fitness: name of the step fitness.
        individuals: how many were drawn.
        best: stored fitness of the best of them.
        held_out: mean of that individual on fresh starts.
        behaviour: share of those trials by behaviour class.
    """

    fitness: str
    individuals: int
    best: float
    held_out: float
    behaviour: Mapping[str, float]


def first_generation(config: ExperimentConfig, fitness: str) -> FirstGeneration:
    """Evaluate the first generation of an experiment by a fitness function.

    Raises:
        UserError: if robot or arena cannot be used.
    """
    config = config.model_copy(update={"fitness": fitness})
    evolution = Evolution(config)
    record = next(evolution.run())
    judge = Judge(evolution.scene, evolution.space, config.task)
    best = config.topology.decode(evolution.best_genomes[0])
    test = judge.test(best, FRESH_STARTS)
    return FirstGeneration(
        fitness, record.evaluations, record.best, test.mean, test.behaviour
    )
