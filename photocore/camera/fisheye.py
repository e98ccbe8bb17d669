r"""The fisheye lens: a polynomial of the angle off the axis, as in OpenCV, COLMAP and Metashape.

With theta the angle between ray and axis and r = tan theta the ideal radius over the principal
distance c:

.. math::
    \theta_d = \theta (1 + k_1 \theta^2 + k_2 \theta^4 + k_3 \theta^6 + k_4 \theta^8), \qquad
    x' = c\, s\, \theta_d \frac{x}{r}, \quad y' = c\, \theta_d \frac{y}{r} .

Kannala and Brandt (2006), Eq. 6, without asymmetric terms; ``cv2.fisheye``, COLMAP's
OPENCV_FISHEYE, Metashape's fisheye with p1 = p2 = 0. All k zero: the equidistant lens. The model
ends where theta_d stops growing, here at 90 degrees at the latest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_points
from photocore.errors import LARGEST, InputError

#: Terms of the polynomial.
TERMS = ("k1", "k2", "k3", "k4")
#: Steps of the inverse: Newton's, halving the bracket where one would leave it.
_STEPS = 80


@dataclass(frozen=True, slots=True, kw_only=True)
class Fisheye:
    """Coefficients of a fisheye lens.

    Attributes
    ----------
    k1, k2, k3, k4 : float
        Of theta^3, theta^5, theta^7, theta^9, theta in rad.
    scale : float
        Scale of x against y.
    farthest : float
        Angle off the axis at which the model ends: 90 degrees, or where theta_d stops growing
        before. [rad]

    Examples
    --------
    Equidistant, c = 10 mm: 45 degrees off the axis, where a central lens has 10 mm, are seen
    10 pi / 4 mm from the centre:

    >>> Fisheye().measured([10.0, 0.0], [0.0, 0.0], 10.0).round(6).tolist()
    [7.853982, 0.0]
    """

    #: Names of the parameters.
    names: ClassVar[tuple[str, ...]] = (*TERMS, "scale")
    #: A fisheye lens never is the central projection.
    is_identity: ClassVar[bool] = False

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    scale: float = 1.0
    farthest: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        values = np.array([getattr(self, name) for name in self.names], dtype=np.float64)
        if not (np.abs(values) <= LARGEST).all():
            raise InputError(f"fisheye: every coefficient must be a number, found {values}.")
        if not 0.5 < self.scale < 2.0:
            raise InputError(
                f"fisheye: scale {self.scale:g} must be near 1: it is that of x against y."
            )
        # d theta_d / d theta is a polynomial of theta^2; its smallest positive root ends the model.
        slope = [1.0, 3.0 * self.k1, 5.0 * self.k2, 7.0 * self.k3, 9.0 * self.k4]
        roots = np.polynomial.polynomial.polyroots(np.trim_zeros(slope, "b"))
        ends = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
        end = float(np.sqrt(ends.min(initial=(np.pi / 2) ** 2)))
        object.__setattr__(self, "farthest", end)

    def measured(
        self, ideal: ArrayLike, principal_point: ArrayLike, principal_distance: float
    ) -> FloatArray:
        """Return where ideal coordinates (about the principal point) are measured. [mm]

        Parameters
        ----------
        ideal : array_like, shape (..., 2)
            Central projection, origin at the principal point. [mm]
        principal_point : array_like, shape (2,)
            [mm]
        principal_distance : float
            [mm]

        Returns
        -------
        ndarray, shape (..., 2)
            Origin at the centre of the sensor; NaN beyond the end of the model.
        """
        points = as_points(ideal, "ideal", dimension=2)
        centre = as_points(principal_point, "principal_point", dimension=2)
        return self._bent(points, principal_distance)[0] + centre

    def ideal(
        self, measured: ArrayLike, principal_point: ArrayLike, principal_distance: float
    ) -> FloatArray:
        """Return the ideal coordinates of measured ones: undoes `measured`, shape (..., 2). [mm]"""
        points = as_points(measured, "measured", dimension=2)
        centre = as_points(principal_point, "principal_point", dimension=2)
        away = (points - centre) / (self.scale * principal_distance, principal_distance)
        bent = np.sqrt((away * away).sum(-1))
        theta = self._angle(bent)
        with np.errstate(invalid="ignore", divide="ignore"):
            longer = np.where(bent > 0, np.tan(theta) / bent, 1.0)
        return away * (principal_distance * longer)[..., None]

    def measured_with_jacobian(
        self,
        ideal: FloatArray,
        principal_point: FloatArray,
        names: Sequence[str] = (),
        principal_distance: float = 1.0,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return `measured` with its derivatives.

        Parameters
        ----------
        ideal, principal_point, principal_distance
            As for `measured`.
        names : sequence of str
            Of `names`, ``xh``, ``yh`` (principal point) and ``c`` (principal distance, while the
            ideal coordinates stay).

        Returns
        -------
        measured : ndarray, shape (..., 2)
        by_ideal : ndarray, shape (..., 2, 2)
        by_names : ndarray, shape (..., 2, len(names))
        """
        c, stretch = principal_distance, np.array([self.scale, 1.0])
        bent, theta, radius, unit = self._bent(ideal, c)
        square = theta * theta
        with np.errstate(invalid="ignore"):
            across = np.where(radius > 0, self._polynomial(theta) / radius, 1.0)
            outwards = self._slope(square) / (1.0 + radius * radius)
            by_ideal = (outwards - across)[..., None, None] * (unit[..., None] * unit[..., None, :])
        by_ideal[..., 0, 0] += across
        by_ideal[..., 1, 1] += across
        by_ideal *= stretch[:, None]
        by_names = np.zeros((*ideal.shape, len(names)))
        for k, name in enumerate(names):
            if name in ("xh", "yh"):
                by_names[..., 0 if name == "xh" else 1, k] = 1.0
            elif name == "scale":
                by_names[..., 0, k] = bent[..., 0] / self.scale
            elif name == "c":
                by_names[..., k] = (bent - (by_ideal @ ideal[..., None])[..., 0]) / c
            else:
                power = theta * square ** (TERMS.index(name) + 1)
                by_names[..., k] = c * stretch * unit * power[..., None]
        return bent + principal_point, by_ideal, by_names

    def _bent(
        self, points: FloatArray, c: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the image about the principal point, theta, r and the direction in the image."""
        radius = np.sqrt((points * points).sum(-1)) / c
        theta = np.arctan(radius)
        theta = np.where(theta < self.farthest, theta, np.nan)
        with np.errstate(invalid="ignore", divide="ignore"):
            unit = np.where(radius[..., None] > 0, points / (c * radius[..., None]), 0.0)
        bent = (c * self._polynomial(theta))[..., None] * unit * (self.scale, 1.0)
        return bent, theta, radius, unit

    def _polynomial(self, theta: FloatArray) -> FloatArray:
        """Return theta_d."""
        t = theta * theta
        return theta * (1.0 + t * (self.k1 + t * (self.k2 + t * (self.k3 + t * self.k4))))

    def _slope(self, t: FloatArray) -> FloatArray:
        """Return d theta_d / d theta, given theta squared."""
        k1, k2, k3, k4 = 3.0 * self.k1, 5.0 * self.k2, 7.0 * self.k3, 9.0 * self.k4
        return 1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4)))

    def _angle(self, bent: FloatArray) -> FloatArray:
        """Return theta for theta_d; NaN beyond the end of the model."""
        end = np.array(self.farthest)
        inside = bent < self._polynomial(end)
        low, high = np.zeros_like(bent), np.full_like(bent, end)
        theta = np.minimum(bent, 0.99 * end)
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                miss = self._polynomial(theta) - bent
                low, high = np.where(miss <= 0, theta, low), np.where(miss >= 0, theta, high)
                better = theta - miss / self._slope(theta * theta)
                better = np.where((better >= low) & (better <= high), better, 0.5 * (low + high))
                change = np.abs(better - theta)[inside]
                theta = better
                if not (change > 1e-15).any():
                    break
        return np.where(inside, theta, np.nan)
