"""Text files in, with messages that say what was expected where."""

from __future__ import annotations

import tomllib
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from errno import ENAMETOOLONG
from importlib.resources import files
from pathlib import Path
from typing import Any

from photocore.errors import InputError
from photocore.names import near_file
from photocore.provenance import note

#: First words of what Git LFS leaves in the place of a file.
_LFS = "version https://git-lfs.github.com/spec/"


def check_name(path: Path) -> None:
    """Refuse a name that no file can have, whether there is one or not.

    Raises
    ------
    InputError
        If it holds NUL or is longer than the file system takes.
    """
    if "\0" in str(path):
        raise InputError(f"{str(path)!r}: is no file's name; it holds a NUL character.")
    try:
        path.lstat()
    except OSError as error:
        if error.errno == ENAMETOOLONG:
            raise InputError(f"{path}: is too long a name for a file; choose another.") from None


def odd_name(error: UnicodeEncodeError) -> str:
    """Return what to say of a name in bytes that are no text, where a library wants text."""
    named = error.object[max(0, error.start - 60) : error.end + 20].splitlines()
    return f"{named[-1]!r}: the name of this file or folder is no UTF-8 text; rename it."


def read_text(path: Path, what: str, *, form: str = "") -> str:
    """Return the text of a UTF-8 file, without a byte order mark.

    Parameters
    ----------
    path : Path
        The file.
    what, form : str
        What it should be and how it is written, for the message: ``"pair file"``, ``" (JSON)"``.

    Raises
    ------
    InputError
        If the file is missing, a folder, cannot be read, or is not text.
    """
    with readable(path, what, missing=what):
        try:
            text = path.read_text(encoding="utf-8-sig")
            if text.startswith(_LFS):
                raise InputError(f"{path}: is the pointer of Git LFS, not the file; git lfs pull.")
            return text
        except UnicodeDecodeError:
            raise InputError(f"{path}: is not a text file, expected a {what}{form}.") from None


def check_file(path: Path, missing: str = "file", *, folder: str = ", expected a file.") -> None:
    """Refuse what is no file: nothing at all, or a pipe or device, reading which may wait for ever.

    Parameters
    ----------
    path : Path
        What is to be read.
    missing : str
        What it should be, for the message.
    folder : str
        What to say of a folder after "is a folder".

    Raises
    ------
    InputError
        Saying which of them, or that no file can have this name.
    """
    check_name(path)
    if path.is_dir():
        raise InputError(f"{path}: is a folder{folder}")
    if not path.exists():
        near = near_file(path)
        hint = f' Did you mean "{near}"?' if near else ""
        raise InputError(f"{path}: no such {missing}.{hint}")
    if not path.is_file():
        raise InputError(f"{path}: is a pipe or a device; save what it gives as a file first.")


def packaged(package: str, name: str) -> dict[str, Any]:
    """Return what a package's own TOML file of this name holds, such as its `words.toml`."""
    text = files(package).joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Return what a TOML file holds.

    Raises
    ------
    InputError
        As for `read_text`, or if it is no valid TOML.
    """
    text = read_text(path, what, form=" (TOML)")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        hint = "" if path.suffix.lower() == ".toml" else f" A {what} ends in .toml."
        raise InputError(f"{path}: is not valid TOML: {error}.{hint}") from None
    except ValueError:  # Python reads no whole number of more than 4300 digits
        raise InputError(f"{path}: holds a whole number of thousands of digits.") from None
    except RecursionError:
        raise InputError(f"{path}: nested too deeply for a {what}.") from None


@contextmanager
def readable(path: Path, what: str, *, missing: str = "file") -> Iterator[None]:
    """Say what is wrong with a file that cannot be read: missing, a folder, a pipe, locked."""
    try:
        check_file(path, missing, folder=f", expected a {what}.")
        note(path)
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: no such {missing}.") from None
    except PermissionError:
        raise InputError(
            f"{path}: may not be read; close it in other programs or check its permissions."
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error


def file_name(title: str) -> str:
    """Return a title as a file name every system and CAD program takes.

    Examples
    --------
    >>> file_name("Palazzo Müller (nord)")
    'Palazzo_Muller_nord'
    """
    plain = unicodedata.normalize("NFKD", title).encode("ascii", "ignore").decode("ascii")
    words = "".join(c if c.isalnum() or c == "-" else " " for c in plain).split()
    return "_".join(words) or "ortho"
