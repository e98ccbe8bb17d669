"""A raster on the reference plane: where its pixels are, in the plane frame."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bifocal.remarks import remark
from photocore.arrays import Float32Array, FloatArray, positive
from photocore.errors import InputError

#: xmin, ymin, xmax, ymax: outer edges of pixels. [m]
Bounds = tuple[float, float, float, float]
#: Column, row, width, height; may reach beyond a raster's edges. [px]
Window = tuple[int, int, int, int]

#: Rows and columns of a relief map and an orthophoto that differ by less are the same. [px]
SAME_PIXEL = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Square pixels parallel to the axes of the plane frame, row 0 at the top.

    Attributes
    ----------
    x0, y0 : float
        Plane position of the centre of the top-left pixel. [m]
    gsd : float
        Side of a pixel. [m]
    width, height : int
        Columns and rows.

    Examples
    --------
    >>> grid = Grid.from_bounds((0.0, 0.0, 2.0, 1.0), gsd=0.5)
    >>> grid.width, grid.height, grid.x0, grid.y0
    (4, 2, 0.25, 0.75)
    """

    x0: float
    y0: float
    gsd: float
    width: int
    height: int

    def __post_init__(self) -> None:
        positive(self.gsd, "gsd", unit="m")
        if not (math.isfinite(self.x0) and math.isfinite(self.y0)):
            raise InputError("the grid's corner is not a finite number.")
        if self.width < 1 or self.height < 1:
            raise InputError(f"a grid of {self.width} x {self.height} px is empty.")

    @classmethod
    def from_bounds(cls, bounds: Bounds, *, gsd: float) -> Grid:
        """Return the grid that fills xmin, ymin, xmax, ymax (outer edges of its pixels). [m]

        The top-left corner is kept; the far edges grow to whole pixels.

        Raises
        ------
        InputError
            If the box is empty or not finite.
        """
        gsd = positive(gsd, "gsd", unit="m")
        xmin, ymin, xmax, ymax = bounds
        if not (np.isfinite(bounds).all() and xmax > xmin and ymax > ymin):
            raise InputError(
                f"bounds: expected xmin,ymin,xmax,ymax in metres with xmin < xmax and "
                f"ymin < ymax, found {xmin:g},{ymin:g},{xmax:g},{ymax:g}."
            )
        # 10 m / 5 mm is 2000.0000000000002 in floating point: not a reason for one more column.
        width, height = (
            max(1, math.ceil(length / gsd - SAME_PIXEL)) for length in (xmax - xmin, ymax - ymin)
        )
        return cls(x0=xmin + gsd / 2, y0=ymax - gsd / 2, gsd=gsd, width=width, height=height)

    @classmethod
    def from_affine(cls, plane_from_pixel: FloatArray, shape: tuple[int, ...]) -> Grid:
        """Return the grid of an array with this pixel-to-plane matrix (pixel centres).

        Raises
        ------
        InputError
            If its pixels are turned, mirrored or not square.
        """
        matrix = np.asarray(plane_from_pixel, dtype=np.float64)
        if matrix.shape not in ((3, 3), (2, 3)):
            raise InputError(f"plane_from_pixel: expected shape (3, 3), found {matrix.shape}.")
        gsd = float(matrix[0, 0])
        span = max(shape[0], shape[1]) * abs(gsd)
        off = max(abs(matrix[0, 1]), abs(matrix[1, 0]), abs(matrix[1, 1] + gsd))
        if not (gsd > 0 and off * max(shape[0], shape[1]) <= 1e-2 * gsd and span > 0):
            raise InputError(remark("raster.turned"))
        return cls(
            x0=float(matrix[0, 2]),
            y0=float(matrix[1, 2]),
            gsd=gsd,
            width=int(shape[1]),
            height=int(shape[0]),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.height, self.width

    @property
    def plane_from_pixel(self) -> FloatArray:
        """Matrix from (column, row, 1) to (X, Y, 1), shape (3, 3). [m]"""
        return np.array([[self.gsd, 0.0, self.x0], [0.0, -self.gsd, self.y0], [0.0, 0.0, 1.0]])

    @property
    def bounds(self) -> Bounds:
        """Outer edges xmin, ymin, xmax, ymax. [m]"""
        half = self.gsd / 2
        return (
            self.x0 - half,
            self.y0 - (self.height - 1) * self.gsd - half,
            self.x0 + (self.width - 1) * self.gsd + half,
            self.y0 + half,
        )

    @property
    def columns_x(self) -> FloatArray:
        """X of every column. [m]"""
        return self.x0 + self.gsd * np.arange(self.width)

    @property
    def rows_y(self) -> FloatArray:
        """Y of every row. [m]"""
        return self.y0 - self.gsd * np.arange(self.height)

    def pixel_of(self, xy: FloatArray) -> FloatArray:
        """Return (column, row) of plane positions, shape (..., 2). [px]"""
        return np.stack(
            [(xy[..., 0] - self.x0) / self.gsd, (self.y0 - xy[..., 1]) / self.gsd], axis=-1
        )

    def window(self, column: int, row: int, width: int, height: int) -> Grid:
        """Return the part that starts at a column and row; it may reach beyond the edges."""
        return Grid(
            x0=self.x0 + column * self.gsd,
            y0=self.y0 - row * self.gsd,
            gsd=self.gsd,
            width=width,
            height=height,
        )

    def offset_in(self, other: Grid) -> tuple[float, float]:
        """Return column and row of this grid's first pixel in another grid."""
        column, row = other.pixel_of(np.array([self.x0, self.y0]))
        return float(column), float(row)

    def tiles(self, side: int) -> Iterator[tuple[int, int, Grid]]:
        """Yield (column, row, window) of tiles that cover the grid, row by row."""
        for row in range(0, self.height, side):
            for column in range(0, self.width, side):
                width, height = min(side, self.width - column), min(side, self.height - row)
                yield column, row, self.window(column, row, width, height)

    def whole_offset_in(self, other: Grid) -> tuple[int, int] | None:
        """Return that offset if the pixels of both grids are the same ones; None if not."""
        column, row = self.offset_in(other)
        whole = round(column), round(row)
        same_gsd = abs(self.gsd / other.gsd - 1) * max(self.shape) < SAME_PIXEL
        near = max(abs(column - whole[0]), abs(row - whole[1])) < 10 * SAME_PIXEL
        return whole if same_gsd and near else None

    def resampling(self, other: Grid, margin: int) -> tuple[Window, Float32Array, Float32Array]:
        """Return the window of another grid that covers this one, and this one's places in it.

        Parameters
        ----------
        other : Grid
        margin : int
            Pixels around the window that the interpolation needs.

        Returns
        -------
        window : tuple of int
            Column, row, width and height.
        columns, rows : ndarray of float32, shape (height, width)
            Of every pixel of this grid, counted in the window: what cv2.remap takes.
        """
        column, row = self.offset_in(other)
        step = self.gsd / other.gsd
        c0, r0 = math.floor(column) - margin, math.floor(row) - margin
        c1 = math.ceil(column + (self.width - 1) * step) + margin + 1
        r1 = math.ceil(row + (self.height - 1) * step) + margin + 1
        x = (column - c0 + step * np.arange(self.width)).astype(np.float32)
        y = (row - r0 + step * np.arange(self.height)).astype(np.float32)
        return (c0, r0, c1 - c0, r1 - r0), *np.meshgrid(x, y)


class Gridded(ABC):
    """An image on the reference plane that knows where its pixels are.

    Attributes
    ----------
    plane_from_pixel : ndarray, shape (3, 3)
        Affine map from (column, row, 1) to (X, Y, 1): square pixels, rows downwards. [m]
    """

    __slots__ = ()
    plane_from_pixel: FloatArray

    @property
    @abstractmethod
    def shape(self) -> tuple[int, int]:
        """Height and width. [px]"""

    @property
    def grid(self) -> Grid:
        """Where the pixels are."""
        return Grid.from_affine(self.plane_from_pixel, self.shape)

    @property
    def gsd(self) -> float:
        """Side of a pixel on the plane. [m]"""
        return float(self.plane_from_pixel[0, 0])

    @property
    def bounds(self) -> Bounds:
        """Outer edges (X min, Y min, X max, Y max). [m]"""
        return self.grid.bounds

    def _drawn(self, values: FloatArray, axes: Any) -> Any:
        """Draw values where they are on the wall; return what matplotlib made of them."""
        xmin, ymin, xmax, ymax = self.bounds
        axes.set(xlabel="X [m]", ylabel="Y [m]")
        return axes.imshow(values, extent=(xmin, xmax, ymin, ymax))

    @property
    def transform(self) -> Any:
        """Affine map from (column, row) of pixel corners to (X, Y), as rasterio counts. [m]"""
        from photocore.raster import corner_transform

        return corner_transform(self.plane_from_pixel)

    def to_xarray(self) -> Any:
        """Return its bands as an xarray Dataset over the pixel centres x and y. [m]

        Raises
        ------
        InputError
            If xarray is not installed.
        """
        try:
            import xarray
        except ImportError:
            raise InputError("xarray is not installed: pip install xarray") from None
        values = {field.name: getattr(self, field.name) for field in fields(cast(Any, self))}
        bands = {
            name: (("y", "x", "band")[: value.ndim], value)
            for name, value in values.items()
            if np.shape(value)[:2] == self.shape and name != "plane_from_pixel"
        }
        return xarray.Dataset(bands, coords={"x": self.grid.columns_x, "y": self.grid.rows_y})


def bounds_of(positions: FloatArray) -> Bounds:
    """Return the box around plane positions, shape (..., 2). [m]"""
    flat = positions.reshape(-1, 2)
    (xmin, ymin), (xmax, ymax) = flat.min(axis=0).tolist(), flat.max(axis=0).tolist()
    return xmin, ymin, xmax, ymax


def cut(array: NDArray[Any], window: Window, fill: Any = 0) -> NDArray[Any]:
    """Return the part of an array at (column, row, width, height); ``fill`` beyond its edges."""
    column, row, width, height = window
    out = np.full((height, width, *array.shape[2:]), fill, array.dtype)
    c0, r0 = max(column, 0), max(row, 0)
    c1, r1 = min(column + width, array.shape[1]), min(row + height, array.shape[0])
    if c1 > c0 and r1 > r0:
        out[r0 - row : r1 - row, c0 - column : c1 - column] = array[r0:r1, c0:c1]
    return out
