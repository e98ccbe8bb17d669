"""Finished rasters re-read as full-width strips, and PNG written from them at any size."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bifocal.model import METRES_PER_INCH, RasterReader
from photocore.arrays import ByteArray
from photocore.output import atomic_path
from photocore.png_text import SIGNATURE, chunk, provenance_chunk

#: RGB and validity of a picture, from the top.
Strips = Iterator[tuple[ByteArray, ByteArray]]
#: Rows read at a time: one row of tiles of the file.
ROWS = 512


def colour_strips(reader: RasterReader) -> Iterator[tuple[ByteArray, ByteArray]]:
    """Yield RGB of shape (rows, width, 3) and validity (rows, width), 8 bits, from the top."""
    grid = reader.grid
    bands = [1, 2, 3] if reader.bands >= 3 else [1, 1, 1]
    for top in range(0, grid.height, ROWS):
        size = (0, top, grid.width, min(ROWS, grid.height - top))
        colours = reader.read(*size, bands=bands)
        if colours.dtype != np.uint8:
            colours = (colours.astype(np.uint32) // 257).astype(np.uint8)
        yield colours, reader.read(*size, mask=True)


def write_png(
    path: Path, reader: RasterReader, *, dpi: float, overwrite: bool, strips: Strips | None = None
) -> None:
    """Write the raster, or strips of it, as PNG with its resolution; empty is transparent."""
    grid = reader.grid
    with atomic_path(path, overwrite=overwrite) as temporary, temporary.open("wb") as file:
        file.write(SIGNATURE)
        # 8 bits, colour with alpha, no interlace.
        file.write(chunk(b"IHDR", struct.pack(">IIBBBBB", grid.width, grid.height, 8, 6, 0, 0, 0)))
        file.write(provenance_chunk())
        per_metre = round(dpi / METRES_PER_INCH)
        file.write(chunk(b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1)))
        packer = zlib.compressobj(3)
        above = np.zeros((1, grid.width * 4), np.uint8)
        for colours, valid in strips or colour_strips(reader):
            pixels = np.dstack([colours, valid]).reshape(len(colours), -1)
            if packed := packer.compress(predicted(pixels, above)):
                file.write(chunk(b"IDAT", packed))
            above = pixels[-1:]
        file.write(chunk(b"IDAT", packer.flush()))
        file.write(chunk(b"IEND", b""))


def predicted(pixels: ByteArray, above: ByteArray) -> bytes:
    """Return rows as PNG's filter 2 wants them: each minus the one above, led by the number 2."""
    rows = np.empty((len(pixels), pixels.shape[1] + 1), np.uint8)
    rows[:, 0] = 2
    rows[0, 1:] = pixels[0] - above[0]
    rows[1:, 1:] = pixels[1:] - pixels[:-1]
    return rows.tobytes()
