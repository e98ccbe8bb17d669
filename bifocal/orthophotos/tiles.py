"""Rasters of a wall written tile by tile: colours or values, and a band of sources."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Grid
from photocore.arrays import IntArray
from photocore.cli import Progress
from photocore.raster import RasterWriter


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterResult:
    """An orthophoto, a mosaic or a relief map that was made.

    Attributes
    ----------
    path : Path
    grid : Grid
    shares : dict of str to float
        Part of the pixels by source, ``none`` for empty ones; of an orthophoto also ``hidden``.
    remarks : tuple of str
    basis : mapping of str to float
        Of what an orthophoto shows, the parts on ``measured`` and ``interpolated`` relief, on the
        ``plane``, and what ``neither`` photo sees; they make up one.
    """

    path: Path
    grid: Grid
    shares: dict[str, float]
    remarks: tuple[str, ...]
    basis: Mapping[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, object]:
        """Return the result for ``--json``."""
        return {
            "file": str(self.path),
            "gsd": self.grid.gsd,
            "width": self.grid.width,
            "height": self.grid.height,
            "bounds": list(self.grid.bounds),
            "shares": self.shares,
            **({"basis": dict(self.basis)} if self.basis else {}),
            "remarks": list(self.remarks),
        }


def write_tiles(
    writer: RasterWriter,
    tiles: Iterator[tuple[int, int, NDArray[Any], NDArray[np.integer]]],
    *,
    sources: int,
    masked: bool,
    empty: Sequence[int] = (0,),
    progress: Progress,
    what: str,
) -> IntArray:
    """Write all tiles and return how many pixels come from each source, shape (sources,).

    Parameters
    ----------
    tiles : iterator of (column, row, image, source)
        Image of shape (h, w) or (h, w, bands); source (h, w), 0 for empty pixels. The source
        becomes one more band.
    sources : int
        Number of sources, the empty one included.
    masked : bool
        Write a validity mask; relief maps say by NaN where they are empty.
    empty : sequence of int
        Sources of pixels that the mask calls empty.
    """
    counts = np.zeros(sources, np.int64)
    for column, row, image, source in tiles:
        mask = ~np.isin(source, empty) if masked else None
        writer.write(with_band(image, source), column=column, row=row, mask=mask)
        counts += np.bincount(source.ravel(), minlength=sources)
        progress(int(counts.sum()), writer.pixels, what)
    return counts


def with_band(image: NDArray[Any], band: NDArray[np.integer]) -> NDArray[Any]:
    """Return an image and one more band, shape (h, w, bands); stored band after band."""
    layers = image.reshape(*image.shape[:2], -1)
    stacked = np.empty((layers.shape[2] + 1, *band.shape), image.dtype)
    for number in range(layers.shape[2]):
        stacked[number] = layers[:, :, number]
    stacked[-1] = band
    return stacked.transpose(1, 2, 0)
