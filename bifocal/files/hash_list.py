"""The list of hashes that lies beside files, as ``sha256sum`` writes and checks it."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from photocore.output import atomic_path
from photocore.provenance import file_hash

#: What the list is called.
SUMS = "SHA256SUMS"


def list_hashes(folder: Path, names: Iterable[str]) -> str:
    """Write the hashes of files into the folder's list, and return its name.

    Lines of others that are there stay.

    Raises
    ------
    InputError
        If a file cannot be read or the list cannot be written.
    """
    lines = {name: f"{file_hash(folder / name)}  {name}" for name in names}
    path = folder / SUMS
    with suppress(FileNotFoundError):
        for line in path.read_text(encoding="utf-8", errors="surrogateescape").splitlines():
            name = line.partition(" ")[2][1:]
            if name not in lines and (folder / name).is_file():
                lines[name] = line
    with atomic_path(path, overwrite=True) as place:
        text = "".join(f"{lines[name]}\n" for name in sorted(lines))
        place.write_text(text, encoding="utf-8", errors="surrogateescape")
    return SUMS
