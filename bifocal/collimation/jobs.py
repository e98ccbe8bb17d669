"""Long jobs, each in a process of its own: started, watched, cancelled."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypedDict

from bifocal.collimation.background import in_background
from bifocal.collimation.wording import without_options
from bifocal.collimation.work.tasks import JobTask
from bifocal.remarks import remark
from photocore.errors import InputError, PhotogrammetryError
from photocore.remarks import learn

#: Jobs that are remembered; older ones are forgotten once they have ended.
MOST_JOBS = 20
#: A worker that was asked to end has this long. [s]
TO_END = 10.0


#: What the worker answers, as JSON holds it.
Result = Mapping[str, object]


class _Event(TypedDict, total=False):
    """A line of the worker: how far it is, and at last its result or why there is none."""

    progress: float
    message: str
    result: Result
    error: str


@dataclass(slots=True)
class PageJob:
    """A job.

    Attributes
    ----------
    number : str
    kind : str
    state : str
        ``running``, ``done``, ``failed`` or ``cancelled``.
    progress : float
        0 to 1.
    message : str
    process : Popen or None
        The worker, while it runs.
    quiet : bool
        Whether the program began it by itself.
    ended_at : int
        Revision of the survey at which it failed: what was changed since may have mended it.
    """

    number: str
    kind: str
    state: str = "running"
    progress: float = 0.0
    message: str = ""
    process: subprocess.Popen[bytes] | None = None
    quiet: bool = False
    ended_at: int = 0

    def as_dict(self) -> dict[str, object]:
        """Return what the page shows of it."""
        return {
            "id": self.number,
            "kind": self.kind,
            "state": self.state,
            "progress": self.progress,
            "message": self.message,
            "quiet": self.quiet,
        }


class JobRunner:
    """Runs one job at a time.

    Parameters
    ----------
    lock : RLock
        Of the survey that the jobs work for.
    tell : callable
        Called with each event of a job.
    changed : callable
        Called where the survey's state is another.
    language : callable
        Returns that of the page.
    revision : callable
        Returns that of the survey.
    """

    def __init__(
        self,
        lock: threading.RLock,
        tell: Callable[[dict[str, object]], None],
        changed: Callable[[], None],
        language: Callable[[], str],
        revision: Callable[[], int] = lambda: 0,
    ) -> None:
        self._lock, self._tell_all, self._changed, self._language = lock, tell, changed, language
        self._revision = revision
        self.jobs: dict[str, PageJob] = {}
        self._count = 0
        self.threads: list[threading.Thread] = []

    def start(
        self,
        kind: str,
        task_of: Callable[[], JobTask],
        finish: Callable[[JobTask, Result], str],
        *,
        quiet: bool = False,
        first: Callable[[], object] = lambda: None,
    ) -> PageJob:
        """Start a job.

        Parameters
        ----------
        kind : str
        task_of : callable
            Returns what the worker is told; asked once no other job runs.
        finish : callable
            Takes task and result over; returns what the user should know.
        quiet : bool
            Whether the program begins it by itself: it makes way for one that is not.
        first : callable
            What has to be done before the worker begins, without the survey's lock.

        Raises
        ------
        InputError
            If another one runs, or it cannot be done as the survey stands.
        """
        with self._lock:
            running = [job for job in self.jobs.values() if job.state == "running"]
            if running and running[0].quiet and not quiet:
                self.cancel(running[0].number)
            elif running:
                raise InputError(remark("page.job_still_runs", kind=running[0].kind))
            task = task_of()
            self._count += 1
            job = PageJob(str(self._count), kind, quiet=quiet)
            self.jobs[job.number] = job
            for number in list(self.jobs)[:-MOST_JOBS]:
                del self.jobs[number]
            thread = in_background(
                f"the job {kind}",
                partial(self._run, job, task, finish, first),
                partial(self._fail, job),
            )
            self.threads = [t for t in self.threads if t.is_alive()] + [thread]
        thread.start()
        self._changed()
        return job

    def cancel(self, number: str) -> None:
        """End a job; what it was writing is not left behind.

        Raises
        ------
        InputError
            If there is no such job.
        """
        job = self.jobs.get(number)
        if job is None:
            raise InputError(remark("page.no_job"))
        with self._lock:
            if job.state == "running":
                job.state = "cancelled"
                if job.process is not None:
                    job.process.terminate()
        self._tell(job)

    def stop(self) -> None:
        """End all jobs; workers that do not end by themselves are killed."""
        for number in list(self.jobs):
            self.cancel(number)
        for thread in self.threads:
            thread.join(timeout=TO_END)
        for process in [job.process for job in self.jobs.values()]:
            if process is not None:
                process.kill()
        for thread in self.threads:
            thread.join(timeout=TO_END)

    def _run(
        self, job: PageJob, task: JobTask, finish: Callable[[JobTask, Result], str],
        first: Callable[[], object],
    ) -> None:  # fmt: skip
        if job.state == "running":
            first()
        if job.state != "running":  # cancelled before it had begun
            self._tell(job)
            return
        command = [sys.executable, "-m", "bifocal.collimation.job_process"]
        try:
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                cwd=Path.cwd(),
            )  # fmt: skip
        except OSError as error:
            self._fail(job, remark("page.job_not_started", why=error.strerror))
            return
        with process:
            with self._lock:
                job.process = process
                if job.state == "cancelled":
                    process.terminate()
            answer = self._follow(job, process, task)
        job.process = None
        if job.state == "cancelled":
            self._tell(job)
        elif "result" in answer:
            self._finish(job, partial(finish, task, answer["result"]))
        else:
            self._fail(job, answer.get("error") or remark("page.job_without_result"))

    def _follow(self, job: PageJob, process: subprocess.Popen[bytes], task: JobTask) -> _Event:
        """Return the last line of a worker, telling its progress meanwhile."""
        assert process.stdin is not None
        assert process.stdout is not None
        answer = _Event()
        try:
            process.stdin.write(pickle.dumps(task))
            process.stdin.close()
        except OSError:
            return answer
        for line in process.stdout:
            try:
                event = json.loads(line)
                learn(event)
            except ValueError:
                continue
            if "progress" in event and job.state == "running":
                job.progress, job.message = event["progress"], event["message"]
                self._tell(job)
            answer = event
        return answer

    def _finish(self, job: PageJob, finish: Callable[[], str]) -> None:
        try:
            remarks = finish()
        except (PhotogrammetryError, OSError) as error:
            self._fail(job, str(error))
            return
        job.progress = 1.0
        self._end(job, "done", remarks)

    def _fail(self, job: PageJob, why: str) -> None:
        self._end(job, "failed", without_options(why, self._language()))

    def _end(self, job: PageJob, state: str, message: str) -> None:
        job.state, job.message, job.ended_at = state, message, self._revision()
        self._changed()
        self._tell(job)

    def _tell(self, job: PageJob) -> None:
        self._tell_all({"job": job.as_dict()})
