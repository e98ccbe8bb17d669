"""The orthophoto and the choices that make it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from bifocal.model.geotiff import create_raster
from bifocal.model.grid import Gridded
from bifocal.model.image import ImageArray
from photocore.arrays import BoolArray, ByteArray, FloatArray
from photocore.errors import InputError
from photocore.plots import Drawable

Interpolation = Literal["nearest", "linear", "cubic", "lanczos"]
INTERPOLATIONS: tuple[str, ...] = get_args(Interpolation)


#: The photo of a set with number n is told as this and n.
OF_SET = 10


class Source(IntEnum):
    """Where a pixel of an orthophoto comes from (its last band); of a set `OF_SET` + n, too."""

    NONE = 0
    IMAGE_1 = 1
    IMAGE_2 = 2
    BOTH = 3
    FILLED = 4
    #: Seen by a photo, but put where it is by relief interpolated from around, or by the plane.
    INTERPOLATED = 5
    PLANE = 6
    #: No photo sees it: paper white, empty to the file's mask.
    NEITHER = 7


def shows(source: NDArray[np.integer]) -> BoolArray:
    """Return which pixels show something of the wall."""
    return (source != Source.NONE) & (source != Source.NEITHER)


@dataclass(frozen=True, slots=True, kw_only=True)
class OrthoOptions:
    """How an orthophoto is rendered.

    Attributes
    ----------
    interpolation : str
        ``cubic`` (default), ``linear``, ``nearest`` or ``lanczos``.
    mask_hidden : bool
        Leave pixels empty that the camera cannot see; otherwise they show what hides them.
    measured_only : bool
        Leave empty what has no known relief or is hidden. Otherwise the picture is whole: where
        relief is unknown a photo is shown on relief interpolated from around
        (`Source.INTERPOLATED`), far from all of it on the plane (`Source.PLANE`); what no photo
        sees takes texture from beside it (`Source.FILLED`), above 0.05 m2 it stays white
        (`Source.NEITHER`).
    fill : bool
        Of a picture of what is measured only, close holes of any size with texture from beside.
    feather : float
        Width of the transition between two photos. [px]
    """

    interpolation: Interpolation = "cubic"
    mask_hidden: bool = True
    measured_only: bool = False
    fill: bool = False
    feather: float = 4.0

    def __post_init__(self) -> None:
        if self.interpolation not in INTERPOLATIONS:
            raise InputError(
                f"interpolation: {self.interpolation!r} is not one of {', '.join(INTERPOLATIONS)}."
            )
        if not (math.isfinite(self.feather) and 0 <= self.feather <= 64):
            raise InputError(f"feather: must be 0 to 64 px, got {self.feather}.")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Orthophoto(Gridded, Drawable):
    """An orthophoto in memory.

    Attributes
    ----------
    image : ndarray of uint8 or uint16, shape (height, width, 3) or (height, width)
        Colours; 0 where empty.
    source : ndarray of uint8, shape (height, width)
        A `Source` per pixel.
    hidden : ndarray of bool, shape (height, width)
        Pixels that relief hides from every photo used.
    plane_from_pixel : ndarray, shape (3, 3)
        Affine map from (column, row, 1) to (X, Y, 1): square pixels, rows downwards. [m]
    """

    image: ImageArray
    source: ByteArray
    hidden: BoolArray
    plane_from_pixel: FloatArray

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width. [px]"""
        return self.source.shape[0], self.source.shape[1]

    @property
    def valid(self) -> BoolArray:
        """Pixels that show something, shape (height, width)."""
        return shows(self.source)

    def _draw(self, axes: Any) -> None:
        colours = self.image.reshape(*self.shape, -1) / np.iinfo(self.image.dtype).max
        colours = np.broadcast_to(colours, (*self.shape, 3))
        self._drawn(np.dstack([colours, self.valid]), axes)

    def write(self, path: Path | str, *, overwrite: bool = False) -> None:
        """Write a GeoTIFF of the plane frame: colours, then the `Source` of each pixel.

        Raises
        ------
        InputError
            If the file exists and is not to be overwritten, or cannot be written.
        """
        colours = self.image.reshape(*self.shape, -1)
        names = ("grey",) if colours.shape[2] == 1 else ("red", "green", "blue")
        with create_raster(
            path,
            self.grid,
            bands=len(names) + 1,
            dtype=self.image.dtype,
            names=(*names, "source"),
            colour=len(names) == 3,
            overwrite=overwrite,
        ) as writer:
            source = self.source[..., None].astype(self.image.dtype)
            writer.write(np.concatenate([colours, source], axis=-1), column=0, row=0)
