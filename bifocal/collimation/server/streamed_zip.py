"""Many files as one archive, sent while it is packed: nothing is held in memory."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from hashlib import sha256
from pathlib import Path

from bifocal.files import SUMS

#: Bytes read at a time.
PIECE = 1 << 20
#: What is packed already is stored as it is.
PACKED = frozenset({".jpg", ".jpeg", ".png", ".tif", ".tiff", ".xlsx", ".xlsm", ".pdf", ".heic"})


class _Outlet:
    """A file that keeps what is written until it is taken away."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []

    def write(self, data: bytes) -> int:
        self.parts.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Nothing waits."""

    def take(self) -> bytes:
        data = b"".join(self.parts)
        self.parts.clear()
        return data


def streamed_zip(files: Mapping[str, Path]) -> Iterator[bytes]:
    """Yield an archive of files by name, with the list of their hashes, piece by piece."""
    outlet, sums = _Outlet(), ""
    with zipfile.ZipFile(outlet, "w", zipfile.ZIP_DEFLATED) as archive:  # type: ignore[call-overload]
        for name, path in sorted(files.items()):
            entry = zipfile.ZipInfo.from_file(path, name)
            packed = path.suffix.lower() in PACKED
            entry.compress_type = zipfile.ZIP_STORED if packed else zipfile.ZIP_DEFLATED
            digest = sha256()
            with path.open("rb") as source, archive.open(entry, "w") as target:
                while piece := source.read(PIECE):
                    digest.update(piece)
                    target.write(piece)
                    yield outlet.take()
            sums += f"{digest.hexdigest()}  {name}\n"
        archive.writestr(SUMS, sums)
    yield outlet.take()
