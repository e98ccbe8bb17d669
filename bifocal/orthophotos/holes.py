"""What no photo sees: small holes take texture from beside them, large ones stay paper white."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.model.image import ImageArray
from bifocal.orthophotos.ortho_image import Source, shows
from bifocal.orthophotos.pull_push import fill_holes
from bifocal.orthophotos.tuning import HOLES
from bifocal.orthophotos.visibility import parts_of
from photocore.arrays import BoolArray, ByteArray, Float32Array, IntArray


def close_holes(
    image: ImageArray, source: ByteArray, holes: BoolArray, relief: Float32Array, gsd: float, *,
    largest: float,
) -> None:  # fmt: skip
    """Fill holes of a window with texture, in place; those of more than ``largest`` [m2] white.

    The fringe of a large one, narrower than `HOLES.narrow`, takes texture, too, as narrow a
    sliver within it is white, and its outline smooth: ragged it would tell of the mask, not of the
    wall. Texture is a copy of what lies beside, shifted to where the rim fits best, and levelled
    along the rim. It comes from what lies no farther out than the hole: that is what goes on
    behind. Specks take the mean colour of their rim.
    """
    side = int(HOLES.narrow / gsd) | 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    large = parts_of(holes, largest / gsd**2).astype(np.uint8)
    # What the fringe leaves of one may be a crumb.
    white = parts_of(cv2.morphologyEx(large, cv2.MORPH_OPEN, disc) > 0, largest / 2 / gsd**2)
    if white.any():
        white = _outlined(white, holes, relief, side)
    image[white] = np.iinfo(image.dtype).max
    source[white] = Source.NEITHER
    rest = (holes & ~white).astype(np.uint8)
    _, label, stats, _ = cv2.connectedComponentsWithStats(rest, connectivity=8)
    closed = _close_specks(image, source, label, stats[:, cv2.CC_STAT_AREA], relief)
    for number in (np.flatnonzero(~closed[1:]) + 1).tolist():
        left, top, width, height, _ = stats[number].tolist()
        _copy_texture(image, source, label, number, (left, top, width, height), relief, gsd)


def _outlined(white: BoolArray, holes: BoolArray, relief: Float32Array, side: int) -> BoolArray:
    """Return white parts with a smooth outline, and without slivers of wall within them.

    A sliver of wall between two parts that no photo sees is seen by chance, and a ragged outline
    is the matcher's. What lies before a part, such as a bar, is left alone.
    """
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    closed = cv2.morphologyEx(white.astype(np.uint8), cv2.MORPH_CLOSE, disc)
    smooth = cv2.GaussianBlur(closed.astype(np.float32), (0, 0), HOLES.smooth * side) > 0.5
    level = cv2.dilate(np.where(white, relief, np.float32(-np.inf)), disc)
    return np.asarray(smooth & (holes | (relief < level + np.float32(HOLES.before))))


def _close_specks(
    image: ImageArray, source: ByteArray, label: IntArray, areas: IntArray, relief: Float32Array
) -> BoolArray:
    """Give small holes the mean colour of their rim, in place; return which were closed."""
    small = areas <= HOLES.speck
    small[0] = False
    numbers = np.where(small[label], label, 0).astype(np.float32)
    row, column = np.nonzero(numbers)
    if not len(row):
        return small
    inside = label[row, column]
    with np.errstate(invalid="ignore"):
        level = np.bincount(inside, relief[row, column], len(areas)) / areas + HOLES.before
    around = cv2.dilate(numbers, np.ones((3, 3), np.uint8)).astype(np.int32)
    rim_row, rim_column = np.nonzero((around > 0) & shows(source))
    beside = around[rim_row, rim_column]
    behind = relief[rim_row, rim_column] < level[beside]
    rim_row, rim_column, beside = rim_row[behind], rim_column[behind], beside[behind]
    count = np.bincount(beside, minlength=len(areas))
    closed: BoolArray = small & (count > 0)
    if not closed.any():
        return closed
    near = closed[inside]
    row, column, inside = row[near], column[near], inside[near]
    colours = image[rim_row, rim_column].reshape(len(beside), -1)
    total = np.stack([np.bincount(beside, band, len(areas)) for band in colours.T], axis=-1)
    mean = np.rint(total[inside] / count[inside, None]).astype(image.dtype)
    image[row, column] = mean.reshape(len(row), *image.shape[2:])
    source[row, column] = Source.FILLED
    return closed


def _copy_texture(
    image: ImageArray, source: ByteArray, label: IntArray, number: int,
    box: tuple[int, int, int, int], relief: Float32Array, gsd: float,
) -> None:  # fmt: skip
    """Fill one hole, in place; where nothing around fits in, with the colours at its rim."""
    part = grown(box, HOLES.rim, label.shape)
    hole = label[part] == number
    painted = shows(source[part])
    # A hole that goes on as another part is no rim.
    rim = painted & (relief[part] < np.median(relief[part][hole]) + np.float32(HOLES.before))
    if np.count_nonzero(rim) < HOLES.fewest:
        rim = painted
    if not rim.any():
        return
    colours = image[part]
    reach = int(max(HOLES.reach / gsd, max(box[2:])))
    around = grown(box, HOLES.rim + reach, label.shape)
    copied = None
    if hole.size < HOLES.most:
        copied = _best_copy(image[around], shows(source[around]), colours, hole, rim)
    level = colours.astype(np.float32) - (0 if copied is None else copied)
    filled = fill_holes(level, rim, hole)[0] + (0 if copied is None else copied)
    limit = np.iinfo(image.dtype).max
    colours[hole] = np.clip(np.rint(filled[hole]), 0, limit).astype(image.dtype)
    source[part][hole] = Source.FILLED


def _best_copy(
    around: ImageArray, valid: BoolArray, colours: ImageArray, hole: BoolArray, rim: BoolArray
) -> Float32Array | None:
    """Return the part of the surroundings whose rim fits best; None if none is whole."""
    if around.shape[0] <= colours.shape[0] or around.shape[1] <= colours.shape[1]:
        return None
    grey = [part.mean(axis=2) if part.ndim == 3 else part for part in (around, colours)]
    wide, patch, weight, unknown, weights = (
        np.asarray(part, np.float32) for part in (*grey, rim, ~valid, hole)
    )
    off = cv2.matchTemplate(wide, patch, cv2.TM_SQDIFF, mask=weight)
    empty = cv2.matchTemplate(unknown, weights, cv2.TM_CCORR)
    off[(empty > 0.5) | ~np.isfinite(off)] = np.inf
    row, column = np.unravel_index(int(np.argmin(off)), off.shape)
    if not np.isfinite(off[row, column]):
        return None
    part = around[row : row + colours.shape[0], column : column + colours.shape[1]]
    return part.astype(np.float32)


def grown(box: tuple[int, int, int, int], by: int, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Return a box (left, top, width, height) grown on all sides, within a window."""
    left, top, width, height = box
    rows = slice(max(top - by, 0), min(top + height + by, shape[0]))
    return rows, slice(max(left - by, 0), min(left + width + by, shape[1]))
