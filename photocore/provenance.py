"""Where a file comes from: program and version, date, hashes of what went in."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from photocore.errors import InputError

_CHUNK = 1 << 20
#: A file changed within this time may change again without its time stamp showing it. [s]
RACY_SECONDS = 2.0


def today() -> str:
    """Return the date in UTC; that of SOURCE_DATE_EPOCH where set, for reproducible files."""
    stamp = os.environ.get("SOURCE_DATE_EPOCH", "")
    moment = datetime.fromtimestamp(int(stamp), UTC) if stamp.isdigit() else datetime.now(UTC)
    return moment.strftime("%Y-%m-%d")


def program() -> str:
    """Return the program's name and version."""
    try:
        return f"bifocal {version('bifocal')}"
    except PackageNotFoundError:
        return "bifocal"


def command_line() -> str:
    """Return the command line that runs, the program by its name only."""
    return " ".join([Path(sys.argv[0]).name, *sys.argv[1:]])


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
    memory : Path
        JSON file that keeps them between runs; a damaged or missing one is no harm.
    """

    def __init__(self, memory: Path) -> None:
        self.memory = memory
        self._known: dict[str, list[object]] = {}
        with suppress(OSError, ValueError):
            known = json.loads(memory.read_text(encoding="utf-8"))
            self._known = known if isinstance(known, dict) else {}
        self._changed = False

    def __call__(self, path: Path) -> str:
        """Return the SHA-256 of a file."""
        try:
            state = path.stat()
        except OSError as error:
            raise InputError(f"{path}: {(error.strerror or str(error)).lower()}.") from error
        mark = [state.st_size, state.st_mtime_ns, state.st_ino]
        name = str(path.absolute())
        known = self._known.get(name)
        if isinstance(known, list) and known[:3] == mark:
            return str(known[3])
        digest = file_hash(path)
        if time.time() - state.st_mtime > RACY_SECONDS:
            self._known[name] = [*mark, digest]
            self._changed = True
        return digest

    def save(self) -> None:
        """Write the memory, if anything is new; not being able to costs time only."""
        if not self._changed:
            return
        with suppress(OSError):
            self.memory.parent.mkdir(parents=True, exist_ok=True)
            temporary = self.memory.with_name(f"{self.memory.name}.{os.getpid()}")
            temporary.write_text(json.dumps(self._known), encoding="utf-8")
            temporary.replace(self.memory)
        self._changed = False


def inputs_by_name(paths: Iterable[Path]) -> dict[str, str]:
    """Return file names with their SHA-256."""
    return {path.name: file_hash(path) for path in paths}
