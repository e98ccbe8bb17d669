"""Another program's lens model as OpenCV's: exact terms where there are some, else fitted to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from photocore.arrays import FloatArray
from photocore.camera.distortion import inverse_2x2
from photocore.camera.lensdata import LensData, lens_data
from photocore.errors import InputError
from photocore.remarks import remark

#: Residuals at the worst place of the photo that are not said, and those that are refused. [px]
UNSAID, REFUSED = 0.02, 0.5
#: Points along either side of the photo.
_GRID = 17
#: Numbers of OpenCV's terms, the fewest that fit: Brown, rational, with thin prism.
_COUNTS = (5, 8, 12)
#: Rays further from a fisheye's axis meet no plane. [rad]
_STEEPEST = 1.5
_NO_SHEAR = np.eye(2)

Function = Callable[[FloatArray], FloatArray]


def equidistant(radius: FloatArray) -> FloatArray:
    """Return the angle from the axis by the projected radius of OpenCV's fisheye. [rad]"""
    return radius


class FittedLens(NamedTuple):
    """A lens with what its model could not take over.

    Attributes
    ----------
    lens : LensData
    residual : float
        Largest distance between both models in the photo. [px]
    """

    lens: LensData
    residual: float = 0.0

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to say of the residual."""
        if self.residual <= UNSAID:
            return ()
        return (remark("programs.lens_fitted", of=self.lens.source, px=self.residual),)


def fitted_lens(
    ideal_from_pixels: Function, size: Sequence[float], source: str, *, fisheye: bool = False
) -> FittedLens:
    """Return OpenCV's lens that is nearest to another model.

    Parameters
    ----------
    ideal_from_pixels : callable
        Pixels to (x, y) at depth 1, shape (n, 2), NaN where there is none; of a fisheye to the
        angle from the axis, in the direction of (x, y). [rad]
    size : sequence of float
        Width and height. [px]
    source : str
        For the lens file and messages.
    fisheye : bool
        Fit OpenCV's fisheye.

    Raises
    ------
    InputError
        If no lens of OpenCV's comes near.
    """
    from scipy.optimize import least_squares

    axes = [np.linspace(-0.5, side - 0.5, _GRID) for side in size]
    pixels = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    ideal = ideal_from_pixels(pixels)
    angle = np.hypot(ideal[:, 0], ideal[:, 1])  # NaN where there is none
    used = angle < (_STEEPEST if fisheye else np.inf)
    ideal, pixels = ideal[used], pixels[used]
    middle = (
        [np.polyfit(ideal[:, k], pixels[:, k], 1) for k in range(2)] if len(pixels) > 50 else []
    )
    best = FittedLens(lens_data([1, 1], [0, 0], [], size, source), np.inf)
    for count in ((4,) if fisheye else _COUNTS) if middle else ():
        fit = least_squares(
            lambda p, n=count: (_seen(p, n, ideal, fisheye=fisheye) - pixels).ravel(),
            [middle[0][0], middle[1][0], middle[0][1], middle[1][1], *[0.0] * count],
            "3-point", x_scale="jac", ftol=1e-12, xtol=1e-12, gtol=None, max_nfev=100,
        )  # fmt: skip
        miss = float(np.hypot(*fit.fun.reshape(-1, 2).T).max())
        if miss < best.residual and min(fit.x[:2]) > 0:
            values = fit.x.tolist()
            lens = lens_data(values[:2], values[2:4], values[4:], size, source, fisheye=fisheye)
            best = FittedLens(lens, miss)
        if best.residual <= UNSAID / 100:
            break
    if best.residual > REFUSED:
        raise InputError(remark("programs.lens_unfit", of=source, px=best.residual))
    return best


def brown_lens(
    focal: Sequence[float],
    centre: Sequence[float],
    radial: Sequence[float],
    tangential: Sequence[float],
    size: Sequence[float],
    source: str,
    *,
    angle: Function | None = None,
    shear: FloatArray = _NO_SHEAR,
) -> FittedLens:
    """Return a lens of Brown's terms beyond OpenCV's: exact where it has them, else fitted.

    Parameters
    ----------
    focal, centre : sequence of float
        fx, fy and principal point; integers at pixel centres. [px]
    radial : sequence of float
        k1 to k4.
    tangential : sequence of float
        p1 and p2 as OpenCV's, p3 and p4: their factor 1 + p3 r² + p4 r⁴.
    size : sequence of float
        Width and height. [px]
    source : str
        For the lens file and messages.
    angle : callable, optional
        A fisheye's: angle from the axis by projected radius. [rad]
    shear : ndarray, shape (2, 2)
        Of distorted coordinates before focal lengths; of ideal ones it is left to the camera.
    """
    (k1, k2, k3, k4), (p1, p2, p3, p4) = radial, tangential
    fisheye, is_square = angle is not None, bool((shear == _NO_SHEAR).all())
    if not (any((p1, p2, p3, p4)) if fisheye else any((k4, p3, p4))) and is_square:
        terms = [k1, k2, k3, k4] if fisheye else [k1, k2, p1, p2, k3]
        if angle in (None, equidistant):
            return FittedLens(lens_data(focal, centre, terms, size, source, fisheye=fisheye))
    matrix = np.diag(focal) @ shear

    def bent(at: FloatArray) -> FloatArray:
        x, y = at[..., 0], at[..., 1]
        square, both = x * x + y * y, 2.0 * x * y
        factor, more = 1.0 + square * np.polyval([k4, k3, k2, k1], square), (p4, p3, 1.0)
        new_x = x * factor + (p1 * both + p2 * (square + 2 * x * x)) * np.polyval(more, square)
        new_y = y * factor + (p2 * both + p1 * (square + 2 * y * y)) * np.polyval(more, square)
        return np.stack([new_x, new_y], axis=-1) @ matrix.T + centre

    def ideal(pixels: FloatArray) -> FloatArray:
        at, step = (pixels - centre) @ np.linalg.inv(matrix).T, 1e-6
        with np.errstate(all="ignore"):
            for _ in range(50):  # Newton
                slopes = [(bent(at + step * axis) - bent(at - step * axis)) / (2.0 * step)
                          for axis in np.eye(2)]  # fmt: skip
                miss = pixels - bent(at)
                at = at + (inverse_2x2(np.stack(slopes, axis=-1)) @ miss[..., None])[..., 0]
            at[~(np.abs(pixels - bent(at)) < 1e-7).all(axis=-1)] = np.nan
            if angle is not None:
                radius = np.hypot(at[:, 0], at[:, 1])
                at = at * np.where(radius > 0, angle(radius) / radius, 1.0)[:, None]
        return np.asarray(at @ shear.T)

    return fitted_lens(ideal, size, source, fisheye=fisheye)


def _seen(p: FloatArray, count: int, ideal: FloatArray, *, fisheye: bool) -> FloatArray:
    """Return OpenCV's projection of (x, y) at depth 1, or of a fisheye's angles. [px]"""
    x, y = ideal.T
    terms, square = np.concatenate([p[4:], np.zeros(12 - count)]), x * x + y * y
    if fisheye:
        factor = 1.0 + square * np.polyval(terms[3::-1], square)
        out = np.column_stack([x * factor, y * factor])
    else:
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = terms
        factor = (1.0 + square * np.polyval([k3, k2, k1], square)) / (
            1.0 + square * np.polyval([k6, k5, k4], square)
        )
        decentred = 2.0 * x * y
        out = np.column_stack([
            x * factor + p1 * decentred + p2 * (square + 2 * x * x) + square * (s1 + s2 * square),
            y * factor + p2 * decentred + p1 * (square + 2 * y * y) + square * (s3 + s4 * square),
        ])  # fmt: skip
    return np.asarray(p[2:4] + p[:2] * out)
