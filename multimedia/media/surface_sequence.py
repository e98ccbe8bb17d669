"""Surfaces in the order in which a ray meets them, with the media between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from multimedia.media.surfaces import RefractingSurface
from multimedia.refraction import checked_indices
from photocore.arrays import BoolArray, FloatArray, as_floats
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
    gradient : float
        By how much the index of the last medium grows per unit of depth (towards -Z).
    level : float
        Z where that medium has the index given.
    """

    surfaces: tuple[RefractingSurface, ...]
    indices: tuple[float, ...]
    gradient: float = 0.0
    level: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "surfaces", tuple(self.surfaces))
        object.__setattr__(self, "indices", checked_indices(self.indices))
        if len(self.indices) != len(self.surfaces) + 1:
            raise InputError(
                f"indices: {len(self.surfaces)} surfaces lie between {len(self.surfaces) + 1} "
                f"media, but {len(self.indices)} indices are given."
            )
        for name in ("gradient", "level"):
            value = as_floats(getattr(self, name), name)
            if value.ndim or not np.isfinite(value):
                raise InputError(f"{name}: expected a number, found {value.tolist()}.")
            object.__setattr__(self, name, float(value))

    def reversed(self) -> SurfaceSequence:
        """Return the same media in the order of a ray from the object; none may be graded."""
        return SurfaceSequence(surfaces=self.surfaces[::-1], indices=self.indices[::-1])

    @property
    def is_graded(self) -> bool:
        """Whether the index of the last medium changes with depth: rays are bent in it."""
        return self.gradient != 0.0

    @property
    def gradient_vector(self) -> FloatArray:
        """Gradient of the index of the last medium, shape (3,)."""
        return np.array([0.0, 0.0, -self.gradient])

    def index_behind(self, number: int, places: FloatArray) -> float | FloatArray:
        """Return the index behind a surface, where rays meet it, shape (n,) if it varies."""
        index = self.indices[number + 1]
        if not self.is_graded or number + 1 < len(self.surfaces):
            return index
        varied: FloatArray = index + self.gradient * (self.level - places[:, 2])
        return varied

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
            crossings = sum(one is surface for one in self.surfaces)
            product = surface.side(starts) * surface.side(ends)
            good &= (product <= 0) if crossings % 2 else (product >= 0)
        return good
