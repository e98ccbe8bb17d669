"""The same pairs on an existing Dask cluster; photos and results on storage that all share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

from bifocal.campaigns.pair_job import PairJob, PairOutcome, run_pair
from bifocal.campaigns.worker_pool import Listener
from photocore.errors import InputError

#: Name of the resource by which workers tell their memory: ``dask worker --resources memory=8e9``.
RESOURCE = "memory"
#: To wait for the scheduler. [s]
TIMEOUT = 10


def run_on_cluster(
    address: str, jobs: Sequence[PairJob], listener: Listener
) -> Iterator[PairOutcome]:
    """Yield what becomes of each pair, as they end.

    Parameters
    ----------
    address : str
        Of the scheduler, ``tcp://host:8786``.
    jobs : sequence of PairJob
    listener : Listener

    Raises
    ------
    InputError
        If Dask is not installed, the scheduler does not answer, or it has no worker.

    Notes
    -----
    A pair whose worker dies is given to another by Dask; finished steps are not done again.
    """
    try:
        cluster: Any = import_module("distributed")
    except ImportError:
        raise InputError(
            'a cluster needs Dask: pip install "bifocal[cluster]" here and on its workers.'
        ) from None
    try:
        client = cluster.Client(address, timeout=TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"--scheduler {address}: does not answer ({error}). Start one with `dask scheduler` "
            "and workers with `dask worker ADDRESS --nthreads 1`."
        ) from None
    with client:
        workers = client.scheduler_info(n_workers=-1)["workers"]
        if not workers:
            raise InputError(
                f"--scheduler {address}: has no worker; start some with `dask worker {address} "
                "--nthreads 1`."
            )
        counted = any(RESOURCE in (info.get("resources") or {}) for info in workers.values())
        names: dict[Any, str] = {}
        for job in map(found_anywhere, jobs):
            resources = {RESOURCE: job.memory()} if counted else None
            future = client.submit(
                run_pair, job, key=f"pair-{job.folder}-{job.name}", pure=False, resources=resources
            )
            names[future] = job.name
        for future in cluster.as_completed(names, loop=client.loop):
            outcome = _outcome(future, names[future])
            listener.ended(outcome)
            yield outcome


def found_anywhere(job: PairJob) -> PairJob:
    """Return a job whose paths are whole: a worker's current folder is another."""
    return replace(
        job, folder=job.folder.absolute(), far=job.far.absolute(), near=job.near.absolute(),
        files={role: path.absolute() for role, path in job.files.items()},
        joint=None if job.joint is None else job.joint.absolute(),
    )  # fmt: skip


def _outcome(future: Any, name: str) -> PairOutcome:
    """Return what a future holds; a cluster's own failure is a pair's."""
    if future.status == "finished":
        outcome: PairOutcome = future.result()
        return outcome
    error = future.exception() if future.status == "error" else "cancelled"
    return PairOutcome(
        name=name, failed_step="run",
        message=f"the cluster gave it up ({error}). Its workers must have this version of bifocal "
        "and see the same folders; look at their memory too.",
    )  # fmt: skip
