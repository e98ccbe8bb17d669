"""Steps whose results are kept: a folder per step, made anew only when what went in changed.

A step works in a hidden folder beside its own; when all is written, a record of what went in and
came out (`RECORD`) is added, and the folder takes the place of the old one by a rename. Killed at
any moment, it leaves either the old folder or the new one. A folder that only passes holds a `MARK`
with its own name: what a killed run left is known by that alone, and nobody else's is touched.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import TypedDict, cast

from bifocal.options import defaults_of, typed
from bifocal.remarks import remark
from photocore import interrupts
from photocore.cli import Progress
from photocore.errors import InputError
from photocore.jsonfile import to_text
from photocore.output import check_not_open, told_as
from photocore.provenance import FileHashes, file_hash, program, today
from photocore.remarks import learn
from photocore.textfile import check_file

FORMAT = "bifocal-step/1"
#: The record of a step, in its folder.
RECORD = ".made.json"
#: In a folder that only passes: which one it is.
MARK = ".bifocal-passing.json"
_WRITING, _OLD = "-writing-", "-old-"


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One piece of work with a folder of its own.

    Attributes
    ----------
    name : str
        Also that of the folder.
    files : mapping of str to Path
        The user's files that go in, by role.
    after : tuple of str
        Steps whose results go in.
    options : mapping
        What else decides the result; plain data.
    make : callable
        Writes into the folder it is given; returns remarks.
    command : str
        What was typed for it; empty where nobody could.
    """

    name: str
    files: Mapping[str, Path]
    after: tuple[str, ...] = ()
    options: Mapping[str, object] = field(default_factory=dict)
    make: Callable[[Path, Progress], tuple[str, ...]]
    command: str = ""

    def described(self) -> str:
        """Return what was typed for the step, and what held where nothing was, in one line."""
        command = self.command or "; ".join(["bifocal survey", *typed(self.options, in_file=True)])
        unsaid = defaults_of(self.name, {**self.options, **self.files})
        defaults = ", ".join(typed(unsaid, in_file=True))
        return f"{command}; step {self.name}" + (f"; by default {defaults}" if defaults else "")


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRecord:
    """What was made from what.

    Attributes
    ----------
    key : str
        Hash of all that went in.
    outputs : mapping of str to str
        Files of the folder and their SHA-256.
    remarks : tuple of str
    seconds : float
        That it took.
    machine : str
        On which it did.
    command : str
        What was typed for it.
    """

    key: str
    outputs: Mapping[str, str]
    remarks: tuple[str, ...] = ()
    seconds: float = 0.0
    machine: str = ""
    command: str = ""


class WholeRecord(TypedDict, total=False):
    """What the record in a step's folder holds; nothing where none can be read."""

    format: str
    program: str
    date: str
    step: str
    key: str
    inputs: dict[str, list[str]]
    after: list[str]
    options: dict[str, object]
    outputs: dict[str, str]
    remarks: list[str]
    seconds: float
    machine: str
    command: str


def step_key(step: Step, earlier: Mapping[str, StepRecord], hashes: FileHashes) -> str:
    """Return the hash of everything that decides a step's result."""
    for path in step.files.values():
        check_file(path)
    content = {
        "program": program(),
        "step": step.name,
        # By name as well: pair files and drawings speak of the files they were made from.
        "inputs": {role: [path.name, hashes(path)] for role, path in step.files.items()},
        "options": dict(step.options),
    }
    return record_key(content, {name: earlier[name].outputs for name in step.after})


def record_key(made: Mapping[str, object], after: Mapping[str, Mapping[str, str]]) -> str:
    """Return the key of a record, given as plain data, that follows steps with these outputs."""
    content = {
        "format": FORMAT, "program": made["program"], "step": made["step"],
        "files": made["inputs"], "after": after, "options": made["options"],
    }  # fmt: skip
    text = json.dumps(json.loads(to_text(content)), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def read_record(folder: Path) -> StepRecord | None:
    """Return the record of a step's folder; None where there is none that can be read."""
    data = read_whole_record(folder)
    with suppress(KeyError, TypeError):
        return StepRecord(
            key=data["key"], outputs=data["outputs"], remarks=tuple(data["remarks"]),
            seconds=data["seconds"], machine=data.get("machine", ""),
            command=data.get("command", ""),
        )  # fmt: skip
    return None


def read_whole_record(folder: Path) -> WholeRecord:
    """Return all that the record of a step's folder tells; empty where none can be read."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        data = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        if data["format"] == FORMAT:
            learn(data)
            return cast("WholeRecord", data)
    return {}


def is_current(folder: Path, record: StepRecord | None, key: str, hashes: FileHashes) -> bool:
    """Tell whether a folder holds, unchanged, what the step would make."""
    if record is None or record.key != key:
        return False
    return not _changed_files(folder, record, hashes, missing_too=True)


def run_step(
    parent: Path,
    step: Step,
    key: str,
    hashes: FileHashes,
    *,
    progress: Progress,
    overwrite: bool = False,
) -> StepRecord:
    """Make a step's folder anew, whole or not at all, and return its record.

    Raises
    ------
    InputError
        If the folder holds files that this program did not write or that were changed since, and
        ``overwrite`` is false; or a workbook that is open in a spreadsheet program.
    """
    folder = parent / step.name
    with _replacing(folder, hashes, overwrite=overwrite) as place:
        start = time.perf_counter()
        with told_as(folder, place):
            remarks = step.make(place, progress)
        outputs = {name.as_posix(): file_hash(place / name) for name in _files(place)}
        record = StepRecord(
            key=key, outputs=outputs, remarks=tuple(remarks),
            seconds=time.perf_counter() - start, machine=_machine(),
            command=step.command,
        )  # fmt: skip
        _write_record(place, step, record, hashes)
    return record


def receive_step(
    folder: Path, files: Mapping[str, bytes], hashes: FileHashes, *, overwrite: bool = False
) -> None:
    """Put a step that another machine made, its record among its files, in place of the old one.

    Raises
    ------
    InputError
        As `run_step`.
    """
    with _replacing(folder, hashes, overwrite=overwrite) as place:
        for name, content in files.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_bytes(content)


def remove_made(folder: Path, outputs: Mapping[str, str], hashes: FileHashes) -> list[str]:
    """Remove a step's unchanged files and its record; return the files that are not ours, or stay.

    Parameters
    ----------
    folder : Path
    outputs : mapping of str to str
        Files that the step made, and their SHA-256.
    hashes : FileHashes
    """
    kept = []
    for name in _files(folder):
        path = folder / name
        if outputs.get(name.as_posix()) == hashes(path):
            with suppress(OSError):  # open in another program
                path.unlink()
                continue
        kept.append(name.as_posix())
    (folder / RECORD).unlink()
    inside = sorted((path for path in folder.rglob("*") if path.is_dir()), reverse=True)
    for path in (*inside, folder):
        with suppress(OSError):  # not empty
            path.rmdir()
    return kept


@contextmanager
def _replacing(folder: Path, hashes: FileHashes, *, overwrite: bool) -> Iterator[Path]:
    """Give a folder to write into, which then takes the place of a step's."""
    old = read_record(folder)
    _refuse_open(folder)
    if not overwrite:
        _refuse_changed(folder, old, hashes)
    with _written_aside(folder.parent, folder.name) as place:
        yield place
        _publish(place, folder, old, overwrite=overwrite)


@cache
def _machine() -> str:
    """Return what computes here: system, processor, Python and the libraries that count."""
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy"))
    return (
        f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores, Python "
        f"{platform.python_version()}, {libraries}, OpenCV {import_module('cv2').__version__}"
    )


@contextmanager
def _written_aside(parent: Path, name: str) -> Iterator[Path]:
    """Give a hidden folder to write into, and remove what is left of it in the end."""
    with suppress(FileExistsError):
        parent.mkdir(parents=True)
    with interrupts.held():
        place = Path(tempfile.mkdtemp(prefix=f".{name}{_WRITING}", dir=parent))
        interrupts.temporary.add(place)
    try:
        _mark(place, place.name)
        place.chmod(0o777 & ~_umask())
        yield place
    finally:
        shutil.rmtree(place, ignore_errors=True)
        interrupts.temporary.discard(place)


def clean(parent: Path) -> None:
    """Remove what a killed run left half-written, and put back what it was about to replace."""
    for old in [path for path in parent.glob(".*") if _bears_mark(path)]:
        name, aside, _ = old.name[1:].rpartition(_OLD)
        if aside and not (parent / name).exists():
            (old.rename(parent / name) / MARK).unlink()
        else:
            shutil.rmtree(old, ignore_errors=True)


def _mark(folder: Path, name: str) -> None:
    """Note that a folder is ours to remove as long as it bears this name."""
    text = to_text({"format": FORMAT, "passing": name})
    (folder / MARK).write_text(text, encoding="utf-8")


def _bears_mark(folder: Path) -> bool:
    with suppress(OSError, ValueError):
        mark = json.loads((folder / MARK).read_text(encoding="utf-8"))
        return mark == {"format": FORMAT, "passing": folder.name} and not folder.is_symlink()
    return False


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _files(folder: Path) -> list[Path]:
    """Return the files of a folder, relative, without the record and the mark, in order."""
    paths = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in paths if path.name not in (RECORD, MARK))


def _changed_files(
    folder: Path, record: StepRecord, hashes: FileHashes, *, missing_too: bool
) -> list[str]:
    return [
        name
        for name, digest in record.outputs.items()
        if (hashes(folder / name) != digest if (folder / name).is_file() else missing_too)
    ]


def _refuse_open(folder: Path) -> None:
    """Refuse to replace a workbook that a spreadsheet program has open."""
    for name in _files(folder):
        if name.suffix.lower() in (".xlsx", ".xlsm", ".csv"):
            check_not_open(folder / name)


def _refuse_changed(folder: Path, record: StepRecord | None, hashes: FileHashes) -> None:
    """Refuse to replace what is the user's: files not of our making, or changed since."""
    if record is None:
        if folder.is_dir() and any(folder.iterdir()):
            raise InputError(remark("campaign.not_made", of=folder))
        return
    changed = _changed_files(folder, record, hashes, missing_too=False)
    if changed:
        raise InputError(remark("campaign.changed", of=folder / changed[0]))


def _write_record(place: Path, step: Step, record: StepRecord, hashes: FileHashes) -> None:
    data = {
        "format": FORMAT,
        "step": step.name,
        "program": program(),
        "date": today(),
        "key": record.key,
        "inputs": {role: [path.name, hashes(path)] for role, path in step.files.items()},
        "after": list(step.after),
        "options": dict(step.options),
        "outputs": dict(record.outputs),
        "remarks": list(record.remarks),
        "seconds": round(record.seconds, 3),
        "machine": record.machine,
        "command": record.command,
    }
    (place / RECORD).write_text(to_text(data, indent=1) + "\n", encoding="utf-8")


@interrupts.held()
def _publish(place: Path, folder: Path, old: StepRecord | None, *, overwrite: bool) -> None:
    """Put a finished folder in place of the old one; what the user added moves over."""
    aside = folder.with_name(_OLD.join(place.name.rsplit(_WRITING, 1)))
    if folder.exists():
        listed = {*(old.outputs if old else ()), RECORD, MARK}
        for path in folder.rglob("*"):
            target = place / path.relative_to(folder)
            if path.relative_to(folder).as_posix() in listed:
                continue
            if path.is_dir() and not path.is_symlink():
                target.mkdir(exist_ok=True)
            elif not target.exists():
                shutil.copy2(path, target, follow_symlinks=False)
            elif not overwrite:
                raise InputError(remark("campaign.foreign", of=path))
        _mark(folder, aside.name)
        folder.rename(aside)
    place.rename(folder)
    (folder / MARK).unlink()
    shutil.rmtree(aside, ignore_errors=True)
