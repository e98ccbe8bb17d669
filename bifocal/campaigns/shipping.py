"""Pairs sent to machines that do not see the survey's folders, and their products brought back.

On the other machine the files lie to one another as they do here: pair files name their photos
relative to themselves, and the products are then the same to the last byte.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from bifocal.campaigns.pair_job import PairOutcome, run_pair
from bifocal.campaigns.step_store import receive_step
from bifocal.campaigns.surveyed_pair import PairJob
from bifocal.remarks import remark
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.provenance import FileHashes


@dataclass(frozen=True, slots=True, kw_only=True)
class Parcel:
    """A pair with all it needs.

    Attributes
    ----------
    job : PairJob
        With the paths of the machine that sent it, absolute.
    root : Path
        Folder that holds all of them.
    files : mapping of str to bytes
        By their place below ``root``: photos, tables, and the steps that were made before.
    """

    job: PairJob
    root: Path
    files: Mapping[str, bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class ShippedPair:
    """What comes back: the outcome, and the files of each step that was made."""

    outcome: PairOutcome
    steps: Mapping[str, Mapping[str, bytes]]


def found_anywhere(job: PairJob) -> PairJob:
    """Return a job whose paths are absolute: a worker's current folder is another."""
    return _moved(job, Path.absolute)


def _moved(job: PairJob, place: Callable[[Path], Path]) -> PairJob:
    """Return a job with its files and folders elsewhere."""
    files = {role: place(path) for role, path in job.files.items()}
    return replace(
        job, folder=place(job.folder), far=place(job.far), near=place(job.near),
        more=tuple(map(place, job.more)), files=files, joint=job.joint and place(job.joint),
    )  # fmt: skip


def packed(job: PairJob) -> Parcel:
    """Return a pair with its files.

    Raises
    ------
    InputError
        If a file cannot be read, or the files have no folder in common.
    """
    job = found_anywhere(job)
    needed = [*job.photos, *job.files.values()]
    try:
        root = Path(os.path.commonpath([job.folder, *(path.parent for path in needed)]))
    except ValueError:
        raise InputError(remark("campaign.drives", of=job.name)) from None
    if job.joint is not None:
        # The pair file of the common frame, and the lens files beside it.
        needed += sorted(job.joint.glob(f"{job.title}.*"))
    for step in _steps(job.folder):
        needed += [path for path in sorted(step.rglob("*")) if path.is_file()]
    files = {path.relative_to(root).as_posix(): _content(path) for path in needed}
    return Parcel(job=job, root=root, files=files)


def run_parcel(parcel: Parcel, progress: Progress = no_progress) -> ShippedPair:
    """Run a pair in a folder of its own and return what was made; the folder is removed."""
    with tempfile.TemporaryDirectory(prefix="bifocal-") as place:
        root = Path(place).resolve()
        for name, content in parcel.files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(content)
        job = _moved(parcel.job, lambda path: root / path.relative_to(parcel.root))
        outcome = run_pair(job, progress)
        steps = {
            step: {
                path.relative_to(job.folder / step).as_posix(): path.read_bytes()
                for path in (job.folder / step).rglob("*") if path.is_file()
            }
            for step in outcome.done
        }  # fmt: skip

    def there(text: str) -> str:
        return text.replace(str(root), str(parcel.root))

    outcome = replace(
        outcome, message=there(outcome.message), remarks=tuple(map(there, outcome.remarks))
    )
    return ShippedPair(outcome=outcome, steps=steps)


def unpacked(job: PairJob, delivery: ShippedPair) -> PairOutcome:
    """Put what came back in its place and return the outcome; a failure to do so becomes it."""
    hashes = FileHashes(job.folder / ".hashes.json")
    try:
        for step, files in delivery.steps.items():
            receive_step(job.folder / step, files, hashes, overwrite=job.overwrite)
    except (InputError, OSError) as error:
        return replace(delivery.outcome, failed_step="deliver", message=str(error))
    return delivery.outcome


def _steps(folder: Path) -> list[Path]:
    """Return the folders of steps that were made."""
    entries = folder.iterdir() if folder.is_dir() else ()
    return sorted(path for path in entries if path.is_dir() and path.name[0] != ".")


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}).") from error
