"""The distortion of a lens as the cells of a survey workbook state it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.model import Lens
from photocore.arrays import FloatArray

#: Turns of Newton in the workbook's formulas.
TURNS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyLens:
    """Radial distortion about a principal point: seen = t (1 + k1 t² + k2 t⁴), t = radius / c.

    Attributes
    ----------
    k1, k2 : float or None
        As OpenCV's; blank: 0.
    x, y : float or None
        Principal point in the unit of the input; blank: the nadir point.
    """

    k1: float | None = None
    k2: float | None = None
    x: float | None = None
    y: float | None = None

    @property
    def distorts(self) -> bool:
        """Whether there is any distortion."""
        return bool(self.k1 or self.k2)

    def middle(self, unit: FloatArray, nadir: tuple[float, float]) -> FloatArray:
        """Return the principal point from the nadir, shape (2,) [mm]; see `lens`."""
        typed = zip(nadir, (self.x, self.y), strict=True)
        return np.array([0.0 if value is None else value - n for n, value in typed]) * unit

    def lens(self, c: float, unit: FloatArray, nadir: tuple[float, float]) -> Lens:
        """Return it for coordinates in millimetres from the nadir, y up.

        Parameters
        ----------
        c : float
            Principal distance of the image as measured. [mm]
        unit : ndarray, shape (2,)
            What brings typed coordinates from the nadir to millimetres.
        nadir : tuple of float
            As typed, in the unit of the input.
        """
        u, v = self.middle(unit, nadir)
        matrix = np.array([[c, 0.0, u], [0.0, c, v], [0.0, 0.0, 1.0]])
        terms = np.array([self.k1 or 0.0, self.k2 or 0.0, 0.0, 0.0])
        return Lens(camera_matrix=matrix, coefficients=terms, image_size=(1, 1))


def freed_scale(lens: Lens, seen: FloatArray) -> FloatArray:
    """Return what picks, from the principal point, are multiplied by to be freed of distortion.

    Parameters
    ----------
    lens : Lens
        In millimetres from the nadir.
    seen : ndarray, shape (n, 2)
        Picks as seen. [mm]

    Returns
    -------
    ndarray, shape (n,)
    """
    k1, k2 = lens.coefficients[:2]
    seen_radius = np.hypot(*(seen - lens.principal_point).T) / lens.camera_matrix[0, 0]
    t = seen_radius
    for _ in range(TURNS):
        gap = t * (1 + k1 * t**2 + k2 * t**4) - seen_radius
        t = t - gap / (1 + 3 * k1 * t**2 + 5 * k2 * t**4)
    return np.asarray(1 / (1 + k1 * t**2 + k2 * t**4))
