"""Jobs: the runs of a study, carried out side by side in processes of this machine.

A process does one run after the other, so that MuJoCo and scipy are loaded once. If a
process dies, even by `kill -9` or for lack of memory, only its run fails and the others
continue. A process ends with the one that started it.
"""

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from epuck_mj.errors import UserError
from epuck_mj.host.hardship import hardship
from epuck_mj.host.interruption import deaf_to_interrupts
from evolution.run.directory import RunDirectory
from evolution.run.means import Means
from evolution.settings.config import ExperimentConfig
from evolution.study.directory import StudyDirectory

if TYPE_CHECKING:
    from evolution.run.execution import Loaded

PATIENCE = 10.0
"""How long to wait for a process to leave a run's directory, and to end [s]."""


@dataclass(frozen=True)
class Job:
    """One run of a study.

    Attributes:
        name: of its experiment.
        config: what to do, seed included.
        directory: where.
        argv: what the person typed.
        study: directory of the study, whose tables may have the run; None if that is
            not on this machine.
    """

    name: str
    config: ExperimentConfig
    directory: Path
    argv: tuple[str, ...]
    study: Path | None = None

    def __str__(self) -> str:
        """Its experiment and seed."""
        return f"{self.name} seed {self.config.seed}"

    @property
    def run(self) -> RunDirectory:
        """The directory of its run."""
        return RunDirectory(self.directory, drawn=False)

    @property
    def packed(self) -> bool:
        """Whether the tables of the study have the run.

        Raises:
            UserError: if they are damaged.
        """
        if self.study is None:
            return False
        tables = StudyDirectory(self.study).tables
        return (self.name, self.config.seed) in tables.packed()


@dataclass(frozen=True)
class Event:
    """News of a job.

    Attributes:
        job: which.
        evaluations: individuals evaluated so far.
        ended: whether it is over.
        failure: why it failed, on one line; None if it did not.
    """

    job: Job
    evaluations: int = 0
    ended: bool = False
    failure: str | None = None


def carry_out(
    job: Job,
    means: Means,
    report: Callable[[int], None],
    loaded: "Loaded | None" = None,
) -> None:
    """Start a job, or continue it from its directory.

    Args:
        job: what to do.
        means: how to do it.
        report: called with the evaluations done, once per generation.
        loaded: what earlier jobs of this process have loaded.

    Raises:
        UserError: for anything the user can put right.
    """
    with closing(generations(job, means, loaded)) as steps:
        for evaluations in steps:
            report(evaluations)


def generations(
    job: Job, means: Means, loaded: "Loaded | None" = None
) -> Generator[int]:
    """Do a job; yield the number of evaluations done after each generation.

    Raises:
        UserError: for anything the user can put right.
    """
    # MuJoCo is slow to import, and the study's own process does not need it
    from evolution.run.execution import Run

    directory = job.run
    with directory.locked(PATIENCE):
        begun = directory.begun
        if begun:
            directory.refuse_other_config(job.config)
        # another process may have done this job since the jobs were listed
        if directory.finished or job.packed:
            return
        run = Run(job.config, directory, means, job.argv, loaded)
        if begun:
            run.resume()
        else:
            run.start()
        for record in run.evolve():
            yield record.evaluations
        run.finish()


def carry_out_side_by_side(
    jobs: Sequence[Job], means: Means, n_processes: int
) -> Iterator[Event]:
    """Do all jobs, at most `n_processes` at once; closing this ends the processes."""
    waiting = list(reversed(jobs))
    idle: list[_Worker] = []
    busy: dict[Connection, tuple[Job, _Worker]] = {}
    try:
        while waiting or busy:
            while waiting and len(busy) < n_processes:
                job, worker = waiting.pop(), idle.pop() if idle else _Worker(means)
                busy[worker.line] = job, worker
                # one that died meanwhile is noticed below
                with suppress(OSError):
                    worker.line.send(job)
            for line in wait(list(busy)):
                assert isinstance(line, Connection)
                job, worker = busy[line]
                try:
                    event = Event(job, *line.recv())
                except (EOFError, ConnectionResetError):
                    event = Event(job, ended=True, failure=worker.ending())
                else:
                    if event.ended:
                        idle.append(worker)
                if event.ended:
                    del busy[line]
                yield event
    finally:
        workers = [*idle, *(worker for _, worker in busy.values())]
        for worker in workers:
            worker.process.terminate()
        for worker in workers:
            worker.ending()


class _Worker:
    """A process that does jobs, and its pipe: jobs come, what is new of them goes."""

    def __init__(self, means: Means):
        """Start the process, which ignores Ctrl-C, as its parent ends it."""
        # a fresh interpreter: threads and MuJoCo do not survive a fork
        context = multiprocessing.get_context("spawn")
        self.line, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(means, theirs), daemon=True)
        with deaf_to_interrupts():
            self.process.start()
        theirs.close()

    def ending(self) -> str:
        """Wait for the end of the process; the reason."""
        self.process.join(PATIENCE)
        if self.process.is_alive():
            # it was stopped, and gets no other signal
            self.process.kill()
            self.process.join()
        self.line.close()
        status = self.process.exitcode or 0
        if status < 0:
            return f"its process was killed by {signal.Signals(-status).name}"
        return f"its process ended with status {status}"


def _work(means: Means, line: Connection) -> None:
    """Main function of a worker: does jobs until its pipe is closed."""
    # tqdm's own lock is a semaphore, which would be left when this process is ended
    tqdm.set_lock(threading.RLock())
    threading.Thread(target=_die_with_parent, daemon=True).start()
    loaded = None
    try:
        while True:
            job: Job = line.recv()
            failure = None
            try:
                loaded = loaded or _nothing_loaded(means)
                carry_out(job, means, partial(_report, line), loaded)
                failure_log(job.directory).unlink(missing_ok=True)
            except (BrokenPipeError, ConnectionResetError):
                raise
            except Exception as error:
                failure = failure_of(job, error)
            line.send((0, True, failure))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        # the parent has ended: the files on disk can be resumed at any moment
        os._exit(1)


def _nothing_loaded(means: Means) -> "Loaded":
    # MuJoCo is slow to import
    from evolution.run.execution import Loaded

    return Loaded(means.threads)


def _report(line: Connection, done: int) -> None:
    # the parent knows the job; its configuration would take longer than a generation
    line.send((done, False, None))


def failure_of(job: Job, error: Exception) -> str:
    """Why a job failed, on one line; an unexpected error also leaves a log."""
    if isinstance(error, UserError):
        return str(error)
    line = hardship(error)
    if line is not None:
        return line
    log = failure_log(job.directory)
    with suppress(OSError):
        log.write_text("".join(traceback.format_exception(error)), encoding="utf-8")
    reason = " ".join(str(error).split())
    return f"{type(error).__name__}: {reason} (see {log})"


def failure_log(directory: Path) -> Path:
    """Path of the traceback of a failed run, beside its directory."""
    return directory.with_name(f"{directory.name}.failure.txt")


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    # the files on disk can be resumed at any moment
    os._exit(1)
