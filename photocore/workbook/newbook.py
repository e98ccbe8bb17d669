"""New workbooks as outputs: none takes the place of one that holds anybody else's work.

Own sheets, charts and typed cells go with a file that is replaced. So every new workbook carries a
seal, the digest of its parts, in the comment of its zip package, and only a workbook whose seal is
whole may be replaced by a new one. Whatever program saves it again breaks the seal.
"""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from photocore.errors import InputError
from photocore.output import atomic_path, check_writable, free_path


@contextmanager
def new_workbook(path: Path | str, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary path for a new workbook, as `photocore.output.atomic_path`.

    Raises
    ------
    InputError
        As `photocore.output.atomic_path`, and if the path holds a workbook that is not exactly as
        this function left it.
    """
    path = check_writable(path, overwrite=overwrite)
    if not is_untouched(path):
        raise InputError(
            f"{path}: was not written by this program, or was changed since; a new workbook in its "
            "place would lose what it holds. Write to another file, e.g. "
            f"{other_name(path).name}, or move this one away."
        )
    with atomic_path(path, overwrite=overwrite) as temporary:
        yield temporary
        with zipfile.ZipFile(temporary, "a") as package:
            package.comment = _seal(package)


def is_untouched(path: Path) -> bool:
    """Tell whether a path is free, empty, or holds a new workbook exactly as it was written."""
    if not path.exists() or not path.stat().st_size:
        return True
    try:
        with zipfile.ZipFile(path) as package:
            return package.comment == _seal(package)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return False


def other_name(path: Path) -> Path:
    """Return a name that is free beside a path: ``own-result.xlsx`` for ``own.xlsx``."""
    stem = path.stem if path.stem.endswith("-result") else f"{path.stem}-result"
    return free_path(path.parent, stem, path.suffix)


def _seal(package: zipfile.ZipFile) -> bytes:
    """Return the digest of names, sizes and checksums of all parts."""
    parts = sorted((part.filename, part.file_size, part.CRC) for part in package.infolist())
    return b"new workbook, parts " + hashlib.sha256(repr(parts).encode()).hexdigest().encode()
