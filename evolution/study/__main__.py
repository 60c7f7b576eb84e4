"""Many runs: `python -m evolution.study STUDY --seeds 1-30 --output runs/paper`."""

import json
import os
import signal
import sys
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from tqdm import tqdm

from epuck_mj.errors import UserError
from epuck_mj.host import files
from epuck_mj.host.command_line import main, parse, shell_command, word
from epuck_mj.host.interruption import Interrupted, Interruption
from epuck_mj.host.limits import check_flag
from epuck_mj.host.yaml_and_json import read_json
from epuck_mj.policies.wall_follower import YARDSTICK, WallFollower
from epuck_mj.scene.model_files import find_arena, find_robot
from evolution.judging.scores import KnownScores, read_champion
from evolution.run.lock import locked
from evolution.run.means import Means
from evolution.settings.memory import check_needs
from evolution.study.config import StudyConfig, find_study, parse_seeds
from evolution.study.directory import PATIENCE, StudyDirectory
from evolution.study.jobs import Event, Job, carry_out_side_by_side

if TYPE_CHECKING:
    from evolution.study.packing import Packer

MODULE = "evolution.study"


EXAMPLES = (
    "python -m evolution.study quick --seeds 1-3 --output runs/quick",
    "python -m evolution.study mine.yaml --seeds 1-10 --output runs/mine",
)


@dataclass(frozen=True)
class Options:
    """Run every experiment of a study with every seed; skip finished runs.

    Runs of one seed get the same starts in every experiment. Call it again to continue
    after Ctrl-C, a crash or a power cut, or to add seeds and experiments. Finished runs
    are rows of champions.parquet and history.parquet.

    Attributes:
        study: a shipped study (paper, variations, steps-150, steps-500, climbing,
            hybrids, good-robot, wheels, transfer, real-robots, quick) or a YAML file.
        output: study directory.
        seeds: seeds of the runs, such as 1-30 or 1,3,5-8.
        experiments: names of the experiments to run, separated by commas; all if not
            given.
        jobs: number of runs side by side; 0 is one per core. Remaining cores are used
            as threads.
        racing: --no-racing also simulates individuals that cannot win any more, which
            are stopped otherwise. Changes no result.
        cluster: address of the Dask scheduler that runs are sent to, such as
            tcp://host:8786, or local:4 to start four workers on this machine. Needs the
            extra [cluster].
        split: with --cluster, do one run at a time and send its evaluations in MuJoCo
            to the workers.
    """

    study: tyro.conf.Positional[Annotated[str, word("STUDY")]]
    output: Annotated[Path, word("FOLDER")]
    seeds: Annotated[str, word("SEEDS")] = "1-30"
    experiments: Annotated[str | None, word("NAMES")] = None
    jobs: int = 0
    racing: bool = True
    cluster: Annotated[str | None, word("ADDRESS")] = None
    split: bool = False


def study(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status, 1 if a run failed.

    Raises:
        UserError: for anything the user can put right.
    """
    options = parse(Options, f"python -m {MODULE}", argv, examples=EXAMPLES)
    config, seeds = _checked(options)
    directory = StudyDirectory(options.output)
    directory.open(config, seeds)
    # pyarrow is slow to import: after the checks of the command line
    from evolution.study.packing import Packer

    # pack runs of killed processes and of older versions
    packer = Packer(directory)
    packer.now()
    everything = _jobs(config, seeds, directory, tuple(argv))
    started = time.monotonic()
    with Interruption(signal.SIGINT, signal.SIGTERM) as interruption:
        try:
            with interruption.raising():
                failed = _carry_out(everything, directory, packer, options)
        except Interrupted:
            try:
                packer.now()
            except UserError as error:
                print(f"finished runs are in no table yet: {error}", file=sys.stderr)
            again = shell_command(MODULE, *argv)
            print(f"Interrupted; continue with: {again}", file=sys.stderr)
            return interruption.status
    done = len(everything) - len(failed)
    minutes = (time.monotonic() - started) / 60
    print(f"{done} of {len(everything)} runs are finished, {minutes:.1f} min")
    if failed:
        print(f"failed: {', '.join(map(str, failed))}", file=sys.stderr)
    if done:
        print(f"Report: {shell_command('evolution.report', directory.path)}")
    return 1 if failed else 0


def _checked(options: Options) -> tuple[StudyConfig, Sequence[int]]:
    """The experiments and seeds that the options ask for.

    Raises:
        UserError: if the options exclude each other, or name what is not there.
    """
    check_flag("jobs", options.jobs)
    if options.split and options.cluster is None:
        raise UserError("expected --cluster with --split, got --split alone")
    if options.jobs and options.cluster is not None:
        raise UserError("expected --jobs or --cluster, got both")
    if options.cluster is not None:
        # an extra
        from evolution.study.cluster import check_address

        check_address(options.cluster)
    seeds = parse_seeds(options.seeds)
    config = StudyConfig.load(find_study(options.study))
    if options.experiments is not None:
        names = [name.strip() for name in options.experiments.split(",")]
        config = config.only(names)
    for each in config.experiments.values():
        find_robot(each.robot)
        find_arena(each.arena)
        if options.cluster is None:
            check_needs(each)
    return config, seeds


def _jobs(
    config: StudyConfig,
    seeds: Sequence[int],
    directory: StudyDirectory,
    typed: tuple[str, ...],
) -> list[Job]:
    """All runs of a study, finished ones too.

    Seed by seed, so that an interrupted study has the same seeds of all experiments.
    """
    return [
        Job(
            name,
            config.with_seed(name, seed),
            directory.run(name, seed).path,
            typed,
            directory.path,
        )
        for seed in seeds
        for name in config.experiments
    ]


def _carry_out(
    everything: Sequence[Job],
    directory: StudyDirectory,
    packer: "Packer",
    options: Options,
) -> list[Job]:
    """Do the runs that are not finished, and pack them; those that failed."""
    # first, so that an interrupted study has it, too
    try:
        _measure_yardstick(directory)
    except UserError as error:
        print(f"{YARDSTICK} could not be tested: {error}", file=sys.stderr)
    there = directory.tables.packed()
    jobs = [
        job
        for job in everything
        if (job.name, job.config.seed) not in there and not job.run.finished
    ]
    failed = []
    with closing(_events(jobs, options)) as events:
        for event in _shown(everything, jobs, events):
            if event.failure is not None:
                failed.append(event.job)
            elif event.ended:
                packer.when_due()
    packer.finish()
    return failed


def _measure_yardstick(directory: StudyDirectory) -> None:
    """Test the hand-written wall follower as champions are, if that is not done yet."""
    path = directory.yardstick
    with suppress(UserError):
        KnownScores.read(read_json(path), path)
        return
    from evolution.judging.held_out import Judges

    # in the setting of the first experiment
    config = next(iter(directory.stored_config().experiments.values()))
    judges, n = Judges(), config.test_starts
    for refusal in judges.refusals(config.robot, config.setting):
        print(refusal, file=sys.stderr)
    judged = judges.tested_on(config.robot, config.setting)
    tests = {robot: judge.test(WallFollower(), n) for robot, judge in judged.items()}
    # opening the study removes what looks left over
    with locked(directory.path, PATIENCE), files.writing():
        text = json.dumps(KnownScores(held_out=tests).to_dict(), indent=1) + "\n"
        files.write_text(path, text)


def _events(jobs: Sequence[Job], options: Options) -> Generator[Event]:
    """Events of all jobs, from this machine or from a cluster."""
    if options.cluster is not None:
        # an extra
        from evolution.study.cluster import carry_out_on_cluster

        yield from carry_out_on_cluster(
            jobs, options.cluster, options.split, options.racing
        )
        return
    cores = _cores()
    n_processes = min(options.jobs or cores, max(1, len(jobs)))
    means = Means(threads=max(1, cores // n_processes), racing=options.racing)
    yield from carry_out_side_by_side(jobs, means, n_processes)


def _cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _shown(
    everything: Sequence[Job], jobs: Sequence[Job], events: Iterator[Event]
) -> Iterator[Event]:
    """Pass events on and show them: a bar for the study, a line for each ended run."""
    budget = {job: job.config.evaluations for job in everything}
    waiting = set(jobs)
    done = {job: 0 if job in waiting else budget[job] for job in everything}
    finished = len(everything) - len(jobs)
    if finished:
        tqdm.write(f"{finished} of {len(everything)} runs were finished already")
    with tqdm(
        total=sum(budget.values()),
        initial=sum(done.values()),
        unit="eval",
        dynamic_ncols=True,
        disable=not sys.stderr.isatty(),
    ) as bar:
        for event in events:
            before = done[event.job]
            if not event.ended:
                done[event.job] = event.evaluations
            elif event.failure is None:
                done[event.job] = budget[event.job]
                finished += 1
                tqdm.write(f"{finished}/{len(everything)} {_line(event.job)}")
                sys.stdout.flush()
            else:
                tqdm.write(f"{event.job} failed: {event.failure}", file=sys.stderr)
            bar.update(done[event.job] - before)
            yield event


def _line(job: Job) -> str:
    """Line that shows the scores of a finished run."""
    path = job.run.champion
    if files.is_file(path):
        _, scores = read_champion(path)
        return f"{job}: {scores.in_short}"
    # packed since then, with another one or by another process
    if job.study is None:
        return str(job)
    from evolution.study.addresses import run_at
    from evolution.study.finished_run import FinishedRun

    packed = run_at(job.study / job.name / job.directory.name)
    return (
        f"{job}: {packed.scores.in_short}"
        if isinstance(packed, FinishedRun)
        else str(job)
    )


if __name__ == "__main__":
    main(study)
