"""Pairs shared among processes of this machine, as many at once as cores and memory allow."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from bifocal.campaigns.pair_job import PairOutcome
from bifocal.campaigns.surveyed_pair import PairJob
from bifocal.remarks import remark
from photocore.machine import cores, free_memory

#: A pair whose process died is tried so often; memory that ran short may be there again.
ATTEMPTS = 2
#: Share of the free memory that is used where no limit is given.
MEMORY_SHARE = 0.8


class Listener:
    """Told what happens; every method may be left as it is."""

    def moved(self, name: str, share: float, step: str) -> None:
        """Hear that a pair has come so far, 0 to 1."""

    def heard(self, text: str) -> None:
        """Hear what is waited for or done with all pairs."""

    def ended(self, outcome: PairOutcome) -> None:
        """Hear that a pair is done or has failed."""


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    connection: Connection
    job: PairJob | None = None


def run_here(
    jobs: Sequence[PairJob],
    listener: Listener,
    *,
    most: int | None = None,
    memory: int | None = None,
) -> Iterator[PairOutcome]:
    """Yield what becomes of each pair, as they end.

    Parameters
    ----------
    jobs : sequence of PairJob
    listener : Listener
    most : int, optional
        Pairs at once; default the cores.
    memory : int, optional
        All of them together; default `MEMORY_SHARE` of what is free. A pair that needs more runs
        alone. [bytes]

    Notes
    -----
    Each process computes on one thread, so that results do not depend on how many there are.
    """
    budget = memory or int(MEMORY_SHARE * free_memory())
    waiting = [(job, job.memory(), 1) for job in jobs]
    running: dict[str, tuple[int, int]] = {}
    workers: list[_Worker] = []
    try:
        while waiting or running:
            _share_out(waiting, running, workers, budget, min(most or cores(), len(jobs)))
            yield from _listen(workers, waiting, running, listener)
    finally:
        for worker in workers:
            worker.process.kill()
        for worker in workers:
            worker.process.join()
            worker.connection.close()


def _share_out(
    waiting: list[tuple[PairJob, int, int]],
    running: dict[str, tuple[int, int]],
    workers: list[_Worker],
    budget: int,
    most: int,
) -> None:
    """Give waiting pairs to workers while cores and memory last."""
    while waiting and len(running) < most:
        used = sum(need for need, _ in running.values())
        fitting = (
            i for i, (_, need, _) in enumerate(waiting) if not running or used + need <= budget
        )
        index = next(fitting, None)
        if index is None:
            return
        job, need, attempt = waiting.pop(index)
        worker = next((worker for worker in workers if worker.job is None), None)
        if worker is None:
            worker = _started()
            workers.append(worker)
        worker.job = job
        with suppress(OSError):  # it died idle: noticed by the next look at it
            worker.connection.send(job)
        running[job.name] = (need, attempt)


def _listen(
    workers: list[_Worker],
    waiting: list[tuple[PairJob, int, int]],
    running: dict[str, tuple[int, int]],
    listener: Listener,
) -> Iterator[PairOutcome]:
    """Wait for news of the workers, and yield the pairs that ended."""
    wait([worker.connection for worker in workers if worker.job is not None])
    for worker in [worker for worker in workers if worker.job is not None]:
        job = worker.job
        try:
            while job is not None and worker.connection.poll():
                news: Any = worker.connection.recv()
                if isinstance(news, PairOutcome):
                    del running[job.name]
                    worker.job = job = None
                    listener.ended(news)
                    yield news
                else:
                    listener.moved(job.name, *news)
        except (EOFError, OSError):
            workers.remove(worker)
            worker.process.join()
            assert job is not None
            need, attempt = running.pop(job.name)
            if attempt < ATTEMPTS:
                waiting.insert(0, (job, need, attempt + 1))
                continue
            outcome = PairOutcome(
                name=job.name, failed_step="run", message=_died(worker.process.exitcode)
            )
            listener.ended(outcome)
            yield outcome


def _died(code: int | None) -> str:
    """Return what to do about a process that ended by itself, twice."""
    if code == -9:
        return remark("campaign.no_memory")
    return f"its process ended by itself twice (exit status {code}); run it alone with --debug."


def _started() -> _Worker:
    """Start a worker whose numerical libraries use one thread."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs,), daemon=True)
    with _one_thread():
        process.start()
    theirs.close()
    return _Worker(process, ours)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Ask libraries loaded by processes started within for one thread; Dask's workers do so too."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(connection: Connection) -> None:
    """Run pairs until the connection closes; end at once with the process that started it."""
    from bifocal.campaigns.pair_job import run_pair

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the starting process's business
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    while True:
        try:
            job = connection.recv()
        except (EOFError, OSError):
            return

        def tell(done: float, total: float, what: str = "") -> None:
            connection.send((done / total, what))

        connection.send(run_pair(job, tell))
