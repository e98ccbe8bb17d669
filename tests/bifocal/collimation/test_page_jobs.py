"""Jobs of the page end, whatever happens to them: a job that runs for ever bars all later ones."""

from __future__ import annotations

import io
import json
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from bifocal.collimation import jobs
from bifocal.collimation.background import in_background
from bifocal.collimation.jobs import JobRunner, PageJob
from bifocal.collimation.work import matching
from bifocal.collimation.work.tasks import MatchTask, TargetsTask
from tests.conftest import Unforeseen


class Worker:
    """A worker that answers at once, or only once it is killed."""

    started = 0
    obeys = True

    def __init__(self, *_: object, **__: object) -> None:
        type(self).started += 1
        self.stdin = io.BytesIO()
        self._ended = threading.Event()
        self.stdout: Any = self._lines()

    def _lines(self) -> Iterator[str]:
        if not self.obeys:
            self._ended.wait(20)
        yield json.dumps({"result": {}})

    def terminate(self) -> None:
        """Do as a worker does that hears nothing."""

    def kill(self) -> None:
        self._ended.set()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is left of it."""


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch) -> JobRunner:
    """Return a runner whose workers answer at once."""
    monkeypatch.setattr(Worker, "started", 0)
    monkeypatch.setattr(Worker, "obeys", True)
    monkeypatch.setattr(subprocess, "Popen", Worker)
    return JobRunner(threading.RLock(), lambda _: None, lambda: None, lambda: "en")


def ended(runner: JobRunner, job: PageJob) -> PageJob:
    for thread in runner.threads:
        thread.join(timeout=20)
    return job


def raising(*_: object) -> str:
    raise KeyError("nobody foresaw this")


def test_an_end_that_nobody_foresaw_fails_the_job_and_the_next_one_runs(
    runner: JobRunner, unforeseen: Unforeseen
) -> None:
    job = ended(runner, runner.start("relief", dict, raising))
    assert job.state == "failed"
    assert "KeyError: 'nobody foresaw this'" in job.message
    following = ended(runner, runner.start("relief", dict, lambda *_: "well"))
    assert (following.state, following.message) == ("done", "well")
    assert len(unforeseen.taken()) == 1


def test_a_beginning_that_nobody_foresaw_fails_the_job_without_a_worker(
    runner: JobRunner, unforeseen: Unforeseen
) -> None:
    job = ended(runner, runner.start("relief", dict, raising, first=raising))
    assert job.state == "failed"
    assert Worker.started == 0
    assert len(unforeseen.taken()) == 1


@pytest.mark.parametrize("begins", [True, False])
def test_a_job_cancelled_before_it_began_starts_no_worker(
    runner: JobRunner, monkeypatch: pytest.MonkeyPatch, begins: bool
) -> None:
    """Cancelled while the workbook is written (first), or before even that."""
    begun: list[str] = []
    go_on = threading.Event()

    def first() -> None:
        begun.append("workbook written")
        go_on.wait(20)

    def late(task: str, work: Callable[[], None], report: Any) -> threading.Thread:
        return in_background(task, lambda: (go_on.wait(20), work())[0], report)  # type: ignore[arg-type, return-value]

    if not begins:
        monkeypatch.setattr(jobs, "in_background", late)
    job = runner.start("relief", dict, raising, first=first)
    while begins and not begun:
        time.sleep(0.001)
    runner.cancel(job.number)
    go_on.set()
    assert ended(runner, job).state == "cancelled"
    assert Worker.started == 0
    assert begun == (["workbook written"] if begins else [])


def test_stopping_kills_a_worker_that_does_not_hear(
    runner: JobRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jobs, "TO_END", 0.05)
    monkeypatch.setattr(Worker, "obeys", False)
    job = runner.start("relief", dict, lambda *_: "")
    while job.process is None:
        time.sleep(0.001)
    runner.stop()
    for thread in runner.threads:
        thread.join(timeout=20)
    assert not any(thread.is_alive() for thread in runner.threads)
    assert job.state == "cancelled"


def test_what_is_offered_as_targets_is_no_feature(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [{"name": name, "code": code} for name, code in (("A", "target"), ("B", "feature"))]

    def matched(task: MatchTask, _progress: object) -> dict[str, Any]:
        assert not task.features
        return {"points": points}

    monkeypatch.setattr(matching, "match", matched)
    assert matching.targets(TargetsTask(pair=Path("a.json")), print)["points"] == points[:1]
