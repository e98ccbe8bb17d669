"""Intersecting the rays of a set of photos: one least-squares point, and which pick is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bifocal import rays
from bifocal.model.flags import FlagLimits, point_flags
from bifocal.model.intersection import Intersection, MeasuredPoints, PlanePicks, inverse_3x3
from bifocal.model.orientation_precision import independent, pixel_rates
from bifocal.model.photo import Photo
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera import inverse_2x2

#: The third correction of a point is below 1e-9 of the first.
_ITERATIONS = 4
#: What a point may do counts as unknown: so many times its variance are added to the misfits'.
_FREE = 1e6
#: A photo is suspected while leaving it out explains the misfits no worse than this: the 95 %
#: point of chi² with the two degrees of freedom of a pick.
_AS_LIKELY = 5.99
#: Points whose misfits are tested at once: 20 photos take 100 MB.
_AT_ONCE = 4000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SetIntersection(MeasuredPoints):
    """Points in the plane frame from two or more photos of a set of m, with their precision.

    Attributes
    ----------
    standardised : ndarray, shape (n,)
        Of two rays their misfit over its standard deviation, as the pair's; of more the normal
        deviate as improbable as all their misfits together.
    residuals : ndarray, shape (n, m, 2)
        Observed minus adjusted (column, row) in every photo; NaN where not measured. [px]
    slips : ndarray, shape (n, m)
        By how much each pick would have to be wrong, alone, to explain the misfits; NaN of points
        of two rays, whose misfit may be either's. [px]
    suspects : ndarray of bool, shape (n, m)
        Picks that may be the wrong one where a point is flagged OFF-RADIAL: they explain the
        misfits as well as any. Several where rays cannot tell, as along the radius of three photos
        on one axis.
    own_covariance : ndarray, shape (n, 3, 3)
        What of the covariance is each point's own, from its picks. [m²]
    effect : ndarray, shape (n, 3, k), or None
        What independent errors of the orientation, of sigma 1, move each point by, the same k
        errors for all; None where its covariance is not known. [m]
    """

    residuals: FloatArray
    slips: FloatArray
    suspects: BoolArray
    own_covariance: FloatArray
    effect: FloatArray | None = None

    def with_pair(
        self, places: IntArray, photos: tuple[int, int], points: Intersection
    ) -> SetIntersection:
        """Return the same with some points as the pair of two of the photos has them."""
        parts = {
            name: getattr(self, name).copy()
            for name in ("xyz", "covariance", "standardised", "residuals", "slips", "suspects")
        }
        for name in ("xyz", "covariance", "standardised"):
            parts[name][places] = getattr(points, name)
        parts["residuals"][places[:, None], photos] = points.residuals.reshape(-1, 2, 2)
        parts["slips"][places], parts["suspects"][places] = np.nan, False
        flags = np.array(self.flags, dtype=object)
        flags[places] = points.flags
        return replace(self, **parts, flags=tuple(flags.tolist()))

    def among(self, numbers: Sequence[int], count: int) -> SetIntersection:
        """Return the same of a set of ``count`` photos, those of these numbers among them."""
        whole: dict[str, Any] = {}
        for name, blank in (("residuals", np.nan), ("slips", np.nan), ("suspects", False)):
            part, axis = getattr(self, name), -2 if name == "residuals" else -1
            shape = list(part.shape)
            shape[axis] = count
            whole[name] = np.full(shape, blank)
            np.moveaxis(whole[name], axis, 0)[list(numbers)] = np.moveaxis(part, axis, 0)
        return replace(self, **whole)


def intersect_rays(
    photos: Sequence[Photo],
    pixels: Sequence[FloatArray],
    *,
    sigma_px: float | None,
    limits: FlagLimits,
    orientation: FloatArray | None,
) -> SetIntersection:
    """Intersect all rays of every point; see `bifocal.PhotoSet.intersect`.

    Parameters
    ----------
    photos : sequence of Photo
    pixels : sequence of ndarray, shape (n, 2)
        Of the same points in each; NaN where not measured.
    sigma_px : float, optional
        Measuring precision; by default each photo's own.
    limits : FlagLimits
        Where the flags begin.
    orientation : ndarray, shape (k, k), or None
        Covariance of all photos (`names_of`).

    Notes
    -----
    Gauss-Newton on plane positions, weighted by the precision of the picks carried there, from
    where the rays ``A + r S`` pass each other closest: both are linear in (X, Y, r). With the
    covariance C of all picks of a point, that of the orientation included, and its design A, the
    misfits v are tested by ``v' M v``, ``M = (C + 1e6 A Q A')⁻¹``: chi² of as many degrees of
    freedom as rays are redundant. Leaving out photo k lowers it by ``u' M_kk⁻¹ u`` with ``u = (M
    v)_k``, and ``M_kk⁻¹ u`` is the slip that would explain it [1]_.

    References
    ----------
    .. [1] Baarda, "A testing procedure for use in geodetic networks", 1968, for two coordinates.
    """
    picks = [photo.picks(own, sigma_px) for photo, own in zip(photos, pixels, strict=True)]
    picked = np.stack([np.isfinite(pick.positions).all(axis=1) for pick in picks], axis=1)
    weights = [_weights(pick, own) for pick, own in zip(picks, picked.T, strict=True)]
    xyz, cofactor = _closest(picks, weights, picked)
    for _ in range(_ITERATIONS):
        rows = [
            _blank(rays.design_rows(xyz, pick.foot), own)
            for pick, own in zip(picks, picked.T, strict=True)
        ]
        miss = [_blank(_miss(pick, xyz), own) for pick, own in zip(picks, picked.T, strict=True)]
        step, cofactor = _solved(rows, miss, weights)
        xyz = xyz + step
    count = picked.sum(axis=1)
    undetermined = (count >= 2) & np.isnan(cofactor[:, 0, 0])
    xyz[undetermined | (count < 2)] = np.nan
    for pick, own in zip(picks, picked.T, strict=True):
        xyz[own & ~rays.is_before(xyz, pick.foot)] = np.nan
    per_metre = [inverse_2x2(pick.metres_per_pixel) for pick in picks]
    shifts = [by @ _miss(pick, xyz)[..., None] for by, pick in zip(per_metre, picks, strict=True)]
    residuals = np.stack([shift[..., 0] for shift in shifts], axis=1)
    finite = np.asarray(np.isfinite(xyz).all(axis=1))
    sigmas = np.array([pick.sigma_px for pick in picks])
    own, total = np.full((len(xyz), 3, 3), np.nan), np.full(len(xyz), np.nan)
    root = None if orientation is None else independent(orientation)
    effect = None if root is None else np.full((len(xyz), 3, len(root)), np.nan)
    slips, saved = np.full((2, *picked.shape), np.nan)
    for start in range(0, len(xyz), _AT_ONCE):
        part = start + np.flatnonzero(finite[start : start + _AT_ONCE])
        own[part], moved, total[part], slips[part], saved[part] = _precision_and_tests(
            photos, xyz[part], residuals[part], picked[part], sigmas, root
        )
        if effect is not None:
            effect[part] = moved
    covariance = own if effect is None else own + effect @ effect.transpose(0, 2, 1)
    standardised, redundant = _deviate(total, 2 * count - 3), count > 2
    distances = np.array([photo.distance for photo in photos])
    flags = point_flags(
        at_nadir=undetermined,
        standardised=standardised,
        incomplete=_incomplete(pixels, picked),
        relief=xyz[:, 2],
        sigma_r=np.sqrt(covariance[:, 2, 2]),
        near_distance=np.where(picked, distances, np.inf).min(axis=1),
        limits=limits,
        redundant=redundant,
    )
    wrong = redundant & (np.array(flags, dtype=object) == "OFF-RADIAL")
    most = np.where(np.isnan(saved), -np.inf, saved).max(axis=1)
    return SetIntersection(
        xyz=xyz,
        covariance=covariance,
        residuals=residuals,
        standardised=standardised,
        slips=np.where(redundant[:, None], slips, np.nan),
        suspects=wrong[:, None] & (saved > most[:, None] - _AS_LIKELY),
        own_covariance=own,
        effect=effect,
        flags=flags,
        sigma_px=float(np.sqrt(np.mean(sigmas**2))),
    )


def _incomplete(pixels: Sequence[FloatArray], seen: BoolArray) -> BoolArray:
    """Tell which points have fewer than two rays, or a pick beyond the horizon of its photo."""
    picked = np.stack([np.isfinite(part).all(axis=1) for part in pixels], axis=1)
    return np.asarray((seen.sum(axis=1) < 2) | (picked & ~seen).any(axis=1))


def _miss(pick: PlanePicks, xyz: FloatArray) -> FloatArray:
    """Return observed minus computed plane positions, shape (n, 2). [m]"""
    return np.asarray(pick.positions - rays.plane_position(xyz, pick.foot))


def _blank(values: FloatArray, picked: BoolArray) -> FloatArray:
    """Return values with zeros where a photo has no pick."""
    return np.where(picked.reshape(-1, *(1,) * (values.ndim - 1)), values, 0.0)


def _weights(pick: PlanePicks, picked: BoolArray) -> FloatArray:
    """Return the inverse covariance of plane positions, zero where there is none, (n, 2, 2)."""
    return _blank(inverse_2x2(pick.covariance), picked)


def _closest(
    picks: Sequence[PlanePicks], weights: Sequence[FloatArray], picked: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return where the rays, lines over relief, pass each other closest, (n, 3), and cofactors."""
    rows, places = [], []
    for pick, rows_seen in zip(picks, picked.T, strict=True):
        ray = rays.object_rays(pick.positions, pick.foot)
        design = np.zeros((len(rows_seen), 2, 3))
        design[:, 0, 0] = design[:, 1, 1] = 1.0
        design[:, :, 2] = -ray.slope
        rows.append(_blank(design, rows_seen))
        places.append(_blank(ray.position, rows_seen))
    return _solved(rows, places, weights)


def _solved(
    rows: Sequence[FloatArray], values: Sequence[FloatArray], weights: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return weighted least-squares solutions (n, 3) and their cofactors; NaN where singular."""
    normal, right = np.zeros((len(rows[0]), 3, 3)), np.zeros((len(rows[0]), 3, 1))
    for design, value, weight in zip(rows, values, weights, strict=True):
        product = design.transpose(0, 2, 1) @ weight
        normal += product @ design
        right += product @ value[..., None]
    cofactor = inverse_3x3(normal)
    return (cofactor @ right)[..., 0], cofactor


def _precision_and_tests(
    photos: Sequence[Photo],
    xyz: FloatArray,
    residuals: FloatArray,
    picked: BoolArray,
    sigmas: FloatArray,
    root: FloatArray | None,
) -> tuple[FloatArray, ...]:
    """Return own covariances, effect of the orientation, v'Mv, slips, what each photo's saves."""
    points, count = residuals.shape[:2]
    design, by_orientation = pixel_rates(photos, xyz)
    rows = np.repeat(picked, 2, axis=1)
    design = np.where(rows[..., None], design, 0.0)
    weight = np.where(rows, np.repeat(sigmas, 2) ** -2.0, 0.0)
    gain = design.transpose(0, 2, 1) * weight[:, None]
    covariance = inverse_3x3(gain @ design)
    of_picks = np.zeros((points, 2 * count, 2 * count))
    np.einsum("nii->ni", of_picks)[:] = np.where(rows, np.repeat(sigmas, 2) ** 2, 1.0)
    spread = of_picks + _FREE * design @ covariance @ design.transpose(0, 2, 1)
    effect = np.zeros((points, 3, 0))
    if root is not None:
        rates = np.where(rows[..., None], by_orientation, 0.0) @ root
        effect = -covariance @ gain @ rates
        spread = spread + rates @ rates.transpose(0, 2, 1)
    inverse = np.linalg.inv(spread)
    miss = np.where(picked[..., None], residuals, 0.0).reshape(points, 2 * count, 1)
    pull = inverse @ miss
    total = (miss * pull).sum(axis=(1, 2))
    numbers = np.arange(count)
    blocks = inverse.reshape(points, count, 2, count, 2)[:, numbers, :, numbers].transpose(
        1, 0, 2, 3
    )
    pulls = pull.reshape(points, count, 2)
    slip = (np.linalg.inv(blocks) @ pulls[..., None])[..., 0]
    saved = (slip * pulls).sum(axis=-1)
    blank = np.where(picked, 1.0, np.nan)
    return covariance, effect, total, np.linalg.norm(slip, axis=-1) * blank, saved * blank


def _deviate(total: FloatArray, degrees: FloatArray) -> FloatArray:
    """Return the normal deviate as improbable, both sides, as chi² of some degrees of freedom."""
    from scipy.special import ndtri_exp  # late: a survey of pairs does without scipy
    from scipy.stats import chi2

    return np.asarray(-ndtri_exp(chi2.logsf(total, np.maximum(degrees, 1)) - np.log(2.0)))
