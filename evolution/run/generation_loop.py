"""The generation loop: ask, evaluate, tell, and a record of each round.

Consumers (progress, checkpoints, figures) read the records and cannot change the
result. Randomness is keyed by what it is for: `random_generator(seed, purpose, ...)`.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import astuple, dataclass, replace

import numpy as np

from epuck_mj.errors import UserError
from epuck_mj.scene.changed_robots import with_body_margin
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import is_kinematic, on_wheels
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.disturbances import Disturbances
from evolution.judging.evaluation import (
    BatchEngine,
    DmControlEngine,
    Engine,
    Evaluation,
    evaluate,
)
from evolution.judging.lessons import (
    Circumstances,
    GivenLessons,
    LessonRobots,
    learnable,
)
from evolution.run.history import Record, history_text
from evolution.search.l_shade import LShadeParameters
from evolution.search.sequence import SequenceParameters
from evolution.search.table import AskTellError, Optimizer, make_optimizer
from evolution.settings.config import ExperimentConfig
from evolution.settings.memory import check_needs
from evolution.settings.randomness import Purpose, disturbances, random_generator

ENGINES = ("batch", "dm_control")


ARRAYS = {"records": len(Record.__dataclass_fields__), "best_genomes": None}
"""Arrays of a state, one row per generation, and their columns (None: genes)."""

EngineMaker = Callable[[Scene], Engine]
"""Makes the engine for a scene; its `str` is what the provenance calls it."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where the robots of a run drive.

    Attributes:
        scene: the robot that the run begins with, in its arena.
        space: where that robot may start.
        evolved: the same with the margin of its body, and the robot that the run climbs
            to there, if it climbs.
    """

    scene: Scene
    space: FreeSpace
    evolved: tuple[Scene, ...]

    @classmethod
    def of(cls, config: ExperimentConfig) -> "Place":
        """The place of a config, loaded.

        Raises:
            UserError: if robot or arena cannot be used.
        """
        scene = load_scene(config.robot, config.arena, config.control_step)
        space, scenes = FreeSpace(scene, config.start_clearance), [scene]
        if config.climbs:
            wheels = on_wheels(config.robot)
            scenes.append(load_scene(wheels, config.arena, config.control_step))
        evolved = [with_body_margin(each, config.body_margin) for each in scenes]
        return cls(scene, space, tuple(evolved))


class Evolution:
    """A run of evolution that can be stopped and resumed between generations.

    A run that climbs begins on the kinematic robot, which is cheap, and spends the rest
    of its budget on wheels in MuJoCo. There its population is evaluated anew, paid from
    the budget: no fitness of the kinematic robot is kept.
    """

    def __init__(
        self,
        config: ExperimentConfig,
        engine: str | EngineMaker = "batch",
        threads: int = 0,
        racing: bool = True,
        place: "Callable[[ExperimentConfig], Place] | None" = None,
    ):
        """Load the scene and draw the first population.

        Args:
            config: what to do.
            engine: one of `ENGINES`, or a maker of engines: how trials are stepped, not
                what they give.
            threads: of the batch engine; 0 is one per core.
            racing: break off individuals that can only lose; changes no result.
            place: gives where the config's robots drive; None loads it.

        Raises:
            UserError: if robot or arena cannot be used, the budget is too small, or
                memory is.
        """
        check_needs(config)
        self.config = config
        where = (place or Place.of)(config)
        self.scene, self.space, self._evolved = where.scene, where.space, where.evolved
        self._maker: EngineMaker = (
            (lambda scene: make_engine(engine, scene, config, threads))
            if isinstance(engine, str)
            else engine
        )
        self.engine = self._maker(self._evolved[0])
        # racing needs the maximum of the fitness
        self.racing = racing and config.task.step_fitness.maximum is not None
        self.optimizer = _optimizer(config)
        self._threads = threads
        self._lesson_scene, self._lesson_robots = self._evolved[0], None
        if self.optimizer.needs_lessons:
            learnable(config.topology)
        self.records: list[Record] = []
        self.best_genomes: list[np.ndarray] = []
        """Best individual of the population after each generation, `(genes,)`."""
        if self.optimizer.next_cost() > config.evaluations:
            raise UserError(
                f"expected a budget of at least one generation, "
                f"{self.optimizer.next_cost()} evaluations, got {config.evaluations}"
            )

    @property
    def evaluations(self) -> int:
        """Individuals evaluated so far."""
        return self.records[-1].evaluations if self.records else 0

    @property
    def climbed(self) -> bool:
        """Whether evolution has gone on to wheels."""
        return bool(self.records) and self.records[-1].climbed

    @property
    def _climbs_now(self) -> bool:
        """Whether the next generation is the first on wheels.

        A run stays where it is if its budget does not suffice to evaluate the
        population anew there and a generation after it.
        """
        config = self.config
        due = self.evaluations >= config.climb * config.evaluations
        size = len(self.optimizer.population) + self.optimizer.next_cost()
        fits = self.evaluations + size <= config.evaluations
        return config.climbs and not self.climbed and due and fits

    @property
    def finished(self) -> bool:
        """Whether the budget has no evaluations left for another generation."""
        return self.evaluations + self.optimizer.next_cost() > self.config.evaluations

    def run(self) -> Iterator[Record]:
        """Evolve until the budget is spent; one record per generation."""
        while not self.finished:
            yield self._generation()

    def climb(self) -> None:
        """Run all further trials on wheels."""
        wheels = self._evolved[-1]
        self.engine = self._maker(wheels)
        self._lesson_scene, self._lesson_robots = wheels, None

    def release(self) -> None:
        """Free the simulated robots, hundreds of megabytes, once all is evolved."""
        vars(self).pop("engine", None)
        self._lesson_robots = None

    def _generation(self) -> Record:
        generation, climbs = self.optimizer.generation, self._climbs_now
        spent, evaluations = self.evaluations, []
        if climbs:
            self.climb()
            known = self.optimizer.population
            evaluations.append(self._evaluated(known))
            self.optimizer.judge_anew(evaluations[-1].fitness)
            spent += len(known)
        spent += self.optimizer.next_cost()
        genomes, lessons = self._asked()
        to_beat = self.optimizer.to_beat() if self.racing else None
        evaluations.append(self._evaluated(genomes, to_beat))
        self.optimizer.tell(evaluations[-1].fitness)
        # the worst there is, what NaN counts as, is no number for a mean
        stored = self.optimizer.fitness
        fitness = np.where(np.isneginf(stored), 0.0, stored)
        record = Record(
            generation=generation,
            evaluations=spent,
            best=float(fitness.max()),
            mean=float(fitness.mean()),
            std=float(fitness.std()),
            control_steps=sum(int(each.steps.sum()) for each in evaluations)
            + (lessons.control_steps if lessons else 0),
            crash_rate=float(np.concatenate([e.crashed for e in evaluations]).mean()),
            climbed=self.climbed or climbs,
        )
        self.records.append(record)
        self.best_genomes.append(self.optimizer.population[fitness.argmax()].copy())
        return record

    def _asked(self) -> tuple[np.ndarray, GivenLessons | None]:
        """Genomes of the next generation, and the lessons that it has had, if any."""
        cost = self.optimizer.next_cost()
        genomes = self.optimizer.ask()
        if cost <= len(genomes):
            return genomes, None
        lessons = self._lessons(self.optimizer.generation)
        self.optimizer.learn_in_life(lessons)
        genomes = self.optimizer.pending()
        if lessons.cost != cost - len(genomes):
            raise AskTellError(
                f"expected lessons of {cost - len(genomes)} evaluations, "
                f"got {lessons.cost}"
            )
        return genomes, lessons

    def _evaluated(
        self, genomes: np.ndarray, to_beat: np.ndarray | None = None
    ) -> Evaluation:
        """Evaluation of genomes, with the starts and robots of this generation."""
        generation = self.optimizer.generation
        starts = self.starts(generation, len(genomes))
        met = self.disturbances(generation)
        topology = self.config.topology
        return evaluate(self.engine, topology, genomes, starts, to_beat, met)

    def _lessons(self, generation: int) -> GivenLessons:
        """The lessons of a generation, with starts and disturbances of their own."""
        config = self.config
        if self._lesson_robots is None:
            self._lesson_robots = LessonRobots(
                self._lesson_scene, config.task, self._threads
            )

        def circumstances(number: int, trials: int) -> Circumstances:
            key = (Purpose.LESSONS, generation, number)
            rng = random_generator(config.seed, *key)
            starts = self.space.sample(rng, trials)
            met = disturbances(
                config.conditions, trials, config.steps, config.seed, *key
            )
            return Circumstances(starts, met, rng)

        return GivenLessons(
            self._lesson_robots, config.topology, circumstances, config.trials
        )

    def starts(self, generation: int, individuals: int) -> np.ndarray:
        """Starts of a generation, the same for every algorithm of that seed.

        Returns:
            Poses `(trials, 3)` for all individuals; or, if each has its own,
            `(individuals, trials, 3)`.
        """
        config = self.config
        key = (Purpose.STARTS, generation // config.starts_every)
        rng, trials = random_generator(config.seed, *key), config.trials
        if not config.own_starts:
            return self.space.sample(rng, trials)
        return self.space.sample(rng, individuals * trials).reshape(-1, trials, 3)

    def disturbances(self, generation: int) -> Disturbances | None:
        """Disturbances of a generation's trials, the same for every individual.

        None if its robots are ideal.
        """
        config, key = self.config, (Purpose.STARTS, generation)
        return disturbances(
            config.conditions, config.trials, config.steps, config.seed, *key
        )

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
            Record(int(k), int(n), best, mean, std, int(steps), crashed, bool(climbed))
            for k, n, best, mean, std, steps, crashed, climbed in rows.tolist()
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
        if self.climbed:
            self.climb()

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
        """Text of history.csv."""
        return history_text(self.records, self.scene.name)


def _optimizer(config: ExperimentConfig) -> Optimizer:
    """The optimiser at generation 0."""
    rng = random_generator(config.seed, Purpose.SEARCH)
    parameters = config.optimizer
    budgeted = isinstance(parameters, LShadeParameters | SequenceParameters)
    if budgeted and not parameters.budget:
        parameters = replace(parameters, budget=config.evaluations)
    try:
        return make_optimizer(parameters, config.search_space, rng)
    except ValueError as error:
        raise UserError(str(error)) from None


def make_engine(
    name: str, scene: Scene, config: ExperimentConfig, threads: int
) -> Engine:
    """The engine of that name.

    Raises:
        UserError: if there is none.
    """
    # dm_control steps MuJoCo: what is not simulated there has no other engine
    if name == "batch" or (name in ENGINES and is_kinematic(scene.name)):
        return BatchEngine(scene, config.task, threads)
    if name == "dm_control":
        if config.noise != "none":
            raise UserError(
                f"engine dm_control supports ideal robots only, got noise "
                f"{config.noise}; expected engine batch"
            )
        return DmControlEngine(scene, config.task)
    raise UserError(f"unknown engine '{name}'; available: {', '.join(ENGINES)}")
