"""The controllers that the ladder is measured with.

A controller may use errors of the simulator that it evolved on. So there are some that
evolved on each simulator, besides some that did not evolve far.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from epuck_mj.policies.network import Network
from epuck_mj.policies.topology import Topology
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.scene.model_files import KINEMATIC_ROBOT
from epuck_mj.step.control import BatchPolicy, TaskParameters
from evolution.run.champion import choose_champion, stored_by
from evolution.run.directory import RunDirectory
from evolution.run.generation_loop import Evolution
from evolution.settings.config_files import find_config, load_config
from evolution.study.addresses import runs_at
from evolution.study.finished_run import FinishedRun

CHAMPION, EARLIER, RANDOM, BY_HAND = "champion", "earlier", "random", "by hand"

SHARES = (0.05, 0.3)
"""Generations whose best individuals are taken, as shares of a run."""

STUDIES = ("paper", "wheels", "transfer", "good-robot", "real-robots")
"""Studies whose champions are taken."""

CHAMPION_SEEDS = 6
"""Number of runs of each experiment whose champions are taken."""

EARLIER_SEEDS = 1
"""Number of runs of each experiment whose earlier generations are taken."""

N_RANDOM = 15

KINEMATIC_SEEDS = range(1, 11)
"""Seeds of the runs of DE/best on the kinematic robot, which are made here."""

MADE_HERE = "kinematic/de-best"
"""What the names of their champions begin with."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A controller of the ladder.

    Attributes:
        name: where it comes from.
        kind: CHAMPION, EARLIER, RANDOM or BY_HAND.
        evolved_on: name of the robot; empty if it did not evolve.
        task: what its trials are.
        topology: of its network; None for the hand-written wall follower.
        genome: of its network, `(genes,)`.
    """

    name: str
    kind: str
    evolved_on: str
    task: TaskParameters
    topology: Topology | None
    genome: np.ndarray

    def policy(self, n: int) -> BatchPolicy:
        """The controller, for `n` robots."""
        if self.topology is None:
            return WallFollower()
        return self.topology.decode(np.tile(self.genome, (n, 1)))


def tried(results: Path, evolved: dict[str, list[float]]) -> list[Tried]:
    """All controllers.

    Args:
        results: folder with studies.
        evolved: genomes of the runs made here and of earlier generations, by name;
            those that it lacks are evolved and added.
    """
    task, nothing = TaskParameters(), np.zeros(0)
    found = [Tried("wall-follower", BY_HAND, "", task, None, nothing)]
    for run in _runs(results):
        found += _of_run(run, run.path.relative_to(results).as_posix(), evolved)
    found += _on_kinematic_robot(evolved)
    genomes = np.random.default_rng(2026).uniform(-5, 5, (N_RANDOM, Network().n_genes))
    for i, genome in enumerate(genomes):
        found.append(Tried(f"random {i}", RANDOM, "", task, Network(), genome))
    return found


def _runs(results: Path) -> Iterator[FinishedRun]:
    """The first runs of each experiment, by study, experiment and seed."""
    for study in STUDIES:
        for run in runs_at(results / study, histories=True):
            if not isinstance(run, RunDirectory) and run.seed <= CHAMPION_SEEDS:
                yield run


def _of_run(
    run: FinishedRun, name: str, evolved: dict[str, list[float]]
) -> Iterator[Tried]:
    """The champion of a run and, of the first runs, the best of earlier generations.

    The latter only of kinematic runs: on wheels, doing them again takes too long.
    """
    file = run.champion
    robot, network = Path(file.origin.robot).stem, file.network
    yield Tried(name, CHAMPION, robot, file.task, network, file.genome)
    if run.seed > EARLIER_SEEDS or robot != KINEMATIC_ROBOT:
        return
    for share in SHARES:
        generation = round(share * int(run.history["generation"][-1]))
        which = f"{name}, generation {generation}"
        if which not in evolved:
            # no table has it: the run is done again until then
            evolution = Evolution(run.config)
            for _ in islice(evolution.run(), generation + 1):
                pass
            evolved[which] = evolution.best_genomes[generation].tolist()
        genome = np.array(evolved[which])
        yield Tried(which, EARLIER, robot, file.task, network, genome)


def _on_kinematic_robot(evolved: dict[str, list[float]]) -> Iterator[Tried]:
    """Champions of DE/best that have met no other robot."""
    config = load_config(find_config("de-best")).model_copy(
        update={"robot": KINEMATIC_ROBOT, "climb": 1.0, "finalists": 0}
    )
    for seed in KINEMATIC_SEEDS:
        name = f"{MADE_HERE}/seed-{seed}"
        if name not in evolved:
            evolution = Evolution(config.model_copy(update={"seed": seed}))
            for _ in evolution.run():
                pass
            engine, stored = evolution.engine, stored_by(evolution)
            champion = choose_champion(engine, evolution, stored)
            evolved[name] = champion.genome.tolist()
        genome = np.array(evolved[name])
        task, topology = config.task, config.topology
        yield Tried(name, CHAMPION, KINEMATIC_ROBOT, task, topology, genome)
