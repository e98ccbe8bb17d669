"""A photo cut into small segments along its edges, and the borders between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from photocore.arrays import ByteArray, Float32Array, FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentTuning:
    """Segments of photo 1."""

    #: Spacing of the segments. [px]
    #: Evidence: façade 84, off by more than 3 cm with one exact relief a segment: 1.0 %, 16 px 1.7
    #: %, 24 px 3.6 %.
    spacing: int = 12
    #: Edges are looked for in a photo smoothed between them: diameter of the bilateral filter. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.57 / -0.71.
    smoothing: int = 7
    #: Standard deviation of that filter in grey value. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.78 / +0.69.
    edge: float = 8.0
    #: Standard deviation of that filter in place. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +1.17 / +1.00.
    reach: float = 2.0
    #: How much less gradient a pixel must have to start a segment a pixel farther from its middle.
    #: [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.00 / -0.28.
    off_middle: float = 0.02


SEGMENTS = SegmentTuning()


class Borders(NamedTuple):
    """What separates segments; every border is there twice, once for either side, by owner.

    Attributes
    ----------
    own, other : ndarray of int, shape (n,)
        The segments on both sides.
    length : ndarray, shape (n,)
        In pixels of the photo.
    contrast : ndarray, shape (n,)
        Step of the smoothed photo from one side to the other. [grey levels]
    row, column : ndarray, shape (n,)
        Middle of the border. [px]
    first : ndarray of int, shape (segments + 1,)
        Where the borders of a segment begin.
    """

    own: IntArray
    other: IntArray
    length: FloatArray
    contrast: FloatArray
    row: FloatArray
    column: FloatArray
    first: IntArray


class Segments(NamedTuple):
    """A photo cut into segments.

    Attributes
    ----------
    label : ndarray of int32, shape (height, width)
        Number of each pixel's segment, from 0.
    number : int
        How many they are.
    row, column : ndarray, shape (count,)
        Middles of the segments. [px]
    borders : Borders
    """

    label: IntArray
    number: int
    row: FloatArray
    column: FloatArray
    borders: Borders

    @classmethod
    def of(cls, image: ByteArray) -> Segments:
        """Cut a photo into segments some `spacing` pixels wide; it must be larger than one."""
        quiet = cv2.medianBlur(
            cv2.bilateralFilter(image, SEGMENTS.smoothing, SEGMENTS.edge, SEGMENTS.reach), 3
        )
        starts = _starts(quiet)
        label = _flooded(quiet, starts)
        count = int(starts.max())
        flat = label.ravel()
        size = np.maximum(np.bincount(flat, minlength=count), 1)
        height, width = label.shape
        rows = np.repeat(np.arange(height, dtype=float), width)
        columns = np.tile(np.arange(width, dtype=float), height)
        row, column = (np.bincount(flat, x, count) / size for x in (rows, columns))
        return cls(label, count, row, column, _borders(label, quiet, count))


def _starts(quiet: ByteArray) -> IntArray:
    """Return the numbered starts of segments, from 1: the flattest place of each square."""
    square = np.ones((3, 3), np.uint8)
    gradient = cv2.morphologyEx(quiet, cv2.MORPH_GRADIENT, square).astype(np.float32)
    gradient = cv2.blur(gradient, (3, 3))
    rows, columns = (length // SEGMENTS.spacing for length in quiet.shape)
    cells = gradient[: rows * SEGMENTS.spacing, : columns * SEGMENTS.spacing]
    cells = cells.reshape(rows, SEGMENTS.spacing, columns, SEGMENTS.spacing).transpose(0, 2, 1, 3)
    away = np.arange(SEGMENTS.spacing) - (SEGMENTS.spacing - 1) / 2
    penalty = SEGMENTS.off_middle * np.hypot(away[:, None], away[None, :])
    best = (cells + penalty).reshape(rows, columns, -1).argmin(-1)
    row = SEGMENTS.spacing * np.arange(rows)[:, None] + best // SEGMENTS.spacing
    column = SEGMENTS.spacing * np.arange(columns)[None, :] + best % SEGMENTS.spacing
    starts = np.zeros(quiet.shape, np.float32)
    starts[row, column] = np.arange(1, rows * columns + 1).reshape(rows, columns)
    return np.asarray(cv2.dilate(starts, square).astype(np.int32))


def _flooded(quiet: ByteArray, starts: IntArray) -> IntArray:
    """Return the segments grown from their starts up to each other (Meyer's watershed), from 0.

    Pixels of the watershed itself join the neighbour that is most like them.
    """
    label = np.asarray(cv2.watershed(cv2.merge([quiet] * 3), starts.copy()))
    row, column = np.nonzero(label <= 0)
    joined = np.ones(len(row), np.int32)
    least = np.full(len(row), np.inf)
    height, width = label.shape
    grey = quiet.astype(np.int32)
    for down in (-1, 0, 1):
        for across in (-1, 0, 1):
            at = np.clip(row + down, 0, height - 1), np.clip(column + across, 0, width - 1)
            unlike = np.where(label[at] > 0, np.abs(grey[at] - grey[row, column]), np.inf)
            nearer = unlike < least
            joined[nearer], least[nearer] = label[at][nearer], unlike[nearer]
    label[row, column] = joined
    return np.asarray(label - 1)


def _borders(label: IntArray, quiet: ByteArray, count: int) -> Borders:
    """Return the borders of all segments."""
    grey = cv2.blur(quiet.astype(np.float32), (3, 3))
    parts = [_along_rows(label, grey, count), _along_rows(label.T, grey.T, count)]
    (key, step, row, column), turned = parts
    key, step = np.concatenate([key, turned[0]]), np.concatenate([step, turned[1]])
    row, column = np.concatenate([row, turned[3]]), np.concatenate([column, turned[2]])
    pairs, number = np.unique(key, return_inverse=True)
    length = np.bincount(number).astype(float)
    means = [np.bincount(number, x, len(pairs)) / length for x in (step, row, column)]
    low, high = pairs // count, pairs % count
    inner, outer = np.concatenate([low, high]), np.concatenate([high, low])
    order = np.argsort(inner, kind="stable")
    edge = np.tile(np.arange(len(pairs)), 2)[order]
    inner = inner[order]
    return Borders(
        own=inner, other=outer[order], length=length[edge], contrast=np.abs(means[0])[edge],
        row=means[1][edge], column=means[2][edge],
        first=np.searchsorted(inner, np.arange(count + 1)),
    )  # fmt: skip


def _along_rows(
    label: IntArray, grey: Float32Array, count: int
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Return pairs of segments that meet along rows: number, step, row and column of each place."""
    row, column = np.nonzero(label[:, 1:-2] != label[:, 2:-1])
    left, right = label[row, column + 1].astype(np.int64), label[row, column + 2].astype(np.int64)
    step = (grey[row, column] - grey[row, column + 3]).astype(float)
    key = np.minimum(left, right) * count + np.maximum(left, right)
    return key, np.where(left < right, step, -step), row.astype(float), column + 1.5
