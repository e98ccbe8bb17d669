"""Walls that repeat themselves: whether the photos may lie some periods aside of each other.

Windows all alike match their neighbours as well as themselves: common points then agree on cameras
a period aside, and nothing in them contradicts. What does not repeat tells where the photos belong
together: the grain of the plaster, or a door, the eaves, the wall's end.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2

from bifocal.model import Images, Interiors, apply_homography
from bifocal.orientation.area_points import resampled
from bifocal.orientation.starts.relative_orientation import Surrounding, Ties
from bifocal.orientation.tuning import REPETITION
from photocore.arrays import BoolArray, Float32Array, FloatArray
from photocore.camera import Pinhole, plane_from_pixel, project

Sheet = tuple[Float32Array, BoolArray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Repetition:
    """How a wall repeats itself in the far photo, and where the near photo lies on it.

    Attributes
    ----------
    ends : ndarray, shape (2 or 3, 2)
        A place of the far photo, and those one period away, the nearest first. [ideal px]
    surrounding : Surrounding
        Where partners are to be sought: within a third of a period.
    is_certain : bool
        Whether what does not repeat tells so; else it is where the common points have it.
    """

    ends: FloatArray
    surrounding: Surrounding
    is_certain: bool


def repetition(images: Images, interiors: Interiors, far: Pinhole, ties: Ties) -> Repetition | None:
    """Return how the wall repeats itself; None where it does not, or is not in sight.

    Parameters
    ----------
    images, interiors : pairs
    far : Pinhole
        Camera 1 in a frame on the wall.
    ties : Ties
    """
    covered = _grid(far, interiors[0].image_size)
    if covered is None:
        return None
    grid, spacing = covered
    pixels = project(far, np.concatenate([grid, np.zeros((*grid.shape[:2], 1))], axis=-1))
    moved = apply_homography(ties.homography, pixels)
    sheets: list[Sheet] = []
    for image, interior, at in zip(images, interiors, (pixels, moved), strict=True):
        ideal = interior.radial(ties.radial).distort(at.reshape(-1, 2))
        raw = interior.raw(ideal).reshape(at.shape)
        inside = (raw > 1) & (raw < np.array(interior.image_size) - 2)
        shown = np.asarray(inside.all(axis=-1))
        sheets.append((resampled(image, raw).astype(np.float32), shown))
    if not len(moves := _periods(sheets[0])):
        return None
    around = int(np.linalg.norm(moves[0]) / 3)
    for witness in (_grain, _outstanding):
        first, second = (witness(sheet, moves[0]) for sheet in sheets)
        lag, is_certain = _clear_peak(_correlation(first, second), around)
        if is_certain:
            break
    metres = np.array([1.0, -1.0]) * spacing  # rows run down, Y up
    middle = grid[grid.shape[0] // 2, grid.shape[1] // 2]
    places = middle + np.vstack([np.zeros(2), moves * metres])
    ends = project(far, np.column_stack([places, np.zeros(len(places))]))
    carried = np.eye(3)
    carried[:2, 2] = lag * metres if is_certain else 0.0
    to_plane = plane_from_pixel(far)
    homography = ties.homography @ np.linalg.inv(to_plane) @ carried @ to_plane
    reach = float(np.linalg.norm(np.diff(apply_homography(homography, ends[:2]), axis=0))) / 3
    surrounding = Surrounding(homography=homography, reach=reach)
    return Repetition(ends=ends, is_certain=is_certain, surrounding=surrounding)


def _grid(far: Pinhole, size: tuple[int, int]) -> tuple[FloatArray, float] | None:
    """Return places of the wall over what the far photo shows of it, and their spacing.

    None where it shows none of it: approximate cameras may be nonsense, which others find out.
    """
    if not far.centre[2] > 0:
        return None
    edge = np.linspace(0.0, 1.0, 9)
    rim = np.array([[(x, 0.0), (x, 1.0), (0.0, x), (1.0, x)] for x in edge]).reshape(-1, 2)
    rim = apply_homography(plane_from_pixel(far), rim * np.array(size))
    reach = REPETITION.reach * far.centre[2]
    rim = np.clip(rim[np.isfinite(rim).all(axis=1)], far.centre[:2] - reach, far.centre[:2] + reach)
    if not len(rim):
        return None
    low, high = rim.min(axis=0), rim.max(axis=0)
    if not (high - low).min() > REPETITION.narrowest * (high - low).max():
        return None
    spacing = float(np.sqrt(np.prod(high - low) / REPETITION.pixels))
    x, y = np.arange(low[0], high[0], spacing), np.arange(high[1], low[1], -spacing)
    return np.stack(np.meshgrid(x, y), axis=-1), spacing


def _periods(sheet: Sheet) -> FloatArray:
    """Return the moves along either axis by which a sheet is like itself, the nearest first. [px]

    Half the pixels a side tell.
    """
    values, share = (
        cv2.resize(part.astype(np.float32), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        for part in sheet
    )
    shown, side = share > 0.99, max(share.shape)
    flat = values - _smooth(values, shown, REPETITION.ground * side)
    alike = _correlation((flat, shown), (flat, shown))
    cone = int(REPETITION.cone * side) + 1
    across = np.arange(-cone, cone + 1)
    out = []
    for turned, order in ((alike, 1), (alike.T, -1)):
        lags = np.arange(1, int(share.shape[order > 0] * REPETITION.longest))
        band = np.concatenate([turned[-cone:, lags], turned[: cone + 1, lags]])
        band[np.abs(across)[:, None] > 1 + REPETITION.cone * lags] = np.nan
        band = np.nan_to_num(band, nan=-1.0)
        top = band.max(axis=0)
        peak = (top[1:-1] >= top[:-2]) & (top[1:-1] > top[2:])
        peak &= (top - np.minimum.accumulate(top))[1:-1] > REPETITION.stands_out
        peaks = 1 + np.flatnonzero(peak)
        least = max(REPETITION.repeats, REPETITION.as_good * top[peaks].max(initial=0.0))
        for first in peaks[top[peaks] > least][:1]:
            out.append([lags[first], across[band[:, first].argmax()]][::order])
    return 2.0 * np.array(sorted(out, key=np.linalg.norm))


def _grain(sheet: Sheet, period: FloatArray) -> Sheet:
    """Return the grain of the plaster between all edges, without what repeats itself of it."""
    values, shown = sheet
    side = max(shown.shape)
    fine = cv2.GaussianBlur(values, (0, 0), 1.0)
    kernel = np.ones((7, 7), np.uint8)
    slope = np.hypot(cv2.Sobel(fine, cv2.CV_32F, 1, 0), cv2.Sobel(fine, cv2.CV_32F, 0, 1))
    steep, inner = cv2.dilate(slope, kernel), cv2.erode(shown.astype(np.uint8), kernel) > 0
    if not inner.any():
        return np.zeros_like(values), inner
    calm = inner & (steep <= np.quantile(steep[inner], REPETITION.calm))
    rest = fine - cv2.medianBlur(values.astype(np.uint8), 2 * round(REPETITION.grain * side) + 1)
    spread = 1.4826 * float(np.median(np.abs(rest[calm])))
    calm &= np.abs(rest) < 4 * max(spread, 0.5)
    calm = cv2.morphologyEx(calm.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0
    rest -= _smooth(rest, calm, REPETITION.grain * side / 2)
    rest -= _neighbours(rest, calm, period)
    return _limited(rest, calm), calm


def _outstanding(sheet: Sheet, period: FloatArray) -> Sheet:
    """Return in what a sheet is unlike its neighbours a period aside: a door, the eaves."""
    values, shown = sheet
    flat = values - _smooth(values, shown, REPETITION.ground * max(shown.shape))
    rest = cv2.GaussianBlur(flat - _neighbours(flat, shown, period), (0, 0), 3.0)
    return _limited(rest, shown), shown


def _neighbours(values: Float32Array, shown: BoolArray, period: FloatArray) -> Float32Array:
    """Return the mean of a sheet one and two periods to either side."""
    total, weight = np.zeros_like(values), np.zeros_like(values)
    for times in (-2, -1, 1, 2):
        move = np.column_stack([np.eye(2), times * period]).astype(np.float32)
        for into, part in ((total, values * shown), (weight, shown.astype(np.float32))):
            into += cv2.warpAffine(part, move, part.shape[::-1], flags=cv2.INTER_NEAREST)
    return np.asarray(total / np.maximum(weight, 1.0), dtype=np.float32)


def _limited(values: Float32Array, shown: BoolArray) -> Float32Array:
    """Return values in their standard deviations, three at most."""
    deviation = float(values[shown].std()) if shown.any() else 0.0
    return np.clip(values / max(deviation, 1e-6), -3, 3)


def _smooth(values: Float32Array, shown: BoolArray, radius: float) -> Float32Array:
    """Return values smoothed over where they are shown."""
    weight = cv2.GaussianBlur(shown.astype(np.float32), (0, 0), radius)
    total = cv2.GaussianBlur(np.where(shown, values, np.float32(0)), (0, 0), radius)
    return np.asarray(total / np.maximum(weight, 1e-3), dtype=np.float32)


def _correlation(first: Sheet, second: Sheet) -> Float32Array:
    """Return the correlation of two sheets by the second's move; NaN where little is common."""
    shape = [next_fast_len(2 * n, real=True) for n in first[0].shape]
    (a, ones_a), (b, ones_b) = (_centred(*sheet) for sheet in (first, second))
    of_a, in_a, square_a = (np.conj(rfft2(part, shape)) for part in (a, ones_a, a * a))
    of_b, in_b, square_b = (rfft2(part, shape) for part in (b, ones_b, b * b))
    common = np.maximum(irfft2(in_b * in_a, shape), 1e-3)
    sum_a, sum_b = irfft2(in_b * of_a, shape) / common, irfft2(of_b * in_a, shape) / common
    product = irfft2(of_b * of_a, shape) / common - sum_a * sum_b
    spread = (irfft2(in_b * square_a, shape) / common - sum_a**2) * (
        irfft2(square_b * in_a, shape) / common - sum_b**2
    )
    out = product / np.sqrt(np.maximum(spread, 1e-6))
    least = REPETITION.overlap * min(ones_a.sum(), ones_b.sum())
    return np.where(common < max(least, 1.0), np.float32(np.nan), out)


def _centred(values: Float32Array, shown: BoolArray) -> tuple[Float32Array, Float32Array]:
    """Return values about their mean, zero where nothing is shown, and where something is."""
    mean = values[shown].mean() if shown.any() else np.float32(0)
    return np.where(shown, values - mean, np.float32(0)), shown.astype(np.float32)


def _clear_peak(alike: Float32Array, around: int) -> tuple[FloatArray, bool]:
    """Return the move of the highest correlation, and whether it stands out for certain. [px]"""
    if np.isnan(alike).all():
        return np.zeros(2), False
    spread = 1.4826 * float(np.nanmedian(np.abs(alike - np.nanmedian(alike))))
    height, width = alike.shape
    row, column = np.unravel_index(np.nanargmax(alike), alike.shape)
    highest = float(alike[row, column])
    reach = np.arange(-around, around + 1)
    rest = alike.copy()
    rest[np.ix_((row + reach) % height, (column + reach) % width)] = np.nan
    second = float(np.nanmax(rest)) if np.isfinite(rest).any() else 0.0
    half = np.array([width // 2, height // 2])
    move = (np.array([column, row]) + half) % [width, height] - half
    clear = highest > max(REPETITION.sure * spread, REPETITION.clearly * second)
    return move.astype(float), bool(clear)
