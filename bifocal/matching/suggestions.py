"""The homologous point of one pick: searched along its radial line, then matched to 0.05 px."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from bifocal.matching.matching import directions_at, local_zoom, seen_at
from bifocal.matching.patches import PatchResult, refine, same_scale
from bifocal.matching.tuning import MATCH, SUGGESTIONS
from bifocal.model import Pair
from bifocal.rays import point_on_ray, relief_from_zoom, zoom_factor
from photocore.arrays import ByteArray, Float32Array, FloatArray
from photocore.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Suggestion:
    """Where the other photo shows what was picked.

    Attributes
    ----------
    pixel : ndarray, shape (2,)
        In the other photo. [px]
    score : float
        Correlation of both patches, up to 1.
    quality : float
        0 to 1: how well they agree, and how much better than anywhere else on the line.
    sigma_px : float
        Precision along the line. [px]
    misfit_px : float
        How far off the line it fits best. [px]
    kept : bool
        Whether it is good enough to be taken.
    others : tuple of ndarray, shape (2,)
        Where it is not: other places on the line that a part of the window takes for as good. Of
        picks at steps that are not kept, suggestion or one of these is right for 77 % (sample pair;
        53 % without them) and 85 % (church never tuned on; 64 %). [px]
    """

    pixel: FloatArray
    score: float
    quality: float
    sigma_px: float
    misfit_px: float
    kept: bool
    others: tuple[FloatArray, ...] = ()


def radial_line(
    pair: Pair, image: int, pixel: FloatArray, size: tuple[int, int], *, count: int = 129
) -> FloatArray:
    """Return where the other photo may show a pick, shape (n, 2), as its relief grows. [px]

    Parameters
    ----------
    pair : Pair
    image : int
        The photo picked, 1 or 2.
    pixel : ndarray, shape (2,)
    size : tuple of int
        Width and height of the other photo; what lies far outside is left out. [px]
    count : int
        Points along the line; it is bent where a lens distorts.
    """
    reliefs = _even(pair, (-2.0 * pair.d2, 0.7 * pair.d2), count)
    line = seen_in_other(pair, image, pixel, reliefs)
    margin = 0.25 * max(size)
    inside = np.isfinite(line).all(axis=1) & (line > -margin).all(axis=1)
    inside &= (line < np.array(size) + margin).all(axis=1)
    return line[inside]


def seen_in_other(pair: Pair, image: int, pixel: FloatArray, reliefs: FloatArray) -> FloatArray:
    """Return where the other photo shows a pick of one photo, for each relief, shape (n, 2)."""
    pixels = np.broadcast_to(pixel, (len(reliefs), 2))
    if image == 1:
        return seen_at(pair, pixels, reliefs)
    if pair.refracted:
        positions = pair.image2.apparent_from_pixels(pixels)
        return pair.image1.project(point_on_ray(positions, reliefs, pair.image2.foot))
    centre = pair.zoom_centre
    factor = zoom_factor(reliefs, d1=pair.d1, d2=pair.d2)[:, None]
    q2 = pair.image2.plane_from_pixels(pixels)
    return pair.image1.pixels_from_plane(centre + (q2 - centre) / factor)


def _zooms(
    pair: Pair, image: int, here: FloatArray, there: FloatArray, r: FloatArray
) -> FloatArray:
    """Return the derivative of the other photo by the picked one, shape (n, 2, 2)."""
    if image == 1:
        return local_zoom(pair, here, r)
    return np.asarray(np.linalg.inv(local_zoom(pair, there, r)))


def suggest(
    pair: Pair,
    images: tuple[ByteArray, ByteArray],
    image: int,
    pixel: FloatArray,
    *,
    relief_range: tuple[float, float] | None = None,
) -> Suggestion:
    """Return the homologous point of a pick.

    Parameters
    ----------
    pair : Pair
    images : two ndarrays, shape (h, w) or (h, w, 3), uint8
        Far and near photo.
    image : int
        The photo picked, 1 or 2.
    pixel : ndarray, shape (2,)
        The pick. [px]
    relief_range : tuple of float, optional
        Least and greatest relief searched; default -0.5 to 0.4 of the near distance. [m]

    Returns
    -------
    Suggestion

    Raises
    ------
    InputError
        If the pick lies at the rim of its photo, or its line outside the other one.

    Notes
    -----
    Normalised correlation of 21 x 21 samples along the line, each seen under the zoom k(r) that its
    relief implies; then least-squares matching along the line (`bifocal.matching.patches`).
    """
    picture, partner = images[image - 1], images[2 - image]
    low, high = relief_range or (SUGGESTIONS.farthest * pair.d2, SUGGESTIONS.nearest * pair.d2)
    reliefs = _reliefs(pair, image, pixel, (low, high), partner.shape)
    predicted = seen_in_other(pair, image, pixel, reliefs)
    search = _LineSearch.along(pair, (picture, partner), image, pixel, reliefs, predicted)
    correlation, *halves = search.correlation()
    if not np.isfinite(correlation).any():
        raise InputError("too near to the rim of a photo for a suggestion; pick it by hand.")
    judged = correlation - SUGGESTIONS.off_wall * np.abs(reliefs) / pair.d2
    best = int(np.nanargmax(judged))
    apart = np.linalg.norm(predicted - predicted[best], axis=1) > search.radius / 2
    second_best = float(np.nanmax(np.where(apart, judged, -1.0))) if apart.any() else -1.0
    match = search.match(best)
    clear = float(np.clip((judged[best] - second_best) / SUGGESTIONS.clear, 0.0, 1.0))
    agreement = float(np.clip((match.score - 0.5) / 0.5, 0.0, 1.0))
    quality = agreement * (0.3 + 0.7 * clear) * (1.0 if match.fits else 0.3)
    away = np.linalg.norm(predicted - match.pixel, axis=1)
    kept = match.fits and match.score > MATCH.least_agreement and quality >= SUGGESTIONS.kept
    kept = kept and _one_surface(halves, away)
    return Suggestion(
        pixel=match.pixel,
        score=match.score,
        quality=quality,
        sigma_px=match.sigma_px,
        misfit_px=match.misfit_px,
        kept=kept,
        others=() if kept else _others(search, [judged, *halves], match.pixel),
    )


class _LineMatch(NamedTuple):
    """A place on the line after least squares."""

    pixel: FloatArray
    score: float
    sigma_px: float
    misfit_px: float
    fits: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _LineSearch:
    """Places on the line of a pick, and both photos around them, equally sharp."""

    pair: Pair
    image: int
    pixel: FloatArray
    reliefs: FloatArray
    there: FloatArray
    local: FloatArray
    smooth: tuple[Float32Array, Float32Array]
    corners: tuple[FloatArray, FloatArray]
    radius: float

    @classmethod
    def along(
        cls, pair: Pair, images: tuple[ByteArray, ByteArray], image: int, pixel: FloatArray,
        reliefs: FloatArray, there: FloatArray,
    ) -> _LineSearch:  # fmt: skip
        """Return the search among places of these reliefs."""
        local = _zooms(pair, image, np.broadcast_to(pixel, there.shape), there, reliefs)
        scale = float(np.median(np.sqrt(np.abs(np.linalg.det(local)))))
        reach = (SUGGESTIONS.half + 3) * max(1.0, 1.0 / scale) + 4
        first, corner1 = _crop(images[0], pixel[None], reach)
        second, corner2 = _crop(images[1], there, reach * max(1.0, scale) * 1.5)
        return cls(
            pair=pair, image=image, pixel=pixel, reliefs=reliefs, there=there, local=local,
            smooth=same_scale(first, second, local), corners=(corner1, corner2),
            radius=SUGGESTIONS.half * max(1.0, scale),
        )  # fmt: skip

    def correlation(self) -> FloatArray:
        """Return the correlations of `_correlation`, shape (5, n)."""
        corner1, corner2 = self.corners
        return _correlation(self.smooth, self.pixel - corner1, self.there - corner2, self.local)

    def match(self, index: int) -> _LineMatch:
        """Return the place of an index, moved to where it fits best."""
        row, (corner1, corner2) = slice(index, index + 1), self.corners
        along = _directions(self.pair, self.image, self.pixel[None], self.reliefs[row])
        result, misfit, across = _refined(
            self.smooth, self.pixel - corner1, self.there[row] - corner2, self.local[row], along
        )
        sigma = float(np.hypot(MATCH.optimism * result.sigma[0], SUGGESTIONS.best))
        fits = bool(result.converged[0]) and abs(misfit) < 2.0 and sigma < 0.5
        # As `bifocal match` does: the misfit stays in the point, for the survey to judge.
        pixel = result.pixels2[0] + corner2 + (across * misfit if fits else 0.0)
        return _LineMatch(pixel, float(result.zncc[0]), sigma, misfit, fits)


def _others(
    search: _LineSearch, curves: list[FloatArray], pixel: FloatArray
) -> tuple[FloatArray, ...]:
    """Return other places that whole or half windows take for as good as the match, best first."""
    offers, places = list[tuple[float, FloatArray]](), [pixel]
    for curve in curves:
        away = np.linalg.norm(search.there - pixel, axis=1)
        near = np.max(curve, where=(away < SUGGESTIONS.peak) & np.isfinite(curve), initial=-1.0)
        free = (away > SUGGESTIONS.apart) & np.isfinite(curve)
        if not free.any():
            continue
        index = int(np.argmax(np.where(free, curve, -1.0)))
        if curve[index] < max(near - SUGGESTIONS.better_beside, SUGGESTIONS.least_offer):
            continue
        match = search.match(index)
        # The whole window does not always settle where half of it fits.
        place = match.pixel if match.fits else search.there[index]
        if min(np.linalg.norm(place - one) for one in places) > SUGGESTIONS.apart:
            places.append(place)
            offers.append((float(curve[index]), place))
    return tuple(place for _, place in sorted(offers, key=lambda offer: -offer[0]))


def _one_surface(halves: list[FloatArray], away: FloatArray) -> bool:
    """Whether all halves of the window fit at the match, not one of them beside it."""
    at, beside = away < SUGGESTIONS.peak, (away > SUGGESTIONS.peak) & (away < SUGGESTIONS.beside)
    return all(
        np.max(half, where=at & np.isfinite(half), initial=-1.0)
        > np.max(half, where=beside & np.isfinite(half), initial=-1.0) - SUGGESTIONS.better_beside
        for half in halves
    )


def _reliefs(
    pair: Pair, image: int, pixel: FloatArray, ends: tuple[float, float], shape: tuple[int, ...]
) -> FloatArray:
    """Return the reliefs of places a pixel apart on the line, inside the other photo."""
    probe = _even(pair, ends, 33)
    places = seen_in_other(pair, image, pixel, probe)
    length = float(np.nansum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
    count = int(np.clip(length / SUGGESTIONS.step, 33, SUGGESTIONS.most))
    reliefs = _even(pair, ends, count)
    places = seen_in_other(pair, image, pixel, reliefs)
    inside = (places > SUGGESTIONS.half).all(axis=1) & (
        places < np.array(shape[1::-1]) - SUGGESTIONS.half
    ).all(axis=1)
    if not inside.any():
        raise InputError("the other photo does not show this place.")
    return np.asarray(reliefs[inside])


def _even(pair: Pair, ends: tuple[float, float], count: int) -> FloatArray:
    """Return reliefs whose places are evenly apart on the line, below the last interface. [m]"""
    d1, d2 = pair.straight_distances
    top = min(ends[1], SUGGESTIONS.before_media * pair.highest_relief) if pair.layers else ends[1]
    factors = zoom_factor(np.array([ends[0], top]), d1=d1, d2=d2)
    return relief_from_zoom(np.linspace(factors[0], factors[1], count), d1=d1, d2=d2)


def _crop(image: ByteArray, places: FloatArray, reach: float) -> tuple[ByteArray, FloatArray]:
    """Return the grey part of a photo around places, and its first column and row."""
    low = np.maximum(np.floor(places.min(axis=0) - reach), 0).astype(int)
    high = np.ceil(places.max(axis=0) + reach).astype(int) + 1
    part = image[low[1] : high[1], low[0] : high[0]]
    if not part.size:
        raise InputError("the pick lies outside its photo.")
    if part.ndim == 3:
        part = np.asarray(cv2.transform(part, np.full((1, 3), 1 / 3)), dtype=np.uint8)
    return np.ascontiguousarray(part), low.astype(np.float64)


def _correlation(
    images: tuple[Float32Array, Float32Array], pixel: FloatArray, there: FloatArray,
    local: FloatArray,
) -> FloatArray:  # fmt: skip
    """Return the correlation of the pick's patch with those along the line, shape (5, n).

    Of the whole window, then of its left, right, upper and lower half.
    """
    scale = np.sqrt(np.abs(np.linalg.det(local)))
    step = float(np.median(np.maximum(1.0, 1.0 / np.clip(scale, 0.1, 10.0))))
    axis = np.arange(-SUGGESTIONS.half, SUGGESTIONS.half + 1, dtype=np.float64)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    weight = np.exp(-(grid**2).sum(1) / (2 * (0.75 * SUGGESTIONS.half) ** 2))
    column, row = grid.T
    parts = np.array([column < np.inf, column <= 0, column >= 0, row <= 0, row >= 0])
    weights = (weight * parts).astype(np.float32).T
    weights /= weights.sum(0)
    template = _sampled(images[0], (pixel + grid * step)[None])[0]
    places = there[:, None] + (grid * step)[None] @ local.transpose(0, 2, 1)
    values = _sampled(images[1], places)
    # Weighted moments, from grey values about the pick's own mean: float32 keeps their digits.
    template, values = template - template.mean(), values - template.mean()
    mean1, mean2 = template @ weights, values @ weights
    both = (values * template) @ weights - mean1 * mean2
    power1 = (template * template) @ weights - mean1**2
    power2 = (values * values) @ weights - mean2**2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(both / np.sqrt(power1 * power2), dtype=np.float64).T


def _sampled(image: Float32Array, places: FloatArray) -> Float32Array:
    """Return a picture at places, shape (n, m, 2); NaN outside."""
    flat = places.astype(np.float32)
    values = [
        cv2.remap(image, flat[k : k + 4096], None, cv2.INTER_LINEAR, borderValue=float("nan"))
        for k in range(0, len(flat), 4096)
    ]
    return np.concatenate(values).astype(np.float32)


def _directions(pair: Pair, image: int, here: FloatArray, relief: FloatArray) -> FloatArray:
    """Return the unit vector along the line in the other photo, shape (1, 2)."""
    if image == 1:
        along = directions_at(pair, here, relief)
    else:
        step = 1e-3 * pair.d2
        ends = [seen_in_other(pair, 2, here[0], relief + sign * step) for sign in (-1, 1)]
        rate = ends[1] - ends[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            along = rate / np.linalg.norm(rate, axis=1, keepdims=True)
    return np.where(np.isfinite(along), along, [[1.0, 0.0]])


def _refined(
    images: tuple[Float32Array, Float32Array], pixel: FloatArray, there: FloatArray,
    local: FloatArray, along: FloatArray,
) -> tuple[PatchResult, float, FloatArray]:  # fmt: skip
    """Return the match moved along the line, its misfit across, and that direction."""
    across = np.array([-along[0, 1], along[0, 0]])
    on_line = refine(*images, pixel[None], there, local, along[:, :, None])
    both = np.stack([along, across[None]], axis=2)
    free = refine(*images, pixel[None], on_line.pixels2, local, both, iterations=4)
    misfit = float((free.pixels2[0] - on_line.pixels2[0]) @ across)
    return on_line, misfit if np.isfinite(misfit) else 0.0, across
