"""Surfaces in the order in which a ray meets them, with the media between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from multimedia.media.surfaces import RefractingSurface
from multimedia.refraction.layers import checked_indices
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfaceSequence:
    """What ray tracing is given: surfaces and indices, all in one frame.

    Attributes
    ----------
    surfaces : tuple of RefractingSurface
        One per interface. A ray may cross the same surface twice: list it twice.
    indices : tuple of float
        Refractive indices of the media, from the ray's start to its end; one more than surfaces.
    """

    surfaces: tuple[RefractingSurface, ...]
    indices: tuple[float, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "surfaces", tuple(self.surfaces))
        object.__setattr__(self, "indices", checked_indices(self.indices))
        if len(self.indices) != len(self.surfaces) + 1:
            raise InputError(
                f"indices: {len(self.surfaces)} surfaces lie between {len(self.surfaces) + 1} "
                f"media, but {len(self.indices)} indices are given."
            )

    def reversed(self) -> SurfaceSequence:
        """Return the same media in the order of a ray from the object."""
        return SurfaceSequence(surfaces=self.surfaces[::-1], indices=self.indices[::-1])

    def with_indices(self, indices: Sequence[float]) -> Self:
        """Return the same surfaces between other media."""
        return replace(self, indices=tuple(indices))

    def separates(self, starts: FloatArray, ends: FloatArray) -> BoolArray:
        """Return whether each pair of points lies on the sides the sequence demands, shape (n,).

        A surface listed an odd number of times must have the two points on different sides, one
        listed twice on the same side. A point on the surface belongs to both.
        """
        good = np.ones(len(starts), dtype=bool)
        for surface in dict.fromkeys(self.surfaces):
            crossings = sum(other is surface for other in self.surfaces)
            product = surface.side(starts) * surface.side(ends)
            good &= (product <= 0) if crossings % 2 else (product >= 0)
        return good
