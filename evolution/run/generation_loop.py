"""The generation loop: ask, evaluate, tell, and a record of each round.

Consumers (progress, checkpoints, figures) read the records and cannot change the
result. Randomness is keyed by what it is for: `random_generator(seed, purpose, ...)`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import astuple, dataclass

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.disturbances import Disturbances
from evolution.judging.evaluation import BatchEngine, DmControlEngine, Engine, evaluate
from evolution.search.table import Optimizer, make_optimizer
from evolution.settings.config import ExperimentConfig
from evolution.settings.memory import check_needs
from evolution.settings.randomness import Purpose, disturbances, random_generator

ENGINES = ("batch", "dm_control")


@dataclass(frozen=True)
class Record:
    """Record of one generation: fitness, then cost.

    Attributes:
        generation: counted from 0, the initial population.
        evaluations: individuals evaluated so far.
        best: highest stored fitness of the population.
        mean: mean stored fitness of the population.
        std: its standard deviation.
        control_steps: of all its trials together; racing makes them fewer.
        crash_rate: share of its trials that ended in a crash; racing breaks some off
            before they can.
    """

    generation: int
    evaluations: int
    best: float
    mean: float
    std: float
    control_steps: int
    crash_rate: float


ARRAYS = {"records": len(Record.__dataclass_fields__), "best_genomes": None}
"""Arrays of a state, one row per generation, and their columns (None: genes)."""

HISTORY: tuple[str, ...] = ("generation", "evaluations", "best", "mean", "std")
"""Columns of history.csv: racing changes none of them."""


class Evolution:
    """A run of evolution that can be stopped and resumed between generations."""

    def __init__(
        self,
        config: ExperimentConfig,
        engine: str | Engine = "batch",
        threads: int = 0,
        racing: bool = True,
    ):
        """Load the scene and draw the first population.

        Args:
            config: what to do.
            engine: one of `ENGINES`, or an engine: how trials are stepped, not what
                they give.
            threads: of the batch engine; 0 is one per core.
            racing: break off individuals that can only lose; changes no result.

        Raises:
            UserError: if robot or arena cannot be used, the budget is too small, or
                memory is.
        """
        check_needs(config)
        self.config = config
        self.scene = load_scene(config.robot, config.arena, config.control_step)
        self.space = FreeSpace(self.scene, config.start_clearance)
        if isinstance(engine, str):
            engine = make_engine(engine, self.scene, config, threads)
        self.engine = engine
        # that an individual can only lose shows only if fitness has a maximum
        self.racing = racing and config.task.step_fitness.maximum is not None
        self.optimizer = _optimizer(config)
        self.records: list[Record] = []
        self.best_genomes: list[np.ndarray] = []
        """Best individual of the population after each generation, `(genes,)`."""
        if self.optimizer.next_size() > config.evaluations:
            raise UserError(
                f"expected a budget of at least one generation, "
                f"{self.optimizer.next_size()} evaluations, got {config.evaluations}"
            )

    @property
    def evaluations(self) -> int:
        """Individuals evaluated so far."""
        return self.records[-1].evaluations if self.records else 0

    @property
    def finished(self) -> bool:
        """Whether the budget has no evaluations left for another generation."""
        size = self.optimizer.next_size()
        return self.evaluations + size > self.config.evaluations

    def run(self) -> Iterator[Record]:
        """Evolve until the budget is spent; one record per generation."""
        while not self.finished:
            yield self._generation()

    def _generation(self) -> Record:
        config = self.config
        generation = self.optimizer.generation
        # the same starts for every individual, and for every algorithm of that seed
        rng = random_generator(config.seed, Purpose.STARTS, generation)
        starts = self.space.sample(rng, config.trials)
        genomes = self.optimizer.ask()
        to_beat = self.optimizer.to_beat() if self.racing else None
        evaluation = evaluate(
            self.engine,
            config.topology,
            genomes,
            starts,
            to_beat,
            self._disturbances(generation),
        )
        self.optimizer.tell(evaluation.fitness)
        # the worst there is, what NaN counts as, is no number for a mean
        stored = self.optimizer.fitness
        fitness = np.where(np.isneginf(stored), 0.0, stored)
        record = Record(
            generation=generation,
            evaluations=self.evaluations + len(genomes),
            best=float(fitness.max()),
            mean=float(fitness.mean()),
            std=float(fitness.std()),
            control_steps=int(evaluation.steps.sum()),
            crash_rate=float(evaluation.crashed.mean()),
        )
        self.records.append(record)
        self.best_genomes.append(self.optimizer.population[fitness.argmax()].copy())
        return record

    def _disturbances(self, generation: int) -> Disturbances | None:
        """Disturbances of a generation's trials, the same for every individual."""
        config, key = self.config, (Purpose.STARTS, generation)
        n, steps, seed = config.trials, config.steps, config.seed
        return disturbances(config.conditions, n, steps, seed, *key)

    def state(self) -> dict[str, np.ndarray]:
        """State from which evolution resumes, with the records so far."""
        optimizer = self.optimizer.state()
        return {
            "records": np.array([astuple(record) for record in self.records]),
            "best_genomes": np.array(self.best_genomes),
            **{f"optimizer.{name}": array for name, array in optimizer.items()},
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a `state`.

        Raises:
            ValueError: if it does not belong to this run.
        """
        prefix = "optimizer."
        rows, genomes = (self._array(state, name) for name in ARRAYS)
        numbered = np.array_equal(rows[:, 0], np.arange(len(rows)))
        spent = np.diff(rows[:, 1], prepend=0)
        if not (
            numbered and (spent > 0).all() and rows[-1, 1] <= self.config.evaluations
        ):
            raise ValueError(
                "expected 'records' of generations from 0 on, with evaluations that "
                f"rise to at most {self.config.evaluations}"
            )
        records = [
            Record(int(index), int(spent), best, mean, std, int(steps), crashed)
            for index, spent, best, mean, std, steps, crashed in rows.tolist()
        ]
        self.optimizer.restore(
            {
                name.removeprefix(prefix): array
                for name, array in state.items()
                if name.startswith(prefix)
            }
        )
        self.records = records
        self.best_genomes = list(genomes)

    def _array(self, state: Mapping[str, np.ndarray], name: str) -> np.ndarray:
        """A float array of a state, one row per generation told."""
        generation = state.get("optimizer.generation", np.array(0))
        if generation.shape != () or generation.dtype.kind != "i" or generation < 1:
            raise ValueError("expected 1 or more generations")
        expected = (int(generation), ARRAYS[name] or self.config.topology.n_genes)
        array = state.get(name)
        if array is None or array.shape != expected:
            got = "none" if array is None else f"shape {array.shape}"
            raise ValueError(
                f"expected an array '{name}' of shape {expected}, got {got}"
            )
        if array.dtype != float or not np.isfinite(array).all():
            raise ValueError(f"expected an array '{name}' of finite numbers")
        return array

    def history(self) -> str:
        """Text of history.csv, without times, with floats that read back exactly."""
        rows = [
            ",".join(repr(getattr(record, name)) for name in HISTORY)
            for record in self.records
        ]
        return "\n".join([",".join(HISTORY), *rows]) + "\n"


def _optimizer(config: ExperimentConfig) -> Optimizer:
    """The optimiser at generation 0."""
    rng = random_generator(config.seed, Purpose.SEARCH)
    try:
        return make_optimizer(config.optimizer, config.search_space, rng)
    except ValueError as error:
        raise UserError(str(error)) from None


def make_engine(
    name: str, scene: Scene, config: ExperimentConfig, threads: int
) -> Engine:
    """The engine of that name.

    Raises:
        UserError: if there is none.
    """
    if name == "batch":
        return BatchEngine(scene, config.task, threads)
    if name == "dm_control":
        if config.noise != "none":
            raise UserError(
                f"engine dm_control supports ideal robots only, got noise "
                f"{config.noise}; expected engine batch"
            )
        return DmControlEngine(scene, config.task)
    raise UserError(f"unknown engine '{name}'; available: {', '.join(ENGINES)}")
