"""What an accuracy study returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from multimedia.design.planarity import Deviation
from multimedia.media import OpticalMedia
from photocore.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Study:
    """What a set-up promises.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Where it was evaluated. [object unit]
    sigma : ndarray, shape (n, 3)
        Expected standard deviations of X, Y, Z, to first order; NaN where fewer than two cameras
        see the point. [object unit]
    angle : ndarray, shape (n,)
        Largest angle between two rays at the point, in its medium. [rad]
    angle_in_air : ndarray, shape (n,)
        The same if the tank were empty: Maas 2015, Fig. 4. [rad]
    seen_by : ndarray of int, shape (n,)
        Cameras that see it.
    sensitivity : mapping of str to ndarray, shape (3,)
        Unknown of the media, e.g. ``tank:index3``, to the RMS error of X, Y, Z that one step of it
        causes, to first order (steps as `multimedia.design.accuracy.STEPS`). [object unit]
    """

    points: FloatArray
    sigma: FloatArray
    angle: FloatArray
    angle_in_air: FloatArray
    seen_by: FloatArray
    sensitivity: Mapping[str, FloatArray]

    @property
    def rms_sigma(self) -> FloatArray:
        """RMS of the standard deviations over the points, shape (3,)."""
        return np.sqrt(np.nanmean(self.sigma**2, axis=0))


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationCosts:
    """Table 1 of Maas 2015 on simulated data: mean errors of check points in X, Y, Z.

    Attributes
    ----------
    air : tuple of float
        I: calibrated and measured in air.
    air_calibration_in_water : tuple of float
        II: calibrated in air, oriented and measured in water.
    water : tuple of float
        III: calibrated and measured in water.
    sigma0 : tuple of float
        Of I, II and III. [mm]
    """

    air: tuple[float, ...]
    air_calibration_in_water: tuple[float, ...]
    water: tuple[float, ...]
    sigma0: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """One way to place the cameras and what it gives.

    Attributes
    ----------
    half_angle : float
        Opening of the ring of cameras. [rad]
    sigma : tuple of float
        RMS standard deviations of X, Y, Z, to first order. [object unit]
    angle : float
        Between the rays that meet in a point. [rad]
    """

    half_angle: float
    sigma: tuple[float, ...]
    angle: float


def best_placement(placements: Sequence[Placement]) -> tuple[Placement, bool]:
    """Return the most precise placement, and whether better ones may lie beyond those tried."""
    ranked = [sum(v * v for v in place.sigma) for place in placements]
    best = ranked.index(min(ranked))
    return placements[best], best in (0, len(placements) - 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Design:
    """Everything the command shows.

    Attributes
    ----------
    study : Study
    by_depth : ndarray, shape (levels, 6)
        Depth, RMS sigma X, Y, Z, mean ray angle and the same in air. [unit, unit, deg]
    sensitivities : tuple of (unknown, step in words, (dX, dY, dZ))
    placements : tuple of Placement
    costs : CalibrationCosts or None
    models : tuple of (model, RMS error, largest error)
        What simplified refraction models would get wrong at the points, at their depth,
        were the camera square to the media. [unit]
    seam : float
        Largest distance of red and blue in the image of the points. [mm]
    unit : str
    remarks : tuple of str
    planarity : tuple of Deviation
        What bent, wedged or wavy faces cost, where asked for.
    centres : ndarray, shape (cameras, 3)
    media : OpticalMedia or None
        What all cameras look through; None where it is not the same. [unit]
    """

    study: Study
    by_depth: FloatArray
    sensitivities: tuple[tuple[str, str, tuple[float, ...]], ...]
    placements: tuple[Placement, ...]
    costs: CalibrationCosts | None
    models: tuple[tuple[str, float, float], ...]
    seam: float
    unit: str
    remarks: tuple[str, ...]
    planarity: tuple[Deviation, ...] = ()
    centres: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    media: OpticalMedia | None = None
