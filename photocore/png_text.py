"""Where a PNG comes from, as text inside it: what readers of pictures show as its comment."""

from __future__ import annotations

import struct
import zlib

from photocore.provenance import is_recorded, provenance

#: What every PNG begins with: its name, and the chunk with its size.
SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEAD = len(SIGNATURE) + 25


def chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG: length, kind, data, checksum."""
    check = struct.pack(">I", zlib.crc32(kind + data))
    return struct.pack(">I", len(data)) + kind + data + check


def provenance_chunk() -> bytes:
    """Return the text chunk ``Comment`` with the provenance; nothing where none is recorded."""
    if not is_recorded():
        return b""
    text = "\n".join(provenance().lines())
    return chunk(b"iTXt", b"Comment\0\0\0\0\0" + text.encode("utf-8"))


def with_provenance(png: bytes) -> bytes:
    """Return a whole PNG with its provenance in it."""
    return png[:_HEAD] + provenance_chunk() + png[_HEAD:]
