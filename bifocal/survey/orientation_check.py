"""What points on the reference plane tell about the orientation, and the correction that follows.

A point with r = 0 has the same plane position in both photos. Where marked points disagree, the
photos differ in scale, rotation, shift or tilt; each of these reads as false relief.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from bifocal import rays
from bifocal.model import Pair, apply_homography
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray, as_points
from photocore.errors import GeometryError, InputError

#: The differences that are looked for, tilts only with `MINIMUM_FOR_TILT` points.
NAMES = ("scale", "rotation", "shift X", "shift Y", "tilt X", "tilt Y")
#: Residuals of this share of their sigma are rounding: the points fit exactly.
ROUNDING = 1e-9
#: Points that move against the plane by more than this many sigma show the centre of zoom.
OFF_PLANE = 10.0
#: Tilt needs this many points: 6 unknowns, 2 observations a point, and some redundancy.
MINIMUM_FOR_TILT = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class OrientationParameter:
    """One difference between the photos.

    Attributes
    ----------
    name : str
        ``scale``, ``rotation``, ``shift X``, ``shift Y``, ``tilt X``, ``tilt Y``.
    value, sigma : float
        In the given unit; image 2 against image 1.
    unit : str
        ``%``, ``deg`` or ``mm`` on the wall.
    false_relief : float
        Largest false relief it causes within the photo, not counting the zone close to the
        nadir. [m]
    """

    name: str
    value: float
    sigma: float
    unit: str
    false_relief: float

    @property
    def is_significant(self) -> bool:
        """Whether the value exceeds three times its standard deviation."""
        return abs(self.value) > 3 * self.sigma


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OrientationCheck:
    """Differences of the photos, found from points on the reference plane.

    Attributes
    ----------
    parameters : tuple of OrientationParameter
    matrix : ndarray, shape (3, 3)
        Homography on the plane that brings positions of image 2 onto those of image 1.
    residuals : ndarray, shape (n, 2)
        What is left after the correction. [m]
    outliers : tuple of str
        Marked points that do not lie on the plane (or are mispicked); not used.
    points : int
        Points used.
    sigma0 : float
        A posteriori over a priori standard deviation of a pick.
    corrected : Pair
        The pair with image 2 corrected.
    """

    parameters: tuple[OrientationParameter, ...]
    matrix: FloatArray
    residuals: FloatArray
    outliers: tuple[str, ...]
    points: int
    sigma0: float
    corrected: Pair

    @property
    def remarks(self) -> tuple[str, ...]:
        """The findings in words a surveyor acts on."""
        lines = [
            remark(
                f"survey.plane_parameter{'' if p.is_significant else '_nothing'}", name=p.name,
                value=p.value, unit=p.unit, sigma=p.sigma, relief=abs(p.false_relief) * 1000,
            )
            for p in self.parameters
        ]  # fmt: skip
        if not any(p.name.startswith("tilt") for p in self.parameters):
            lines.append(remark("survey.no_tilt", count=MINIMUM_FOR_TILT))
        lines += [remark("survey.off_plane", name=name) for name in self.outliers]
        return tuple(lines)


def check_orientation(
    pair: Pair,
    pixels1: ArrayLike,
    pixels2: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    sigma_px: float | None = None,
) -> OrientationCheck:
    """Find scale mismatch, rotation, shift and tilt between the photos from plane points.

    Parameters
    ----------
    pair : Pair
        The orientation as assumed.
    pixels1, pixels2 : array_like, shape (n, 2)
        The same points of the reference plane (r = 0) in both photos, n >= 2. [px]
    names : sequence of str, optional
        Their names, for messages.
    sigma_px : float, optional
        Measuring precision; default the pair's, else 0.5. [px]

    Returns
    -------
    OrientationCheck

    Raises
    ------
    InputError
        If fewer than two points are given.
    GeometryError
        If the points coincide, so that nothing but the shift could be told.

    Notes
    -----
    Least squares on ``q1 = G q2`` with G = scale, rotation, shift and, from five points on, the two
    projective terms of a tilt; weighted by the picks' precision in both photos. Points beyond
    four sigma (robustly scaled) are left out one by one, worst first. Through media q1 is where
    photo 2 would show the place that photo 1 sees, its ray going straight on: there its homography
    counts. Shift and tilt are counted at the near nadir. Scale: false relief ``eps B`` everywhere;
    shift t: ``t B / s'`` at a fifth of the points' largest radius; tilt p: ``p s' B`` at that
    radius. Rotation moves points across the radius and makes no relief.
    """
    first = as_points(pixels1, "pixels1", dimension=2)
    second = as_points(pixels2, "pixels2", dimension=2)
    labels = list(names) if names is not None else [str(i + 1) for i in range(len(first))]
    measured: BoolArray = np.isfinite(np.hstack([first, second])).all(axis=1)
    if measured.sum() < 2:
        raise InputError(remark("survey.few_plane_points", count=int(measured.sum())))
    origin = pair.image2.nadir
    places = pair.image1.plane_from_pixels(first)
    q1 = rays.apparent_of_plane(places, pair.image2.foot) - origin
    q2 = pair.image2.apparent_from_pixels(second) - origin
    sigma = pair.image2.precision(sigma_px or pair.image2.sigma_pixel or pair.image1.sigma_pixel)
    weight = _root_weights(pair, first, second, sigma)
    used = measured.copy()
    while True:
        values, covariance, scaled, rest = _fit(q1, q2, weight, used)
        worst, limit = _worst(scaled, used)
        if worst is None or used.sum() <= 4 or scaled[worst] <= limit:
            break
        used[worst] = False
    matrix = _mapped(values, q2)[0]
    shift = np.array([[1, 0, origin[0]], [0, 1, origin[1]], [0, 0, 1]])
    plane = shift @ matrix @ np.linalg.inv(shift)
    redundancy = 2 * int(used.sum()) - len(values)
    sigma0 = float(np.sqrt((scaled[used] ** 2).sum() / redundancy)) if redundancy > 0 else 1.0
    radius = float(np.hypot(*q2[used].T).max())
    corrected = replace(pair.image2, plane_from_pixel=plane @ pair.image2.plane_from_pixel)
    return OrientationCheck(
        parameters=_parameters(values, np.sqrt(np.diag(covariance)), pair, radius),
        matrix=plane,
        residuals=rest,
        outliers=tuple(labels[i] for i in np.flatnonzero(measured & ~used)),
        points=int(used.sum()),
        sigma0=sigma0,
        corrected=replace(pair, image2=corrected),
    )


def zoom_centre_of_points(
    pair: Pair, q1: FloatArray, q2: FloatArray, sigma: FloatArray | float
) -> tuple[FloatArray, FloatArray] | None:
    """Return the centre of zoom that points off the plane show, and its covariance.

    Parameters
    ----------
    pair : Pair
        Corrected by its plane points.
    q1, q2 : ndarray, shape (n, 2)
        Where the rays of both photos meet the plane. [m]
    sigma : float or ndarray, shape (n,)
        Precision of either position. [m]

    Returns
    -------
    centre : ndarray, shape (2,)
        [m]
    covariance : ndarray, shape (2, 2)
        [m²]
        None instead of both where fewer than three points stand off the plane, or they do not
        determine it.

    Notes
    -----
    q1, q2 and e lie on one line, ``(q1 - e) x (q2 - e) = 0``, which is linear in e:
    ``e x (q2 - q1) = q1 x q2``. Robust: residuals beyond three sigma count less (Huber).
    """
    finite = np.isfinite(np.hstack([q1, q2])).all(axis=1)
    q1, q2 = q1[finite], q2[finite]
    sigma = np.asarray(np.broadcast_to(sigma, finite.shape)[finite])
    move = q2 - q1
    off = np.linalg.norm(move, axis=1) > OFF_PLANE * sigma
    if off.sum() < 3:
        return None
    rows = np.column_stack([move[:, 1], -move[:, 0]])[off]
    side = (q1[:, 0] * q2[:, 1] - q1[:, 1] * q2[:, 0])[off]
    centre, usual = pair.zoom_centre, np.ones(int(off.sum()))
    for _ in range(10):
        away1, away2 = q1[off] - centre, q2[off] - centre
        spread = sigma[off] * np.sqrt((away1**2).sum(axis=1) + (away2**2).sum(axis=1))
        weight = usual / np.maximum(spread, 1e-12) ** 2
        normal = (rows * weight[:, None]).T @ rows
        if np.linalg.cond(normal) > 1e8:
            return None
        centre = np.linalg.solve(normal, rows.T @ (weight * side))
        misses = np.abs(rows @ centre - side) / np.maximum(spread, 1e-12)
        unit = max(1.4826 * float(np.median(misses)), 1.0)
        usual = np.minimum(1.0, 3.0 * unit / np.maximum(misses, 1e-12))
    return centre, np.linalg.inv(normal) * unit**2


def with_zoom_centre(pair: Pair, centre: FloatArray) -> Pair:
    """Return the pair with its near nadir moved so that relief spreads from a centre of zoom.

    e = (d1 N2 - d2 N1) / (d1 - d2); the far nadir stays where it was stated.
    """
    nadir = (centre * (pair.d1 - pair.d2) + pair.d2 * pair.image1.nadir) / pair.d1
    return replace(pair, image2=replace(pair.image2, nadir=nadir))


def _root_weights(pair: Pair, first: FloatArray, second: FloatArray, sigma: float) -> FloatArray:
    """Return matrices that make differences of apparent positions unit normal, (n, 2, 2)."""
    covariance = np.zeros((len(first), 2, 2))
    by_pixel = pair.image1.metres_per_pixel(first)
    if pair.refracted:
        places = pair.image1.plane_from_pixels(first)
        on_plane = np.column_stack([places, np.zeros(len(places))])
        by_pixel = rays.design_rows(on_plane, pair.image2.foot)[:, :, :2] @ by_pixel
    for metres in (by_pixel, pair.image2.apparent_by_pixel(second)):
        covariance += metres @ metres.transpose(0, 2, 1) * sigma**2
    safe = np.where(np.isfinite(covariance), covariance, np.eye(2))
    inverse_root: FloatArray = np.linalg.inv(np.linalg.cholesky(safe))
    return inverse_root


def _mapped(values: FloatArray, q2: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the homography of (scale, rotation, shift X, shift Y[, tilt X, tilt Y]) at work.

    Returns
    -------
    matrix : ndarray, shape (3, 3)
    mapped : ndarray, shape (n, 2)
    jacobian : ndarray, shape (n, 2, 4 or 6)
    """
    stretch, sine, cosine = 1.0 + values[0], np.sin(values[1]), np.cos(values[1])
    turn = np.array([[cosine, sine], [-sine, cosine]])
    matrix = np.eye(3)
    matrix[:2, :2], matrix[:2, 2] = stretch * turn, values[2:4]
    matrix[2, :2] = values[4:] if len(values) == 6 else 0.0
    mapped = apply_homography(matrix, q2)
    by_rotation = stretch * np.array([[-sine, cosine], [-cosine, -sine]])
    shift = np.broadcast_to(np.eye(2), (len(q2), 2, 2))
    columns = [(q2 @ turn.T)[..., None], (q2 @ by_rotation.T)[..., None], shift]
    if len(values) == 6:
        columns.append(-mapped[:, :, None] * q2[:, None, :])
    scale = q2 @ matrix[2, :2] + 1.0
    return matrix, mapped, np.concatenate(columns, axis=2) / scale[:, None, None]


def _fit(
    q1: FloatArray, q2: FloatArray, weight: FloatArray, used: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return parameters, their covariance, each point's size of residual in sigma, and residuals.

    Residual sizes are root mean squares over the two coordinates, so that 1 is usual.
    """
    from photocore import adjustment  # brings scipy, which only plane points need

    names = NAMES if used.sum() >= MINIMUM_FOR_TILT else NAMES[:4]

    def equations(values: FloatArray) -> adjustment.DenseEquations:
        _, mapped, by = _mapped(values, q2[used])
        misfit = weight[used] @ (mapped - q1[used])[:, :, None]
        by = (weight[used] @ by).reshape(-1, len(names))
        return adjustment.DenseEquations(residuals=misfit.ravel(), jacobian=by)

    try:
        fit = adjustment.fit(
            np.zeros(len(names)),
            equations,
            np.add,
            names=names,
            what="set-up check",
            rounding=ROUNDING,
        )
    except GeometryError:
        raise GeometryError(remark("survey.plane_in_line")) from None
    rest = q1 - _mapped(fit.state, q2)[1]
    scaled = np.linalg.norm((weight @ rest[:, :, None])[:, :, 0], axis=1)
    return fit.state, fit.linear.cofactor, scaled, rest


def _worst(scaled: FloatArray, used: BoolArray) -> tuple[int | None, float]:
    """Return the point that fits worst and the limit it has to keep."""
    from photocore.adjustment import OUTLIER_DISTANCE  # brings scipy, as above

    if used.sum() < 4:
        return None, np.inf
    # Robust unit: the median of |N2| is 1.177; never finer than a quarter of the given sigma.
    unit = max(float(np.median(scaled[used])) / 1.177, 0.25)
    worst = int(np.argmax(np.where(used, scaled, -1.0)))
    return worst, OUTLIER_DISTANCE * unit


def _parameters(
    values: FloatArray, sigmas: FloatArray, pair: Pair, radius: float
) -> tuple[OrientationParameter, ...]:
    """Return the parameters in a surveyor's units with the false relief each one causes."""
    base, distance = pair.base_factor, pair.d2
    # What lies on the wall seems displaced by more, or less, where its rays are bent.
    wall = 1000.0 * rays.seen_distance(pair.image2.foot) / distance
    inner = radius / 5
    # The correction maps image 2 onto image 1: image 2 itself deviates by the opposite.
    values = np.concatenate([[values[0] / (1 + values[0])], values[1:]])
    degrees = float(np.degrees(1.0))
    table = [(100.0, "%", base), (degrees, "deg", 0.0)]
    table += [(wall, "mm", base / inner)] * 2 + [(degrees * distance, "deg", -base * radius)] * 2
    return tuple(
        OrientationParameter(
            name=name,
            value=float(-value * factor),
            sigma=float(sigma * factor),
            unit=unit,
            false_relief=float(-value * effect),
        )
        for name, (factor, unit, effect), value, sigma in zip(
            NAMES, table, values, sigmas, strict=False
        )
    )
