"""The orthophoto and the choices that make it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Literal

from numpy.typing import NDArray

from bifocal.model.grid import Grid
from photocore.arrays import BoolArray, ByteArray, FloatArray
from photocore.errors import InputError

#: 8 or 16 bits, shape (h, w) or (h, w, 3).
ImageArray = NDArray[Any]
Interpolation = Literal["nearest", "linear", "cubic", "lanczos"]
INTERPOLATIONS = ("nearest", "linear", "cubic", "lanczos")


class Source(IntEnum):
    """Where a pixel of an orthophoto comes from (its last band)."""

    NONE = 0
    IMAGE_1 = 1
    IMAGE_2 = 2
    BOTH = 3
    FILLED = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class OrthoOptions:
    """How an orthophoto is rendered.

    Attributes
    ----------
    interpolation : str
        ``cubic`` (default), ``linear``, ``nearest`` or ``lanczos``.
    mask_hidden : bool
        Leave pixels empty that the camera cannot see; otherwise they show what hides them.
    fill : bool
        Close holes with the colours around them; such pixels are marked `Source.FILLED`.
    feather : float
        Width of the transition between two photos. [px]
    """

    interpolation: Interpolation = "cubic"
    mask_hidden: bool = True
    fill: bool = False
    feather: float = 8.0

    def __post_init__(self) -> None:
        if self.interpolation not in INTERPOLATIONS:
            raise InputError(
                f"interpolation: {self.interpolation!r} is not one of {', '.join(INTERPOLATIONS)}."
            )
        if not (math.isfinite(self.feather) and 0 <= self.feather <= 64):
            raise InputError(f"feather: must be 0 to 64 px, got {self.feather}.")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Orthophoto:
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
    def grid(self) -> Grid:
        """Where the pixels are."""
        return Grid.from_affine(self.plane_from_pixel, self.source.shape)

    @property
    def gsd(self) -> float:
        """Side of a pixel on the plane. [m]"""
        return float(self.plane_from_pixel[0, 0])

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Outer edges (X min, Y min, X max, Y max). [m]"""
        return self.grid.bounds

    @property
    def valid(self) -> BoolArray:
        """Pixels that show something, shape (height, width)."""
        valid: BoolArray = self.source > 0
        return valid
