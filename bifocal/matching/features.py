"""Features of two photos and their matches: SIFT at full resolution, neighbours, epipolar lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.matching.tuning import FEATURES
from photocore.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Features:
    """Keypoints in pixels of the full photo with descriptors of unit length, strongest first.

    Attributes
    ----------
    pixels : ndarray, shape (n, 2)
    size : ndarray, shape (n,)
        Diameter. [px]
    direction : ndarray, shape (n,)
        Direction of the strongest gradient. [deg]
    descriptors : ndarray, shape (n, 128), float32
    reduction : float
        Full pixels per pixel searched.
    """

    pixels: FloatArray
    size: FloatArray
    direction: FloatArray
    descriptors: Float32Array
    reduction: float

    def strongest(self, count: int) -> Features:
        """Return the first so many features."""
        return self.of(slice(count))

    def of(self, rows: slice | NDArray[np.intp]) -> Features:
        """Return the features of some rows."""
        each = ("pixels", "size", "direction", "descriptors")
        return replace(self, **{name: getattr(self, name)[rows] for name in each})


def stretch(image: ByteArray) -> ByteArray:
    """Return a grey image with its 1st to 99th percentile spread over the whole range.

    A dark or hazy photo then gives as many features as a bright one.
    """
    sample = image[::8, ::8]
    low, high = np.percentile(sample, [1, 99])
    if high - low > 180 or high <= low:
        return image
    table = np.clip((np.arange(256) - low) * (255.0 / (high - low)), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(image, table), dtype=np.uint8)


def find_features(
    image: ByteArray, *, limit: int = FEATURES.strongest, budget: float = FEATURES.most_pixels
) -> Features:
    """Return the strongest features of a grey photo, found strip by strip.

    Parameters
    ----------
    image : ndarray, shape (h, w), uint8
    limit : int
        At most so many.
    budget : float
        Pixels searched; larger photos are reduced to this.
    """
    image = stretch(image)
    reduction = max(1.0, float(np.sqrt(image.size / budget)))
    size = (round(image.shape[1] / reduction), round(image.shape[0] / reduction))
    small = image if reduction == 1.0 else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    factor = np.array([image.shape[1] / small.shape[1], image.shape[0] / small.shape[0]])
    detector: Any = cv2.SIFT.create(contrastThreshold=FEATURES.contrast)
    height = small.shape[0]
    edges = np.linspace(
        0, height, max(1, int(np.ceil(small.size / FEATURES.strip_pixels))) + 1
    ).astype(int)
    keys, parts = [], []
    for top, bottom in pairwise(edges.tolist()):
        start = max(top - FEATURES.margin, 0)
        strip = np.ascontiguousarray(small[start : min(bottom + FEATURES.margin, height)])
        keypoints = [
            key
            for key in detector.detect(strip, None)
            if top - 0.5 <= key.pt[1] + start < bottom - 0.5
            or height == bottom <= key.pt[1] + start
        ]
        # Descriptors cost as much as the search: only those of the strongest are made.
        keypoints.sort(key=lambda key: -key.response)
        keypoints, part = detector.compute(
            strip, keypoints[: int(1.3 * limit / (len(edges) - 1)) + 1]
        )
        if len(keypoints):
            numbers = [(k.pt[0], k.pt[1] + start, k.size, k.angle, k.response) for k in keypoints]
            keys.append(np.array(numbers))
            parts.append(part)
    table = np.concatenate(keys) if keys else np.zeros((0, 5))
    descriptors = np.concatenate(parts) if parts else np.zeros((0, 128), np.float32)
    order = np.argsort(-table[:, 4], kind="stable")[:limit]
    table, descriptors = table[order], descriptors[order]
    # Square root of L1-normalised SIFT: Euclidean distance then is Hellinger's.
    descriptors = descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9)
    return Features(
        pixels=(table[:, :2] + 0.5) * factor - 0.5,
        size=table[:, 2] * factor.mean(),
        direction=table[:, 3],
        descriptors=np.sqrt(descriptors).astype(np.float32),
        reduction=reduction,
    )


def match_features(first: Features, second: Features) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return indices of mutual nearest neighbours that stand out from the second nearest."""
    if len(first.pixels) < 2 or len(second.pixels) < 2:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    count = len(first.pixels)
    nearest = np.zeros(count, np.intp)
    value = np.zeros(count, np.float32)
    distinct = np.zeros(count, dtype=bool)
    highest = np.full(len(second.pixels), -np.inf, np.float32)
    for start in range(0, count, 2000):
        part = first.descriptors[start : start + 2000] @ second.descriptors.T
        rows = slice(start, start + len(part))
        best = nearest[rows] = part.argmax(axis=1)
        value[rows] = part[np.arange(len(part)), best]
        np.maximum(highest, part.max(axis=0), out=highest)
        runner = _runner_up(part, best, second.pixels, FEATURES.same_place * second.reduction)
        # |a - b|² = 2 - 2 a·b for unit vectors.
        distinct[rows] = (2 - 2 * value[rows]) < FEATURES.distinct**2 * (2 - 2 * runner)
    # Of several that are as near to one feature the first.
    mutual = np.flatnonzero(value == highest[nearest])
    mutual = np.sort(mutual[np.unique(nearest[mutual], return_index=True)[1]])
    good = mutual[distinct[mutual]]
    return good, nearest[good]


def _runner_up(
    similarity: Float32Array, best: NDArray[np.intp], pixels: FloatArray, place: float
) -> Float32Array:
    """Return each row's second best similarity at another place; blanks the better ones."""
    rows = np.arange(len(best))
    similarity[rows, best] = -1.0
    runner = np.full(len(best), -1.0, np.float32)
    for once in range(4):  # a place has at most a few orientations
        second = (similarity[rows] if once else similarity).argmax(axis=1)
        runner[rows] = similarity[rows, second]
        close = np.linalg.norm(pixels[second] - pixels[best[rows]], axis=1) < place
        similarity[rows[close], second[close]] = -1.0
        rows = rows[close]
        if not len(rows):
            break
    return runner


def alike(
    first: Features, second: Features, rows1: NDArray[np.intp], rows2: NDArray[np.intp]
) -> BoolArray:
    """Return which matches differ in size and turn no more than one pair of photos can explain."""
    grown = np.log(second.size[rows2] / first.size[rows1])
    turned = np.deg2rad(second.direction[rows2] - first.direction[rows1])
    usual = np.arctan2(np.sin(turned).sum(), np.cos(turned).sum())
    away = np.abs((turned - usual + np.pi) % (2 * np.pi) - np.pi)
    size = np.abs(grown - np.median(grown)) if len(grown) else grown
    return np.asarray((size < FEATURES.size_slack) & (away < np.deg2rad(FEATURES.turn_slack)))


def match_along_lines(
    first: Features,
    second: Features,
    epipole: FloatArray,
    expected: tuple[FloatArray, FloatArray],
    *,
    across: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the nearest neighbours among those that lie near each feature's epipolar segment.

    Parameters
    ----------
    first, second : Features
    epipole : ndarray, shape (2,)
        Where all lines of photo 2 meet. [px]
    expected : two ndarrays, shape (n, 2)
        The segments' ends in photo 2. [px]
    across : float
        Largest distance from the line. [px]

    Returns
    -------
    rows1, rows2 : ndarray of int
        Paired features; each appears once.
    """
    angle1 = _angle((expected[0] + expected[1]) / 2 - epipole)
    angle2 = _angle(second.pixels - epipole)
    reach = np.linalg.norm(second.pixels - epipole, axis=1)
    slack = np.arctan2(across, reach)
    order1 = np.argsort(angle1)
    order1 = order1[np.isfinite(angle1[order1])]
    nearest = np.full(len(angle1), -1, np.intp)
    similarity = np.full(len(angle1), -1.0, np.float32)
    # Features next to each other in angle share their candidates: lines meet in the epipole.
    for start in range(0, len(order1), 128):
        rows = order1[start : start + 128]
        middle = (angle1[rows[0]] + angle1[rows[-1]]) / 2
        half = (angle1[rows[-1]] - angle1[rows[0]]) / 2
        away = np.abs((angle2 - middle + np.pi) % (2 * np.pi) - np.pi)
        candidates = np.flatnonzero(away < half + slack)
        if len(candidates):
            ends = expected[0][rows], expected[1][rows]
            best, value = _best_on_segment(
                first.descriptors[rows], second, candidates, ends, across
            )
            nearest[rows], similarity[rows] = best, value
    # One partner each: the most similar keeps it.
    order = np.argsort(-similarity)
    order = order[nearest[order] >= 0]
    _, keep = np.unique(nearest[order], return_index=True)
    rows = order[keep]
    return rows, nearest[rows]


def _angle(away: FloatArray) -> FloatArray:
    return np.asarray(np.arctan2(away[:, 1], away[:, 0]))


def _best_on_segment(
    descriptors: Float32Array,
    second: Features,
    candidates: NDArray[np.intp],
    ends: tuple[FloatArray, FloatArray],
    across: float,
) -> tuple[NDArray[np.intp], Float32Array]:
    """Return each feature's distinct nearest candidate near its segment (-1: none)."""
    x2 = second.pixels[candidates]
    along = ends[1] - ends[0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = along / np.maximum(length, 1e-9)
    dx = x2[None, :, 0] - ends[0][:, 0, None]
    dy = x2[None, :, 1] - ends[0][:, 1, None]
    at = dx * along[:, 0, None] + dy * along[:, 1, None]
    off = np.abs(dx * along[:, 1, None] - dy * along[:, 0, None])
    inside = (off < across) & (at > -across) & (at < length + across)
    part = np.where(inside, descriptors @ second.descriptors[candidates].T, np.float32(-1.0))
    best = part.argmax(axis=1)
    lines = np.arange(len(part))
    value = part[lines, best].copy()
    # A second feature at the same place (another orientation) is no rival.
    close = np.abs(x2[None, :, 0] - x2[best, None, 0]) < across
    close &= np.abs(x2[None, :, 1] - x2[best, None, 1]) < across
    part[close] = -1.0
    runner = part.max(axis=1)
    good = (value > FEATURES.least_alike) & (
        (2 - 2 * value) < FEATURES.distinct_on_line**2 * (2 - 2 * runner)
    )
    return (
        np.where(good, candidates[best], -1).astype(np.intp),
        np.where(good, value, -1.0).astype(np.float32),
    )


def spread_evenly(
    pixels: FloatArray, sigma: FloatArray, shape: tuple[int, ...], count: int
) -> IntArray:
    """Return the indices of about ``count`` points, the best of every part of the photo first.

    The photo is divided into cells, half as many as points are wanted; the best point of each cell
    comes first, then the second best of each, until there are enough.
    """
    if len(pixels) <= count:
        return np.arange(len(pixels), dtype=np.int64)
    side = np.sqrt(2.0 * shape[0] * shape[1] / count)
    cell = (pixels[:, 1] // side) * 100_000 + pixels[:, 0] // side
    order = np.lexsort((sigma, cell))
    start = np.r_[True, np.diff(cell[order]) != 0]
    first = np.maximum.accumulate(np.where(start, np.arange(len(order)), 0))
    rank = np.arange(len(order)) - first
    by_rank = np.lexsort((sigma[order], rank))
    return np.sort(order[by_rank[:count]]).astype(np.int64)


def sharpness(image: ByteArray) -> float:
    """Return how much fine detail a photo has against coarse detail, 0 (blurred) to about 1.

    Ratio of the gradient at one pixel to that at four pixels, on the strongest edges: a sharp
    photo keeps its steepness at every scale, a blurred one has none left at the finest.
    """
    height, width = image.shape
    if min(height, width) < FEATURES.smallest_side:
        return 0.0
    part = image[height // 8 : -height // 8 or None, width // 8 : -width // 8 or None]
    if part.size > 4e6:
        step = int(np.ceil(np.sqrt(part.size / 4e6)))
        band = part.shape[0] // step
        part = part[(part.shape[0] - band) // 2 :][:band]
    grey = part.astype(np.float32)

    fine, coarse = (_steepness(cv2.GaussianBlur(grey, (0, 0), blur)) for blur in (0.7, 2.8))
    edges = coarse > np.percentile(coarse[::4, ::4], 98)
    if not edges.any() or coarse[edges].mean() < 1e-3:
        return 0.0
    # An ideal edge is steeper by the ratio of the blurs, 4; noise is far below on these edges.
    return float((np.median(fine[edges]) / np.median(coarse[edges]) - 1.0) / 1.5)


def _steepness(image: Float32Array) -> Float32Array:
    """Return the larger of both grey-value differences across each inner pixel."""
    across = np.abs(image[1:-1, 2:] - image[1:-1, :-2])
    return np.maximum(across, np.abs(image[2:, 1:-1] - image[:-2, 1:-1]))


def drop_repeated(pixels1: FloatArray, pixels2: FloatArray) -> BoolArray:
    """Return which matches to keep when several sit at one place (one per orientation)."""
    keys = np.round(np.concatenate([pixels1, pixels2], axis=1)).astype(np.int64)
    _, first = np.unique(keys, axis=0, return_index=True)
    keep = np.zeros(len(pixels1), dtype=bool)
    keep[first] = True
    return keep
