"""From a pick near a target or a corner to its centre."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from bifocal.matching.corners import at_places, crossing
from bifocal.matching.targets import find_targets
from bifocal.matching.tuning import SNAPPING, TARGETS
from photocore.arrays import ByteArray, Float32Array, FloatArray


class Snapped(NamedTuple):
    """What lies near a pick.

    Attributes
    ----------
    column, row : float
        Its centre, or the pick itself. [px]
    kind : str
        ``target``, ``corner`` or ``none``.
    sigma_px : float or None
        Precision of the centre. [px]
    """

    column: float
    row: float
    kind: str
    sigma_px: float | None


def snap(image: ByteArray, pixel: tuple[float, float], radius: float) -> Snapped:
    """Return the centre of the target, or else the corner, next to a pick.

    Parameters
    ----------
    image : ndarray, shape (h, w) or (h, w, 3), uint8
    pixel : tuple of float
        The pick. [px]
    radius : float
        How far off the centre may lie; at most `farthest`. [px]

    Notes
    -----
    Targets that `bifocal match` finds are measured as there, by the centroid of their darkness.
    Discs, chequers and crosses look the same when turned by half a turn about their centre. Of all
    places near the pick and all sizes, that is taken whose centre would be known best: with the
    grey values g and what is left of the symmetry, ``s0² / sum((2 dg/dx)²)``.
    """
    pick, radius = np.array(pixel), min(float(radius), SNAPPING.farthest)
    reach = int(np.ceil(radius + 1.5 * TARGETS.largest))
    low = np.maximum(np.round(pick).astype(int) - reach, 0)
    high = np.round(pick).astype(int) + reach + 1
    part = image[low[1] : high[1], low[0] : high[0]]
    nothing = Snapped(pixel[0], pixel[1], "none", None)
    if min(part.shape[:2], default=0) < 4 * SNAPPING.half:
        return nothing
    if part.ndim == 3:
        part = np.asarray(cv2.transform(part, np.full((1, 3), 1 / 3)), dtype=np.uint8)
    grey = np.ascontiguousarray(part)
    for kind, find in (("target", _known_target), ("target", _target), ("corner", _corner)):
        spot = find(grey, pick - low, radius)
        if spot is not None:
            column, row = (spot[0] + low).tolist()
            return Snapped(
                column, row, kind, float(np.clip(spot[1], SNAPPING.best, SNAPPING.worst))
            )
    return nothing


def _known_target(
    grey: ByteArray, pick: FloatArray, radius: float
) -> tuple[FloatArray, float] | None:
    """Return the nearest target as `bifocal match` finds it; None without one."""
    targets = find_targets(grey)
    away = np.linalg.norm(targets.pixels - pick, axis=1)
    # Its crossings of chequers are a little less sharp than the centre of symmetry.
    away[[kind == "chequer" for kind in targets.kinds]] = np.inf
    if not len(away) or away.min() > radius:
        return None
    return targets.pixels[int(away.argmin())], SNAPPING.target_sigma


def _target(grey: ByteArray, pick: FloatArray, radius: float) -> tuple[FloatArray, float] | None:
    """Return the best centre of symmetry near a pick, and its precision; None without one."""
    values = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), 0.7)
    across, down = (
        cv2.Sobel(values, cv2.CV_32F, *order, ksize=3) / 8 for order in ((1, 0), (0, 1))
    )
    height, width = grey.shape
    rows, columns = np.mgrid[0:height, 0:width]
    near = np.hypot(columns - pick[0], rows - pick[1]) <= radius
    best: tuple[float, FloatArray, float] | None = None
    for size in SNAPPING.radii:
        margin = int(size) + 1
        inside = near & (columns >= margin) & (columns < width - margin)
        inside &= (rows >= margin) & (rows < height - margin)
        places = np.argwhere(inside).astype(np.float64)
        if not len(places):
            continue
        sigma = _symmetry(values, (np.asarray(across), np.asarray(down)), places, size)
        index = int(sigma.argmin())
        if np.isfinite(sigma[index]) and (best is None or sigma[index] < best[0]):
            best = float(sigma[index]), places[index, ::-1], size
    if best is None:
        return None
    from scipy.ndimage import spline_filter

    refined = _refined(spline_filter(values.astype(np.float64)), best[1], best[2])
    if refined is None or refined[1] > SNAPPING.worst_target:
        return None
    place = _disc_centre(grey, refined[0])
    return (place, refined[1]) if np.linalg.norm(place - pick) <= radius + 1.0 else None


def _disc_centre(grey: ByteArray, place: FloatArray) -> FloatArray:
    """Return the centroid of a disc about its centre of symmetry; that itself if it is none."""
    rows, columns = np.mgrid[0 : grey.shape[0], 0 : grey.shape[1]]
    away = np.hypot(columns - place[0], rows - place[1])
    steps = np.arange(0.0, SNAPPING.radii[-1])
    profile = np.array([np.median(grey[np.abs(away - r) < 0.8]) for r in steps])
    edges = np.flatnonzero(np.abs(profile - profile[0]) > SNAPPING.least_contrast)
    if not len(edges) or not 2 <= edges[0] <= SNAPPING.radii[-1] / 1.6:
        return place
    size = float(edges[0])
    inner, plate = (
        (away < 0.7 * size),
        (away > size + 1.5) & (away < max(1.6 * size + 0.5, size + 3.0)),
    )
    low, high = float(np.median(grey[inner])), float(np.median(grey[plate]))
    if abs(high - low) < 2 * SNAPPING.least_contrast or grey[inner].std() > 0.2 * abs(high - low):
        return place
    share = np.clip((high - grey.astype(np.float64)) / (high - low), 0.0, 1.0)
    if (share[plate] > 0.5).mean() > 0.1:  # a cross or a chequer
        return place
    share[(away > size + 1.5) | (share < 0.06)] = 0.0
    total = share.sum()
    centre = np.array([(share * columns).sum() / total, (share * rows).sum() / total])
    return centre if np.linalg.norm(centre - place) < 0.5 else place


def _half_disc(size: float) -> FloatArray:
    """Return whole-pixel offsets (column, row) of one half of a disc, shape (n, 2)."""
    reach = int(size)
    rows, columns = np.mgrid[0 : reach + 1, -reach : reach + 1]
    half = (rows > 0) | (columns > 0)
    half &= np.hypot(rows, columns) <= size
    return np.stack([columns[half], rows[half]], axis=-1)


def _symmetry(
    values: Float32Array, gradient: tuple[FloatArray, FloatArray], places: FloatArray, size: float
) -> FloatArray:
    """Return how precisely each place would be a centre of symmetry; inf where it is none. [px]"""
    offsets = _half_disc(size).astype(int)
    row, column = places[:, :1].astype(int), places[:, 1:].astype(int)

    def both(image: FloatArray | Float32Array) -> tuple[FloatArray, FloatArray]:
        one = image[row + offsets[:, 1], column + offsets[:, 0]]
        mirrored = image[row - offsets[:, 1], column - offsets[:, 0]]
        return np.asarray(one, np.float64), np.asarray(mirrored, np.float64)

    one, mirrored = both(values)
    mean = (one.mean(axis=1) + mirrored.mean(axis=1))[:, None] / 2
    power = ((one - mean) ** 2 + (mirrored - mean) ** 2).mean(axis=1) / 2
    difference = ((one - mirrored) ** 2).mean(axis=1)
    correlation = 1.0 - difference / np.maximum(2 * power, 1e-9)
    gx, gy = (one - mirrored for one, mirrored in (both(image) for image in gradient))
    xx, yy, xy = (gx * gx).sum(1), (gy * gy).sum(1), (gx * gy).sum(1)
    least = (xx + yy) / 2 - np.sqrt(((xx - yy) / 2) ** 2 + xy**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma = np.sqrt(np.maximum(difference, SNAPPING.noise**2) / least)
    good = (
        (correlation > SNAPPING.least_symmetry - 0.15)
        & (np.sqrt(power) > SNAPPING.least_contrast)
        & (least > 0)
    )
    return np.where(good, sigma, np.inf)


def _refined(values: FloatArray, start: FloatArray, size: float) -> tuple[FloatArray, float] | None:
    """Return the centre of symmetry by least squares, and its precision.

    Parameters
    ----------
    values : ndarray, shape (h, w)
        Spline coefficients of the picture.
    """
    offsets = _half_disc(size).astype(np.float64)
    place = start.copy()
    sigma, symmetry = np.inf, 0.0
    for turn in range(16):
        one, opposite = (at_places(values, place + sign * offsets) for sign in (1, -1))
        slopes = []
        for axis in np.eye(2) * 0.5:
            ahead, behind = (
                [at_places(values, place + s * axis + sign * offsets) for sign in (1, -1)]
                for s in (1, -1)
            )
            slopes.append((ahead[0] - ahead[1]) - (behind[0] - behind[1]))
        design = np.column_stack([*slopes, offsets / size])
        difference = one - opposite
        weight = np.ones(len(difference))
        # A shadow across the target must not pull its centre; far from it edges are no shadows.
        for _ in range(3 if turn > 3 else 1):
            normal = design.T @ (weight[:, None] * design) + 1e-6 * np.eye(4)
            step = -np.linalg.solve(normal, design.T @ (weight * difference))
            rest = difference + design @ step
            spread = max(1.4826 * float(np.median(np.abs(rest))), SNAPPING.noise)
            weight = 1.0 / (1.0 + (rest / (3 * spread)) ** 2)
        place = place + np.clip(step[:2], -1.0, 1.0)
        if np.linalg.norm(place - start) > 2.5:
            return None
        if turn > 4 and np.abs(step[:2]).max() < 1e-3:
            break
    noise = max(float(np.sqrt((weight * rest**2).sum() / weight.sum())), SNAPPING.noise)
    sigma = noise * float(np.sqrt(np.linalg.inv(normal)[[0, 1], [0, 1]].max()))
    mean = float(np.mean([one, opposite]))
    power = float(np.mean([(one - mean) ** 2, (opposite - mean) ** 2]))
    symmetry = 1.0 - float((weight * rest**2).sum() / weight.sum()) / max(2 * power, 1e-9)
    if symmetry < SNAPPING.least_symmetry or np.sqrt(power) < SNAPPING.least_contrast:
        return None
    return place, sigma


def _corner(grey: ByteArray, pick: FloatArray, radius: float) -> tuple[FloatArray, float] | None:
    """Return the nearest strong corner and its precision; None without one."""
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), 0.7)
    strength = np.asarray(cv2.cornerMinEigenVal(smooth, 5, 3))
    rows, columns = np.mgrid[0 : grey.shape[0], 0 : grey.shape[1]]
    near = np.hypot(columns - pick[0], rows - pick[1]) <= radius
    if not near.any():
        return None
    # The nearest of those that are about as strong as the strongest.
    peaks = near & (strength >= cv2.dilate(strength, np.ones((5, 5), np.uint8)))
    peaks &= strength >= max(0.5 * float(strength[near].max()), 1e-12)
    if not peaks.any():
        return None
    places = np.stack([columns[peaks], rows[peaks]], axis=-1).astype(np.float64)
    start = places[int(np.linalg.norm(places - pick, axis=1).argmin())]
    fine = cv2.cornerSubPix(
        grey,
        start.astype(np.float32).reshape(1, 1, 2),
        (SNAPPING.half, SNAPPING.half),
        (-1, -1),
        (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-4),
    )
    cross = crossing(smooth, np.asarray(fine, dtype=np.float64).reshape(2))
    if (
        cross is None
        or cross[1] > SNAPPING.worst
        or np.linalg.norm(cross[0] - start) > SNAPPING.half
    ):
        return None
    if np.linalg.norm(cross[0] - pick) > radius + 1.0:
        return None
    return cross[0], max(cross[1], SNAPPING.best_corner)
