"""Lengths taped on site that give a pair nothing, and so check it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bifocal import rays
from bifocal.model.doubts import NO_NUMBER
from bifocal.model.orientation_precision import pixel_rates
from bifocal.model.pair import Pair
from bifocal.model.photo_set import PhotoSet
from bifocal.remarks import remark
from photocore.arrays import FloatArray, as_points
from photocore.errors import GeometryError
from photocore.remarks import Remark

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


def checks_of(setup: Any) -> dict[str, LengthCheck]:
    """Return how the lengths agree that checked a pair or set, by name, from its ``setup``."""
    checks = {}
    with suppress(*NO_NUMBER, AttributeError):
        for entry in setup.get("length_checks", ()):
            values = {key: float(entry[key]) for key in ("taped", "measured", "sigma")}
            checks[str(entry["name"])] = LengthCheck(**values)
    return checks


def check_in_set(
    photos: PhotoSet, number: int, ends: FloatArray, length: float, *, sigma: float
) -> LengthCheck:
    """Return `length_check` of a photo of a set by its number, from 0."""
    distances = np.array([photo.distance for photo in photos.photos])
    pair = photos.pair(number, int(np.argmax(np.abs(distances - distances[number]))))
    place = 1 if pair.d1 == distances[number] else 2
    return length_check(pair, place, ends, length, sigma=sigma)


def disagreement(checks: Mapping[str, LengthCheck]) -> tuple[Remark, ...]:
    """Return, for the user, that lengths disagree which check, and what is likely wrong."""
    wrong = {name: check for name, check in checks.items() if not check.agrees}
    if not wrong:
        return ()
    name = max(wrong, key=lambda name: abs(wrong[name].difference / wrong[name].sigma))
    worst, key = wrong[name], "orientation.lengths_disagree"
    factors = np.array([check.taped / check.measured for check in checks.values()])
    spread = np.array([check.sigma / check.measured for check in checks.values()])
    factor = float(np.average(factors, weights=spread**-2.0))
    if len(wrong) == len(checks) > 1 and (np.abs(factors - factor) < AGREES * spread).all():
        key = "orientation.scale_disagrees"
    return (
        remark(
            key, count=len(wrong), all=len(checks), name=name, taped=worst.taped, factor=factor,
            measured=worst.measured, sigma=1000 * worst.sigma,
        ),
    )  # fmt: skip


def length_check(
    pair: Pair, number: int, ends: ArrayLike, length: float, *, sigma: float
) -> LengthCheck:
    """Return how a taped length agrees with a pair.

    Parameters
    ----------
    pair : Pair
    number : int
        Photo 1 or 2.
    ends : array_like, shape (2, 2)
        Both on the reference plane. [px]
    length, sigma : float
        As taped, and its standard deviation. [m]

    Returns
    -------
    LengthCheck

    Raises
    ------
    GeometryError
        If the ends coincide.

    Examples
    --------
    >>> from bifocal import SAMPLE
    >>> pair = Pair.read(SAMPLE / "facade.pair.json")
    >>> check = length_check(pair, 1, [(225.5, 782.5), (1309.5, 782.5)], 8.002, sigma=0.003)
    >>> f"{1000 * check.difference:+.1f} mm, sigma {1000 * check.sigma:.1f} mm, {check.agrees}"
    '-2.1 mm, sigma 10.9 mm, True'
    """
    picks = as_points(ends, "ends", dimension=2)
    measured, by_orientation, of_ends = length_on_wall(pair, number, picks)
    of_pair = 0.0
    if pair.orientation is not None:
        variance = float(by_orientation @ pair.orientation @ by_orientation)
        of_pair = measured * np.sqrt(max(variance, 0.0))  # below 0 by rounding
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
