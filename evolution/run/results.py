"""What a finished run shows: its champion, judged by fresh starts, drawn and logged."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from epuck_mj.host import files
from epuck_mj.policies.file import ControllerFile, Origin
from epuck_mj.scene.model import Scene
from epuck_mj.step.disturbances import Disturbances
from epuck_mj.trials.recorder import record_trajectories
from evolution.judging.evaluation import BatchEngine
from evolution.judging.held_out import WHEELED_ROBOT, HeldOut, Judge, judging, tested_on
from evolution.judging.starts import N_TEST, held_out_disturbances
from evolution.run.champion import Champion, choose_champion, most_believed
from evolution.run.directory import RunDirectory
from evolution.run.generation_loop import Experiment
from evolution.settings.config import ExperimentConfig
from evolution.settings.randomness import Purpose

N_SHOWN = 4
"""Trials of the champion in the picture; the first is also the recording."""


def judges(config: ExperimentConfig, threads: int = 0) -> dict[str, Judge]:
    """The robots that a champion is tested on: its own, then the planar or wheeled one.

    Raises:
        UserError: if the wheeled robot cannot use the arena, or nobody can measure it.
    """
    judge = judging(threads)
    return {
        Path(robot).name: judge(robot, config.setting)
        for robot in tested_on(config.robot)
    }


def write_results(
    experiment: Experiment,
    judges: Mapping[str, Judge],
    directory: RunDirectory,
    threads: int = 0,
) -> ControllerFile:
    """Choose the champion, test it, and write everything that shows it.

    Args:
        experiment: a finished run.
        judges: robots to test it on, as of `judges`.
        directory: where to write.
        threads: that step the robots; 0 is one per core.

    Returns:
        The champion as written, with its scores.
    """
    config = experiment.config
    champion = choose_champion(
        BatchEngine(experiment.scene, config.task, threads), experiment
    )
    policy = config.network.decode(champion.genome)
    tests = {robot: judge.test(policy) for robot, judge in judges.items()}
    met = held_out_disturbances(config.conditions, Purpose.TEST, N_TEST, config.steps)
    as_evolved = {
        robot: judge.test(policy, N_TEST, met)
        for robot, judge in judges.items()
        if met is not None
    }
    # what the run believed its best to be, and what that is worth on an ideal robot
    genome, stored = most_believed(experiment)
    believed = next(iter(judges.values())).test(config.network.decode(genome))
    most = {"stored": stored, "held_out": believed.mean}
    controller = _controller_file(experiment, champion, tests, as_evolved, most)
    files.write_text(directory.champion, controller.to_json())
    _draw_fitness(experiment, directory)
    wheeled = judges[WHEELED_ROBOT]
    starts = wheeled.starts(N_SHOWN)
    shown = None if met is None else met[:N_SHOWN]
    _show(experiment, directory, controller, wheeled.scene, starts, shown)
    return controller


def summary(controller: ControllerFile) -> str:
    """Held-out fitness on each robot and stored fitness, in lines."""
    scores, steps = controller.scores, controller.task.steps
    starts = next(iter(scores["held_out"].values()))["starts"]
    lines = [
        f"Held-out fitness of {steps}, mean of {starts} fresh starts: "
        + _held_out(scores["held_out"]),
        f"Stored fitness of {steps}, what evolution believes: {scores['stored']:.1f}",
    ]
    if "held_out_as_evolved" in scores:
        disturbed = _held_out(scores["held_out_as_evolved"])
        lines.insert(1, f"The same with the disturbances it evolved with: {disturbed}")
    return "\n".join(lines)


def scores(controller: ControllerFile) -> str:
    """The same in short."""
    found = controller.scores
    return f"held-out {_held_out(found['held_out'])}; stored {found['stored']:.1f}"


def _held_out(tests: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{robot} {test['mean']:.1f} ({test['crash_rate']:.0%} crash)"
        for robot, test in tests.items()
    )


def _controller_file(
    experiment: Experiment,
    champion: Champion,
    tests: dict[str, HeldOut],
    as_evolved: dict[str, HeldOut],
    most_believed: dict[str, float],
) -> ControllerFile:
    config = experiment.config
    scores: dict[str, Any] = {
        "stored": champion.stored_fitness,
        "validation": champion.validation_fitness,
        "held_out": {robot: asdict(test) for robot, test in tests.items()},
        "most_believed": most_believed,
    }
    if as_evolved:
        disturbed = {robot: asdict(test) for robot, test in as_evolved.items()}
        scores["held_out_as_evolved"] = disturbed
    return ControllerFile(
        network=config.network,
        genome=champion.genome,
        task=config.task,
        origin=Origin(
            config.robot,
            config.arena,
            config.start_clearance,
            dict(experiment.scene.sha256),
        ),
        scores=scores,
    )


def _draw_fitness(experiment: Experiment, directory: RunDirectory) -> None:
    from epuck_mj.show.figures import fitness_figure
    from epuck_mj.show.pictures import save_figure

    records = experiment.records
    figure = fitness_figure(
        [record.evaluations for record in records],
        [record.best for record in records],
        [record.mean for record in records],
        title=f"{experiment.optimizer.name}, seed {experiment.config.seed}",
        steps=experiment.config.steps,
    )
    save_figure(figure, directory.fitness_figure)


def _show(
    experiment: Experiment,
    directory: RunDirectory,
    controller: ControllerFile,
    scene: Scene,
    starts: np.ndarray,
    met: Disturbances | None,
) -> None:
    """Trials of the champion on the wheeled robot, with the disturbances they met."""
    from epuck_mj.show.figures import trajectory_figure
    from epuck_mj.show.pictures import save_figure
    from epuck_mj.show.recording import Trial, save_recording

    task = experiment.config.task
    trials = record_trajectories(scene, controller.controller, starts, task, met)
    titles = [
        f"start {i}: fitness {trial.trial_fitness:.0f}"
        for i, trial in enumerate(trials)
    ]
    save_figure(
        trajectory_figure(scene, trials, task, titles), directory.trajectory_figure
    )
    trials[0].save(directory.trajectory)
    trial = Trial("start 0", trials[0], task)
    title = f"{experiment.optimizer.name}, seed {experiment.config.seed}"
    text = (
        f"# {title}\n\n{summary(controller)}\n\n```\n{experiment.config.to_yaml()}```\n"
    )
    save_recording(directory.recording, scene, [trial], title, text)
