"""Faces that a program would draw: planes where relief was not measured, for a person to accept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from bifocal.faces.face_planes import robust_plane
from bifocal.faces.faces import Face, Faces
from bifocal.faces.tuning import SUGGESTIONS
from bifocal.model import TOLD, Grid, Photo, Quality, ReliefMap, as_grey
from photocore.arrays import BoolArray, ByteArray, Float32Array
from photocore.large_photos import Pixels

#: Left, top, right, bottom in pixels of the map, right and bottom excluded.
Box = tuple[int, int, int, int]


def suggest_faces(relief: ReliefMap, photos: Sequence[Photo], images: Sequence[Pixels]) -> Faces:
    """Return upright rectangles that look like planes where a map is not measured.

    Parameters
    ----------
    relief : ReliefMap
        As measured.
    photos, images : sequence
        Far and near photo, of a set all its photos, and their pixels.

    Returns
    -------
    Faces
        Faces with level planes, named S1, S2, ..., those first that mend most of the picture
        (``mends``), ``sigma`` the spread of what was measured on them.

    Notes
    -----
    Of each larger part that was not measured, the box is drawn to the straightest upright and level
    edges of the far photo nearby, and the relief is that at which the photos agree best within
    (largest correlation), the plane through what was measured there among the candidates.
    """
    greys = [as_grey(image, "image") for image in images]
    grid, lost = relief.grid, _lost(relief)
    faces = []
    for mask in (lost, *_slabs(relief)):
        for box in _boxes(mask):
            drawn = _drawn_to_edges(box, relief, photos[0], greys[0])
            mends = _cut(lost, drawn).sum() / lost.size
            if mends < SUGGESTIONS.least:
                continue
            if (face := _face_of(relief, grid, drawn, photos, greys)) is not None:
                faces.append((float(mends), face))
    faces.sort(key=lambda one: -one[0])
    kept: list[Face] = []
    for mends, face in faces:
        if len(kept) < SUGGESTIONS.most and all(_apart(face, chosen) for chosen in kept):
            kept.append(
                Face(name=f"S{len(kept) + 1}", rings=face.rings, plane=face.plane,
                     sigma=face.sigma, mends=round(mends, 5))
            )  # fmt: skip
    return Faces(faces=tuple(kept))


def _lost(relief: ReliefMap) -> BoolArray:
    """Return what is not measured, but for thin strips."""
    return _opened(~np.isin(relief.quality, TOLD))


def _opened(mask: BoolArray) -> BoolArray:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (SUGGESTIONS.thin, SUGGESTIONS.thin))
    return np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc) > 0)


def _slabs(relief: ReliefMap) -> Iterator[BoolArray]:
    """Yield what lies at each level that much of the relief lies at, known or made up alike."""
    known = relief.known
    if not known.any():
        return
    step = SUGGESTIONS.slab
    low = float(relief.r[known].min())
    number = np.where(known, (np.nan_to_num(relief.r) - low) / step, -1).astype(np.int64)
    count = np.bincount(number[known])
    padded = np.pad(count, 1)
    peaks = (count >= padded[:-2]) & (count > padded[2:])
    peaks &= count > SUGGESTIONS.least * relief.r.size
    disc = np.ones((SUGGESTIONS.thin, SUGGESTIONS.thin), np.uint8)
    for peak in np.flatnonzero(peaks).tolist():
        slab = np.abs(number - peak) <= 1
        yield np.asarray(
            cv2.morphologyEx(_opened(slab).astype(np.uint8), cv2.MORPH_CLOSE, disc) > 0
        )


def _boxes(mask: BoolArray) -> Iterator[Box]:
    """Yield the boxes of connected parts of a mask that fill them as a window would."""
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), None, 4)
    for number in range(1, count):
        left, top, wide, high, area = stats[number].tolist()
        if area < max(SUGGESTIONS.least * mask.size, SUGGESTIONS.smallest):
            continue
        part = label[top : top + high, left : left + wide] == number
        box = []
        for axis, start in ((0, left), (1, top)):
            share = part.mean(axis=axis)
            full = np.flatnonzero(share > SUGGESTIONS.ragged * np.quantile(share, 0.9))
            box += [(start + int(full[0]), start + int(full[-1]) + 1)]
        (left, right), (top, bottom) = box
        wide, high = right - left, bottom - top
        broad = min(wide, high) >= SUGGESTIONS.narrowest
        filled = (label[top:bottom, left:right] == number).mean() > SUGGESTIONS.filled
        if broad and filled and wide * high < SUGGESTIONS.largest * mask.size:
            yield left, top, right, bottom


def _cut(mask: BoolArray, box: Box) -> BoolArray:
    """Return the part of a mask within a box."""
    left, top, right, bottom = box
    return mask[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]


def _drawn_to_edges(box: Box, relief: ReliefMap, photo: Photo, grey: ByteArray) -> Box:
    """Return a box whose sides lie on the straightest edges of the photo near to them."""
    left, top, right, bottom = box
    reach = max(3, round(SUGGESTIONS.reach * min(right - left, bottom - top)))
    grid = relief.grid.window(
        left - reach, top - reach, right - left + 2 * reach, bottom - top + 2 * reach
    )
    inner = relief.r[top:bottom, left:right]
    level = float(np.nanmedian(inner)) if np.isfinite(inner).any() else 0.0
    visible = _seen(photo, grey, grid, level)
    if not np.isfinite(visible).all():
        return box
    sides = []
    for axis, (low, high) in ((1, (left, right)), (0, (top, bottom))):
        # Signed steps add up along a straight edge and cancel on texture.
        part = visible[reach:-reach] if axis == 1 else visible[:, reach:-reach].T
        rise = np.abs(np.diff(cv2.GaussianBlur(part, (0, 0), 1.0), axis=1).mean(axis=0))
        near = rise[: 2 * reach], rise[len(rise) - 2 * reach :]
        first = low - reach + 1 + int(near[0].argmax())
        last = high + reach - len(near[1]) + int(near[1].argmax())
        sides.append((first, last))
    (left, right), (top, bottom) = sides
    return (left, top, right, bottom) if left + 4 < right and top + 4 < bottom else box


def _face_of(
    relief: ReliefMap, grid: Grid, box: Box, photos: Sequence[Photo], greys: Sequence[ByteArray]
) -> Face | None:
    """Return the level plane of a box on which the photos agree best; None where none convinces."""
    left, top, right, bottom = box
    x, y = grid.x0 - grid.gsd / 2, grid.y0 + grid.gsd / 2
    xs, ys = (x + grid.gsd * c for c in (left, right)), (y - grid.gsd * r for r in (top, bottom))
    (x0, x1), (y1, y0) = xs, ys
    ring = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    cut = np.s_[max(top, 0) : bottom, max(left, 0) : right]
    measured = np.where(relief.quality[cut] == Quality.MEASURED, relief.r[cut], np.nan)
    row, column = np.nonzero(np.isfinite(measured))
    around = relief.r[max(top - 20, 0) : bottom + 20, max(left - 20, 0) : right + 20]
    if not np.isfinite(around).any():
        return None
    middle = float(np.nanmedian(around))
    levels = middle + np.arange(-SUGGESTIONS.behind, SUGGESTIONS.before, SUGGESTIONS.step)
    coarse = Grid.from_bounds((x0, y0, x1, y1), gsd=max(grid.gsd, (x1 - x0) / SUGGESTIONS.places))
    scores = np.array([_agreement(photos, greys, coarse, level) for level in levels])
    best = int(scores.argmax())
    score, measured_share = float(scores[best]), measured[row, column]
    # The photos alone tell the level where no other is as good.
    level, spread = float(levels[best]), SUGGESTIONS.step
    rivals = scores[np.abs(levels - level) > SUGGESTIONS.apart]
    certain = (
        score > max(rivals.max(), SUGGESTIONS.alone - SUGGESTIONS.clearly) + SUGGESTIONS.clearly
    )
    certain &= 0 < best < len(levels) - 1
    if (
        not certain and len(measured_share) >= SUGGESTIONS.support
    ):  # else what was measured, if they agree
        xyr = np.column_stack([column * grid.gsd, -row * grid.gsd, measured_share])
        plane, _ = robust_plane(xyr, grid.gsd)
        level = float(plane @ [1, (right - left) * grid.gsd / 2, (top - bottom) * grid.gsd / 2])
        away = np.abs(measured_share - level)
        spread = max(float(np.quantile(away, 0.3)), 0.001)
        certain = (away < 2 * SUGGESTIONS.step).mean() > SUGGESTIONS.supported
        least = max(score - SUGGESTIONS.clearly, SUGGESTIONS.agreement)
        certain &= _agreement(photos, greys, coarse, level) > least
    if not certain:
        return None
    return Face(rings=(ring,), plane=np.array([level, 0.0, 0.0]).round(4), sigma=round(spread, 4))


def _agreement(
    photos: Sequence[Photo], greys: Sequence[ByteArray], grid: Grid, level: float
) -> float:
    """Return the correlation of what the first two photos that see a level show of it; -1: none."""
    patches = []
    for photo, grey in zip(photos, greys, strict=True):
        picture = _seen(photo, grey, grid, level)
        if np.isfinite(picture).mean() > SUGGESTIONS.framed:
            patches.append(picture)
    if len(patches) < 2:
        return -1.0
    both = np.isfinite(patches[0]) & np.isfinite(patches[1])
    first, second = (cv2.GaussianBlur(np.nan_to_num(p), (0, 0), 1.0)[both] for p in patches[:2])
    first, second = first - first.mean(), second - second.mean()
    size = float(np.sqrt((first @ first) * (second @ second)))
    return float(first @ second) / size if size > 0 else -1.0


def _seen(photo: Photo, grey: ByteArray, grid: Grid, level: float) -> Float32Array:
    """Return a level plane as a photo shows it, on a grid; NaN beyond its frame."""
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    xyz = np.stack([x, y, np.full(x.shape, level)], axis=-1)
    pixels = photo.project(xyz.reshape(-1, 3)).reshape(*grid.shape, 2).astype(np.float32)
    size = np.array(grey.shape[::-1])
    with np.errstate(invalid="ignore"):
        framed = ((pixels >= 0) & (pixels <= size - 1)).all(axis=-1)
    picture = cv2.remap(grey, np.nan_to_num(pixels), None, cv2.INTER_LINEAR).astype(np.float32)
    return np.where(framed, picture, np.float32(np.nan))


def _apart(first: Face, second: Face) -> bool:
    """Whether two boxes share no part."""
    (left, low), (right, high) = first.rings[0].min(axis=0), first.rings[0].max(axis=0)
    (west, south), (east, north) = second.rings[0].min(axis=0), second.rings[0].max(axis=0)
    return bool(left >= east or right <= west or low >= north or high <= south)
