"""Results of a finished run: its champion, tested, drawn and recorded."""

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from epuck_mj.host import files
from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.scene.changed_robots import with_body_margin
from epuck_mj.scene.model import Scene
from epuck_mj.scene.model_files import on_wheels
from epuck_mj.step.control import BatchPolicy
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.trials.recorder import record_trajectories
from epuck_mj.trials.trajectory import Trajectory
from evolution.judging.evaluation import BatchEngine
from evolution.judging.held_out import Judge
from evolution.judging.held_out_starts import held_out_disturbances
from evolution.judging.scores import BestStored, Scores
from evolution.run.champion import (
    Champion,
    Stored,
    best_stored,
    choose_champion,
    stored_by,
)
from evolution.run.directory import RunDirectory
from evolution.run.generation_loop import Evolution
from evolution.settings.config import ExperimentConfig
from evolution.settings.randomness import Purpose

N_SHOWN = 4
"""Trials of the champion in the picture; the first is also the recording."""

Stage = Callable[[str, int, int], None]
"""Told what is done next, the number of that stage, and how many there are."""


def silent(text: str, number: int = 0, stages: int = 0) -> None:
    """A `Stage` that shows nothing."""


def write_results(
    evolution: Evolution,
    judges: Mapping[str, Judge],
    directory: RunDirectory,
    stage: Stage = silent,
    threads: int = 0,
) -> Scores:
    """Choose the champion, test it, and write it and, if asked for, what shows it.

    Args:
        evolution: a finished run.
        judges: by robot, as of `Judges.tested_on`.
        directory: where to write.
        stage: told what is done next.
        threads: that step the robots; 0 is one per core.

    Returns:
        The champion's scores, as written.
    """
    config = evolution.config
    stages = 2 + len(judges) * (1 if config.noise == "none" else 2)
    stages += 2 if directory.drawn else 0
    numbers = itertools.count()

    def tell(text: str) -> None:
        stage(text, next(numbers), stages)

    stored = stored_by(evolution)
    controller, scores = judged(evolution, stored, judges, threads, tell)
    files.write_text(directory.champion, controller.to_json())
    if not directory.drawn:
        return scores
    tell("Drawing the fitness")
    _draw_fitness(evolution, directory)
    tell("Recording the champion")
    text = scores.in_lines(config.task.most)
    judge = judges[on_wheels(config.robot)]
    _show(evolution, directory, controller.controller, judge, text)
    return scores


def judged(
    evolution: Evolution,
    stored: Stored,
    judges: Mapping[str, Judge],
    threads: int = 0,
    tell: Callable[[str], None] = silent,
    best: tuple[np.ndarray, float] | None = None,
) -> tuple[ControllerFile, Scores]:
    """The champion of a run, chosen and tested, and its scores.

    Args:
        evolution: the run.
        stored: what it stored.
        judges: by robot, as of `Judges.tested_on`.
        threads: that step the robots; 0 is one per core.
        tell: told what is done next.
        best: genome `(genes,)` of the individual with the highest stored fitness, and
            that fitness; None to take it from what was stored.
    """
    config, n = evolution.config, evolution.config.test_starts
    met = _met(config)
    tell(f"Choosing the champion on {config.validation_starts:,} fresh starts")
    wheels = on_wheels(config.robot)
    champion = _chosen(evolution, stored, judges[wheels].scene, threads)
    policy = config.topology.decode(champion.genome)
    held_out, as_evolved = {}, {}
    for robot, judge in judges.items():
        where = f"on {n:,} other starts, {robot}"
        tell(f"Testing it {where}")
        held_out[robot] = judge.test(policy, n)
        if met is not None:
            tell(f"Testing it with disturbances {where}")
            as_evolved[robot] = judge.test(policy, n, met)
    # the highest fitness that the run stored, and what its individual is worth there
    tell("Testing the individual of the highest fitness")
    genome, stored_fitness = best or best_stored(stored)
    where = wheels if stored.climbed else Path(config.robot).name
    worth = judges[where].fitness(config.topology, genome, n)
    scores = Scores(
        stored=champion.stored_fitness,
        validation=champion.validation_fitness,
        held_out=held_out,
        best_stored=BestStored(fitness=stored_fitness, held_out=worth, robot=where),
    )
    if as_evolved:
        scores = scores.model_copy(update={"held_out_as_evolved": as_evolved})
    return _controller_file(evolution, champion, scores), scores


def _chosen(
    evolution: Evolution, stored: Stored, rolling: Scene, threads: int
) -> Champion:
    """The champion; its engines, of hundreds of megabytes, end with the choice."""
    config, wheels = evolution.config, None
    # chosen with the margin of evolution, so that the champion keeps away from walls
    margin = config.body_margin
    scene = with_body_margin(evolution.scene, margin)
    engine = BatchEngine(scene, config.task, threads)
    if config.has_finalists:
        scene = with_body_margin(rolling, margin)
        wheels = BatchEngine(scene, config.task, threads)
    return choose_champion(engine, evolution, stored, wheels)


def _met(config: ExperimentConfig) -> Disturbances | None:
    """What the robots of the tests meet, if they are as in evolution."""
    n, steps = config.test_starts, config.steps
    return held_out_disturbances(config.conditions, Purpose.TEST, n, steps)


def _controller_file(
    evolution: Evolution, champion: Champion, scores: Scores
) -> ControllerFile:
    config = evolution.config
    return ControllerFile(
        network=config.topology,
        genome=champion.genome,
        task=config.task,
        origin=Origin(
            config.robot,
            config.arena,
            config.start_clearance,
            dict(evolution.scene.sha256),
            config.own_parts,
        ),
        scores=scores.to_dict(),
    )


def _draw_fitness(evolution: Evolution, directory: RunDirectory) -> None:
    from epuck_mj.show.figures import fitness_figure
    from epuck_mj.show.pictures import save_figure

    records = evolution.records
    figure = fitness_figure(
        [record.evaluations for record in records],
        [record.best for record in records],
        [record.mean for record in records],
        title=f"{evolution.optimizer.name}, seed {evolution.config.seed} "
        f"(trials per evaluation: {evolution.config.trials})",
        steps=evolution.config.steps,
        climbed=_spent_before_climb(evolution),
    )
    save_figure(figure, directory.fitness_figure)


def _spent_before_climb(evolution: Evolution) -> int | None:
    """Evaluations of a run when it climbed; None if it did not."""
    if not evolution.climbed:
        return None
    return max(each.evaluations for each in evolution.records if not each.climbed)


def shown_trials(
    evolution: Evolution, policy: BatchPolicy, judge: Judge, n: int = N_SHOWN
) -> list[Trajectory]:
    """The first trials of the champion's test, with the disturbances they met.

    Args:
        evolution: the run.
        policy: its champion.
        judge: of the robot that is shown.
        n: number of trials.
    """
    met = _met(evolution.config)
    met = None if met is None else met[:n]
    starts, task = judge.starts(n), evolution.config.task
    return record_trajectories(judge.scene, policy, starts, task, met)


def _show(
    evolution: Evolution,
    directory: RunDirectory,
    policy: BatchPolicy,
    judge: Judge,
    scores: str,
) -> None:
    """Draw and record the champion's first trials."""
    from epuck_mj.show.figures import trajectory_figure
    from epuck_mj.show.pictures import save_figure
    from epuck_mj.show.recording import Trial, save_recording

    task, scene = evolution.config.task, judge.scene
    trials = shown_trials(evolution, policy, judge)
    titles = [
        f"start {i}: fitness {trial.trial_fitness:.0f}"
        for i, trial in enumerate(trials)
    ]
    save_figure(
        trajectory_figure(scene, trials, task, titles), directory.trajectory_figure
    )
    trials[0].save(directory.trajectory)
    trial = Trial("start 0", trials[0], task)
    title = f"{evolution.optimizer.name}, seed {evolution.config.seed}"
    text = f"# {title}\n\n{scores}\n\n```\n{evolution.config.to_yaml()}```\n"
    save_recording(directory.recording, scene, [trial], title, text)
