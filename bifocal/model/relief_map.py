"""A relief map: relief, precision and quality on a square grid of the reference plane."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bifocal.model.geotiff import RELIEF_BANDS, RasterReader, check_relief, create_raster
from bifocal.model.grid import Grid, Gridded
from bifocal.model.surface import Fetch, MapSurface
from photocore.arrays import BoolArray, ByteArray, Float32Array, FloatArray, as_points, read_only
from photocore.errors import InputError
from photocore.plots import Drawable
from photocore.raster import BLOCK


class Quality(IntEnum):
    """Where the relief of a pixel comes from (third band of a relief GeoTIFF)."""

    UNKNOWN = 0
    MEASURED = 1
    INTERPOLATED = 2
    HIDDEN = 3
    #: On a face that was drawn, or a plane that was typed.
    DRAWN = 4


#: What relief is known by; the rest was made up from around.
TOLD = (Quality.MEASURED, Quality.DRAWN)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReliefMap(Gridded, Drawable):
    """Relief of a wall as seen square on: pixel (column, row) is a point (X, Y) of the plane.

    Attributes
    ----------
    r : ndarray of float32, shape (height, width)
        Relief, positive towards the cameras; NaN where unknown. [m]
    sigma : ndarray of float32, shape (height, width)
        Standard deviation of r; NaN where r is. [m]
    quality : ndarray of uint8, shape (height, width)
        A `Quality` per pixel: measured in both photos, interpolated from its neighbours, hidden
        from at least one camera (relief taken from the surface behind), drawn, or unknown.
    plane_from_pixel : ndarray, shape (3, 3)
        Affine map from (column, row, 1) to (X, Y, 1): square pixels, rows downwards. [m]

    Raises
    ------
    InputError
        If the arrays differ in shape or the pixels are not square and upright.

    Examples
    --------
    >>> grid = Grid.from_bounds((0.0, 0.0, 2.0, 1.0), gsd=0.5)
    >>> flat = ReliefMap.from_relief(np.zeros((2, 4)), plane_from_pixel=grid.plane_from_pixel)
    >>> flat.gsd, flat.bounds
    (0.5, (0.0, 0.0, 2.0, 1.0))
    >>> float(flat.sample([1.2, 0.1]))
    0.0
    """

    r: Float32Array
    sigma: Float32Array
    quality: ByteArray
    plane_from_pixel: FloatArray

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        r = np.asarray(self.r, dtype=np.float32)
        if r.ndim != 2 or 0 in r.shape:
            raise InputError(f"r: expected shape (height, width), found {r.shape}.")
        sigma = np.asarray(self.sigma, dtype=np.float32)
        quality = np.asarray(self.quality, dtype=np.uint8)
        for name, array in (("sigma", sigma), ("quality", quality)):
            if array.shape != r.shape:
                raise InputError(f"{name}: shape {array.shape} differs from that of r {r.shape}.")
        matrix = read_only(self.plane_from_pixel, "plane_from_pixel", shape=(3, 3))
        Grid.from_affine(matrix, r.shape)  # refuses turned, mirrored and oblong pixels
        for name, value in (("r", r), ("sigma", sigma), ("quality", quality)):
            view = value.view()
            view.setflags(write=False)
            set_(self, name, view)
        set_(self, "plane_from_pixel", matrix)

    @classmethod
    def from_relief(cls, r: ArrayLike, *, plane_from_pixel: ArrayLike) -> ReliefMap:
        """Return a map of given relief with zero sigma: finite pixels count as measured."""
        relief = np.asarray(r, dtype=np.float32)
        finite = np.isfinite(relief)
        return cls(
            r=relief,
            sigma=np.where(finite, np.float32(0), np.float32(np.nan)),
            quality=np.where(finite, Quality.MEASURED, Quality.UNKNOWN).astype(np.uint8),
            plane_from_pixel=np.asarray(plane_from_pixel, dtype=np.float64),
        )

    @classmethod
    def read(cls, path: Path | str) -> ReliefMap:
        """Return the relief map of a raster of the plane frame.

        Sigma and quality are filled in where the file lacks them: a file of one band is taken as
        exact, sigma 0 and quality measured.

        Raises
        ------
        InputError
            If the file is missing or damaged, does not say where it lies, has turned or oblong
            pixels, or is a picture.
        """
        with RasterReader(path) as reader:
            check_relief(reader)
            size = (0, 0, reader.grid.width, reader.grid.height)
            plane_from_pixel = reader.grid.plane_from_pixel
            exact = cls.from_relief(reader.read_floats(*size), plane_from_pixel=plane_from_pixel)
            sigma, quality = exact.sigma, exact.quality
            with np.errstate(invalid="ignore", over="ignore"):  # what the types cannot hold
                if reader.bands >= 2:
                    sigma = np.asarray(reader.read(*size, bands=[2])[:, :, 0], np.float32)
                if reader.bands >= 3:
                    band = np.asarray(reader.read(*size, bands=[3])[:, :, 0], np.float64)
                    quality = np.clip(np.nan_to_num(band), 0, 255).astype(np.uint8)
            return replace(exact, sigma=sigma, quality=quality)

    def _draw(self, axes: Any) -> None:
        axes.figure.colorbar(self._drawn(self.r, axes), ax=axes, label="r [m]")

    def write(
        self, path: Path | str, *, overwrite: bool = False, tags: Mapping[str, str] | None = None
    ) -> None:
        """Write a GeoTIFF of the plane frame: relief, sigma, quality; NaN where unknown.

        Parameters
        ----------
        tags : mapping of str, optional
            What else the file is to say of itself.

        Raises
        ------
        InputError
            If the file exists and is not to be overwritten, or cannot be written.
        """
        with create_raster(
            path, self.grid, bands=3, dtype=np.float32, overwrite=overwrite, names=RELIEF_BANDS,
            nodata=float("nan"), tags=tags,
        ) as writer:  # fmt: skip
            for column, row, part in self.grid.tiles(4 * BLOCK):
                cut = np.s_[row : row + part.height, column : column + part.width]
                layers = (self.r[cut], self.sigma[cut], self.quality[cut])
                block = np.stack([np.asarray(layer, np.float32) for layer in layers], axis=-1)
                writer.write(block, column=column, row=row)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width. [px]"""
        return self.r.shape[0], self.r.shape[1]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Pixels whose relief is known, shape (height, width)."""
        return np.isfinite(self.r)

    def plane_positions(self, rows: slice = slice(None)) -> FloatArray:
        """Return (X, Y) of the pixel centres of some rows, shape (n, width, 2). [m]"""
        x, y = self.grid.columns_x, self.grid.rows_y[rows]
        return np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)

    def sample(self, positions: ArrayLike) -> FloatArray:
        """Return the relief at plane positions (X, Y), shape (...). [m]

        Bilinear between four known pixels; beside unknown ones the nearest pixel; NaN outside the
        map and where the nearest pixel is unknown.
        """
        bilinear, _ = self._interpolated(self.r, positions, order=1)
        nearest, inside = self._interpolated(self.r, positions, order=0)
        values = np.where(np.isfinite(bilinear), bilinear, nearest)
        return np.where(inside, values, np.nan)

    def sample_quality(self, positions: ArrayLike) -> ByteArray:
        """Return the `Quality` of the nearest pixel, shape (...); UNKNOWN outside the map."""
        nearest, inside = self._interpolated(self.quality, positions, order=0)
        return np.where(inside, nearest, Quality.UNKNOWN).astype(np.uint8)

    def _interpolated(
        self, band: NDArray[Any], positions: ArrayLike, *, order: int
    ) -> tuple[FloatArray, BoolArray]:
        """Return a band at positions, nearest (order 0) or bilinear, and which are inside."""
        from scipy.ndimage import map_coordinates

        pixels = self.grid.pixel_of(as_points(positions, "positions", dimension=2))
        with np.errstate(invalid="ignore"):
            inside = np.all((pixels >= -0.5) & (pixels < np.array(self.shape[::-1]) - 0.5), -1)
        at = np.where(inside[..., None], pixels, 0.0).reshape(-1, 2).T[::-1]
        values = map_coordinates(band, at, np.float64, order=order, mode="nearest")
        return values.reshape(inside.shape), inside


def told_pixels(reader: RasterReader) -> Fetch | None:
    """Return what reads 1 where a relief map is measured or drawn; None where it is silent."""
    if reader.bands < 3 or not reader.names[2].startswith("quality"):
        return None
    return lambda *window: np.isin(reader.read(*window, bands=[3])[:, :, 0], TOLD).astype(
        np.float32
    )


def measured_part(reader: RasterReader) -> MapSurface | None:
    """Return what of an open relief map was measured or drawn; None where it does not say."""
    measured = told_pixels(reader)
    if measured is None:
        return None

    def fetch(*window: int) -> Float32Array:
        return np.where(measured(*window) > 0, reader.read_floats(*window), np.float32("nan"))

    with suppress(InputError):  # nothing was
        return MapSurface(reader.grid, fetch)
    return None
