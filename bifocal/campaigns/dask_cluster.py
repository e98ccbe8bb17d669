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
from bifocal.campaigns.shipping import ShippedPair, found_anywhere, packed, run_parcel, unpacked
from bifocal.campaigns.surveyed_pair import PairJob
from bifocal.campaigns.worker_pool import Listener
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.installation import how_to_install
from photocore.provenance import program

#: Name of the resource by which workers tell their memory: ``dask worker --resources memory=8e9``.
RESOURCE = "memory"
#: To wait for the scheduler, and for its first worker. [s]
TIMEOUT, PATIENCE = 10, 1800
#: A pair tells how far it is by such steps.
SHARE = 0.02
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
        If Dask is not installed, the scheduler does not answer, no worker comes within `PATIENCE`,
        or there is one with another version of this program.

    Notes
    -----
    A pair whose worker dies is given to another by Dask. On shared storage finished steps are not
    done again; of files that are sent, products come back when their pair has ended, and no more
    pairs than `AHEAD` for each thread are on their way at a time. Workers that come later are
    given pairs like the first.
    """
    try:
        cluster: Any = import_module("distributed")
    except ImportError:
        raise InputError(remark("campaign.no_dask", how=how_to_install("cluster"))) from None
    try:
        client = cluster.Client(address, timeout=TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(remark("campaign.no_scheduler", address=address, error=error)) from None
    with client:
        crew = _Crew(client, address, jobs[0].folder, listener, ship=ship)
        topic = f"bifocal-{secrets.token_hex(8)}"
        client.subscribe_topic(topic, lambda event: listener.moved(*event[1]))
        counted = any(RESOURCE in (info.get("resources") or {}) for info in crew.workers.values())
        waiting = iter(jobs)
        running: dict[Any, PairJob] = {}
        ended = cluster.as_completed(loop=client.loop)
        while True:
            crew.look()
            most = AHEAD * crew.threads if crew.ship else len(jobs)
            while len(running) < most and (job := next(waiting, None)) is not None:
                try:
                    task = (
                        (run_parcel, packed(job)) if crew.ship else (run_pair, found_anywhere(job))
                    )
                except InputError as error:
                    yield _told(
                        listener, PairOutcome(name=job.name, failed_step="send", message=str(error))
                    )
                    continue
                resources = {RESOURCE: job.memory()} if counted else None
                key = f"pair-{job.folder}-{job.name}"
                future = client.submit(
                    _reporting, *task, job.name, topic, key=key, pure=False, resources=resources
                )
                del task  # photos are kept by the scheduler alone
                running[future] = job
                ended.add(future)
            if not running:
                return
            future = next(ended)
            yield _told(listener, _outcome(future, running.pop(future)))
            del future  # its products with it


class _Crew:
    """The workers of a cluster: who is there, and whether all of them see a folder.

    Raises
    ------
    InputError
        If none comes within `PATIENCE`, or one has another version of the program, or none.
    """

    def __init__(
        self, client: Any, address: str, folder: Path, listener: Listener, *, ship: bool
    ) -> None:
        self.client, self.address, self.folder = client, address, folder
        self.listener, self.ship = listener, ship
        self.workers: dict[str, Any] = {}
        if not client.scheduler_info(n_workers=-1)["workers"]:
            start = f"`dask worker {address} --nthreads 1`"
            listener.heard(f"--scheduler {address}: waiting for workers; start some with {start}")
            try:
                client.wait_for_workers(1, timeout=PATIENCE)
            except TimeoutError:
                about = {"address": address, "minutes": PATIENCE / 60, "start": start}
                raise InputError(remark("campaign.no_worker", **about)) from None
        self.look()

    @property
    def threads(self) -> int:
        """How many pairs are computed at once."""
        return sum(int(info.get("nthreads", 1)) for info in self.workers.values())

    def look(self) -> None:
        """See who is there; what is new is looked at and told of."""
        before = set(self.workers)
        self.workers = self.client.scheduler_info(n_workers=-1)["workers"]
        if not (new := set(self.workers) - before):
            return
        self.ship = (
            not _see_folder(self.client, self.address, self.folder, sorted(new)) or self.ship
        )
        way = "photos are sent to them" if self.ship else "they see the survey's folder"
        crew = f"workers {len(self.workers)}, pairs at once {self.threads}; {way}"
        self.listener.heard(f"--scheduler {self.address}: {crew}")


def _reporting(work: Any, given: Any, name: str, topic: str) -> Any:
    """Do a pair's work on a worker, and tell the machine that sent it how far it is."""
    worker: Any = import_module("distributed").get_worker()
    last: tuple[float, str] = -1.0, ""

    def progress(done: float, total: float, what: str = "") -> None:
        nonlocal last
        share = done / max(total, 1e-9)
        if what != last[1] or share >= last[0] + SHARE:
            last = share, what
            worker.log_event(topic, (name, share, what))

    return work(given, progress)


def _told(listener: Listener, outcome: PairOutcome) -> PairOutcome:
    listener.ended(outcome)
    return outcome


def _see_folder(client: Any, address: str, folder: Path, workers: Sequence[str]) -> bool:
    """Tell whether each of some workers sees what lies in a folder here.

    Raises
    ------
    InputError
        If a worker has another version of this program, or none.
    """
    mark = secrets.token_hex(16)
    probe = folder / f".seen-by-all-{mark[:8]}"
    try:
        probe.write_text(mark, encoding="utf-8")
        answers = client.run(_look, str(probe.absolute()), workers=list(workers))
    except ImportError as error:
        raise InputError(remark("campaign.worker_without", address=address, error=error)) from None
    finally:
        probe.unlink(missing_ok=True)
    for worker, (version, _) in answers.items():
        if version != program():
            worker_program = {
                "address": address,
                "worker": worker,
                "version": version,
                "own": program(),
            }
            raise InputError(remark("campaign.other_version", **worker_program))
    return all(content == mark for _, content in answers.values())


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
        name=job.name, failed_step="run", message=remark("campaign.given_up", error=error)
    )
