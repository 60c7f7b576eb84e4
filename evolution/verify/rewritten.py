"""What a run would write now, compared with what is written.

With its checkpoint, a run writes all its results again. A copy without one has its
first generations, which everything random in the config decides, and of the final
population only the champion: whatever of it can be made again is compared.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from epuck_mj.host.csv_text import csv_columns
from epuck_mj.host.own_parts import is_own
from epuck_mj.policies.file import CHAMPIONS
from epuck_mj.scene.model_files import on_wheels
from evolution.judging.evaluation import evaluate
from evolution.judging.held_out import Judge, Judges
from evolution.run.champion import Stored, stored_by
from evolution.run.generation_loop import Evolution
from evolution.run.history import (
    CLIMBED,
    HISTORY,
    ROBOT,
    Record,
    timing_text,
)
from evolution.run.results import judged, shown_trials
from evolution.search.ask_tell import Optimizer
from evolution.settings.comparison import flat
from evolution.verify.differences import lines_of_differences, said, unsaid
from evolution.verify.written import Written

AGAIN = 2
"""Generations that are run again: the initial population, and what is made of it."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a comparison.

    Attributes:
        differing: lines about what would be written otherwise now.
        unsaid: what the champion's file does not say, as older ones do.
    """

    differing: tuple[str, ...]
    unsaid: tuple[str, ...]


def compared(written: Written, judges: Judges, threads: int) -> Outcome:
    """What is written, compared with what would be written now.

    Raises:
        UserError: if the run cannot be repeated here, or its checkpoint is no such.
    """
    evolution = Evolution(written.source, threads=threads)
    lines = [*_made_of(written, evolution), *_evolved(written, evolution)]
    if written.has_checkpoint:
        stored = stored_by(evolution)
    else:
        lines += _histories(written, evolution)
        stored = stored_without_checkpoint(written, evolution)
    tested, best = _judges(written, judges), None
    if written.packed and len(written.best[1]):
        best = written.best[0][0], float(written.best[1][0])
    unknown = written.packed and best is None
    controller, _ = judged(evolution, stored, tested, threads, best=best)
    now, name = json.loads(controller.to_json()), written.run.champion.name
    name = CHAMPIONS if written.packed else name
    if unknown:
        # whose genome is not known: what it says cannot be made again
        before = written.champion["scores"].get("best_stored", {})
        now["scores"]["best_stored"] = before
    known = said(now, written.champion)
    lines += lines_of_differences(name, written.champion, known)
    if written.trajectory is not None:
        policy, judge = controller.controller, tested[on_wheels(written.source.robot)]
        (shown,) = shown_trials(evolution, policy, judge, 1)
        name, before = written.run.trajectory.name, _arrays(written.trajectory)
        lines += lines_of_differences(name, before, _arrays(shown))
    # the first generations are compared twice
    silent = ["best_stored_genome"] if unknown else []
    silent += unsaid(now, written.champion)
    return Outcome(tuple(dict.fromkeys(lines)), tuple(silent))


def _judges(written: Written, judges: Judges) -> Mapping[str, Judge]:
    """Judges of the robots that the champion was tested on, which once were others."""
    config = written.source
    names: list[str] = list(written.champion["scores"]["held_out"])
    robots = {name: name for name in names} | {Path(config.robot).name: config.robot}
    return {name: judges.of(robots[name], config.setting) for name in names}


def _made_of(written: Written, evolution: Evolution) -> Iterator[str]:
    """Lines about the config and the models."""
    run, config = written.run, written.source
    yield from lines_of_differences(run.config.name, flat(written.config), flat(config))
    now = {
        "mjcf_sha256": dict(evolution.scene.sha256),
        "own_sha256": config.own_parts,
    }
    before = {key: written.provenance.get(key, {}) for key in now}
    yield from lines_of_differences(run.provenance.name, before, now)


def _evolved(written: Written, evolution: Evolution) -> Iterator[str]:
    """Lines about the histories: of the beginning, and of all if there is a checkpoint.

    The evolution is at the end of the run then.
    """
    run = written.run
    list(islice(evolution.run(), AGAIN))
    yield from _generations(written, evolution, len(evolution.records))
    if written.has_checkpoint:
        run.restore_checkpoint(evolution)
        yield from _generations(written, evolution, None)
        now = csv_columns(timing_text(evolution.records, (), run.timing))
        yield from lines_of_differences(run.timing.name, written.timing, now)


def _generations(
    written: Written, evolution: Evolution, n: int | None
) -> Iterator[str]:
    """Lines about the first `n` generations, or all of them."""
    run, records = written.run, evolution.records
    before = {name: values[:n].tolist() for name, values in written.history.items()}
    now = _columns(records)
    if written.packed:
        # of every generation, the table has numbers only
        now |= {ROBOT: [_robot(r, evolution) for r in records]}
        now = {name: now[name] for name in before if name in now}
        before = {name: before[name] for name in now}
        yield from lines_of_differences("history.parquet", before, now)
        return
    yield from lines_of_differences(run.history.name, before, now)
    genomes, fitness = (array[:n].tolist() for array in written.best)
    yield from lines_of_differences(
        run.best_individuals.name,
        {"genomes": genomes, "fitness": fitness},
        {
            "genomes": np.array(evolution.best_genomes).tolist(),
            "fitness": [record.best for record in records],
        },
    )


def _robot(record: Record, evolution: Evolution) -> str:
    """Name of the robot of a generation."""
    name = evolution.scene.name
    return on_wheels(name) if record.climbed else name


def _columns(records: list[Record]) -> dict[str, list[Any]]:
    """Columns of history.csv."""
    names = [*HISTORY, CLIMBED]
    return {name: [float(getattr(r, name)) for r in records] for name in names}


def _histories(written: Written, evolution: Evolution) -> Iterator[str]:
    """Lines about the histories of a run without checkpoint."""
    name = written.run.best_individuals.name
    fitness, best = written.best[1].tolist(), written.history["best"].tolist()
    if written.packed:
        # the highest, of a run that has climbed since then
        climbed = written.history[CLIMBED]
        name, best = CHAMPIONS, [max(best[int(climbed.argmax()) :])][: len(fitness)]
    yield from lines_of_differences(name, {"fitness": fitness}, {"fitness": best})
    spent, config = int(written.history["evaluations"][-1]), evolution.config
    # the size of the generations of a user's optimiser is not known
    own = is_own(config.optimizer.algorithm)
    left = config.evaluations - spent
    most = largest_generation(written.history, evolution.optimizer)
    if left < 0 or not (own or left < most):
        yield (
            f"{written.run.config.name}: evaluations {config.evaluations}, but "
            f"{'history.parquet' if written.packed else written.run.history.name} ends "
            f"with {spent}"
        )


def largest_generation(history: Mapping[str, np.ndarray], optimizer: Optimizer) -> int:
    """Most genomes that the generation after a history may have had.

    Args:
        history: columns by name, of all generations or of some.
        optimizer: of the run, after a few generations.
    """
    spent = np.diff(history["evaluations"], prepend=0)
    sizes = np.ceil(spent / np.diff(history["generation"], prepend=-1))
    return max(optimizer.next_cost(), int(sizes.max()) * optimizer.growth)


def stored_without_checkpoint(written: Written, evolution: Evolution) -> Stored:
    """What a run without checkpoint stored; of its population, the champion only."""
    # of a run that has climbed, what was stored since then
    climbed = written.history[CLIMBED]
    first = int(climbed.argmax())
    if climbed.any():
        evolution.climb()
    genomes, fitness = written.best
    if not written.packed:
        genomes, fitness = genomes[first:], fitness[first:]
    genome, stored_fitness = (
        written.controller.genome,
        written.champion["scores"]["stored"],
    )
    if genome.size != genomes.shape[1]:
        nobody = np.empty((0, genomes.shape[1])), np.empty(0)
        return Stored(*nobody, genomes, fitness, bool(climbed.any()))
    # it was the best of some generations, or it earned in one what is stored for it
    as_best = fitness[(genomes == genome).all(axis=1)]
    # a user's optimiser may store any individuals
    own = is_own(evolution.config.optimizer.algorithm)
    if stored_fitness not in as_best and not own:
        generation = written.history["generation"].astype(int)
        generations = range(generation[first], generation[-1] + 1)
        earned = _earned(evolution, genome, generations)
        least, most = earned.min(), earned.max()
        mean = evolution.optimizer.stores_means and least <= stored_fitness <= most
        if stored_fitness not in earned and not mean:
            stored_fitness = as_best[-1] if as_best.size else earned.max()
    alone = genome[None], np.array([stored_fitness])
    # which others the champion was chosen from, the tables do not say
    bests = alone if written.packed else (genomes, fitness)
    return Stored(*alone, *bests, bool(climbed.any()))


def _earned(evolution: Evolution, genome: np.ndarray, generations: range) -> np.ndarray:
    """What a genome earns on the trials of each generation, `(n,)`.

    Where individuals have starts of their own, on those of each of them: which one it
    was is not stored.
    """
    engine, topology = evolution.engine, evolution.config.topology
    # offspring, and parents that are evaluated again
    most = 2 * len(evolution.optimizer.population)
    individuals = most if evolution.config.own_starts else 1
    genomes = np.repeat(genome[None], individuals, axis=0)
    each = [
        evaluate(
            engine,
            topology,
            genomes,
            evolution.starts(generation, individuals),
            disturbances=evolution.disturbances(generation),
        ).fitness
        for generation in generations
    ]
    return np.concatenate(each)


def _arrays(content: Any) -> Mapping[str, Any]:
    """The arrays of a dataclass as lists."""
    arrays = {f.name: getattr(content, f.name) for f in fields(content)}
    # a robot's log has one array more than a simulated trial
    return {k: array.tolist() for k, array in arrays.items() if array is not None}
