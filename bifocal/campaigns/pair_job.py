"""One pair of a survey: running its steps, and what became of it."""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from bifocal.campaigns.pair_steps import steps_of
from bifocal.campaigns.step_store import (
    Step,
    StepRecord,
    is_current,
    read_record,
    run_step,
    step_key,
)
from bifocal.campaigns.surveyed_pair import PairJob
from bifocal.model import untold
from photocore.cli import Progress, no_progress, unforeseen_message
from photocore.errors import InputError, PhotogrammetryError
from photocore.provenance import FileHashes, recording
from photocore.raster_places import cloud_optimised
from photocore.textfile import odd_name

#: Share of a pair's time that each step takes, measured on church_2.
WEIGHTS = {
    "align": 0.22, "relief": 0.36, "points": 0.02, "ortho": 0.07, "drawing": 0.15, "view": 0.02,
    "report": 0.16,
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class PairOutcome:
    """What became of a pair.

    Attributes
    ----------
    name : str
    done, kept : tuple of str
        Steps that ran, and steps whose results were still good.
    failed_step, message : str
        Where it stopped and why; empty if it did not.
    remarks : tuple of str
        What the user should know, each with its step.
    seconds : float
    """

    name: str
    done: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    failed_step: str = ""
    message: str = ""
    remarks: tuple[str, ...] = ()
    seconds: float = 0.0

    def to_dict(self) -> dict[str, object]:
        """Return it as plain data."""
        return asdict(self)


def plan_of(job: PairJob, hashes: FileHashes) -> list[tuple[str, str]]:
    """Return each step of a pair with ``keep``, ``make``, or why it cannot run."""
    return plan_of_steps(job.folder, steps_of(job), hashes)


def plan_of_steps(parent: Path, steps: Sequence[Step], hashes: FileHashes) -> list[tuple[str, str]]:
    """Return steps whose folders lie in ``parent`` with ``keep``, ``make``, or what is wrong."""
    plan: list[tuple[str, str]] = []
    earlier: dict[str, StepRecord] = {}
    stale = False
    for step in steps:
        folder = parent / step.name
        record = read_record(folder)
        try:
            key = "" if stale else step_key(step, earlier, hashes)
            current = not stale and is_current(folder, record, key, hashes)
        except InputError as error:
            return [*plan, (step.name, str(error))]
        if current and record is not None:
            earlier[step.name] = record
        else:
            stale = True
        plan.append((step.name, "keep" if current else "make"))
    return plan


def run_pair(job: PairJob, progress: Progress = no_progress) -> PairOutcome:
    """Run the steps of a pair whose results are not there yet; errors become its outcome.

    The number of threads is fixed while it runs: optical flow shares its rows among threads, and
    its last digits depend on how many there are.
    """
    import cv2

    steps = steps_of(job)
    total = sum(WEIGHTS[step.name] for step in steps)
    parts = []
    behind = 0.0
    for step in steps:
        part = _part_of(progress, behind / total, WEIGHTS[step.name] / total, step.name)
        parts.append((step, part))
        behind += WEIGHTS[step.name]
    hashes = FileHashes(job.folder / ".hashes.json")
    where, day = f"pair {job.name}, ", job.date or None
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        return run_steps(
            job.name, job.folder, parts, hashes, overwrite=job.overwrite, day=day, where=where
        )
    finally:
        cv2.setNumThreads(threads)


def run_steps(
    name: str,
    parent: Path,
    steps: Sequence[tuple[Step, Progress]],
    hashes: FileHashes,
    *,
    overwrite: bool,
    day: str | None = None,
    where: str = "",
) -> PairOutcome:
    """Run the steps whose results are not in their folders yet; errors become the outcome.

    Parameters
    ----------
    name : str
        That of the outcome.
    parent : Path
        Where the folders of the steps lie.
    steps : sequence of (Step, Progress)
        Each with what is told how far it is.
    hashes : FileHashes
    overwrite : bool
        Replace files that were changed after they were made.
    day : str, optional
        That the files bear.
    where : str
        What an error belongs to.
    """
    start = time.perf_counter()
    done: list[str] = []
    kept: list[str] = []
    remarks: list[str] = []
    sentences: list[str] = []
    records: dict[str, StepRecord] = {}
    failed = message = ""
    try:
        for step, progress in steps:
            failed, folder = step.name, parent / step.name
            progress(0.0, 1.0)
            key = step_key(step, records, hashes)
            record = read_record(folder)
            if record is not None and is_current(folder, record, key, hashes):
                kept.append(step.name)
            else:
                rasters = cloud_optimised(bool(step.options.get("cog")))
                with recording(step.described(), day=day), rasters:
                    record = run_step(
                        parent, step, key, hashes, progress=progress, overwrite=overwrite
                    )
                done.append(step.name)
            records[step.name] = record
            new = untold(sentences, record.remarks)
            sentences += new
            remarks += [f"{step.name}: {remark}" for remark in new]
        failed = ""
    except Exception as error:  # one fault, whatever it is, must not stop the other pairs
        message = failure_message(error, f"{where}step {failed}", parent)
    finally:
        with suppress(OSError):
            hashes.save()
    return PairOutcome(
        name=name, done=tuple(done), kept=tuple(kept), failed_step=failed, message=message,
        remarks=tuple(remarks), seconds=time.perf_counter() - start,
    )  # fmt: skip


def failure_message(error: Exception, what: str, folder: Path) -> str:
    """Return what to say of the error that ended a step, while it is handled."""
    if isinstance(error, PhotogrammetryError):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory; give it fewer neighbours (--jobs) or a coarser gsd."
    if isinstance(error, UnicodeEncodeError):
        return odd_name(error)
    if isinstance(error, OSError):
        return f"{error.filename or folder}: {error.strerror or error}."
    if os.environ.get("BIFOCAL_DEBUG"):
        traceback.print_exc()
    return unforeseen_message(what, error)


def _part_of(progress: Progress, start: float, share: float, step: str) -> Progress:
    """Return a reporter for a part of a whole."""

    def report(done: float, total: float, what: str = "") -> None:  # noqa: ARG001
        progress(start + share * (done / total if total > 0 else 0.0), 1.0, step)

    return report
