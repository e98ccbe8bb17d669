"""Elevation models: heights of a raster, unknown cells told from known ones, and copies of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.raster import RasterFile, Window, create_geotiff

#: Heights that programs write where they know none.
SENTINELS = (-9999.0, -99999.0, -32768.0, -32767.0, 9999.0, 1e20, -1e20)
#: A height repeated this often and this far from the others is no height (share of their range).
REPEATS, APART = 16, 3.0
#: What no number of an ASCII grid holds; its heading: lines of a word and a value, before the line
#: in which cells begin at the latest.
_STRANGE, _HEADING = re.compile(rb"[^\s0-9.,eE+-]"), re.compile(rb"\s*[A-Za-z_]+\s+\S")
_FIRST_CELLS = 8


class Dem(RasterFile):
    """An open elevation model (band 1 of a raster).

    Attributes
    ----------
    remarks : list of str
        What the user should know about the file.

    Raises
    ------
    InputError
        If it is a picture, or an ASCII grid with a cell that is no number.
    """

    def __init__(self, path: Path | str, *, nodata: float | None = None) -> None:
        super().__init__(path, nodata=nodata)
        if self.path.suffix.lower() == ".asc":
            _refuse_bad_cells(self.path)
        if self.dtype == np.uint8 and self.bands > 2:
            raise InputError(remark("project.picture", of=path, bands=self.bands))
        self._unmarked = self.nodata is None and not self.masked
        name = self.path.name
        lost = not self.has_position
        doubts = {
            f"{name} has no position (no geotransform); X and Y are unknown.": lost,
            f"{name} has no coordinate reference system; its coordinates are taken as metres, "
            "like those of the cameras.": self.crs is None,
            f"{name} declares no no-data value; every number in it is taken as a height. If it "
            "has empty cells, name their value with --nodata.": self._unmarked,
            f"{name} has {self.bands} bands; band 1 is taken as the heights.": self.bands > 1
            and self.names[1:] != ("sigma",),
        }
        self.remarks = [remark for remark, holds in doubts.items() if holds]

    @property
    def is_geographic(self) -> bool:
        """Whether its cells are in degrees."""
        return bool(self.crs is not None and self.crs.is_geographic)

    def heights(self, window: Window) -> FloatArray:
        """Return heights, shape (height, width), NaN where unknown or outside the raster.

        Raises
        ------
        InputError
            If they hold what is most likely a mark for empty cells that nobody declared.
        """
        values = self.read_floats(*window, dtype=np.float64)
        values[~np.isfinite(values)] = np.nan
        if self._unmarked:
            self._refuse_hidden_nodata(values)
        return values

    def _refuse_hidden_nodata(self, values: FloatArray) -> None:
        """Raise InputError if the heights hold what is most likely a mark for empty cells."""
        finite = values[np.isfinite(values)]
        if not finite.size:
            return
        for mark in (finite.min(), finite.max()):
            rest = finite[finite != mark]
            repeats = finite.size - rest.size
            sentinel = bool((np.abs(np.array(SENTINELS) - mark) < 1e-6 * abs(mark)).any())
            sentinel |= abs(mark) > 1e30
            apart = False
            if repeats >= REPEATS and rest.size >= REPEATS:
                low, high = np.percentile(rest, [1, 99])
                gap = np.abs(rest - mark).min()
                apart = bool(gap > APART * max(high - low, 1e-3 * max(abs(low), abs(high))))
            if sentinel or apart:
                raise InputError(
                    f"{self.path}: {repeats} cells hold {mark:g}, far from all other heights, and "
                    f"the file declares no no-data value. Say --nodata {mark:g} if these cells are "
                    "empty."
                )

    def windows(self, size: int) -> Iterator[Window]:
        """Yield windows of at most size x size cells that cover the raster."""
        for row in range(0, self.height, size):
            for column in range(0, self.width, size):
                yield Window(
                    column, row, min(size, self.width - column), min(size, self.height - row)
                )

    def positions(self, window: Window) -> FloatArray:
        """Return (X, Y) of the cell centres of a window, shape (height, width, 2)."""
        columns, rows = np.meshgrid(
            window.column + np.arange(window.width), window.row + np.arange(window.height)
        )
        cells = np.stack([columns, rows, np.ones_like(rows)], axis=-1).astype(np.float64)
        positions: FloatArray = cells @ self.xy_from_pixel.T
        return positions

    @contextmanager
    def copy(
        self, path: Path, *, bands: Sequence[str], tags: Mapping[str, str], overwrite: bool
    ) -> Iterator[Callable[[Window, FloatArray], None]]:
        """Yield a function (window, array of shape (bands, height, width)) that writes a copy.

        Grid, reference system, no-data value and tags are those of this model; NaN is the no-data
        value where there is none or the copy's numbers do not reach it. The copy is whole or not
        there.

        Raises
        ------
        InputError
            If it cannot be written, or the disk is full.
        """
        if self.dtype.kind != "f":
            self.remarks.append(
                f"{self.path.name} holds whole numbers; the corrected model holds float32."
            )
        dtype = np.float64 if self.dtype == np.float64 else np.float32
        # Programs declare marks that float32 cannot hold, such as -1.8e308.
        nodata = np.nan if self.nodata is None else self.nodata
        nodata = nodata if abs(nodata) <= float(np.finfo(dtype).max) else np.nan
        with create_geotiff(
            path, width=self.width, height=self.height, bands=len(bands), dtype=dtype,
            transform=self.transform if self.has_position else None, crs=self.crs, nodata=nodata,
            names=bands, tags={**self.tags, **tags}, overwrite=overwrite,
        ) as out:  # fmt: skip

            def write(window: Window, values: FloatArray) -> None:
                block = np.where(np.isfinite(values), values, nodata).astype(dtype)
                out.write(block.transpose(1, 2, 0), column=window.column, row=window.row)

            yield write


def _refuse_bad_cells(path: Path) -> None:
    """Raise InputError where a cell of an ASCII grid is no number: GDAL takes it for zero."""
    with path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if not _STRANGE.search(line) or (_HEADING.match(line) and number < _FIRST_CELLS):
                continue
            for word in line.split():
                if _STRANGE.search(word) and word.lower().lstrip(b"+-") not in (b"nan", b"inf"):
                    shown = word.decode("ascii", "replace")
                    raise InputError(f"{path}, line {number}: {shown!r:.40} is no height.")
