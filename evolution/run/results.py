"""Results of a finished run: its champion, tested, drawn and recorded."""

import itertools
from collections.abc import Callable, Mapping

import numpy as np

from epuck_mj.host import files
from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.scene.model import Scene
from epuck_mj.scene.model_files import WHEELED_ROBOT
from epuck_mj.step.control import BatchPolicy
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.trials.recorder import record_trajectories
from evolution.judging.evaluation import BatchEngine
from evolution.judging.held_out import Judge
from evolution.judging.held_out_starts import held_out_disturbances
from evolution.judging.scores import Believed, Scores
from evolution.run.champion import Champion, choose_champion, most_believed
from evolution.run.directory import RunDirectory
from evolution.run.generation_loop import Evolution
from evolution.settings.randomness import Purpose

N_SHOWN = 4
"""Trials of the champion in the picture; the first is also the recording."""

Stage = Callable[[str, int, int], None]
"""Told what is done next, the number of that stage, and how many there are."""


def silent(text: str, number: int, stages: int) -> None:
    """A `Stage` that tells nobody."""


def write_results(
    evolution: Evolution,
    judges: Mapping[str, Judge],
    directory: RunDirectory,
    stage: Stage = silent,
    threads: int = 0,
) -> Scores:
    """Choose the champion, test it, and write everything that shows it.

    Args:
        evolution: a finished run.
        judges: by robot, as of `Judges.tested_on`.
        directory: where to write.
        stage: told what is done next.
        threads: that step the robots; 0 is one per core.

    Returns:
        The champion's scores, as written.
    """
    config, n = evolution.config, evolution.config.test_starts
    met = held_out_disturbances(config.conditions, Purpose.TEST, n, config.steps)
    stages = 4 + len(judges) * (1 if met is None else 2)
    number = itertools.count()
    fresh = f"{config.validation_starts:,} fresh starts"
    stage(f"Choosing the champion on {fresh}", next(number), stages)
    engine, wheels = (
        BatchEngine(scene, config.task, threads)
        for scene in (evolution.scene, judges[WHEELED_ROBOT].scene)
    )
    champion = choose_champion(engine, evolution, wheels)
    policy = config.topology.decode(champion.genome)
    held_out, as_evolved = {}, {}
    for robot, judge in judges.items():
        where = f"on {n:,} other starts, {robot}"
        stage(f"Testing it {where}", next(number), stages)
        held_out[robot] = judge.test(policy, n)
        if met is not None:
            stage(f"Testing it with disturbances {where}", next(number), stages)
            as_evolved[robot] = judge.test(policy, n, met)
    # what the run believed its best to be, and what that is worth on an ideal robot
    stage("Testing the individual of the highest fitness", next(number), stages)
    genome, stored = most_believed(evolution)
    believed = next(iter(judges.values())).test(config.topology.decode(genome), n)
    scores = Scores(
        stored=champion.stored_fitness,
        validation=champion.validation_fitness,
        held_out=held_out,
        most_believed=Believed(stored=stored, held_out=believed.mean),
    )
    if as_evolved:
        scores = scores.model_copy(update={"held_out_as_evolved": as_evolved})
    controller = _controller_file(evolution, champion, scores)
    files.write_text(directory.champion, controller.to_json())
    stage("Drawing the fitness", next(number), stages)
    _draw_fitness(evolution, directory)
    stage("Recording the champion", next(number), stages)
    wheeled = judges[WHEELED_ROBOT]
    starts = wheeled.starts(N_SHOWN)
    shown = None if met is None else met[:N_SHOWN]
    text = scores.in_lines(config.task.most)
    _show(evolution, directory, policy, wheeled.scene, starts, shown, text)
    return scores


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
    )
    save_figure(figure, directory.fitness_figure)


def _show(
    evolution: Evolution,
    directory: RunDirectory,
    policy: BatchPolicy,
    scene: Scene,
    starts: np.ndarray,
    met: Disturbances | None,
    scores: str,
) -> None:
    """Trials of the champion on the wheeled robot, with the disturbances they met."""
    from epuck_mj.show.figures import trajectory_figure
    from epuck_mj.show.pictures import save_figure
    from epuck_mj.show.recording import Trial, save_recording

    task = evolution.config.task
    trials = record_trajectories(scene, policy, starts, task, met)
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
