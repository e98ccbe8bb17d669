"""Survey targets in a photo: discs, chequers and coded markers, to a few hundredths of a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.matching.tuning import TARGETS
from photocore.arrays import BoolArray, ByteArray, Float32Array, FloatArray

#: Families of coded markers looked for, most common first.
FAMILIES = ("DICT_4X4_250", "DICT_5X5_250", "DICT_6X6_250", "DICT_APRILTAG_36h11")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurveyTargets:
    """Targets found in one photo.

    Attributes
    ----------
    pixels : ndarray, shape (n, 2)
        Centres. [px]
    size : ndarray, shape (n,)
        Diameter. [px]
    dark : ndarray of bool, shape (n,)
        Dark on a bright plate.
    kinds : tuple of str
        ``disc``, ``chequer`` or ``code``.
    codes : tuple of str
        Name of a coded marker; empty for others.
    """

    pixels: FloatArray
    size: FloatArray
    dark: BoolArray
    kinds: tuple[str, ...]
    codes: tuple[str, ...]


def find_targets(image: ByteArray) -> SurveyTargets:
    """Return every target of a grey photo.

    Parameters
    ----------
    image : ndarray, shape (h, w), uint8

    Notes
    -----
    A disc's centre is the centroid of its darkness, measured against its own plate: 0.005 to 0.01
    px on a clean photo. Seen obliquely, the centroid is not quite the centre's image, but the same
    place of the disc in both photos to first order.
    """
    parts = [_discs(image, dark=True), _discs(image, dark=False), _chequers(image)]
    codes, names, sizes = _codes(image)
    pixels = np.concatenate([part[0] for part in parts] + [codes])
    counts = [len(part[0]) for part in parts]
    return SurveyTargets(
        pixels=pixels,
        size=np.concatenate([part[1] for part in parts] + [sizes]),
        dark=np.repeat([True, False, True, True], [*counts, len(codes)]),
        kinds=(
            *("disc",) * (counts[0] + counts[1]),
            *("chequer",) * counts[2],
            *("code",) * len(codes),
        ),
        codes=("",) * sum(counts) + names,
    )


def _discs(image: ByteArray, *, dark: bool) -> tuple[FloatArray, FloatArray]:
    """Return centres and diameters of discs."""
    grey = image if dark else cv2.bitwise_not(image).astype(np.uint8)
    discs: list[tuple[float, float, float]] = []
    for box in (41, 161):
        mean = cv2.blur(grey, (box, box))
        mask = (grey.astype(np.int16) < mean.astype(np.int16) - 15).astype(np.uint8)
        _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
        for left, top, width, height, area in stats[_round_ones(stats, image.shape, box)]:
            disc = _measure(grey, (int(left), int(top), int(width), int(height)), float(area))
            if disc is not None:
                discs.append(disc)
    if not discs:
        return np.zeros((0, 2)), np.zeros(0)
    array = np.array(discs)
    _, first = np.unique(np.round(array[:, :2] / 2), axis=0, return_index=True)
    return array[first, :2], array[first, 2]


def _round_ones(stats: NDArray[np.int32], shape: tuple[int, ...], box: int) -> BoolArray:
    """Return which connected parts may be discs, by box and area alone."""
    left, top, width, height, area = stats.T.astype(np.float64)
    largest = np.maximum(width, height)
    fill = area / np.maximum(width * height, 1)
    good = (np.minimum(width, height) >= TARGETS.smallest) & (
        largest <= min(TARGETS.largest, 0.75 * box)
    )
    # A digital disc fills pi/4 of its box, small ones somewhat more.
    good &= (np.minimum(width, height) > 0.5 * largest) & (fill > 0.68) & (fill < 0.90)
    margin = largest
    good &= (left > margin) & (top > margin)
    good &= (left + width + margin < shape[1]) & (top + height + margin < shape[0])
    return np.asarray(good)


def _measure(
    grey: ByteArray, box: tuple[int, int, int, int], area: float
) -> tuple[float, float, float] | None:
    """Return column, row and diameter of a dark disc, None if it is not one."""
    left, top, width, height = box
    pad = max(3, round(0.45 * max(width, height)))
    part = grey[top - pad : top + height + pad, left - pad : left + width + pad].astype(np.float64)
    y, x = np.mgrid[0 : part.shape[0], 0 : part.shape[1]]
    cx, cy = pad + (width - 1) / 2, pad + (height - 1) / 2
    radial = np.hypot((x - cx) / (width / 2 + 0.5), (y - cy) / (height / 2 + 0.5))
    inner, ring = part[radial < 0.6], part[(radial > 1.4) & (radial < 1.9)]
    if len(inner) < 4 or len(ring) < 8:
        return None
    low, high = float(np.median(inner)), float(np.median(ring))
    contrast = high - low
    if (
        contrast < TARGETS.least_contrast
        or ring.std() > 0.2 * contrast
        or inner.std() > 0.2 * contrast
    ):
        return None
    darkness = np.clip((high - part) / contrast, 0.0, 1.0)
    # Noise of the plate must not pull the centroid: only the disc and its soft edge count.
    darkness[(radial > 1.5) | (darkness < 0.06)] = 0.0
    total = darkness.sum()
    if not 0.7 < total / area < 1.5:
        return None
    column, row = (darkness * x).sum() / total, (darkness * y).sum() / total
    moments = [
        (darkness * (x - column) ** 2).sum() / total,
        (darkness * (y - row) ** 2).sum() / total,
        (darkness * (x - column) * (y - row)).sum() / total,
    ]
    spread = moments[0] * moments[1] - moments[2] ** 2
    # For an ellipse the area is 4 pi times the root of the second moments' determinant.
    if spread <= 0 or not 0.93 < total / (4 * np.pi * np.sqrt(spread)) < 1.07:
        return None
    return left - pad + column, top - pad + row, 2.0 * float(np.sqrt(total / np.pi))


def _chequers(image: ByteArray) -> tuple[FloatArray, FloatArray]:
    """Return crossings of two-by-two chequers: saddle points of high contrast, symmetric."""
    smooth = cv2.GaussianBlur(image, (0, 0), 2.0).astype(np.float32)
    xx = cv2.Sobel(smooth, cv2.CV_32F, 2, 0, ksize=3) / 4
    yy = cv2.Sobel(smooth, cv2.CV_32F, 0, 2, ksize=3) / 4
    xy = cv2.Sobel(smooth, cv2.CV_32F, 1, 1, ksize=3) / 4
    saddle = np.asarray(xy * xy - xx * yy)
    peak = cv2.dilate(saddle, np.ones((9, 9), np.uint8))
    rows, columns = np.nonzero((saddle >= peak) & (saddle > 12.0))
    out = [
        place
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
        if (place := _crossing(image, smooth, column, row)) is not None
    ]
    # A peak of two equal pixels is one crossing.
    array = np.unique(np.round(np.array(out).reshape(-1, 3), 3), axis=0)
    apart = np.hypot(*(array[:, None, :2] - array[None, :, :2]).transpose(2, 0, 1))
    array = array[~np.tril(apart < 3.0, -1).any(axis=1)]
    return array[:, :2], array[:, 2]


def _crossing(
    image: ByteArray, smooth: Float32Array, column: int, row: int
) -> tuple[float, float, float] | None:
    """Return the crossing near a pixel and the size used, None if it is no chequer."""
    reach = 8
    height, width = image.shape
    if not (reach < column < width - reach - 1 and reach < row < height - reach - 1):
        return None
    angles = np.arange(32) * (2 * np.pi / 32)
    ring = image[
        np.round(row + 5 * np.sin(angles)).astype(int),
        np.round(column + 5 * np.cos(angles)).astype(int),
    ].astype(np.float64)
    bright = ring > (ring.max() + ring.min()) / 2
    changes = int((bright != np.roll(bright, 1)).sum())
    if ring.max() - ring.min() < 80 or changes != 4 or not 10 <= bright.sum() <= 22:
        return None
    # Opposite sectors of a chequer are equal.
    if np.abs(ring - np.roll(ring, 16)).mean() > 0.2 * (ring.max() - ring.min()):
        return None
    # Its sectors are of one grey, and straight: stones that touch and crossing joints are not. How
    # sharp the lens drew the edges between them says nothing of that.
    edge = bright != np.roll(bright, 1)
    within = ~np.any([np.roll(edge, by) for by in range(-2, 3)], axis=0)
    if not ((within & bright).any() and (within & ~bright).any()):
        return None
    low, high = float(np.median(ring[within & ~bright])), float(np.median(ring[within & bright]))
    for radius in (4.0, 6.0, 7.5):
        around = image[
            np.round(row + radius * np.sin(angles)).astype(int),
            np.round(column + radius * np.cos(angles)).astype(int),
        ].astype(np.float64)
        off = np.minimum(np.abs(around - low), np.abs(around - high))[within]
        same = (around > (low + high) / 2) == bright
        if np.median(off) > TARGETS.uneven * (high - low) or same.mean() < 0.8:
            return None
    y, x = np.mgrid[-3:4, -3:4].astype(np.float64)
    design = np.stack([x * x, y * y, x * y, x, y, np.ones_like(x)], axis=-1).reshape(-1, 6)
    part = smooth[row - 3 : row + 4, column - 3 : column + 4].astype(np.float64).ravel()
    a, b, c, d, e, _ = np.linalg.lstsq(design, part, rcond=None)[0]
    determinant = 4 * a * b - c * c
    if determinant >= 0:
        return None
    dx, dy = (c * e - 2 * b * d) / determinant, (c * d - 2 * a * e) / determinant
    if max(abs(dx), abs(dy)) > 1.5:
        return None
    return column + float(dx), row + float(dy), 10.0


def _codes(image: ByteArray) -> tuple[FloatArray, tuple[str, ...], FloatArray]:
    """Return centres, names and sizes of coded markers."""
    centres: list[FloatArray] = []
    names: list[str] = []
    sizes: list[float] = []
    reduction = max(1, round(np.sqrt(image.size / 6e6)))
    small = image[::reduction, ::reduction] if reduction > 1 else image
    for family in FAMILIES:
        dictionary: Any = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, family))
        parameters = cv2.aruco.DetectorParameters()
        corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(small)
        if ids is None:
            continue
        for quad, number in zip(corners, ids.ravel().tolist(), strict=True):
            rough = np.asarray(quad, dtype=np.float32).reshape(4, 1, 2) * reduction
            half = max(2, int(0.06 * np.linalg.norm(rough[0] - rough[1])))
            criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-3)
            fine: Any = cv2.cornerSubPix(image, rough, (half, half), (-1, -1), criteria)
            points = np.asarray(fine, dtype=np.float64).reshape(4, 2)
            centres.append(_diagonals(points))
            names.append(f"{family[5:].removesuffix('_250')}-{number}")
            sizes.append(float(np.linalg.norm(points[0] - points[2])))
        break  # a wall carries one family
    return np.array(centres).reshape(-1, 2), tuple(names), np.array(sizes)


def _diagonals(points: FloatArray) -> FloatArray:
    """Return where the diagonals of a quadrilateral meet: the centre, in any perspective."""
    along, across = points[2] - points[0], points[3] - points[1]
    start = points[1] - points[0]
    share = (start[0] * across[1] - start[1] * across[0]) / (
        along[0] * across[1] - along[1] * across[0]
    )
    return points[0] + share * along
