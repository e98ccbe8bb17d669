"""A survey file or two photos in; every product of every pair out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bifocal.campaigns.folder_locks import locked
from bifocal.campaigns.inputs import check_files, check_photos
from bifocal.campaigns.leftovers import refuse_other_delivery, remove_leftovers
from bifocal.campaigns.pair_job import PairOutcome, plan_of
from bifocal.campaigns.pair_steps import refusal, steps_of
from bifocal.campaigns.step_store import Step, clean
from bifocal.campaigns.surveyed_pair import FIRST_STEP, MOST_PRODUCTS, PRODUCTS, PairJob
from bifocal.campaigns.whole_wall import (
    JOINT,
    MOSAIC,
    joint_step,
    mosaic_step,
    plan_of_whole,
    run_whole,
)
from bifocal.campaigns.worker_pool import Listener, run_here
from bifocal.options import FILES, OF_PAIR
from photocore.cli import Progress, no_progress
from photocore.errors import InputError, PhotogrammetryError
from photocore.interrupts import raising
from photocore.output import check_writable
from photocore.provenance import FileHashes, recording, today

#: In place of a pair's name in a plan.
_ALL = "all pairs"


@dataclass(frozen=True, slots=True, kw_only=True)
class Machines:
    """Where pairs are computed.

    Attributes
    ----------
    jobs : int, optional
        Pairs at once on this machine; default its cores.
    memory : float, optional
        For all of them; default most of what is free. [GiB]
    scheduler : str
        Address of a Dask scheduler; empty: this machine.
    ship : bool
        Send files to its workers and back even if they see the folders.
    """

    jobs: int | None = None
    memory: float | None = None
    scheduler: str = ""
    ship: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyResult:
    """What became of a survey.

    Attributes
    ----------
    outcomes : tuple of PairOutcome
        In the order of the survey.
    seconds : float
    together : tuple of PairOutcome
        Of what is made of all pairs: ``joint``, ``mosaic``, where asked for.
    """

    outcomes: tuple[PairOutcome, ...]
    seconds: float
    together: tuple[PairOutcome, ...] = ()

    @property
    def failed(self) -> tuple[PairOutcome, ...]:
        """Pairs that did not come to their end."""
        everything = (*self.outcomes, *self.together)
        return tuple(outcome for outcome in everything if outcome.failed_step)

    def in_words(self, worded: Callable[[str], str]) -> SurveyResult:
        """Return it with what it says put into other words."""

        def put(outcomes: tuple[PairOutcome, ...]) -> tuple[PairOutcome, ...]:
            return tuple(
                replace(one, message=worded(one.message), remarks=tuple(map(worded, one.remarks)))
                for one in outcomes
            )

        return replace(self, outcomes=put(self.outcomes), together=put(self.together))

    def to_dict(self) -> dict[str, object]:
        """Return it as plain data."""
        pairs = [outcome.to_dict() for outcome in self.outcomes]
        whole = {outcome.name: outcome.to_dict() for outcome in self.together}
        return {"pairs": pairs, **whole, "failed": len(self.failed), "seconds": self.seconds}

    def lines(self) -> list[str]:
        """Return what was made, and what failed and how to mend it, for people."""
        finished = sum(bool(outcome.done) and not outcome.failed_step for outcome in self.outcomes)
        failed = sum(bool(outcome.failed_step) for outcome in self.outcomes)
        kept = len(self.outcomes) - finished - failed
        lines = [
            f"{pairs_in_words(len(self.outcomes))}: {finished} made, {kept} kept as they were, "
            f"{failed} failed; {_duration(self.seconds)}."
        ]
        for outcome in self.together:
            if not outcome.failed_step:
                lines.append(f"{outcome.name}: {'kept' if outcome.kept else 'made'}")
                lines += [f"  {text}" for text in outcome.remarks]
        for outcome in self.failed:
            lines += ["", f"{outcome.name}, failed at {outcome.failed_step}:"]
            lines.append(f"  {outcome.message}")
        return lines


def pairs_in_words(count: int) -> str:
    """Return how many pairs.

    Examples
    --------
    >>> pairs_in_words(1), pairs_in_words(40)
    ('1 pair', '40 pairs')
    """
    return f"{count} pair" + ("" if count == 1 else "s")


def _duration(seconds: float) -> str:
    """Return a time in words.

    Examples
    --------
    >>> _duration(42), _duration(150), _duration(7300)
    ('42 s', '2 min', '2 h 1 min')
    """
    minutes = int(seconds // 60)
    if minutes < 2:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


def begin_survey(
    out: Path, folder: Path, *, overwrite: bool = False, progress: Progress = no_progress
) -> tuple[int, int]:
    """Write a survey file from a folder of photos; return how many pairs, and photos in none.

    Raises
    ------
    InputError
        If no photos make a pair, or the file cannot be written.
    """
    from bifocal.campaigns.photo_pairing import pair_photos, write_survey_file

    check_writable(out, overwrite=overwrite)
    pairs, unpaired = pair_photos(folder, progress=progress)
    write_survey_file(out, folder, pairs, unpaired, overwrite=overwrite)
    return len(pairs), len(unpaired)


def plan_survey(
    jobs: Sequence[PairJob], *, mosaic: Mapping[str, object] | None = None
) -> list[tuple[str, str, str]]:
    """Return (pair, step, ``keep``, ``make`` or what stands against it), doing nothing.

    What is made of all pairs, if asked for, comes last.
    """
    frame = "" if all(job.joint is None for job in jobs) else _plan_of_frame(jobs)
    rows = []
    for job in jobs:
        hashes = FileHashes(job.folder / ".hashes.json")
        if frame in ("", "keep"):
            plan = plan_of(job, hashes)
        else:  # what follows the common frame is made anew with it
            plan = plan_of(replace(job, products=(), joint=None), hashes)
            if plan[-1][1] in ("keep", "make"):
                plan += [(step.name, "make") for step in steps_of(job)[1:]]
        if plan[0] == (FIRST_STEP, "make"):
            plan[0] = FIRST_STEP, refusal(job) or _unreadable(job) or "make"
        rows += [(job.name, step, what) for step, what in plan]
    if frame:
        rows.append((_ALL, JOINT, frame))
    if mosaic is not None:
        rows.append((_ALL, MOSAIC, _plan_of_mosaic(jobs, mosaic, rows)))
    return rows


def _unreadable(job: PairJob) -> str:
    try:
        check_files(job)
        check_photos(job)
    except PhotogrammetryError as error:
        return str(error)
    return ""


def _plan_of_frame(jobs: Sequence[PairJob]) -> str:
    alone = [replace(job, products=(), joint=None) for job in jobs]
    if any(what != "keep" for _, _, what in plan_survey(alone)):
        return "make"
    return plan_of_whole(jobs[0].folder.parent, joint_step(jobs))


def _plan_of_mosaic(
    jobs: Sequence[PairJob], options: Mapping[str, object], rows: Sequence[tuple[str, str, str]]
) -> str:
    if any(what != "keep" for _, _, what in rows):
        return "make"
    try:
        return plan_of_whole(jobs[0].folder.parent, mosaic_step(jobs, options))
    except InputError as error:
        return str(error)


def run_survey(
    jobs: Sequence[PairJob],
    *,
    machines: Machines = Machines(),
    mosaic: Mapping[str, object] | None = None,
    progress: Progress = no_progress,
    tell: Callable[[str], None] | None = None,
) -> SurveyResult:
    """Make the products of every pair; what is there already and still good is kept.

    Products of an earlier run that do not follow from what a pair holds now are removed, and named.
    One pair's failure stops no other; stopped at any moment, it goes on from there when called
    again. ``tell`` is given a line for every pair that ends. Where the jobs ask for one frame,
    all pairs are aligned first and adjusted together; ``mosaic``, the options of `make_mosaic`
    where it is wanted, joins their drawings at the end.

    Raises
    ------
    InputError
        If another process works on the same folders, or the cluster cannot be used.
    """
    start = time.perf_counter()
    jobs = [replace(job, date=job.date or today()) for job in jobs]
    together: list[PairOutcome] = []
    outcomes: dict[str, PairOutcome] = {}
    with raising(), locked([job.folder for job in jobs]):
        for job in jobs:
            clean(job.folder)
        ready = list(jobs)
        if any(job.joint is not None for job in jobs):
            outcomes = _aligned(jobs, machines, progress)
            ready = [job for job in jobs if not outcomes[job.name].failed_step]
            together.append(_one_frame(ready, progress, tell))
            if together[-1].failed_step:
                why = "waits for the common frame of all pairs, which failed: see joint."
                for job in ready:
                    alone = outcomes[job.name]
                    outcomes[job.name] = replace(alone, failed_step=JOINT, message=why)
                ready = []
        outcomes |= _made(ready, machines, _Count(ready, progress, tell))
        for job in ready:
            outcomes[job.name] = _without_leftovers(job, outcomes[job.name])
        if mosaic is not None:
            drawn = [job for job in ready if not outcomes[job.name].failed_step]
            together.append(_mosaic(drawn, mosaic, jobs[0], progress, tell))
    return SurveyResult(
        outcomes=tuple(outcomes[job.name] for job in jobs), together=tuple(together),
        seconds=time.perf_counter() - start,
    )  # fmt: skip


def _made(jobs: Sequence[PairJob], machines: Machines, listener: _Count) -> dict[str, PairOutcome]:
    """Return what became of each pair."""
    waiting = [job for job in jobs if not _kept(job, listener)]
    try:
        for _ in _running(waiting, machines, listener):
            pass
    finally:
        for job in waiting:
            clean(job.folder)
    return {outcome.name: outcome for outcome in listener.outcomes}


def _without_leftovers(job: PairJob, outcome: PairOutcome) -> PairOutcome:
    """Remove what a pair's folder held before and does not belong to it any more, and say so.

    A pair that failed may go on from there, unless what was there was to be overwritten.
    """
    if outcome.failed_step and not (job.overwrite and outcome.done):
        return outcome
    sentences = remove_leftovers(job, (*outcome.done, *outcome.kept))
    message = "\n".join((outcome.message, *sentences)) if outcome.failed_step else outcome.message
    return replace(outcome, message=message, remarks=(*outcome.remarks, *sentences))


def _aligned(
    jobs: Sequence[PairJob], machines: Machines, progress: Progress
) -> dict[str, PairOutcome]:
    """Set every pair up by itself, nothing else."""
    alone = [replace(job, products=(), joint=None) for job in jobs]
    return _made(alone, machines, _Count(alone, progress, None))


def _one_frame(
    jobs: Sequence[PairJob], progress: Progress, tell: Callable[[str], None] | None
) -> PairOutcome:
    """Adjust the pairs that are set up in one frame."""
    if len(jobs) < 2:
        return PairOutcome(
            name=JOINT, failed_step=JOINT,
            message="fewer than two pairs could be set up: there is nothing to adjust together.",
        )  # fmt: skip
    return _whole(joint_step(jobs), jobs[0], progress, tell)


def _mosaic(
    jobs: Sequence[PairJob],
    options: Mapping[str, object],
    first: PairJob,
    progress: Progress,
    tell: Callable[[str], None] | None,
) -> PairOutcome:
    try:
        step = mosaic_step(jobs, options)
    except InputError as error:
        return PairOutcome(name=MOSAIC, failed_step=MOSAIC, message=str(error))
    return _whole(step, first, progress, tell)


def _whole(
    step: Step, job: PairJob, progress: Progress, tell: Callable[[str], None] | None
) -> PairOutcome:
    with recording(step.name, day=job.date):
        outcome = run_whole(job.folder.parent, step, overwrite=job.overwrite, progress=progress)
    if tell is not None and not outcome.kept:
        what = f"FAILED: {outcome.message}" if outcome.failed_step else "made"
        tell(f"{step.name}: {what}; {_duration(outcome.seconds)}")
    return outcome


def _running(
    jobs: Sequence[PairJob], machines: Machines, listener: Listener
) -> Iterator[PairOutcome]:
    if not jobs:
        return iter(())
    if machines.scheduler:
        from bifocal.campaigns.dask_cluster import run_on_cluster

        return run_on_cluster(machines.scheduler, jobs, listener, ship=machines.ship)
    memory = None if machines.memory is None else int(machines.memory * (1 << 30))
    return run_here(jobs, listener, most=machines.jobs, memory=memory)


def _kept(job: PairJob, listener: Listener) -> bool:
    """Tell the listener of a pair of which nothing has to be made; no process is started for it."""
    hashes = FileHashes(job.folder / ".hashes.json")
    plan = plan_of(job, hashes)
    hashes.save()
    if any(what != "keep" for _, what in plan):
        return False
    listener.ended(PairOutcome(name=job.name, kept=tuple(step for step, _ in plan)))
    return True


class _Count(Listener):
    """Adds up how far all pairs are, tells of each that ends, and keeps what became of them."""

    def __init__(
        self, jobs: Sequence[PairJob], progress: Progress, tell: Callable[[str], None] | None
    ) -> None:
        self.shares: dict[str, float] = dict.fromkeys((job.name for job in jobs), 0.0)
        self.progress, self.tell = progress, tell
        self.outcomes: list[PairOutcome] = []
        self.start, self.kept = time.perf_counter(), 0

    def moved(self, name: str, share: float, step: str) -> None:
        """Add up."""
        self.shares[name] = share
        self.progress(sum(self.shares.values()), len(self.shares), f"{name}: {step}")

    def heard(self, text: str) -> None:
        """Tell of it."""
        if self.tell is not None:
            self.tell(text)

    def ended(self, outcome: PairOutcome) -> None:
        """Keep it, and tell of it with the time that is left."""
        self.shares[outcome.name] = 1.0
        self.outcomes.append(outcome)
        self.progress(sum(self.shares.values()), len(self.shares), outcome.name)
        self.kept += not outcome.done and not outcome.failed_step
        if self.tell is None or not (outcome.done or outcome.failed_step):
            return
        what = f"FAILED at {outcome.failed_step}" if outcome.failed_step else "made"
        total = len(self.shares) - self.kept
        behind = sum(self.shares.values()) - self.kept
        remaining = (time.perf_counter() - self.start) * (total - behind) / max(behind, 1e-3)
        rest = f"; about {_duration(remaining)} left" if behind < total else ""
        self.tell(
            f"[{len(self.outcomes)}/{len(self.shares)}] {outcome.name}: {what} in "
            f"{_duration(outcome.seconds)}{rest}"
        )


def facade_job(
    far: Path,
    near: Path,
    out: Path,
    *,
    more: tuple[Path, ...] = (),
    name: str = "",
    given: Mapping[str, Any] | None = None,
    products: tuple[str, ...] | None = None,
    overwrite: bool = False,
) -> PairJob:
    """Return the survey of one pair: everything a façade drawing needs, into one folder.

    Parameters
    ----------
    far, near : Path
        Photos.
    out : Path
        Folder; each step gets one in it.
    more : tuple of Path
        Photos that make a set of these.
    name : str
        Title; default that of the folder.
    given : mapping
        Files and options by the names of the survey file; None, False and nothing in a list count
        as not given.
    products : tuple of str, optional
        Of `PRODUCTS`.
    overwrite : bool
        Replace files changed since they were made, and what was made from other photos.

    Raises
    ------
    InputError
        If the folder is a file or a product is unknown.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; name a folder with --out.")
    unknown = [product for product in products or () if product not in PRODUCTS]
    if unknown:
        raise InputError(f"--products: {unknown[0]!r} is none of {', '.join(PRODUCTS)}.")
    settings = {key: value for key, value in (given or {}).items() if OF_PAIR[key].is_said(value)}
    return PairJob(
        name=name or out.resolve().name,
        folder=out,
        far=far,
        near=near,
        more=more,
        files={role: path for role, path in settings.items() if role in FILES},
        options={key: value for key, value in settings.items() if key not in FILES},
        way="facade",
        products=tuple(p for p in PRODUCTS if p in products) if products else MOST_PRODUCTS,
        overwrite=overwrite,
    )


def facade(
    job: PairJob, *, machines: Machines = Machines(), progress: Progress = no_progress
) -> PairOutcome:
    """Survey one pair; see `run_survey`.

    Raises
    ------
    InputError
        Where a step fails: with what it said. What was made before stays and counts. If the folder
        holds a delivery made from other photos, which is not to be overwritten.
    """
    if (fresh := not job.folder.exists()) and (why := refusal(job)):
        raise InputError(why)
    check_files(job)
    refuse_other_delivery(job)
    outcome = run_survey([job], machines=machines, progress=progress).outcomes[0]
    if outcome.failed_step:
        if fresh and not outcome.done:
            with suppress(OSError):  # what else lies there is not ours
                (job.folder / ".hashes.json").unlink(missing_ok=True)
                job.folder.rmdir()
        raise InputError(outcome.message)
    return outcome
