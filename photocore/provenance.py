"""Where a file comes from: program and version, date, command, hashes of what went in.

While a `recording` runs, readers `note` the files they open; every output that is written then
carries the `Provenance` so far. A command records its line, a step of a survey its options, and
from Python ``with bifocal.recording("what I do"):`` does the same.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from photocore.errors import InputError
from photocore.installation import DISTRIBUTION

_CHUNK = 1 << 20
#: A file changed within this time may change again without its time stamp showing it. [s]
RACY_SECONDS = 2.0
_CHANGED = "BIFOCAL_CHANGED_PHOTOS"


@dataclass(slots=True)
class _Recording:
    """What runs, the date it bears, and the files it has read, by their place."""

    command: str
    day: str
    files: dict[Path, str] = field(default_factory=dict)
    remarks: dict[str, None] = field(default_factory=dict)
    outputs: set[Path] = field(default_factory=set)


_recording: ContextVar[_Recording | None] = ContextVar("recording", default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Where an output comes from.

    Attributes
    ----------
    program : str
        Name and version.
    date : str
        Year-month-day, UTC.
    command : str
        Command line, or options; empty where nobody said.
    inputs : tuple of (str, str)
        Names of the files read and their SHA-256.
    """

    program: str
    date: str
    command: str = ""
    inputs: tuple[tuple[str, str], ...] = ()

    def to_dict(self) -> dict[str, object]:
        """Return it as plain data, without what is empty."""
        inputs = [{"file": name, "sha256": digest} for name, digest in self.inputs]
        more = {"command": self.command, "inputs": inputs}
        facts = {key: value for key, value in more.items() if value}
        return {"program": self.program, "date": self.date, **facts}

    def lines(self) -> list[str]:
        """Return it as lines of text."""
        command = [self.command] if self.command else []
        return [
            f"{self.program}, {self.date}",
            *command,
            *(f"{name} SHA-256 {digest}" for name, digest in self.inputs),
        ]


@contextmanager
def recording(command: str, *, day: str | None = None) -> Iterator[None]:
    """Let the outputs written within say what made them, and from which files.

    Parameters
    ----------
    command : str
        Command line, or what is done with which options.
    day : str, optional
        Date that outputs bear, year-month-day; default that of the recording around this one,
        else today.

    Yields
    ------
    None
        The outputs are written within.

    Raises
    ------
    InputError
        If ``day`` is no date.

    Examples
    --------
    >>> with recording("my script, gsd 5 mm", day="2026-11-22"):
    ...     provenance().command, provenance().date
    ('my script, gsd 5 mm', '2026-11-22')
    """
    token = _recording.set(_Recording(command, today() if day is None else checked_date(day)))
    try:
        yield
    finally:
        _recording.reset(token)


def is_recorded() -> bool:
    """Tell whether a recording runs."""
    return _recording.get() is not None


def set_day(day: str) -> None:
    """Let the outputs of what is recorded from here on bear this date."""
    running = _recording.get()
    if running is not None:
        running.day = day


def note(path: Path | str) -> None:
    """Remember, while something is recorded, that a file was read; our own outputs do not count."""
    running, place = _recording.get(), Path(path).absolute()
    if running is not None and place not in running.outputs and place.name[:1] != ".":
        running.files.setdefault(place, "")


def note_remark(text: str) -> None:
    """Remember, while something is recorded, what a reader did to a file, each once."""
    running = _recording.get()
    if running is not None:
        running.remarks[text] = None


def noted_remarks() -> tuple[str, ...]:
    """Return what readers did to files, as long as this is recorded."""
    running = _recording.get()
    return () if running is None else tuple(running.remarks)


def note_output(path: Path | str) -> None:
    """Remember that a file was written: read again, it is nothing that went in."""
    running, place = _recording.get(), Path(path).absolute()
    if running is not None and place not in running.files:
        running.outputs.add(place)


def provenance() -> Provenance:
    """Return what an output written now should carry; files that are gone by now are left out."""
    running = _recording.get()
    if running is None:
        return Provenance(program=program(), date=today())
    for path, digest in list(running.files.items()):
        if not digest:
            # Hashed once: a file that the command itself replaces counts as it was read.
            try:
                running.files[path] = known_hash(path)
            except InputError:
                del running.files[path]
    inputs = sorted({(path.name, digest) for path, digest in running.files.items()})
    return Provenance(
        program=program(), date=running.day, command=running.command, inputs=tuple(inputs)
    )


def checked_date(text: str) -> str:
    """Return a date as year-month-day.

    Raises
    ------
    InputError
        If it is none.
    """
    try:
        return date.fromisoformat(text.strip()).isoformat()
    except ValueError:
        raise InputError(f"{text!r} is no date; write year-month-day, e.g. 2026-11-22.") from None


def today() -> str:
    """Return the date in UTC that outputs bear.

    That of the recording, else that of SOURCE_DATE_EPOCH, for reproducible files.

    Raises
    ------
    InputError
        If SOURCE_DATE_EPOCH is no time.
    """
    running = _recording.get()
    if running is not None:
        return running.day
    stamp = os.environ.get("SOURCE_DATE_EPOCH", "")
    try:
        moment = datetime.fromtimestamp(int(stamp), UTC) if stamp else datetime.now(UTC)
    except (ValueError, OverflowError, OSError):
        raise InputError(
            f"SOURCE_DATE_EPOCH: {stamp!r} is no time; set it to seconds since 1970, or unset it."
        ) from None
    return moment.strftime("%Y-%m-%d")


@cache  # asked for with every step of a survey, and read from a file of the installation
def program() -> str:
    """Return the program's name and version."""
    try:
        return f"bifocal {version(DISTRIBUTION)}"
    except PackageNotFoundError:
        return "bifocal"


def file_hash(path: Path | str) -> str:
    """Return the SHA-256 of a file's content.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    digest = hashlib.sha256()
    try:
        with Path(path).open("rb") as file:
            while chunk := file.read(_CHUNK):
                digest.update(chunk)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}).") from error
    return digest.hexdigest()


class FileHashes:
    """Hashes of files, remembered by size and time of change so that nothing is read twice.

    Parameters
    ----------
    memory : Path, optional
        JSON file that keeps them between runs; a damaged or missing one is no harm. Without one
        they are remembered as long as the object.
    """

    def __init__(self, memory: Path | None = None) -> None:
        self.memory = memory
        self._known: dict[str, list[object]] = {}
        if memory is not None:
            with suppress(OSError, ValueError):
                hashes = json.loads(memory.read_text(encoding="utf-8"))
                self._known = hashes if isinstance(hashes, dict) else {}
        self._changed = False

    def __call__(self, path: Path) -> str:
        """Return the SHA-256 of a file."""
        try:
            state = path.stat()
        except OSError as error:
            raise InputError(f"{path}: {(error.strerror or str(error)).lower()}.") from error
        mark = [state.st_size, state.st_mtime_ns, state.st_ino]
        name = str(path.absolute())
        entry = self._known.get(name)
        if isinstance(entry, list) and entry[:3] == mark:
            return str(entry[3])
        digest = file_hash(path)
        if time.time() - state.st_mtime > RACY_SECONDS:
            self._known[name] = [*mark, digest]
            self._changed = True
        return digest

    def save(self) -> None:
        """Write the memory, if it is new and has a folder; not being able to costs time only."""
        if self.memory is None or not (self._changed and self.memory.parent.is_dir()):
            return
        with suppress(OSError):
            temporary = self.memory.with_name(f"{self.memory.name}.{os.getpid()}")
            try:
                temporary.write_text(json.dumps(self._known), encoding="utf-8")
                temporary.replace(self.memory)
            finally:
                temporary.unlink(missing_ok=True)
        self._changed = False


#: Return the SHA-256 of a file; of one whose size and time are the same as before without reading.
known_hash = FileHashes()


def digest_of(value: Any) -> str:
    """Return the SHA-256 of plain data, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


@contextmanager
def changed_photos(*, taken: bool = True) -> Iterator[None]:
    """Take, within, photos and maps of another state than what was made from them.

    Threads and processes that begin within do so too.

    Parameters
    ----------
    taken : bool
        False: nothing changes.

    Yields
    ------
    None
        Photos, relief maps and orthophotos are read within.

    Examples
    --------
    >>> with changed_photos():
    ...     print("whatever lies beside the pair file is taken")
    whatever lies beside the pair file is taken
    """
    before = os.environ.get(_CHANGED)
    if taken:
        os.environ[_CHANGED] = "1"
    try:
        yield
    finally:
        if taken and before is None:
            os.environ.pop(_CHANGED, None)


def changes_are_taken() -> bool:
    """Tell whether `changed_photos` holds."""
    return _CHANGED in os.environ
