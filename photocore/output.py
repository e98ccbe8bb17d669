"""Outputs that are whole or absent: write under a temporary name, then rename."""

from __future__ import annotations

import logging
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

from photocore.errors import InputError

_LOG = logging.getLogger(__name__)


def check_writable(path: Path | str, *, overwrite: bool) -> Path:
    """Return path if a file may be created there; call it before any long work.

    Raises
    ------
    InputError
        If it exists and ``overwrite`` is false, is a folder, is open in a spreadsheet program, or
        its folder is missing or read-only.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file to write.")
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; add --overwrite to replace it.")
    folder = path.parent
    if not folder.is_dir():
        raise InputError(f"{path}: the folder {folder} does not exist; create it first.")
    if not os.access(folder, os.W_OK):
        raise InputError(f"{path}: the folder {folder} is read-only; choose another place.")
    check_not_open(path)
    return path


def check_all_writable(*paths: Path | None, overwrite: bool) -> None:
    """Refuse each path that is given as `check_writable` does; None stands for no file."""
    for path in paths:
        if path is not None:
            check_writable(path, overwrite=overwrite)


def check_not_open(path: Path) -> None:
    """Refuse a file that a spreadsheet program has open.

    Raises
    ------
    InputError
        Naming the program and the way out.
    """
    locks = {"Excel": f"~${path.name}", "LibreOffice": f".~lock.{path.name}#"}
    for program, name in locks.items():
        if (path.parent / name).exists():
            raise InputError(
                f"{path}: is open in {program}. Close it there and try again, or write to another "
                f"file with --out. (If it is not open, delete the left-over file {name}.)"
            )


def free_path(folder: Path, stem: str, ending: str = "") -> Path:
    """Return the first of ``stem``, ``stem2``, ``stem3`` ... that does not exist in a folder.

    Parameters
    ----------
    folder : Path
        Where to look.
    stem, ending : str
        The name; the number goes between them.
    """
    names = (f"{stem}{number if number > 1 else ''}{ending}" for number in count(1))
    return next(path for path in map(folder.joinpath, names) if not os.path.lexists(path))


@contextmanager
def atomic_path(path: Path | str, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it on success, remove it on any failure.

    The temporary name keeps the ending, so libraries that choose a format by it work.

    Raises
    ------
    InputError
        As `check_writable`, and when the disk is full or the rename is refused.
    """
    path = check_writable(path, overwrite=overwrite)
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        _give_usual_mode(temporary)
        temporary.replace(path)
        _LOG.info("written: %s", path)
    except OSError as error:
        raise InputError(
            f"{path}: could not be written ({error.strerror or error}); nothing was left behind. "
            "Free some space or choose another place, and close the file in other programs."
        ) from error
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: Path | str, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary folder; on success its files move into ``path`` one by one.

    Existing files of other names in ``path`` stay.

    Raises
    ------
    InputError
        If a file of the same name exists and ``overwrite`` is false, or writing fails.
    """
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file; name a folder.")
    try:
        path.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=".writing-", dir=path))
    except OSError as error:
        raise InputError(f"{path}: cannot be written to ({error.strerror or error}).") from error
    try:
        yield temporary
        made = [item.relative_to(temporary) for item in temporary.rglob("*") if item.is_file()]
        taken = [str(name) for name in made if (path / name).exists()]
        if taken and not overwrite:
            raise InputError(
                f"{path}: holds {', '.join(sorted(taken)[:5])} already; add --overwrite to replace."
            )
        for name in made:
            check_not_open(path / name)
        for name in made:
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            (temporary / name).replace(path / name)
    except OSError as error:
        raise InputError(f"{path}: could not be written ({error.strerror or error}).") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _give_usual_mode(path: Path) -> None:
    """Replace mkstemp's owner-only mode by what a plain open() would have given."""
    mask = os.umask(0)
    os.umask(mask)
    path.chmod(0o666 & ~mask)


def relative_name(path: Path | str, folder: Path) -> str:
    """Return a path as seen from a folder, with slashes; absolute across Windows drives."""
    whole = Path(path).resolve()
    try:
        return Path(os.path.relpath(whole, folder.resolve())).as_posix()
    except ValueError:
        return whole.as_posix()
