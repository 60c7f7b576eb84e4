"""Runs of a study on a Dask cluster, with their files on this machine.

If the processors are of one type, the bytes are those of a run on this machine: if a
worker dies, another one repeats its task, and a worker with other versions, code or
models refuses its tasks. Only this package imports `distributed`, an extra.
"""

from collections.abc import Iterator, Sequence

from epuck_mj.errors import UserError
from evolution.study.jobs import Event, Job

try:
    import distributed as _  # noqa: F401
except ModuleNotFoundError as error:
    raise UserError(
        f"--cluster needs '{error.name}', which is not installed: "
        "pip install 'epuck-mj[cluster]'"
    ) from None

from evolution.study.cluster.connection import check_address, connected
from evolution.study.cluster.split_runs import split_runs
from evolution.study.cluster.whole_runs import whole_runs

__all__ = ["carry_out_on_cluster", "check_address"]


def carry_out_on_cluster(
    jobs: Sequence[Job], address: str, split: bool, racing: bool
) -> Iterator[Event]:
    """Do all jobs on a cluster; closing the generator drops unfinished jobs.

    Args:
        jobs: what to do.
        address: of a Dask scheduler, `tcp://host:8786` or `tls://host:8786`, or
            `local:4`: four workers on this machine, which end with the generator. Has
            to have passed `check_address`.
        split: do one job after the other, sending its trials, instead of whole runs.
        racing: break off individuals that can only lose; changes no result.

    Raises:
        UserError: if the cluster cannot be reached or is lost. A job that fails is an
            event.
    """
    if jobs:
        with connected(address) as cluster:
            yield from (split_runs if split else whole_runs)(jobs, cluster, racing)
