"""Whole runs, one task each: workers return the files and share no file system."""

import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from distributed import Future, get_worker

from epuck_mj.errors import UserError
from epuck_mj.host import files
from evolution.run.directory import RunDirectory
from evolution.run.means import Means
from evolution.study.cluster.connection import LOOK_AFTER, Cluster, ClusterLost
from evolution.study.cluster.requirements import Requirements, requirements_of
from evolution.study.jobs import (
    PATIENCE,
    Event,
    Job,
    carry_out,
    failure_log,
    failure_of,
)


def whole_runs(jobs: Sequence[Job], cluster: Cluster, racing: bool) -> Iterator[Event]:
    """Do each job as one task."""
    waiting = deque(jobs)
    running: dict[Future, Job] = {}
    while waiting or running:
        # one task a thread: those queued behind a worker that dies would be blamed
        free = cluster.n_threads() - len(running)
        while waiting and free > 0:
            job = waiting.popleft()
            try:
                running[_sent(job, cluster, racing)] = job
                free -= 1
            except ClusterLost:
                raise
            except Exception as error:
                yield Event(job, ended=True, failure=failure_of(job, error))
        if not running:
            time.sleep(LOOK_AFTER / 10 if waiting else 0)
            continue
        for future, answer in cluster.answers(running).items():
            job = running.pop(future)
            try:
                if isinstance(answer, Exception):
                    raise answer
                _keep(job, answer)
                failure = None
            except Exception as error:
                failure = failure_of(job, error)
            yield Event(job, ended=True, failure=failure)


def _sent(job: Job, cluster: Cluster, racing: bool) -> Future:
    """Submit a task that starts a job or continues it from its directory.

    Raises:
        UserError: if it cannot be begun.
    """
    directory = job.run
    with directory.locked(PATIENCE):
        _refuse_foreign(directory, job)
        begun = {
            path.name: path.read_bytes()
            for path in (
                directory.config,
                directory.provenance,
                directory.checkpoint,
                directory.timing,
            )
            if path.exists()
        }
    name = f"{job.name}-seed-{job.config.seed}"
    return cluster.submit(name, _run, job, begun, racing, requirements_of(job.config))


def _refuse_foreign(directory: RunDirectory, job: Job) -> None:
    """Refuse a directory that a run on this machine could not continue.

    Raises:
        UserError: if it holds something else.
    """
    if directory.begun:
        directory.refuse_other_config(job.config)
    else:
        directory.refuse_if_used()


def _run(
    job: Job, begun: Mapping[str, bytes], racing: bool, required: Requirements
) -> dict[str, bytes]:
    """On a worker: continue a run from the files `begun`; all its files by name.

    Raises:
        UserError: for anything the user can put right.
    """
    worker = get_worker()
    # files are written with the process's umask: one run at a time
    with _running, TemporaryDirectory(dir=worker.local_directory) as folder:
        _stop_if_unwanted()
        required.refuse_another()
        path = Path(folder)
        for name, content in begun.items():
            files.write_bytes(path / name, content)
        # which has no tables
        here = replace(job, directory=path, study=None)
        means = Means(threads=worker.state.nthreads, racing=racing)
        try:
            carry_out(here, means, lambda _: _stop_if_unwanted())
        except UserError as error:
            # the user knows the directory by another name
            message = str(error).replace(folder, str(job.directory))
            raise UserError(message) from None
        # the lock, should it still be there, begins with a dot
        names = (p for p in path.iterdir() if not p.name.startswith("."))
        return {p.name: p.read_bytes() for p in sorted(names)}


_running = threading.Lock()


class _UnwantedError(Exception):
    """The client does not wait for this task any more."""


def _stop_if_unwanted() -> None:
    """On a worker: end a task that was cancelled, which Dask would continue."""
    worker = get_worker()
    task = worker.state.tasks.get(worker.get_current_task())
    if task is None or task.state == "cancelled":
        raise _UnwantedError


def _keep(job: Job, found: Mapping[str, bytes]) -> None:
    """Write a run's files as the run itself would have written them.

    Raises:
        UserError: if they cannot be written.
    """
    directory = job.run
    first = [directory.config.name, directory.checkpoint.name]
    # after a kill in between the first two can be resumed; the last ends the run
    last = directory.provenance.name
    middle = [name for name in found if name not in (*first, last)]
    with directory.locked(PATIENCE), files.writing():
        # another process may have been there meanwhile
        _refuse_foreign(directory, job)
        if not (directory.finished or job.packed):
            files.remove_leftovers(directory.path)
            for name in (*first, *middle, last):
                files.write_bytes(directory.path / name, found[name])
    failure_log(job.directory).unlink(missing_ok=True)
