"""Outputs that are whole or absent: write under a temporary name, then rename."""

from __future__ import annotations

import filecmp
import logging
import os
import re
import shutil
import socket
import stat
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from hashlib import sha256
from itertools import count
from pathlib import Path

from photocore import interrupts
from photocore.errors import InputError
from photocore.provenance import note_output
from photocore.remarks import remark
from photocore.textfile import check_name

#: Temporary names tell the machine and the process, so that what a killed run left is known.
_NODE = sha256(socket.gethostname().encode()).hexdigest()[:6]
#: Where processes of others cannot be asked, a temporary file of this age is left over. [s]
_LEFT_OVER = 86_400.0
#: When this process began, or a little before: clocks of files are coarse. [s]
_BEGUN = time.time() - 1.0
#: Finished outputs, under their temporary names, that wait for the others of their set.
_waiting: ContextVar[list[tuple[Path, Path]] | None] = ContextVar("waiting", default=None)

#: How GDAL's names of what is no local file begin: /vsis3/, /vsicurl/, /vsiaz/, /vsimem/ ...
VIRTUAL = "/vsi"

_LOG = logging.getLogger(__name__)


def is_virtual(path: Path | str) -> bool:
    """Tell whether a path is one of GDAL's own file systems, object storage for example."""
    return Path(path).as_posix().startswith(VIRTUAL)


def check_writable(path: Path | str, *, overwrite: bool) -> Path:
    """Return path if a file may be created there; call it before any long work.

    A link to a file stands for that file.

    Raises
    ------
    InputError
        If it exists and ``overwrite`` is false, is a folder, a device or a pipe, is a link that
        leads nowhere, is open in a spreadsheet program, is the command's own log, or its folder is
        missing or read-only.
    """
    path = Path(path)
    check_name(path)
    if is_virtual(path):  # only rasters go there
        return path
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file to write.")
    if path.is_symlink() and not path.exists():
        raise InputError(remark("output.dangling", of=path, target=path.readlink()))
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is a device or a pipe; name a file to write.")
    real = path.resolve()
    if any(real == log.resolve() for log in _logs()):
        raise InputError(f"{path}: is the log of this command; name two files.")
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; add --overwrite to replace it.")
    if not real.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; create it first.")
    if not os.access(real.parent, os.W_OK):
        raise InputError(f"{path}: the folder {real.parent} is read-only; choose another place.")
    for place in dict.fromkeys((path, real)):
        check_not_open(place)
    return path


def _logs() -> list[Path]:
    """Return the files that what happens is added to."""
    handlers = logging.getLogger(__name__.partition(".")[0]).handlers
    return [Path(log.baseFilename) for log in handlers if isinstance(log, logging.FileHandler)]


def check_all_writable(*paths: Path | None, overwrite: bool) -> None:
    """Refuse each path that is given as `check_writable` does, and one named twice.

    Parameters
    ----------
    *paths : Path or None
        The outputs of one command; None stands for no file.
    overwrite : bool
        Replace existing files.
    """
    targets = [path for path in paths if path is not None]
    for number, path in enumerate(targets):
        check_writable(path, overwrite=overwrite)
        if path.resolve() in [earlier.resolve() for earlier in targets[:number]]:
            raise InputError(f"{path}: is named for two outputs; name two files.")


def check_not_input(path: Path | None, *inputs: Path | str | None) -> None:
    """Refuse an output that is one of the files a command reads; ask this before `check_writable`.

    Otherwise the advice to add --overwrite would cost the input, or end in a second refusal.

    Parameters
    ----------
    path : Path or None
        The output; None stands for no file.
    *inputs : path or None
        What is read.

    Raises
    ------
    InputError
        Naming it.
    """
    if path is None or not path.exists():
        return
    for source in inputs:
        if source is not None and Path(source).exists() and path.samefile(source):
            free = free_path(path.parent, f"{path.stem}-result", path.suffix).name
            raise InputError(remark("output.is_read", of=path, other=free))


def check_ending(path: Path | None, rule: str, *endings: str) -> None:
    """Refuse a file with another ending than these, given in small letters; None is no file.

    Raises
    ------
    InputError
        With the rule as its message.
    """
    if path is not None and path.suffix.lower() not in endings:
        raise InputError(f"{path}: {rule}")


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
            raise InputError(remark("output.is_open", of=path, program=program, name=name))


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


def kept_copy(path: Path) -> Path:
    """Return the backup of a file as it is, made where there is none yet."""
    stem = f"{path.name}.bak"
    for number in count(1):
        backup = path.with_name(f"{stem}{number if number > 1 else ''}")
        if not backup.is_file():
            break
        if filecmp.cmp(backup, path, shallow=False):
            return backup
    kept = free_path(path.parent, stem)
    with atomic_path(kept, overwrite=False) as temporary:
        shutil.copyfile(path, temporary)
    shutil.copystat(path, kept)
    return kept


@contextmanager
def all_or_none() -> Iterator[None]:
    """Let all outputs that the body writes appear together at its end, or none of them.

    Usable as a decorator too. Until the end the outputs bear temporary names, so the body cannot
    read them back. A set within a set is part of it.

    Raises
    ------
    InputError
        If two outputs are one file, or one of them cannot be put in its place.
    """
    if _waiting.get() is not None:
        yield
        return
    finished: list[tuple[Path, Path]] = []
    token = _waiting.set(finished)
    try:
        yield
        try:
            _put_in_place(finished)
        except OSError as error:
            raise _not_written(finished[0][1], error) from error
    finally:
        _waiting.reset(token)
        for temporary, _ in finished:
            _forget(temporary)


@contextmanager
def atomic_path(path: Path | str, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it on success, remove it on any failure.

    The temporary name keeps the ending, so libraries that choose a format by it work. A file that
    is replaced hands on its mode; a link is followed. What earlier, killed runs left of the same
    output is removed.

    Raises
    ------
    InputError
        As `check_writable`, and when the disk is full or the rename is refused.
    """
    path = check_writable(path, overwrite=overwrite)
    note_output(path)
    real, finished = path.resolve(), _waiting.get()
    if finished is not None and any(real == place for _, place in finished):
        raise InputError(f"{path}: is named for two outputs; name two files.")
    try:
        temporary = _temporary_file(real)
    except OSError as error:
        raise _not_written(path, error) from error
    waits = False
    try:
        yield temporary
        temporary.chmod(_mode_for(real))
        if finished is None:
            temporary.replace(real)
            _LOG.info("written: %s", path)
        else:
            finished.append((temporary, real))
            waits = True
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        if not waits:
            _forget(temporary)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a folder outside of the user's, for files that only pass; gone at the end, however."""
    with interrupts.held():
        folder = Path(tempfile.mkdtemp(prefix="bifocal-"))
        interrupts.temporary.add(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        interrupts.temporary.discard(folder)


@contextmanager
def scratch_beside(path: Path | str) -> Iterator[Path]:
    """Yield a file beside another, removed at the end; relative names in it stay true there.

    Raises
    ------
    InputError
        If the folder takes no file.
    """
    path = Path(path)
    try:
        temporary = _temporary_file(path.resolve())
    except OSError as error:
        raise _not_written(path, error) from error
    try:
        yield temporary
    finally:
        _forget(temporary)


@contextmanager
def told_as(path: Path, temporary: Path) -> Iterator[None]:
    """Let what is refused in a temporary folder be told of the folder it stands for.

    Raises
    ------
    InputError
        What the body raises, in other words.
    """
    try:
        yield
    except InputError as error:
        if str(temporary) not in str(error):
            raise
        raise InputError(str(error).replace(str(temporary), str(path))) from error


@contextmanager
def atomic_folder(path: Path | str, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary folder; on success all its files move into ``path``, otherwise none.

    Existing files of other names in ``path`` stay. A new folder comes whole, by one rename.

    Raises
    ------
    InputError
        If a file of the same name exists and ``overwrite`` is false, or writing fails.
    """
    path = Path(path)
    check_name(path)
    if os.path.lexists(path) and not path.is_dir():
        raise InputError(f"{path}: is a file; name a folder.")
    made_folders: list[Path] = []
    temporary: Path | None = None
    done, is_new = False, not path.exists()
    home, stem = (path.parent, f".{path.name[:60]}") if is_new else (path, ".writing")
    try:
        _make_folder(home, made_folders)
        _remove_left_over(home, stem, "")
        with interrupts.held():
            temporary = Path(tempfile.mkdtemp(prefix=_prefix(stem), dir=home))
            interrupts.temporary.add(temporary)
        with told_as(path, temporary):
            yield temporary
        files = [item.relative_to(temporary) for item in temporary.rglob("*") if item.is_file()]
        existing = [str(name) for name in files if os.path.lexists(path / name)]
        if existing and not overwrite:
            raise InputError(
                f"{path}: holds {', '.join(sorted(existing)[:5])} already; "
                "add --overwrite to replace."
            )
        is_new = is_new and not path.exists()
        for name in files:
            if not is_new:
                _make_folder((path / name).parent, made_folders)
                check_writable(path / name, overwrite=overwrite)
            (temporary / name).chmod(_mode_for((path / name).resolve()))
        if is_new:
            temporary.chmod(_mode_for(path, 0o777))
            _put_in_place([(temporary, path)])
        else:
            _put_in_place([(temporary / name, (path / name).resolve()) for name in files])
        done = True
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)
            interrupts.temporary.discard(temporary)
        for folder in reversed(made_folders):
            interrupts.made_folders.remove(folder)
            if not done:
                with suppress(OSError):
                    folder.rmdir()


def _make_folder(path: Path, folders: list[Path]) -> None:
    """Make a folder and those above it that are missing; note which."""
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    for folder in reversed(missing):
        with interrupts.held():
            folder.mkdir(exist_ok=True)
            folders.append(folder)
            interrupts.made_folders.append(folder)


@interrupts.held()
def _put_in_place(finished: Sequence[tuple[Path, Path]]) -> None:
    """Rename all files to their places; where one fails, put the old state of all back.

    Each place holds its old or its new file at any moment, also if the program is killed.
    """
    done: list[tuple[Path, Path | None]] = []
    try:
        for temporary, place in finished:
            old = _second_name(place) if len(finished) > 1 and place.exists() else None
            done.append((place, old))
            temporary.replace(place)
            _LOG.info("written: %s", place)
    except OSError:
        for (temporary, _), (place, old) in zip(finished, done, strict=False):
            if not temporary.exists():
                place.unlink() if old is None else old.replace(place)
        raise
    finally:
        for _, old in done:
            if old is not None:
                _forget(old)


def _second_name(place: Path) -> Path:
    """Return another name under which a file can be had back."""
    second = _temporary_file(place)
    second.unlink()
    try:
        os.link(place, second)
    except OSError:  # a file system without links
        shutil.copy2(place, second)
    return second


def _not_written(path: Path, error: OSError) -> InputError:
    return InputError(remark("output.unwritten", of=path, why=error.strerror or error))


#: Stem of a temporary file, from that of its output.
_OURS = re.compile(r"^\.(.+)-[0-9a-f]{6}-\d+-\w{8}$")


def _prefix(stem: str) -> str:
    return f"{stem}-{_NODE}-{os.getpid()}-"


def _temporary_file(place: Path) -> Path:
    """Make an empty file beside a place, of the same ending, and remove left-over ones."""
    # Names have an end; Python's random letters and the process number take some of it. What is
    # written for a temporary file is left over with it, and bears the same name.
    stem = "." + _OURS.sub(r"\1", place.stem)[:60]
    _remove_left_over(place.parent, stem, place.suffix)
    with interrupts.held():
        handle, name = tempfile.mkstemp(prefix=_prefix(stem), suffix=place.suffix, dir=place.parent)
        os.close(handle)
        temporary = Path(name)
        interrupts.temporary.add(temporary)
    return temporary


def _forget(temporary: Path) -> None:
    temporary.unlink(missing_ok=True)
    interrupts.temporary.discard(temporary)


def _remove_left_over(folder: Path, stem: str, ending: str) -> None:
    """Remove temporary files and folders of an output whose process is gone."""
    pattern = re.compile(
        rf"{re.escape(stem)}-(?P<node>[0-9a-f]{{6}})-(?P<process>\d+)-\w{{8}}{re.escape(ending)}.*"
    )
    in_use = {path.name for path in list(interrupts.temporary)}  # other threads add to it
    for entry in os.scandir(folder):
        match = pattern.fullmatch(entry.name)
        with suppress(OSError):
            if match and entry.name not in in_use and _is_left_over(match, entry.stat()):
                if entry.is_dir(follow_symlinks=False):
                    shutil.rmtree(entry.path, ignore_errors=True)
                else:
                    Path(entry.path).unlink()


def _is_left_over(match: re.Match[str], status: os.stat_result) -> bool:
    if match["node"] == _NODE and os.name == "posix":
        process = int(match["process"])
        # What bears our own number and is older than we are was left by a namesake.
        return status.st_mtime < _BEGUN if process == os.getpid() else not _is_running(process)
    return time.time() - status.st_mtime > _LEFT_OVER


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def _mode_for(place: Path, plain: int = 0o666) -> int:
    """Return the mode of the file that is replaced, or what a plain open() would give."""
    if place.exists():
        return stat.S_IMODE(place.stat().st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return plain & ~mask


def relative_name(path: Path | str, folder: Path) -> str:
    """Return a path as seen from a folder, with slashes; absolute across Windows drives."""
    whole = Path(path).resolve()
    try:
        return Path(os.path.relpath(whole, folder.resolve())).as_posix()
    except ValueError:
        return whole.as_posix()
