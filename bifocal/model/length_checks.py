"""Lengths taped on site that give a pair nothing, and so check it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bifocal import rays
from bifocal.model.orientation_precision import pixel_rates
from bifocal.model.pair import Pair
from photocore.arrays import FloatArray
from photocore.errors import GeometryError

#: Precision of the ends of a length that are clicked on a photo. [px]
SIGMA_END = 1.0
#: A length contradicts the pair that differs by more standard deviations.
AGREES = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthCheck:
    """A taped length beside the same one on the wall of a pair.

    Attributes
    ----------
    taped, measured : float
        As taped on site, and between the two pixels on the reference plane. [m]
    sigma : float
        Standard deviation of their difference: of tape, clicks and orientation; a pair that
        states none, as typed set-ups do, is taken as exact. [m]
    """

    taped: float
    measured: float
    sigma: float

    @property
    def difference(self) -> float:
        """Measured minus taped. [m]"""
        return self.measured - self.taped

    @property
    def agrees(self) -> bool:
        """Whether chance explains the difference."""
        return abs(self.difference) <= AGREES * self.sigma


def agreement(checks: Sequence[LengthCheck]) -> dict[str, float]:
    """Return ``agree`` of ``count`` lengths, and the largest difference, ``most`` [mm]."""
    return {
        "agree": sum(check.agrees for check in checks),
        "count": len(checks),
        "most": 1000 * max(abs(check.difference) for check in checks),
    }


def length_check(
    pair: Pair, number: int, ends: FloatArray, length: float, *, sigma: float
) -> LengthCheck:
    """Return how a taped length agrees with a pair.

    Parameters
    ----------
    pair : Pair
    number : int
        Photo 1 or 2.
    ends : ndarray, shape (2, 2)
        Both on the reference plane. [px]
    length, sigma : float
        As taped, and its standard deviation. [m]

    Raises
    ------
    GeometryError
        If the ends coincide.
    """
    measured, by_orientation, of_ends = length_on_wall(pair, number, ends)
    of_pair = 0.0
    if pair.orientation is not None:
        of_pair = measured * float(np.sqrt(by_orientation @ pair.orientation @ by_orientation))
    return LengthCheck(
        taped=length, measured=measured, sigma=float(np.sqrt(of_pair**2 + of_ends**2 + sigma**2))
    )


def length_on_wall(pair: Pair, number: int, ends: FloatArray) -> tuple[float, FloatArray, float]:
    """Return how far apart two pixels of photo 1 or 2 are on the wall, and what that depends on.

    Parameters
    ----------
    pair, number, ends
        As for `length_check`.

    Returns
    -------
    length : float
        [m]
    by_orientation : ndarray, shape (24,)
        Derivative of its logarithm by the orientation.
    of_ends : float
        Its standard deviation by the clicks alone. [m]

    Raises
    ------
    GeometryError
        If the ends coincide.
    """
    photo = pair.photo(number)
    places = rays.object_rays(photo.plane_from_pixels(ends), photo.foot).position
    apart = places[1] - places[0]
    length = float(np.linalg.norm(apart))
    if not length > 0 or np.hypot(*(ends[1] - ends[0])) < 2 * SIGMA_END:
        raise GeometryError("the ends of the length coincide: pick them farther apart.")
    xyz = np.column_stack([places, np.zeros(2)])
    by_point, by_camera = pixel_rates((pair.image1, pair.image2), xyz)
    rows = slice(2 * number - 2, 2 * number)
    inverse = np.linalg.inv(by_point[:, rows, :2])
    moved = -inverse @ by_camera[:, rows]
    by_orientation = (apart / length**2) @ (moved[1] - moved[0])
    of_ends = float(np.sqrt((((apart / length) @ inverse) ** 2).sum())) * SIGMA_END
    return length, by_orientation, of_ends
