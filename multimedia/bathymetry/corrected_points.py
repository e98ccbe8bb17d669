"""What a refraction correction is given and what it returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media import HeightField, Plane
from multimedia.media import WaterSurface as WaterSurface
from multimedia.refraction import checked_index
from multimedia.remarks import remark
from photocore.arrays import FloatArray, IntArray, as_floats, not_negative, positive
from photocore.errors import GeometryError, InputError
from photocore.labelled import LabelledCode


class BathymetryStatus(LabelledCode):
    """How a point was treated; written to tables by its label."""

    DRY = 0, "dry"
    NADIR = 1, "nadir"
    RAYS = 2, "rays"
    NO_SURFACE = 3, "outside the water surface"
    FAILED = 4, "failed"
    OUTSIDE = 5, "outside the area"


def status_labels(status: IntArray) -> list[str]:
    """Return how points were treated, in words."""
    return [BathymetryStatus(code).label for code in status.tolist()]


@dataclass(frozen=True, slots=True, kw_only=True)
class Precision:
    """Standard deviations that are carried through to the corrected points.

    Attributes
    ----------
    index : float
        Of the refractive index.
    level : float
        Of the height of the water surface. [m]
    point : float
        Of each coordinate of the apparent points. [m]
    direction : float
        Of a ray: with the directions from which a point was seen it gives the precision of the
        network, beside ``point``. Of points with rays only. [rad]
    wave : tuple of float
        Amplitude and length of a wave that runs in another direction with another phase in every
        photo; (0, 0) is none. Of points with rays through a plane only. [m]
    """

    index: float = 0.0
    level: float = 0.0
    point: float = 0.0
    direction: float = 0.0
    wave: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("index", "level", "point", "direction"):
            not_negative(getattr(self, name), f"sigma of the {name}")
        amplitude, length = self.wave
        if not_negative(amplitude, "wave: amplitude") > 0:
            positive(length, "wave: length")

    @property
    def needs_rays(self) -> bool:
        """Whether a part of it counts only where rays are known."""
        return self.direction > 0 or self.wave[0] > 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CorrectedPoints:
    """Points after refraction correction.

    Attributes
    ----------
    xyz : ndarray, shape (..., 3)
        True positions; dry points and points outside the modelled surface as they were given;
        NaN where the correction failed. [m]
    depth : ndarray, shape (...)
        Height of the water surface above the point, true, not apparent; 0 for dry points. [m]
    status : ndarray of int, shape (...)
        `BathymetryStatus`.
    covariance : ndarray, shape (..., 3, 3), or None
        From the `Precision` given; None if none was. [m²]
    """

    xyz: FloatArray
    depth: FloatArray
    status: IntArray
    covariance: FloatArray | None = None

    @property
    def sigma(self) -> FloatArray | None:
        """Standard deviations of X, Y and Z, shape (..., 3); None without `Precision`. [m]"""
        if self.covariance is None:
            return None
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))


def as_water_surface(level: float | WaterSurface) -> WaterSurface:
    """Return a height as the horizontal plane at that height, a surface as it is.

    Raises
    ------
    InputError
        If it is neither.
    GeometryError
        If a plane stands on edge.
    """
    if isinstance(level, HeightField):
        return level
    if isinstance(level, Plane):
        if abs(level.normal[2]) < 0.5:
            raise GeometryError(remark("bathymetry.steep"))
        # Normals of a water surface point up.
        return level if level.normal[2] > 0 else Plane(point=level.point, normal=-level.normal)
    height = as_floats(level, "water_level")
    if height.ndim or not np.isfinite(height):
        raise InputError(
            f"water_level: expected one height [m] or a water surface, found {level!r:.60}."
        )
    return Plane.level(float(height))


def checked_water_index(index: ArrayLike) -> float:
    """Return the refractive index of water.

    Raises
    ------
    InputError
        If nothing transparent has it.
    """
    value = float(as_floats(index, "index"))
    return checked_index(value, f"index: {value:g} is no refractive index of water")
