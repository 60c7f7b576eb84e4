"""Evolve a controller: `python -m evolution.run [EXPERIMENT] [options]`."""

import argparse
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, make_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import check_threads, main, parse, shell_command, word
from epuck_mj.host.interruption import Interrupted, Interruption
from epuck_mj.scene.model_files import on_wheels
from evolution.judging.scores import Scores
from evolution.run.directory import RunDirectory
from evolution.run.progress import Progress
from evolution.settings.config import ExperimentConfig
from evolution.settings.config_files import DEFAULT_EXPERIMENT, find_config, load_config

if TYPE_CHECKING:
    from evolution.run.execution import Run

MODULE = "evolution.run"


EXAMPLES = (
    "python -m evolution.run ga --seed 7 --evaluations 3000",
    "python -m evolution.run --resume runs/ga-seed-7",
)


@dataclass(frozen=True)
class Options:
    """Evolve a controller for the e-puck and test its champion on new starts.

    Attributes:
        experiment: a shipped experiment (de-best, de-rand, ga, random-search,
            one-plus-one-es, one-plus-one-es-as-first-shipped, cma-es, lra-cma-es,
            l-shade, openai-es, ssshc, de-best-then-cma-es, memetic-de,
            imitators-then-cma-es, lifetime-learning, policy-gradient, best, robust,
            de-best-calibrated, de-best-randomised, ga-randomised) or a YAML file; must
            be the first argument.
        config: the experiment's keys; a flag overrides the YAML file.
        optimizer: an optimiser of your own, my.py:Class, instead of the experiment's.
        output: run directory; runs/<experiment>-seed-<seed> if not given.
        resume: run directory of the run to continue.
        threads: threads that step the robots; 0 is one per core. Changes no result.
        engine: batch steps all robots at once; dm_control runs one trial after the
            other, where MuJoCo moves the robot. Changes no result.
        racing: --no-racing also simulates individuals that cannot win any more, which
            are stopped otherwise. Changes no result.
        live: show curves and the best individual in a rerun viewer that is running.
            Changes no result.
        print_config: print the complete configuration as YAML and exit.
    """

    experiment: tyro.conf.Positional[Annotated[str, word("EXPERIMENT")]]
    config: ExperimentConfig
    optimizer: Annotated[str | None, word("FILE:CLASS")] = None
    output: Annotated[Path | None, word("FOLDER")] = None
    resume: Annotated[Path | None, word("RUN")] = None
    threads: int = 0
    engine: Literal["batch", "dm_control"] = "batch"
    racing: bool = True
    live: bool = False
    print_config: bool = False


def evolve(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status.

    Raises:
        UserError: for anything the user can put right.
    """
    options = _options(argv)
    if options.print_config:
        print(options.config.to_yaml(), end="")
        return 0
    check_threads(options.threads)
    if options.live:
        from evolution.run.live import require_viewer

        require_viewer()
    if options.resume is not None:
        directory = RunDirectory(options.resume)
        directory.refuse_other_config(options.config)
        if directory.finished:
            print(f"{directory.path} is finished; {_replay(directory)}")
            return 0
    else:
        # a user's optimiser gives the run its class's name
        stem = Path(options.experiment).stem
        if options.optimizer is not None:
            stem = options.optimizer.rpartition(":")[2]
        default = Path("runs") / f"{stem}-seed-{options.config.seed}"
        directory = RunDirectory(options.output or default)
        directory.refuse_if_used()
    with Progress() as progress:
        return _run(options, directory, argv, progress)


def _run(
    options: Options, directory: RunDirectory, argv: Sequence[str], progress: Progress
) -> int:
    """Begin the run, or go on with it, and return the exit status."""
    # a simulator costs seconds to load
    from evolution.run.execution import Run
    from evolution.run.means import Means

    resumed = options.resume is not None
    lost = directory.lost() if resumed and directory.marked_finished() else []
    means = Means(options.engine, options.threads, options.racing)
    run = Run(options.config, directory, means, argv)
    with directory.locked():
        if resumed:
            differing = run.resume()
            if lost:
                print(f"written again: {'; '.join(lost)}", file=sys.stderr)
            if differing:
                print(
                    f"warning: {', '.join(differing)} differ from those at the start "
                    f"of this run (see {directory.provenance}); the last bits of its "
                    "results may differ, too",
                    file=sys.stderr,
                )
        else:
            run.start()
        for note in run.notes:
            print(note, file=sys.stderr)
        return _carry_out(run, options.live, progress)


def _options(argv: Sequence[str]) -> Options:
    """The options, with defaults from the experiment or the run to be resumed."""
    first = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    first.add_argument("--resume", type=Path, nargs="?")
    first.add_argument("--optimizer", nargs="?")
    known = first.parse_known_args(argv)[0]
    resume, optimizer = known.resume, known.optimizer
    named = bool(argv) and not argv[0].startswith("-")
    experiment = argv[0] if named else DEFAULT_EXPERIMENT
    if resume is not None and not named:
        config = RunDirectory(resume).stored_config()
    else:
        config = load_config(find_config(experiment))
    if optimizer is not None:
        # its parameters are flags as well
        own = config.model_dump() | {"optimizer": {"algorithm": optimizer}}
        config = ExperimentConfig.parsed(own, "--optimizer")
    default = _kind(config)(experiment, config, optimizer=optimizer)
    options = parse(
        type(default), f"python -m {MODULE}", argv, default, examples=EXAMPLES
    )
    if options.experiment != experiment:
        command = shell_command(MODULE, options.experiment, "...")
        raise UserError(f"expected the experiment as the first argument: {command}")
    # a run can be resumed from anywhere
    options = replace(options, config=options.config.located())
    if options.resume is not None and options.output is not None:
        raise UserError("expected --resume or --output, got both")
    return options


def _kind(config: ExperimentConfig) -> type[Options]:
    """The class of options with a flag for each key of a config."""
    if type(config) is ExperimentConfig:
        return Options
    keys = [("config", type(config))]
    kind = make_dataclass("Options", keys, bases=(Options,), frozen=True)
    kind.__doc__ = Options.__doc__
    return kind


def _carry_out(run: "Run", live: bool, progress: Progress) -> int:
    """Evolve, choose and show the champion, and return the exit status."""
    evolution, directory = run.evolution, run.directory
    started = time.monotonic()
    with Interruption(signal.SIGINT, signal.SIGTERM) as interruption:
        try:
            with interruption.raising():
                scores = _finished(run, live, progress)
        except Interrupted:
            progress.close()
            print(
                f"Interrupted after {directory.evaluations():,} evaluations; "
                f"continue with: {shell_command(MODULE, '--resume', directory.path)}",
                file=sys.stderr,
            )
            return interruption.status
    progress.close()
    minutes, seconds = divmod(round(time.monotonic() - started), 60)
    print(
        f"{evolution.optimizer.name}, seed {evolution.config.seed}: "
        f"{evolution.evaluations:,} evaluations in {len(evolution.records)} "
        f"generations, {minutes} min {seconds} s"
    )
    print(scores.in_lines(evolution.config.task.most))
    print(f"Written to {directory.path}: {directory.contents()}")
    print(_replay(directory))
    return 0


def _finished(run: "Run", live: bool, progress: Progress) -> Scores:
    """Evolve, choose the champion, and give its scores."""
    from evolution.run.live import Live

    evolution = run.evolution
    config = evolution.config
    wheels = on_wheels(config.robot)
    progress.begin(config.evaluations, evolution.evaluations, wheels)
    with Live(evolution) if live else nullcontext() as view:
        for record in run.evolve():
            progress.update(record)
            if view is not None:
                view.update()
    return run.finish(progress.stage)


def _replay(directory: RunDirectory) -> str:
    return f"Replay: {shell_command('evolution.replay', directory.path)}"


if __name__ == "__main__":
    main(evolve)
