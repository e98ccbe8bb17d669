"""Homologous points of a pair found automatically, each along its radial line.

Features of both photos are paired under the pair's geometry: the partner of a pixel lies on one
line, and how far along it is the relief. The patch around it is then matched by least squares with
one unknown, the position along that line, under the zoom k(r) that the relief implies.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import chain
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from bifocal.matching.features import (
    Features,
    drop_repeated,
    find_features,
    match_along_lines,
    spread_evenly,
)
from bifocal.matching.matches import Matches
from bifocal.matching.patches import PatchResult, refine, same_scale
from bifocal.matching.targets import SurveyTargets, find_targets
from bifocal.matching.tuning import FEATURES, MATCH
from bifocal.model import FlagLimits, Images, Pair, Photo, apply_homography
from bifocal.rays import point_on_ray, relief_of_rays, zoom_factor
from bifocal.remarks import remark
from photocore.adjustment.outliers import robust_sigma
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.errors import GeometryError


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchSettings:
    """What `match_pair` looks for.

    Attributes
    ----------
    count : int
        About so many points, spread evenly.
    relief_range : pair of float or None
        Lowest and highest relief looked for; by default -0.5 to 0.4 of the near distance. [m]
    features, targets : bool
        What is looked for.
    budget : float
        Pixels of a photo searched for features.
    """

    count: int = 4000
    relief_range: tuple[float, float] | None = None
    features: bool = True
    targets: bool = True
    budget: float = FEATURES.most_pixels


def match_pair(pair: Pair, images: Images, settings: MatchSettings | None = None) -> Matches:
    """Return homologous points spread over the façade.

    Parameters
    ----------
    pair : Pair
    images : two ndarrays, shape (h, w), uint8
        Far and near photo, grey.
    settings : MatchSettings

    Raises
    ------
    GeometryError
        If hardly anything matches: photos and pair file do not belong together; or if both photos
        can see no relief of the range.
    """
    settings = settings or MatchSettings()
    near = pair.image2.distance
    low, high = settings.relief_range or (-0.5 * near, 0.4 * near)
    reliefs = (low, min(high, MATCH.highest_share * pair.highest_relief))
    if not reliefs[0] < reliefs[1]:
        about = {"low": low, "seen": pair.highest_relief, "high": high}
        raise GeometryError(remark("match.relief_unseen", **about))
    parts = []
    if settings.targets:
        parts.append(_target_matches(pair, images, reliefs))
    if settings.features:
        parts.append(_feature_matches(pair, images, reliefs, settings))
    matches = _joined(parts)
    few = settings.features and len(matches.ids) < MATCH.fewest_matched
    if not len(matches.ids) or few:
        raise GeometryError(remark("match.too_few", count=len(matches.ids)))
    return matches


def _feature_matches(
    pair: Pair, images: Images, reliefs: tuple[float, float], settings: MatchSettings
) -> Matches:
    """Return matched features, spread evenly."""
    first, second = (find_features(image, budget=settings.budget) for image in images)
    rows1, rows2 = _guided(pair, first, second, reliefs)
    pixels1, pixels2 = first.pixels[rows1], second.pixels[rows2]
    keep = drop_repeated(pixels1, pixels2)
    pixels1, pixels2 = pixels1[keep], pixels2[keep]
    patches, misfit = refine_along_lines(pair, images, pixels1, pixels2)
    sigma = np.hypot(MATCH.optimism * patches.sigma, 0.02)
    on_line = patches.pixels2
    relief = relief_at(pair, pixels1, on_line)
    good = _accepted(pair, patches, misfit, sigma, relief, reliefs, pixels1)
    # Behind a balustrade the patch around a feature shows two depths and never agrees; the feature
    # itself was found, and its neighbours tell whether it is true.
    rest = np.nan_to_num(relief_at(pair, pixels1, pixels2), nan=np.inf)
    inside = (rest > reliefs[0]) & (rest < reliefs[1])
    predicted = seen_at(pair, pixels1, np.where(inside, rest, 0.0))
    along = directions_at(pair, pixels1, np.where(inside, rest, 0.0))
    off = ((pixels2 - predicted) * normals_of(along)).sum(axis=1)
    inside &= good.sum() >= MATCH.fewest_matched  # else pair and photos do not belong together
    kept = ~good & inside & (np.abs(off) < MATCH.feature_across * first.reduction)
    on_line = np.where(kept[:, None], predicted, on_line)
    relief, misfit = np.where(kept, rest, relief), np.where(kept, off, misfit)
    sigma = np.where(kept, MATCH.sigma_feature * first.reduction, sigma)
    good |= kept
    good[good] = _relief_supported(pixels1[good], relief[good], MATCH.relief_alike * pair.d1)
    chosen = np.flatnonzero(good)
    chosen = chosen[spread_evenly(pixels1[chosen], sigma[chosen], images[0].shape, settings.count)]
    order = np.lexsort((pixels1[chosen, 0], pixels1[chosen, 1] // 100))
    chosen = chosen[order]
    # With the misfit across the line put back, `solve` can tell honest points from blunders.
    along = directions_at(pair, pixels1, np.nan_to_num(relief))
    pixels2 = on_line + normals_of(along) * misfit[:, None]
    matches = Matches(
        pixels1=pixels1[chosen],
        pixels2=pixels2[chosen],
        sigma=sigma[chosen],
        misfit=misfit[chosen],
        agreement=patches.zncc[chosen],
        ids=tuple(f"M{number:04d}" for number in range(1, len(chosen) + 1)),
        kinds=("feature",) * len(chosen),
    )
    return _without_off_radial(pair, matches)


def _relief_supported(pixels: FloatArray, relief: FloatArray, alike: float) -> BoolArray:
    """Return which points have two or more of their eight neighbours at like relief."""
    count = min(MATCH.neighbours + 1, len(pixels))
    if count <= MATCH.supporters:
        return np.ones(len(pixels), dtype=bool)
    near = cKDTree(pixels).query(pixels, count)[1][:, 1:]
    apart = np.abs(relief[near] - relief[:, None])
    return np.asarray((apart < alike).sum(axis=1) >= MATCH.supporters)


def precision(matches: Matches) -> float:
    """Return the precision of the points: what the patches say, or the misfits if worse. [px]

    A misfit holds the noise of both photos and what the set-up leaves.
    """
    misfit = 1.4826 * float(np.median(np.abs(matches.misfit))) / np.sqrt(2.0)
    return float(np.clip(max(float(np.median(matches.sigma)), misfit), 0.01, 2.0))


def _without_off_radial(pair: Pair, matches: Matches) -> Matches:
    """Return the matches without those that `solve` would call OFF-RADIAL, by its own test."""
    limit = 0.98 * FlagLimits().off_radial  # pixels and precision are rounded in the file
    for _ in range(5):
        if not len(matches.ids):
            break
        solved = pair.intersect(matches.pixels1, matches.pixels2, sigma_px=precision(matches))
        good = ~(np.abs(solved.standardised) > limit)
        if good.all():
            break
        picked = np.flatnonzero(good)
        matches = replace(
            matches,
            **{
                column.name: getattr(matches, column.name)[picked]
                for column in fields(Matches)
                if column.name not in ("ids", "kinds")
            },
            ids=matches.ids[: len(picked)],
            kinds=matches.kinds[: len(picked)],
        )
    return matches


def _joined(parts: list[Matches]) -> Matches:
    """Return several sets of matches as one."""
    joined: dict[str, Any] = {}
    for column in fields(Matches):
        values = [getattr(part, column.name) for part in parts]
        joined[column.name] = (
            tuple(chain(*values)) if column.name in ("ids", "kinds") else np.concatenate(values)
        )
    return Matches(**joined)


def _target_matches(pair: Pair, images: Images, reliefs: tuple[float, float]) -> Matches:
    """Return survey targets seen in both photos; coded ones keep their code as name."""
    first, second = find_targets(images[0]), find_targets(images[1])
    rows1, rows2 = pair_targets(pair, first, second, reliefs)
    pixels1, pixels2 = first.pixels[rows1], second.pixels[rows2]
    kinds = tuple(first.kinds[row] for row in rows1)
    patches, misfit = refine_along_lines(pair, images, pixels1, pixels2)
    # A disc's or code's own centre beats the patch around it; a chequer's crossing does not.
    round_ones = np.array([kind != "chequer" for kind in kinds], dtype=bool)
    pixels2 = np.where(round_ones[:, None], pixels2, patches.pixels2)
    relief = relief_at(pair, pixels1, pixels2)
    on_line = seen_at(pair, pixels1, relief)
    off = np.linalg.norm(pixels2 - on_line, axis=1)
    sigma = np.where(round_ones, 0.02, np.hypot(MATCH.optimism * patches.sigma, 0.03))
    good = (
        (patches.zncc > MATCH.least_agreement)
        & (round_ones | patches.converged)
        & np.isfinite(relief)
    )
    good &= (relief > reliefs[0]) & (relief < reliefs[1]) & (sigma < 0.3)
    order = np.flatnonzero(good)
    order = order[np.lexsort((pixels1[order, 0], pixels1[order, 1] // 100))]
    names, number = [], 0
    for row in order:
        code = first.codes[rows1[row]]
        number += not code
        names.append(code or f"T{number:03d}")
    return Matches(
        pixels1=pixels1[order],
        pixels2=pixels2[order],
        sigma=sigma[order],
        misfit=np.where(round_ones, off, np.nan_to_num(misfit))[order],
        agreement=patches.zncc[order],
        ids=tuple(names),
        kinds=tuple(kinds[row] for row in order),
    )


def pair_targets(
    pair: Pair, first: SurveyTargets, second: SurveyTargets, reliefs: tuple[float, float]
) -> tuple[IntArray, IntArray]:
    """Return indices of the same targets in both photos.

    Coded ones by their code; others if exactly one of the same kind, colour and size (under the
    zoom its relief implies) lies on the radial line.
    """
    count1, count2 = len(first.codes), len(second.codes)
    if not (count1 and count2):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    x1 = np.repeat(first.pixels, count2, axis=0)
    x2 = np.tile(second.pixels, (count1, 1))
    relief = relief_at(pair, x1, x2)
    fits = np.isfinite(relief) & (relief > reliefs[0]) & (relief < reliefs[1])
    usable = np.clip(np.nan_to_num(relief), *reliefs)
    off = np.linalg.norm(seen_at(pair, x1, usable) - x2, axis=1)
    zoom = np.sqrt(np.abs(np.linalg.det(local_zoom(pair, x1, usable))))
    grown = np.repeat(first.size, count2) * zoom / np.tile(second.size, count1)
    fits &= (off < 2.0) & (grown > 0.8) & (grown < 1.25)
    table = fits.reshape(count1, count2)
    kinds1, kinds2 = np.array(first.kinds), np.array(second.kinds)
    table &= kinds1[:, None] == kinds2[None, :]
    table &= first.dark[:, None] == second.dark[None, :]
    codes1, codes2 = np.array(first.codes), np.array(second.codes)
    coded = (codes1 != "")[:, None] | (codes2 != "")[None, :]
    table = np.where(coded, codes1[:, None] == codes2[None, :], table)
    alone = table & (table.sum(axis=1) == 1)[:, None] & (table.sum(axis=0) == 1)[None, :]
    rows1, rows2 = np.nonzero(alone)
    return rows1.astype(np.int64), rows2.astype(np.int64)


def seen_at(pair: Pair, pixels1: FloatArray, relief: FloatArray | float) -> FloatArray:
    """Return where photo 2 sees the points of photo 1 if they have a given relief. [px]"""
    if pair.refracted:
        positions = pair.image1.apparent_from_pixels(pixels1)
        heights = np.broadcast_to(np.asarray(relief, dtype=np.float64), positions.shape[:-1])
        return pair.image2.project(point_on_ray(positions, heights, pair.image1.foot))
    centre = pair.zoom_centre
    factor = zoom_factor(
        np.asarray(relief, dtype=np.float64), d1=pair.image1.distance, d2=pair.image2.distance
    )
    q1 = pair.image1.plane_from_pixels(pixels1)
    q2 = centre + np.asarray(factor)[..., None] * (q1 - centre)
    return np.asarray(pair.image2.pixels_from_plane(q2))


def relief_at(pair: Pair, pixels1: FloatArray, pixels2: FloatArray) -> FloatArray:
    """Return the relief of point pairs (not adjusted across the line). [m]"""
    return relief_of_rays(
        pair.image1.apparent_from_pixels(pixels1),
        pair.image2.apparent_from_pixels(pixels2),
        pair.image1.foot,
        pair.image2.foot,
    )


def _ideal(photo: Photo, pixels: FloatArray) -> FloatArray:
    return pixels if photo.lens is None else photo.lens.undistort(pixels)


def _guided(
    pair: Pair, first: Features, second: Features, reliefs: tuple[float, float]
) -> tuple[IntArray, IntArray]:
    """Return features paired along their radial lines."""
    ends = [_ideal(pair.image2, seen_at(pair, first.pixels, relief)) for relief in reliefs]
    ideal = replace(second, pixels=_ideal(pair.image2, second.pixels))
    across = 1.5 + second.reduction
    expected = (ends[0], ends[1])
    to_pixels = np.linalg.inv(pair.image2.plane_from_pixel)
    epipole = apply_homography(to_pixels, np.asarray(pair.zoom_centre))
    rows1, rows2 = match_along_lines(first, ideal, epipole, expected, across=across)
    return rows1.astype(np.int64), rows2.astype(np.int64)


def pixels_per_relief(pair: Pair, pixels1: FloatArray, relief: FloatArray) -> FloatArray:
    """Return how a point moves in photo 2 as its relief grows, shape (n, 2). [px/m]"""
    step = 1e-3 * pair.image2.distance
    shift = seen_at(pair, pixels1, relief + step) - seen_at(pair, pixels1, relief - step)
    return shift / (2 * step)


def directions_at(pair: Pair, pixels1: FloatArray, relief: FloatArray) -> FloatArray:
    """Return unit vectors in photo 2 along which a point moves as its relief grows, (n, 2)."""
    rate = pixels_per_relief(pair, pixels1, relief)
    with np.errstate(divide="ignore", invalid="ignore"):
        return rate / np.linalg.norm(rate, axis=1, keepdims=True)


def normals_of(along: FloatArray) -> FloatArray:
    """Return unit vectors turned by a quarter, square to lines along which points move, (n, 2)."""
    return np.stack([-along[:, 1], along[:, 0]], axis=1)


def local_zoom(pair: Pair, pixels1: FloatArray, relief: FloatArray) -> FloatArray:
    """Return the derivative of photo 2 by photo 1 under the zoom k(r), shape (n, 2, 2)."""
    factor = zoom_factor(relief, d1=pair.image1.distance, d2=pair.image2.distance)
    metres1 = raw_metres(pair.image1, pixels1)
    metres2 = raw_metres(pair.image2, seen_at(pair, pixels1, relief))
    if pair.refracted:
        metres1 = raw_metres(pair.image1, pixels1, relief)
        metres2 = raw_metres(pair.image2, seen_at(pair, pixels1, relief), relief)
        factor = np.where(np.isfinite(metres2).all(axis=(1, 2)), 1.0, np.nan)
    bad = ~(np.abs(np.linalg.det(np.nan_to_num(metres2))) > 0) | ~np.isfinite(factor)
    metres2[bad] = np.eye(2)
    return np.nan_to_num(np.linalg.inv(metres2) @ metres1 * factor[:, None, None])


def raw_metres(photo: Photo, pixels: FloatArray, relief: FloatArray | float = 0.0) -> FloatArray:
    """Return the derivative of points at a relief by the raw pixel, lens included. [m/px]"""
    metres = photo.metres_per_pixel(pixels, relief)
    if photo.lens is None:
        return np.array(metres)
    return metres @ np.linalg.inv(photo.lens.distorted_by_ideal(_ideal(photo, pixels)))


def refine_along_lines(
    pair: Pair, images: Images, pixels1: FloatArray, pixels2: FloatArray
) -> tuple[PatchResult, FloatArray]:
    """Return matches refined along their radial lines, and how far off the line they fit best.

    Parameters
    ----------
    pair : Pair
    images : two ndarrays, uint8
    pixels1, pixels2 : ndarray, shape (n, 2)
        Approximate matches.

    Returns
    -------
    result : PatchResult
    misfit : ndarray, shape (n,)
        [px]
    """
    relief = np.nan_to_num(relief_at(pair, pixels1, pixels2))
    highest = min(0.9 * pair.image2.distance, MATCH.highest_share * pair.highest_relief)
    relief = np.clip(relief, -3 * pair.image2.distance, highest)
    # On the line, at the relief nearest to the approximate match.
    start = seen_at(pair, pixels1, relief)
    local = local_zoom(pair, pixels1, relief)
    along = directions_at(pair, pixels1, relief)
    along = np.where(np.isfinite(along), along, [1.0, 0.0])
    smooth1, smooth2 = same_scale(*images, local)
    basis = along[:, :, None]
    patches = refine(smooth1, smooth2, pixels1, start, local, basis)
    across = normals_of(along)
    both = np.stack([along, across], axis=2)
    free = refine(smooth1, smooth2, pixels1, patches.pixels2, local, both, iterations=4)
    misfit = ((free.pixels2 - patches.pixels2) * across).sum(axis=1)
    return patches, np.where(free.converged, misfit, np.nan)


def _accepted(
    pair: Pair,
    patches: PatchResult,
    misfit: FloatArray,
    sigma: FloatArray,
    relief: FloatArray,
    reliefs: tuple[float, float],
    pixels1: FloatArray,
) -> BoolArray:
    """Return which matches to believe."""
    good = patches.converged & (patches.zncc > MATCH.least_agreement) & (sigma < 0.5)
    good &= np.isfinite(misfit) & (relief > reliefs[0]) & (relief < reliefs[1])
    if not good.any():
        return np.asarray(good)
    # Honest misfits across the line show what the pair's geometry and the patches are good for.
    usual = max(robust_sigma(misfit[good]), 0.05)
    good &= np.abs(misfit) < np.maximum(3.5 * usual, 0.3)
    rate = np.linalg.norm(pixels_per_relief(pair, pixels1, relief), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        good &= sigma / rate < 0.05 * pair.image2.distance
    return np.asarray(good)
