"""Connection to a cluster: tasks and answers, with a limit to every wait."""

import asyncio
import logging
import re
import time
import uuid
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, cast

import dask.config
from distributed import (
    CancelledError,
    Client,
    Future,
    KilledWorker,
    LocalCluster,
    Security,
    wait,
)
from distributed.comm.core import connect

from epuck_mj.errors import UserError
from epuck_mj.host.interruption import ignoring_interrupts

REMOTE = re.compile(r"(tcp|tls)://[^\s/]+:\d{1,5}")
LOCAL = re.compile(r"local:([1-9]\d{0,2})")

SCHEDULER_PATIENCE = 10.0
"""How long the scheduler may take to answer [s]."""

WORKERS_PATIENCE = 60.0
"""How long the scheduler may be without a worker [s]."""

TRANSFER_PATIENCE = 60.0
"""Time of a result's transfer after which it is asked for again [s]."""

LOOK_AFTER = 2.0
"""Time without results after which scheduler and workers are checked [s]."""

LOGGERS = ("distributed", "distributed.client", "tornado", "tornado.application")

LOCAL_SETTINGS: dict[str, Any] = {
    "threads_per_worker": 1,
    "memory_limit": 0,
    "dashboard_address": "127.0.0.1:0",
    "scheduler_kwargs": {"dashboard": False},
    "silence_logs": logging.CRITICAL,
}
"""Settings of a cluster on this machine, without extras."""

QUIET = {
    "distributed.nanny.pre-spawn-environ.DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": (
        "critical"
    )
}
"""Setting that keeps workers on this machine quiet from their first import on."""


class ClusterLost(UserError):
    """The cluster as a whole has failed, not only one job."""


def check_address(address: str) -> None:
    """Refuse an invalid address of a cluster.

    Raises:
        UserError: saying what is a valid one.
    """
    if not REMOTE.fullmatch(address) and not LOCAL.fullmatch(address):
        raise UserError(
            "expected --cluster tcp://host:8786, tls://host:8786 or, for workers on "
            f"this machine, local:4, got '{address}'"
        )


class Cluster:
    """Workers that can be given tasks, with a limit to every wait."""

    def __init__(self, client: Client, address: str):
        """Use a connected client; `address` is for messages."""
        # typed as if every call could be asynchronous
        self._client: Any = client
        self._address = address
        self._seen_workers = time.monotonic()

    def n_threads(self) -> int:
        """Number of threads of all workers; 0 while there is no worker.

        Raises:
            ClusterLost: if there was no worker for too long, or no scheduler answers.
        """
        if self._client.status != "running":
            raise self._lost()
        try:
            threads = self._client.nthreads(callback_timeout=SCHEDULER_PATIENCE)
        except OSError:
            raise self._lost() from None
        if threads:
            self._seen_workers = time.monotonic()
        elif time.monotonic() - self._seen_workers > WORKERS_PATIENCE:
            raise ClusterLost(
                f"the scheduler at '{self._address}' has had no worker for "
                f"{WORKERS_PATIENCE:g} s: start one with dask worker {self._address}"
            )
        return sum(threads.values())

    def submit(self, name: str, function: Callable, *args: Any) -> Future:
        """Submit a task to a worker, or to another one if that dies.

        Raises:
            ClusterLost: if the scheduler is lost.
        """
        if self._client.status != "running":
            raise self._lost()
        # never the key of another task, which Dask would take for the same
        key = f"{name}-{uuid.uuid4().hex}"
        return self._client.submit(function, *args, key=key, pure=False)

    def answers(self, futures: Collection[Future]) -> dict[Future, Any]:
        """Results or exceptions of the tasks that have ended.

        Waits until one has ended, but no longer than `LOOK_AFTER`.

        Raises:
            ClusterLost: as `n_threads`.
        """
        answers: dict[Future, Any] = {}
        try:
            with self._client.as_current():
                waited = wait(list(futures), LOOK_AFTER, "FIRST_COMPLETED")
                ended = cast(Any, waited).done
            for future in ended:
                # if a worker dies before it has handed over, another begins again
                with suppress(TimeoutError):
                    answers[future] = _answer(future)
        except CancelledError:
            raise self._lost() from None
        except TimeoutError:
            # raises if there is no worker any more
            self.n_threads()
        return answers

    def results(self, futures: Sequence[Future]) -> list[Any]:
        """Results of all tasks, in their order.

        Raises:
            ClusterLost: as `n_threads`.
            Exception: whatever a task raised.
        """
        results: dict[Future, Any] = {}
        while len(results) < len(futures):
            missing = [future for future in futures if future not in results]
            for future, answer in self.answers(missing).items():
                if isinstance(answer, Exception):
                    raise answer
                results[future] = answer
        return [results[future] for future in futures]

    def _lost(self) -> ClusterLost:
        return ClusterLost(
            f"lost the scheduler at '{self._address}'; finished runs are kept: start "
            "it again and repeat the command"
        )


def _answer(future: Any) -> Any:
    """Result of an ended future, or the exception that it ended with.

    Raises:
        TimeoutError: if it does not come.
    """
    if future.status != "error":
        return future.result(TRANSFER_PATIENCE)
    error = future.exception(TRANSFER_PATIENCE)
    if isinstance(error, KilledWorker):
        return UserError(
            f"{error.allowed_failures + 1} workers died during this task: killed, or "
            "out of memory? See their logs"
        )
    assert isinstance(error, Exception)
    return error.with_traceback(future.traceback(TRANSFER_PATIENCE))


@contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """The cluster at an address of `carry_out_on_cluster`.

    Raises:
        UserError: if no scheduler answers there.
    """
    # errors that concern the study are raised; other log messages are not shown
    for name in LOGGERS:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with ExitStack() as stack:
        local = LOCAL.fullmatch(address)
        if local is None:
            _greet(address)
            scheduler = address
        else:
            with ignoring_interrupts(), dask.config.set(QUIET):
                scheduler = LocalCluster(n_workers=int(local[1]), **LOCAL_SETTINGS)
            stack.callback(scheduler.close)
        client = Client(scheduler, timeout=SCHEDULER_PATIENCE, set_as_default=False)
        stack.callback(_close, client)
        yield Cluster(client, address)


def _greet(address: str) -> None:
    """Refuse an address where no scheduler answers: a client would wait forever.

    Raises:
        UserError: if none answers.
    """

    async def greet() -> None:
        arguments = Security().get_connection_args("client")
        greeting = connect(address, SCHEDULER_PATIENCE, **arguments)
        comm = await asyncio.wait_for(greeting, SCHEDULER_PATIENCE)
        await comm.close()

    try:
        asyncio.run(greet())
    # another program may answer anything
    except Exception as error:
        reason = " ".join(str(error).split()) or "no answer"
        raise UserError(
            f"no Dask scheduler at '{address}' (start one with dask scheduler): "
            + reason
        ) from None


def _close(client: Client) -> None:
    """Disconnect; the scheduler drops this client's tasks."""
    with suppress(TimeoutError):
        client.close(SCHEDULER_PATIENCE)
