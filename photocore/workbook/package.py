"""Zip packages of spreadsheets, opened only when they are harmless."""

from __future__ import annotations

import lzma
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.parsers import expat

from photocore.errors import InputError

#: The largest honest compression ratio seen in 1539 real workbooks was 121.
LARGEST_RATIO = 250
LARGEST_PART = 256 * 2**20
LARGEST_TOTAL = 512 * 2**20
MOST_MEMBERS = 10_000
_RATIO_MATTERS_FROM = 2**20
_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_CHUNK = 2**18
#: What unpacking a damaged member may raise.
_UNPACKING = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    OSError,
    EOFError,
    NotImplementedError,
    RuntimeError,  # zipfile's word for a missing password
)


class EnoughError(Exception):
    """Raised by a handler to stop a scan early; never leaves this package."""


@contextmanager
def open_package(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a spreadsheet's zip package after checking that it is safe to unpack.

    Raises
    ------
    InputError
        If the file is missing, empty, encrypted, of the old binary format, damaged, not a zip
        package, or would unpack to more than the limits of this module.
    """
    check_header(path)
    try:
        package = zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        raise InputError(
            f"{path}: is not a workbook or is damaged. Open it in the spreadsheet program and "
            "save it again as .xlsx."
        ) from None
    with package:
        check_members(path, package.infolist())
        yield package


def check_header(path: Path) -> None:
    """Refuse by its first bytes what is not a zip package, saying what it is instead.

    Raises
    ------
    InputError
        Always, unless the file begins like a zip package.
    """
    try:
        with path.open("rb") as file:
            start = file.read(8)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file.") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder, expected a table file.") from None
    except PermissionError:
        if path.is_dir():
            raise InputError(f"{path}: is a folder, expected a table file.") from None
        raise InputError(
            f"{path}: may not be read; close it in other programs or check its permissions."
        ) from None
    if not start:
        raise InputError(f"{path}: the file is empty (0 bytes).")
    if start == _OLE:
        raise InputError(
            f"{path}: is protected by a password or of the old .xls format. Save it as .xlsx "
            "without a password."
        )
    if not start.startswith(b"PK"):
        raise InputError(
            f"{path}: is not a workbook (its content is of another kind). Save it as .xlsx, or "
            "give text tables the ending .csv."
        )


def check_members(path: Path, members: list[zipfile.ZipInfo]) -> None:
    """Refuse packages that would unpack to absurd sizes or outside their place.

    Raises
    ------
    InputError
        Naming the first limit that is exceeded.
    """
    refuse = f"{path}: refused, this is not an ordinary workbook: "
    if len(members) > MOST_MEMBERS:
        raise InputError(f"{refuse}it has {len(members)} parts, more than {MOST_MEMBERS}.")
    seen = set()
    total = 0
    for member in members:
        name = member.filename
        if name.startswith(("/", "\\")) or ".." in name.replace("\\", "/").split("/"):
            raise InputError(f"{refuse}the part {name!r:.80} lies outside the package.")
        if name in seen:
            raise InputError(f"{refuse}it holds the part {name!r:.80} twice.")
        seen.add(name)
        if member.flag_bits & 1:
            raise InputError(
                f"{path}: is protected by a password. Save it as .xlsx without a password."
            )
        total += member.file_size
        ratio = member.file_size / max(member.compress_size, 1)
        if member.file_size > LARGEST_PART or total > LARGEST_TOTAL:
            raise InputError(
                f"{path}: refused, it unpacks to more than {LARGEST_TOTAL // 2**20} MiB (or "
                f"{LARGEST_PART // 2**20} MiB in one part). For that many rows use a .csv file."
            )
        if member.file_size > _RATIO_MATTERS_FROM and ratio > LARGEST_RATIO:
            raise InputError(f"{refuse}the part {name!r:.80} grows {ratio:.0f}-fold when unpacked.")


def read_part(path: Path, package: zipfile.ZipFile, name: str) -> bytes:
    """Return the bytes of one part.

    Raises
    ------
    InputError
        If the part is missing or damaged.
    """
    try:
        return package.read(name)
    except KeyError:
        raise InputError(f"{path}: is not a workbook, the part {name} is missing.") from None
    except _UNPACKING as error:
        raise _damaged(path, name) from error


def scan_part(
    path: Path,
    package: zipfile.ZipFile,
    name: str,
    *,
    start: Callable[[str, dict[str, str]], None],
    end: Callable[[str], None] | None = None,
    text: Callable[[str], None] | None = None,
) -> None:
    """Stream one XML part through handlers without ever holding it whole.

    A handler stops the scan by raising `EnoughError`.

    Raises
    ------
    InputError
        If the part is missing, damaged, not XML, or declares a document type (the door of entity
        bombs; no spreadsheet program writes one).
    """
    parser = new_parser(path, name, start=start, end=end, text=text)
    try:
        with package.open(name) as part:
            while chunk := part.read(_CHUNK):
                parser.Parse(chunk, False)
            parser.Parse(b"", True)
    except EnoughError:
        return
    except KeyError:
        raise InputError(f"{path}: is not a workbook, the part {name} is missing.") from None
    except expat.ExpatError as error:
        raise InputError(
            f"{path}: damaged, the part {name} is not valid XML ({error}). Open it in the "
            "spreadsheet program and save it again."
        ) from None
    except _UNPACKING as error:
        raise _damaged(path, name) from error


def new_parser(
    path: Path,
    name: str,
    *,
    start: Callable[[str, dict[str, str]], None],
    end: Callable[[str], None] | None = None,
    text: Callable[[str], None] | None = None,
) -> Any:
    """Return an expat parser that refuses document types."""
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise InputError(
            f"{path}: refused, the part {name} declares a document type (DOCTYPE), which "
            "ordinary workbooks never do."
        )

    parser.StartDoctypeDeclHandler = refuse
    parser.buffer_text = True
    parser.StartElementHandler = start
    if end is not None:
        parser.EndElementHandler = end
    if text is not None:
        parser.CharacterDataHandler = text
    return parser


def local(name: str) -> str:
    """Return an element's or attribute's name without its prefix."""
    return name.rpartition(":")[2]


def _damaged(path: Path, name: str) -> InputError:
    return InputError(
        f"{path}: damaged, the part {name} cannot be unpacked. Open it in the spreadsheet "
        "program and save it again."
    )
