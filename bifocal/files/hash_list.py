"""The list of hashes that lies beside files, as ``sha256sum`` writes and checks it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from photocore.errors import InputError
from photocore.output import atomic_path
from photocore.provenance import file_hash

#: What the list is called.
SUMS = "SHA256SUMS"
_LINE = re.compile(r"[0-9a-fA-F]{64} [ *](.+)")


def listed_hashes(folder: Path) -> dict[str, str]:
    """Return the lines of the folder's list by file, of those that are there; none without one.

    Raises
    ------
    InputError
        If what is called so is no such list, or cannot be read.
    """
    path = folder / SUMS
    try:
        text = path.read_text(encoding="utf-8", errors="surrogateescape")
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}).") from error
    matches = [_LINE.fullmatch(line) for line in text.splitlines()]
    if not all(matches):
        raise InputError(f"{path}: is no list of hashes; move it away, or deliver elsewhere.")
    return {one[1]: one[0] for one in matches if one and (folder / one[1]).is_file()}


def list_hashes(folder: Path, names: Iterable[str]) -> str:
    """Write the hashes of files into the folder's list, and return its name.

    Lines of others that are there stay.

    Raises
    ------
    InputError
        If a file cannot be read or the list cannot be written.
    """
    lines = {name: f"{file_hash(folder / name)}  {name}" for name in names}
    lines = listed_hashes(folder) | lines
    with atomic_path(folder / SUMS, overwrite=True) as place:
        text = "".join(f"{lines[name]}\n" for name in sorted(lines))
        place.write_text(text, encoding="utf-8", errors="surrogateescape")
    return SUMS
