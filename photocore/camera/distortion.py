"""Lens distortion: Brown's formula in mm, and the division model in pixels, with derivatives.

Brown: ideal <-> measured image coordinates, one formula, three conventions. With
r2 = x^2 + y^2, q = k1 r2 + k2 r2^2 + k3 r2^3:

    x' = x (1 + q) + p1 (r2 + 2 x^2) + 2 p2 x y
    y' = y (1 + q) + p2 (r2 + 2 y^2) + 2 p1 x y
    B(x, y) = (scale * x' - sin(shear) * y', cos(shear) * y')

- ``brown``: measured = principal point + B(ideal). OpenCV's model in mm; see `from_opencv`.
- ``photogrammetric``: ideal = B(measured - principal point). The correction is a function of the
  measured coordinates, as in most calibration certificates.
- ``openptv``: measured = B(ideal + principal point): about the centre of the sensor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_points
from photocore.compiled import inlined
from photocore.errors import LARGEST, InputError
from photocore.remarks import remark

#: Names of the parameters in the order of `Brown`'s fields.
NAMES = ("k1", "k2", "k3", "p1", "p2", "scale", "shear")
#: Newton steps of the inverse; honest lenses need 3 to 5.
STEPS = 25


@inlined
def _brown(terms: FloatArray, x: Any, y: Any) -> tuple[Any, Any]:
    """Return x', y': B without the axes' scale and shear."""
    k1, k2, k3, p1, p2 = terms[0], terms[1], terms[2], terms[3], terms[4]
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    q = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    x1 = x * q + p1 * (r2 + 2.0 * xx) + 2.0 * p2 * xy
    return x1, y * q + p2 * (r2 + 2.0 * yy) + 2.0 * p1 * xy


@inlined
def bent(terms: FloatArray, x: Any, y: Any) -> tuple[Any, Any]:
    """Return B of a point, or of each of many: `Brown.terms` are what it takes."""
    x1, y1 = _brown(terms, x, y)
    return terms[5] * x1 - terms[6] * y1, terms[7] * y1


@inlined
def bent_slopes(terms: FloatArray, x: Any, y: Any) -> tuple[Any, Any, Any, Any]:
    """Return dB/d(x, y), row by row, of a point or of each of many."""
    k1, k2, k3, p1, p2 = terms[0], terms[1], terms[2], terms[3], terms[4]
    scale, sin, cos = terms[5], terms[6], terms[7]
    r2 = x * x + y * y
    q = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    dq = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))  # dq/dx = dq * x
    xx = q + dq * x * x + 6.0 * p1 * x + 2.0 * p2 * y
    mixed = dq * x * y + 2.0 * p1 * y + 2.0 * p2 * x
    yy = q + dq * y * y + 6.0 * p2 * y + 2.0 * p1 * x
    return scale * xx - sin * mixed, scale * mixed - sin * yy, cos * mixed, cos * yy


@inlined
def towards(terms: FloatArray, at_x: Any, at_y: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Return Newton's step towards the point for which B gives (x, y), or each of many."""
    seen_x, seen_y = bent(terms, at_x, at_y)
    a, b, c, d = bent_slopes(terms, at_x, at_y)
    miss_x, miss_y, determinant = x - seen_x, y - seen_y, a * d - b * c
    return (d * miss_x - b * miss_y) / determinant, (a * miss_y - c * miss_x) / determinant


class Convention(Enum):
    """What the formula is applied to; the module's head has the equations."""

    BROWN = "brown"
    PHOTOGRAMMETRIC = "photogrammetric"
    OPENPTV = "openptv"


@dataclass(frozen=True, slots=True, kw_only=True)
class Brown:
    """Distortion coefficients with the convention they belong to.

    Attributes
    ----------
    k1, k2, k3 : float
        Radial. [mm^-2, mm^-4, mm^-6]
    p1, p2 : float
        Decentring. [mm^-1]
    scale : float
        Scale of x against y.
    shear : float
        Departure of the axes from a right angle. [rad]
    convention : Convention
        What they are applied to.

    Examples
    --------
    10 mm from the centre, k1 = 1e-5 moves a point 10 um outwards:

    >>> Brown(k1=1e-5).measured([10.0, 0.0], [0.0, 0.0]).round(9).tolist()
    [10.01, 0.0]
    """

    #: Names of the parameters.
    names: ClassVar[tuple[str, ...]] = NAMES

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    scale: float = 1.0
    shear: float = 0.0
    convention: Convention = Convention.BROWN

    def __post_init__(self) -> None:
        values = np.array([getattr(self, name) for name in NAMES], dtype=np.float64)
        if not (np.abs(values) <= LARGEST).all():
            raise InputError(f"distortion: every coefficient must be a number, found {values}.")
        if not (0.5 < self.scale < 2.0 and abs(self.shear) < 0.5):
            raise InputError(remark("lens.axes", scale=self.scale, shear=self.shear))

    @classmethod
    def from_opencv(cls, coefficients: Sequence[float], *, principal_distance: float) -> Brown:
        """Return the same distortion from OpenCV's k1 k2 p1 p2 [k3].

        OpenCV counts in units of the principal distance and with y downwards.

        Raises
        ------
        InputError
            For the rational, thin-prism and tilted models (more than 5 coefficients).
        """
        values = [float(v) for v in coefficients]
        if any(values[5:]):
            raise InputError(remark("lens.more_terms", count=len(values)))
        k1, k2, q1, q2, k3 = [*values, *[0.0] * 5][:5]
        c = principal_distance
        return cls(k1=k1 / c**2, k2=k2 / c**4, k3=k3 / c**6, p1=q2 / c, p2=-q1 / c)

    @property
    def is_identity(self) -> bool:
        """Whether nothing is distorted."""
        return not (self.k1 or self.k2 or self.k3 or self.p1 or self.p2 or self.shear) and (
            self.scale == 1.0
        )

    def measured(
        self,
        ideal: ArrayLike,
        principal_point: ArrayLike,
        principal_distance: float = 1.0,  # noqa: ARG002
    ) -> FloatArray:
        """Return where ideal coordinates (about the principal point) are measured. [mm]

        Parameters
        ----------
        ideal : array_like, shape (..., 2)
            Central projection, origin at the principal point. [mm]
        principal_point : array_like, shape (2,)
            [mm]
        principal_distance : float
            Not needed: the terms count in mm; see `photocore.camera.fisheye.Fisheye`.

        Returns
        -------
        ndarray, shape (..., 2)
            Origin at the centre of the sensor; NaN where the distortion cannot be inverted.
        """
        points = as_points(ideal, "ideal", dimension=2)
        centre = as_points(principal_point, "principal_point", dimension=2)
        if self.is_identity:
            return points + centre
        if self.convention is Convention.BROWN:
            return self._formula(points) + centre
        if self.convention is Convention.OPENPTV:
            return self._formula(points + centre)
        return self._inverse(points) + centre

    def ideal(
        self,
        measured: ArrayLike,
        principal_point: ArrayLike,
        principal_distance: float = 1.0,  # noqa: ARG002
    ) -> FloatArray:
        """Return the ideal coordinates of measured ones: undoes `measured`, shape (..., 2). [mm]"""
        points = as_points(measured, "measured", dimension=2)
        centre = as_points(principal_point, "principal_point", dimension=2)
        if self.is_identity:
            return points - centre
        if self.convention is Convention.BROWN:
            return self._inverse(points - centre)
        if self.convention is Convention.OPENPTV:
            return self._inverse(points) - centre
        return self._formula(points - centre)

    def measured_with_jacobian(
        self,
        ideal: FloatArray,
        principal_point: FloatArray,
        names: Sequence[str] = (),
        principal_distance: float = 1.0,  # noqa: ARG002
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return `measured` with its derivatives.

        Parameters
        ----------
        ideal, principal_point
            As for `measured`.
        names : sequence of str
            Of `NAMES`, ``xh``, ``yh`` (principal point) and ``c``, the last for nothing.

        Returns
        -------
        measured : ndarray, shape (..., 2)
        by_ideal : ndarray, shape (..., 2, 2)
        by_names : ndarray, shape (..., 2, len(names))
        """
        measured = self.measured(ideal, principal_point)
        by_names = np.zeros((*ideal.shape, len(names)))
        if self.convention is Convention.BROWN:
            argument = ideal
        elif self.convention is Convention.OPENPTV:
            argument = ideal + principal_point
        else:
            argument = measured - principal_point
        by_argument = self._by_argument(argument)
        for k, name in enumerate(names):
            if name in NAMES:
                by_names[..., k] = self._by_coefficient(argument, name)
        if self.convention is Convention.PHOTOGRAMMETRIC:
            # ideal = B(m): dm = (dB/dm)^-1 (d ideal - dB of the coefficients).
            by_argument = inverse_2x2(by_argument)
            by_names = -(by_argument @ by_names)
        for k, name in enumerate(names):
            if name in ("xh", "yh"):
                axis = 0 if name == "xh" else 1
                if self.convention is Convention.OPENPTV:
                    by_names[..., k] = by_argument[..., axis]
                else:
                    by_names[..., axis, k] = 1.0
        return measured, by_argument, by_names

    @property
    def terms(self) -> FloatArray:
        """k1, k2, k3, p1, p2, scale, sine and cosine of shear: what the kernels take, (8,)."""
        radial = (self.k1, self.k2, self.k3, self.p1, self.p2)
        return np.array([*radial, self.scale, np.sin(self.shear), np.cos(self.shear)])

    def _formula(self, points: FloatArray) -> FloatArray:
        """Return B(x, y)."""
        out = np.empty_like(points)
        out[..., 0], out[..., 1] = bent.plain(self.terms, points[..., 0], points[..., 1])
        return out

    def _by_argument(self, points: FloatArray) -> FloatArray:
        """Return dB/d(x, y), shape (..., 2, 2)."""
        slopes = bent_slopes.plain(self.terms, points[..., 0], points[..., 1])
        out = np.empty((*points.shape, 2))
        out[..., 0, 0], out[..., 0, 1], out[..., 1, 0], out[..., 1, 1] = slopes
        return out

    def _by_coefficient(self, points: FloatArray, name: str) -> FloatArray:
        """Return dB/d(coefficient), shape (..., 2)."""
        x, y = points[..., 0], points[..., 1]
        r2 = x * x + y * y
        sin, cos = np.sin(self.shear), np.cos(self.shear)
        if name in ("scale", "shear"):
            x1, y1 = _brown.plain(self.terms, x, y)
            zero = np.zeros_like(x1)
            parts = (x1, zero) if name == "scale" else (-cos * y1, -sin * y1)
            return np.stack(parts, axis=-1)
        if name == "p1":
            dx, dy = r2 + 2.0 * x * x, 2.0 * x * y
        elif name == "p2":
            dx, dy = 2.0 * x * y, r2 + 2.0 * y * y
        else:
            power = r2 ** (NAMES.index(name) + 1)
            dx, dy = x * power, y * power
        return np.stack([self.scale * dx - sin * dy, cos * dy], axis=-1)

    def _inverse(self, target: FloatArray) -> FloatArray:
        """Return the argument for which B gives ``target``, NaN where Newton finds none."""
        x, y = target[..., 0], target[..., 1]
        at_x, at_y, terms = x.copy(), y.copy(), self.terms
        size = 1.0 + np.maximum(np.abs(x), np.abs(y))
        with np.errstate(all="ignore"):
            for _ in range(STEPS):
                step_x, step_y = towards.plain(terms, at_x, at_y, x, y)
                at_x += step_x
                at_y += step_y
                # Quadratic convergence: after a step this small the next would be lost in rounding.
                if not (np.maximum(np.abs(step_x), np.abs(step_y)) > 1e-9 * size).any():
                    break
            seen_x, seen_y = bent.plain(terms, at_x, at_y)
            lost = ~(np.maximum(np.abs(seen_x - x), np.abs(seen_y - y)) <= 1e-11 * size)
        points = np.stack([at_x, at_y], axis=-1)
        points[lost] = np.nan
        return points


class RadialDivision(NamedTuple):
    """Radial distortion of a lens that is unknown: ideal = c + (seen - c) / (1 + q).

    q = k1 rho^2 + k2 rho^4, rho the seen radius over the principal distance.

    Attributes
    ----------
    k1, k2 : float
        Coefficients. [-]
    centre : ndarray, shape (2,)
        Column and row about which it is radial. [px]
    focal : float
        Principal distance. [px]

    Examples
    --------
    >>> bent = RadialDivision(0.1, np.array([500.0, 400.0]), 1000.0, -0.02)
    >>> bent.distort(bent.undistort([900.0, 400.0])).round(9).tolist()
    [900.0, 400.0]
    """

    k1: float
    centre: FloatArray
    focal: float
    k2: float = 0.0

    def undistort(self, pixels: ArrayLike) -> FloatArray:
        """Return where seen points would be without distortion, shape (..., 2). [px]"""
        away, square = self._polar(pixels)
        return self.centre + away / self._divisor(square)

    def undistorted_by_k(self, pixels: ArrayLike) -> FloatArray:
        """Return the derivative of `undistort` by k1 and k2, shape (..., 2, 2). [px]"""
        away, square = self._polar(pixels)
        by_divisor = -away / self._divisor(square) ** 2
        return np.stack([by_divisor * square, by_divisor * square**2], axis=-1)

    def undistorted_by_seen(self, pixels: ArrayLike) -> FloatArray:
        """Return the derivative of `undistort` by the seen point, shape (..., 2, 2)."""
        away, square = self._polar(pixels)
        divisor, square = self._divisor(square)[..., None], square[..., None]
        outer = away[..., :, None] * away[..., None, :] / self.focal**2
        slope = 2.0 * (self.k1 + 2.0 * self.k2 * square)
        return np.eye(2) / divisor - outer * slope / divisor**2

    def distort(self, pixels: ArrayLike) -> FloatArray:
        """Return where ideal points are seen, shape (..., 2); NaN where none is. [px]

        Newton from the root for k1 alone, so that k2 = 0 is closed: seen = ideal (1 + q).
        """
        away, square = self._polar(pixels)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            factor = 2.0 / (1.0 + np.sqrt(1.0 - 4.0 * self.k1 * square))
            if self.k2:
                factor = np.where(np.isfinite(factor), factor, 1.0)
                for _ in range(STEPS):
                    t = factor**2 * square
                    miss = 1.0 + t * (self.k1 + t * self.k2) - factor
                    slope = 2.0 * factor * square * (self.k1 + 2.0 * self.k2 * t) - 1.0
                    factor = factor - miss / slope
                    if not (np.abs(miss) > 1e-13).any():
                        break
                t = factor**2 * square
                miss = np.abs(1.0 + t * (self.k1 + t * self.k2) - factor)
                factor = np.where((miss < 1e-9) & (factor > 0), factor, np.nan)
        return self.centre + away * factor

    def distorted_by_ideal(self, pixels: ArrayLike) -> FloatArray:
        """Return the derivative of `distort` at ideal points, shape (..., 2, 2)."""
        return inverse_2x2(self.undistorted_by_seen(self.distort(pixels)))

    def _divisor(self, square: FloatArray) -> FloatArray:
        return 1.0 + square * (self.k1 + square * self.k2)

    def _polar(self, pixels: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the way from the centre and its squared length over the principal distance's."""
        away = as_points(pixels, "pixels", dimension=2) - self.centre
        return away, (away**2).sum(-1, keepdims=True) / self.focal**2


def inverse_2x2(matrices: FloatArray) -> FloatArray:
    """Return the inverses of matrices, shape (..., 2, 2); nothing finite where singular."""
    a, b = matrices[..., 0, 0], matrices[..., 0, 1]
    c, d = matrices[..., 1, 0], matrices[..., 1, 1]
    out = np.empty_like(matrices)
    out[..., 0, 0], out[..., 0, 1], out[..., 1, 0], out[..., 1, 1] = d, -b, -c, a
    with np.errstate(divide="ignore", invalid="ignore"):
        return out / (a * d - b * c)[..., None, None]
