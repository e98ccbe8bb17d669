"""Hatch over what a picture does not show as measured: what no photo saw, or where it may stand."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from bifocal.files.strips import colour_strips
from bifocal.model.geotiff import RasterReader
from bifocal.orthophotos.ortho_image import Source
from bifocal.orthophotos.tuning import HATCH, SHADING
from photocore.arrays import BoolArray, ByteArray

#: Directions of the lines of each source: 1 rises, -1 falls, both cross.
DIRECTIONS = {
    Source.INTERPOLATED: (1,), Source.PLANE: (-1,), Source.FILLED: (1, -1),
    Source.NEITHER: (1, -1),
}  # fmt: skip


def hatched_strips(
    reader: RasterReader, scale: float, *, hatch: bool
) -> Iterator[tuple[ByteArray, ByteArray]]:
    """Yield a picture as `colour_strips` does, with lines over what is not measured.

    Parameters
    ----------
    reader : RasterReader
        An orthophoto whose last band is its `Source`; another picture stays as it is.
    scale : float
        1:scale, for the lines are so wide and so far apart on paper.
    hatch : bool
        Draw them.
    """
    if not hatch or reader.names[-1] != "source":
        yield from colour_strips(reader)
        return
    pixel = 1000 * reader.grid.gsd / scale  # on paper [mm]
    least = max(3, round(SHADING.lined / pixel) | 1)
    top = 0
    for colours, valid in colour_strips(reader):
        rows = len(colours)
        size = (0, top - least, reader.grid.width, rows + 2 * least)
        source = reader.read(*size, bands=[reader.bands])[:, :, 0]
        lines = _lines(source, least, pixel, top - least)[least:-least]
        picture, valid = np.array(colours), np.array(valid)
        # Light lines on what is dark, dark ones on what is light, whole ones over fine detail.
        side = max(3, round(HATCH.period / pixel) | 1)
        around = cv2.blur(picture, (side, side))
        light = around[lines].mean(axis=1, keepdims=True) < HATCH.dark
        tone = np.where(light, 255, 0)
        picture[lines] = np.rint(picture[lines] * (1 - HATCH.share) + tone * HATCH.share)
        rim = _rim(source == Source.NEITHER, pixel)[least:-least]
        picture[rim], valid[rim | lines] = 0, 255
        yield picture, valid
        top += rows


def _rim(white: BoolArray, pixel: float) -> BoolArray:
    """Return the outline of what is left white."""
    side = 2 * max(1, round(SHADING.stroke / pixel)) + 1
    inner = cv2.erode(white.astype(np.uint8), np.ones((side, side), np.uint8))
    return white & (inner == 0)


def _lines(source: ByteArray, least: int, pixel: float, first: int) -> BoolArray:
    """Return the pixels of lines over what is broad enough not to be a rash of dashes."""
    guessed = np.isin(source, list(DIRECTIONS)).astype(np.uint8)
    square = np.ones((least, least), np.uint8)
    broad = cv2.morphologyEx(guessed, cv2.MORPH_OPEN, square) > 0
    period = max(6, round(HATCH.period * np.sqrt(2) / pixel))
    stroke = max(1, round(SHADING.stroke * np.sqrt(2) / pixel))
    row, column = np.nonzero(broad)
    kind = source[row, column]
    drawn = np.zeros(len(row), bool)
    for value, directions in DIRECTIONS.items():
        for rises in directions:
            drawn |= (kind == value) & ((column + rises * (row + first)) % period < stroke)
    lines = np.zeros(source.shape, bool)
    lines[row[drawn], column[drawn]] = True
    return lines
