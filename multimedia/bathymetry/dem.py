"""Elevation models as GeoTIFF, read and written window by window; corner and centre live here."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.raster import written_whole

#: GDAL keeps no more than this of a raster in memory; its own default is 5 % of the machine. [MB]
CACHE_MB = 64
#: Heights that programs write where they know none.
SENTINELS = (-9999.0, -99999.0, -32768.0, -32767.0, 9999.0, 1e20, -1e20)
#: A height repeated this often and this far from the others is no height (share of their range).
REPEATS, APART = 16, 3.0


@dataclass(frozen=True, slots=True)
class Window:
    """Part of a raster, in cells."""

    column: int
    row: int
    width: int
    height: int


class Dem:
    """An open elevation model (band 1 of a raster).

    Attributes
    ----------
    path : Path
    width, height : int
        Cells.
    xy_from_cell : ndarray, shape (2, 3)
        Affine map from (column, row, 1), integers at cell centres, to (X, Y).
    has_position : bool
        Whether X and Y of the cells are known.
    remarks : list of str
        What the user should know about the file.
    tags : dict
    """

    def __init__(self, path: Path | str, *, nodata: float | None = None) -> None:
        import rasterio
        from rasterio.enums import MaskFlags
        from rasterio.errors import NotGeoreferencedWarning, RasterioError

        self.path = Path(path)
        if not self.path.is_file():
            raise InputError(f"{self.path}: no such file.")
        self._environment = rasterio.Env(GDAL_CACHEMAX=CACHE_MB)
        self._environment.__enter__()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", NotGeoreferencedWarning)
                self._file = rasterio.open(self.path)
        except RasterioError:
            self._environment.__exit__()
            raise InputError(f"{self.path}: is not a raster file GDAL can read.") from None
        self.width, self.height = int(self._file.width), int(self._file.height)
        self.tags: dict[str, str] = dict(self._file.tags())
        self.remarks: list[str] = []
        self.nodata = nodata if nodata is not None else self._file.nodata
        self._asked_nodata = nodata
        masked = MaskFlags.per_dataset in self._file.mask_flag_enums[0]
        self._unmarked = self.nodata is None and not masked
        a = self._file.transform
        half = 0.5  # GeoTIFF counts from cell corners
        self.xy_from_cell = np.array(
            [
                [a.a, a.b, a.c + half * (a.a + a.b)],
                [a.d, a.e, a.f + half * (a.d + a.e)],
            ]
        )
        self.has_position = not a.is_identity
        if not self.has_position:
            self.remarks.append(
                f"{self.path.name} has no position (no geotransform); X and Y are unknown."
            )
        if self._file.crs is None:
            self.remarks.append(
                f"{self.path.name} has no coordinate reference system; its coordinates are taken "
                "as metres, like those of the cameras."
            )
        if self._unmarked:
            self.remarks.append(
                f"{self.path.name} declares no no-data value; every number in it is taken as a "
                "height. If it has empty cells, name their value with --nodata."
            )
        if self._file.count > 1:
            self.remarks.append(
                f"{self.path.name} has {self._file.count} bands; band 1 is taken as the heights."
            )

    @property
    def is_geographic(self) -> bool:
        """Whether its cells are in degrees."""
        return bool(self._file.crs is not None and self._file.crs.is_geographic)

    @property
    def crs(self) -> Any:
        """Coordinate reference system, None if unknown."""
        return self._file.crs

    def read(self, window: Window) -> FloatArray:
        """Return heights, shape (height, width), NaN where unknown or outside the raster."""
        from rasterio.windows import Window as RasterWindow

        c0, r0 = max(window.column, 0), max(window.row, 0)
        c1 = min(window.column + window.width, self.width)
        r1 = min(window.row + window.height, self.height)
        out = np.full((window.height, window.width), np.nan)
        if c1 <= c0 or r1 <= r0:
            return out
        try:
            part = self._file.read(1, window=RasterWindow(c0, r0, c1 - c0, r1 - r0), masked=True)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read, it is damaged ({error}).") from error
        values = np.asarray(part.data, dtype=np.float64)
        values[np.ma.getmaskarray(part)] = np.nan
        if self._asked_nodata is not None:
            values[values == np.asarray(self._asked_nodata, self._file.dtypes[0])] = np.nan
        values[~np.isfinite(values)] = np.nan
        if self._unmarked:
            self._refuse_hidden_nodata(values)
        out[r0 - window.row : r1 - window.row, c0 - window.column : c1 - window.column] = values
        return out

    def _refuse_hidden_nodata(self, values: FloatArray) -> None:
        """Raise InputError if the heights hold what is most likely a mark for empty cells."""
        known = values[np.isfinite(values)]
        if not known.size:
            return
        for mark in (known.min(), known.max()):
            rest = known[known != mark]
            repeats = known.size - rest.size
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
        positions: FloatArray = cells @ self.xy_from_cell.T
        return positions

    @contextmanager
    def writer(self, path: Path, *, bands: tuple[str, ...], tags: dict[str, str]) -> Iterator[Any]:
        """Yield a function (window, array of shape (bands, height, width)) that writes a copy.

        Grid, reference system, no-data value and tags are those of this model.

        Raises
        ------
        OSError
            If the copy is not whole: the disk is full.
        """
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning
        from rasterio.windows import Window as RasterWindow

        kind = "float64" if self._file.dtypes[0] == "float64" else "float32"
        if not self._file.dtypes[0].startswith("float"):
            self.remarks.append(
                f"{self.path.name} holds whole numbers; the corrected model holds float32."
            )
        nodata = float("nan") if self.nodata is None else float(self.nodata)
        size = 256
        tiles = (
            {"tiled": True, "blockxsize": size, "blockysize": size}
            if min(self.width, self.height) >= size
            else {}
        )
        profile = {
            "driver": "GTiff", "dtype": kind, "count": len(bands), "crs": self._file.crs,
            "transform": self._file.transform if self.has_position else None,
            "width": self.width, "height": self.height,
            "nodata": nodata, "compress": "deflate", "predictor": 3, "bigtiff": "if_safer",
        }  # fmt: skip
        with written_whole(path, width=self.width, height=self.height, bands=len(bands)):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", NotGeoreferencedWarning)
                out = rasterio.open(path, "w", **profile, **tiles)
            with out:
                out.update_tags(**{**self.tags, **tags})
                for number, name in enumerate(bands, start=1):
                    out.set_band_description(number, name)

                def write(window: Window, values: FloatArray) -> None:
                    block = np.where(np.isfinite(values), values, nodata).astype(kind)
                    place = RasterWindow(window.column, window.row, window.width, window.height)
                    out.write(block, window=place)

                yield write

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        self._environment.__exit__()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()
