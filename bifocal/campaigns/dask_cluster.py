"""The same pairs on an existing Dask cluster.

Photos and results lie on storage that all machines share, or are sent to the workers and back.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from bifocal.campaigns.pair_job import PairOutcome, run_pair
from bifocal.campaigns.pair_steps import PairJob
from bifocal.campaigns.shipping import ShippedPair, found_anywhere, packed, run_parcel, unpacked
from bifocal.campaigns.worker_pool import Listener
from photocore.errors import InputError
from photocore.installation import how_to_install
from photocore.provenance import program

#: Name of the resource by which workers tell their memory: ``dask worker --resources memory=8e9``.
RESOURCE = "memory"
#: To wait for the scheduler. [s]
TIMEOUT = 10
#: Pairs sent for each thread of the workers: one at work, the next already there.
AHEAD = 2


def run_on_cluster(
    address: str, jobs: Sequence[PairJob], listener: Listener, *, ship: bool = False
) -> Iterator[PairOutcome]:
    """Yield what becomes of each pair, as they end.

    Parameters
    ----------
    address : str
        Of the scheduler, ``tcp://host:8786``.
    jobs : sequence of PairJob
    listener : Listener
    ship : bool
        Send photos and tables to the workers and products back, also where the workers see the
        folders; where one of them does not, this is done in any case.

    Raises
    ------
    InputError
        If Dask is not installed, the scheduler does not answer, it has no worker, or one with
        another version of this program.

    Notes
    -----
    A pair whose worker dies is given to another by Dask. On shared storage finished steps are not
    done again; of files that are sent, products come back when their pair has ended, and no more
    pairs than `AHEAD` for each thread are on their way at a time.
    """
    try:
        cluster: Any = import_module("distributed")
    except ImportError:
        raise InputError(
            f"a cluster needs Dask, here and on its workers: {how_to_install('cluster')}."
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
        ship = ship or not _see_folder(client, address, jobs[0].folder)
        threads = sum(int(info.get("nthreads", 1)) for info in workers.values())
        most = AHEAD * threads if ship else len(jobs)
        waiting = iter(jobs)
        running: dict[Any, PairJob] = {}
        ended = cluster.as_completed(loop=client.loop)
        while True:
            while len(running) < most and (job := next(waiting, None)) is not None:
                try:
                    task = (run_parcel, packed(job)) if ship else (run_pair, found_anywhere(job))
                except InputError as error:
                    yield _told(listener, PairOutcome(
                        name=job.name, failed_step="send", message=str(error)
                    ))  # fmt: skip
                    continue
                resources = {RESOURCE: job.memory()} if counted else None
                key = f"pair-{job.folder}-{job.name}"
                future = client.submit(*task, key=key, pure=False, resources=resources)
                del task  # photos are kept by the scheduler alone
                running[future] = job
                ended.add(future)
            if not running:
                return
            future = next(ended)
            yield _told(listener, _outcome(future, running.pop(future)))
            del future  # its products with it


def _told(listener: Listener, outcome: PairOutcome) -> PairOutcome:
    listener.ended(outcome)
    return outcome


def _see_folder(client: Any, address: str, folder: Path) -> bool:
    """Tell whether every worker sees what lies in a folder here.

    Raises
    ------
    InputError
        If a worker has another version of this program, or none.
    """
    mark = secrets.token_hex(16)
    probe = folder / f".seen-by-all-{mark[:8]}"
    try:
        probe.write_text(mark, encoding="utf-8")
        found = client.run(_look, str(probe.absolute()))
    except ImportError as error:
        raise InputError(
            f"--scheduler {address}: a worker lacks bifocal ({error}); install it there."
        ) from None
    finally:
        probe.unlink(missing_ok=True)
    for worker, (version, _) in found.items():
        if version != program():
            raise InputError(
                f"--scheduler {address}: worker {worker} has {version}, this is {program()}; "
                "install the same version everywhere."
            )
    return all(content == mark for _, content in found.values())


def _look(path: str) -> tuple[str, str]:
    """Return this machine's version of the program, and what a file holds here."""
    content = ""
    with suppress(OSError):
        content = Path(path).read_text(encoding="utf-8")
    return program(), content


def _outcome(future: Any, job: PairJob) -> PairOutcome:
    """Return what a future holds, its files put in place; a cluster's own failure is a pair's."""
    if future.status == "finished":
        result: PairOutcome | ShippedPair = future.result()
        return unpacked(job, result) if isinstance(result, ShippedPair) else result
    error = future.exception() if future.status == "error" else "cancelled"
    return PairOutcome(
        name=job.name, failed_step="run",
        message=f"the cluster gave it up ({error}). Its workers must have this version of bifocal "
        "and memory enough for it.",
    )  # fmt: skip
