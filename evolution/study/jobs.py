"""Jobs: the runs of a study, carried out side by side in processes of this machine.

One process per run: whatever becomes of one, memory exhausted and `kill -9` included,
the others go on. A process ends with the one that started it.
"""

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from epuck_mj.errors import UserError
from epuck_mj.host.interruption import deaf_to_interrupts
from evolution.run.directory import RunDirectory
from evolution.run.execution import Means, Run
from evolution.settings.config import ExperimentConfig

PATIENCE = 10.0
"""How long a process waits for one that is about to leave its directory [s]."""


@dataclass(frozen=True)
class Job:
    """One run of a study.

    Attributes:
        name: of its experiment.
        config: what to do, seed included.
        directory: where.
        argv: what the person typed.
    """

    name: str
    config: ExperimentConfig
    directory: Path
    argv: tuple[str, ...]

    def __str__(self) -> str:
        """Its experiment and seed."""
        return f"{self.name} seed {self.config.seed}"


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


def carry_out(job: Job, means: Means, report: Callable[[int], None]) -> None:
    """Do a job, from wherever its directory stands.

    Args:
        job: what to do.
        means: how to do it.
        report: called with the evaluations done, once per generation.

    Raises:
        UserError: for anything the user can put right.
    """
    with closing(generations(job, means)) as steps:
        for evaluations in steps:
            report(evaluations)


def generations(job: Job, means: Means) -> Generator[int]:
    """The same step by step: evaluations done, once per generation.

    Raises:
        UserError: for anything the user can put right.
    """
    directory = RunDirectory(job.directory)
    with directory.locked(PATIENCE):
        if directory.config.exists():
            directory.refuse_other_config(job.config)
        # another process may have done it since the jobs were listed
        if directory.finished:
            return
        run = Run(job.config, directory, means, job.argv)
        if directory.config.exists():
            run.resume()
        else:
            run.start()
        for record in run.evolve():
            yield record.evaluations
        run.finish()


def carry_out_side_by_side(
    jobs: Sequence[Job], means: Means, n_processes: int
) -> Iterator[Event]:
    """Do all jobs, at most so many at once; the processes end with this generator."""
    waiting = list(reversed(jobs))
    running: dict[Connection, tuple[Job, BaseProcess]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < n_processes:
                job = waiting.pop()
                process, news = _started(job, means)
                running[news] = job, process
            for news in wait(list(running)):
                assert isinstance(news, Connection)
                job, process = running[news]
                try:
                    evaluations, failure = news.recv()
                    event = Event(job, evaluations, failure is not None, failure)
                except EOFError:
                    process.join()
                    event = Event(job, ended=True, failure=_ending(process))
                yield event
                if event.ended:
                    del running[news]
                    process.join()
                    news.close()
    finally:
        for _, process in running.values():
            process.terminate()
        for _, process in running.values():
            process.join()


def _started(job: Job, means: Means) -> tuple[BaseProcess, Connection]:
    """A process that does the job, and the end of a pipe on which it reports."""
    # a fresh interpreter: threads and MuJoCo do not survive a fork
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(
        target=_work, args=(job, means, theirs), name=str(job), daemon=True
    )
    with deaf_to_interrupts():
        process.start()
    theirs.close()
    return process, ours


def _work(job: Job, means: Means, news: Connection) -> None:
    """What the process does: report evaluations, and a failure if there is one."""
    threading.Thread(target=_die_with_parent, daemon=True).start()
    try:
        carry_out(job, means, lambda evaluations: news.send((evaluations, None)))
        failure_log(job.directory).unlink(missing_ok=True)
    except BrokenPipeError:
        # the parent has gone
        os._exit(1)
    except Exception as error:
        news.send((0, failure_of(job, error)))
    finally:
        news.close()


def failure_of(job: Job, error: Exception) -> str:
    """Why a job failed, on one line; what is nobody's to put right leaves a log."""
    if isinstance(error, UserError):
        return str(error)
    log = failure_log(job.directory)
    with suppress(OSError):
        log.write_text("".join(traceback.format_exception(error)), encoding="utf-8")
    reason = " ".join(str(error).split())
    return f"{type(error).__name__}: {reason} (see {log})"


def failure_log(directory: Path) -> Path:
    """Where the traceback of a run that failed is kept, beside its directory."""
    return directory.with_name(f"{directory.name}.failure.txt")


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    # what is on disk can be resumed at any moment
    os._exit(1)


def _ending(process: BaseProcess) -> str | None:
    """Why a process that said nothing more has ended; None if all is well."""
    status = process.exitcode or 0
    if status < 0:
        return f"its process was killed by {signal.Signals(-status).name}"
    return f"its process ended with status {status}" if status else None
