"""Several orthophotos or relief maps of one wall made one, in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Bounds, Gridded, cut
from bifocal.model.image import ImageArray
from bifocal.model.relief_map import ReliefMap
from bifocal.orthophotos.compose import as_surface
from bifocal.orthophotos.mosaic_blending import Seen, common_grid, mosaic_window, plan_mosaic
from bifocal.orthophotos.ortho_image import Orthophoto
from photocore.arrays import ByteArray, FloatArray
from photocore.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class MosaicOptions:
    """How rasters are joined.

    Attributes
    ----------
    priority : bool
        Earlier rasters cover later ones; otherwise seams run where the rasters agree.
    gain : bool
        Make the exposures equal to the first raster's (colours only).
    blend : bool
        Fade colours over the seams; relief values are never mixed.
    """

    priority: bool = False
    gain: bool = True
    blend: bool = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mosaic(Gridded):
    """One raster made of several.

    Attributes
    ----------
    image : ndarray, shape (height, width, 3) or (height, width)
        Colours, 0 where empty; of relief maps the relief, float32, NaN where unknown. [m]
    source : ndarray of uint8, shape (height, width)
        Which input a pixel comes from, from 1; 0 where none.
    gains : ndarray, shape (inputs, bands)
        Factors that made the exposures equal.
    plane_from_pixel : ndarray, shape (3, 3)
        Affine map from (column, row, 1) to (X, Y, 1). [m]
    """

    image: ImageArray
    source: ByteArray
    gains: FloatArray
    plane_from_pixel: FloatArray

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width. [px]"""
        return self.source.shape[0], self.source.shape[1]


class _ArrayLayer:
    """An orthophoto or relief map in memory as a layer of a mosaic."""

    def __init__(self, raster: Orthophoto | ReliefMap) -> None:
        self.grid = raster.grid
        if isinstance(raster, ReliefMap):
            values, self.seen = raster.r, np.isfinite(raster.r)
        else:
            values, self.seen = raster.image, raster.valid
        self.image: NDArray[Any] = np.atleast_3d(values)

    def read(self, column: int, row: int, width: int, height: int) -> Seen:
        """Return a window and its validity; empty beyond the edges."""
        window = (column, row, width, height)
        return cut(self.image, window), cut(self.seen, window)

    def reduced(self, width: int, height: int) -> Seen:
        """Return the whole raster shrunk: the mean of what is seen."""

        def shrunk(values: NDArray[Any]) -> FloatArray:
            return cv2.resize(values, (width, height), interpolation=cv2.INTER_AREA)

        share = shrunk(self.seen.astype(np.float32))
        filled = np.where(self.seen[:, :, None], self.image, 0).astype(np.float32)
        mean = np.atleast_3d(shrunk(filled)) / np.maximum(share, 1e-6)[:, :, None]
        return mean.astype(self.image.dtype), share > 0.5


def mosaic(
    rasters: Sequence[Orthophoto | ReliefMap],
    *,
    gsd: float | None = None,
    bounds: Bounds | None = None,
    relief: ReliefMap | None = None,
    options: MosaicOptions | None = None,
) -> Mosaic:
    """Join orthophotos, or relief maps, of one wall.

    Parameters
    ----------
    rasters : sequence of Orthophoto or of ReliefMap
        Two or more of one kind, in any position; resampled only if their pixels do not fit.
    gsd : float, optional
        Side of a pixel; by default the finest input's. [m]
    bounds : tuple of float, optional
        X min, Y min, X max, Y max; by default the box around all. [m]
    relief : ReliefMap, optional
        Seams keep away from its edges.
    options : MosaicOptions, optional
        Seams or priority, equal exposure, blending.

    Returns
    -------
    Mosaic

    Raises
    ------
    InputError
        If there are fewer than two rasters, they differ in kind, show different things on their
        overlap, or nothing lies in the bounds.

    Examples
    --------
    Two halves of a grey wall, the second one darker, become one:

    >>> from bifocal import Grid
    >>> def half(x, grey):
    ...     grid = Grid.from_bounds((x, 0.0, x + 2.0, 1.0), gsd=0.02)
    ...     image = np.full((*grid.shape, 3), grey, np.uint8)
    ...     return Orthophoto(image=image, source=np.ones(grid.shape, np.uint8),
    ...         hidden=np.zeros(grid.shape, bool), plane_from_pixel=grid.plane_from_pixel)
    >>> whole = mosaic([half(0.0, 120), half(1.0, 80)])
    >>> whole.image.shape, np.unique(whole.image).tolist()
    ((50, 150, 3), [120])
    """
    options = options or MosaicOptions()
    layers = [_ArrayLayer(raster) for raster in rasters]
    if len({(layer.image.dtype, layer.image.shape[2]) for layer in layers}) != 1 or len(layers) < 2:
        raise InputError("a mosaic needs two rasters or more, all of one kind.")
    values = layers[0].image.dtype.kind == "f"
    grid = common_grid(layers, gsd=gsd, bounds=bounds)
    seams = plan_mosaic(
        layers, grid, priority=options.priority, gain=options.gain and not values,
        relief=None if relief is None else as_surface(relief).window,
    )  # fmt: skip
    image, owner = mosaic_window(layers, seams, grid, blend=options.blend)
    if (owner < 0).all():
        raise InputError("none of the rasters shows anything within the bounds.")
    return Mosaic(
        image=image[:, :, 0] if image.shape[2] == 1 else image,
        source=(owner + 1).astype(np.uint8),
        gains=seams.gains,
        plane_from_pixel=grid.plane_from_pixel,
    )
