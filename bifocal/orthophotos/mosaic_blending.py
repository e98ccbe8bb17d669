"""Several rasters of one wall made one: seams, equal exposure, blending, window by window."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import SAME_PIXEL, Bounds, Grid, bounds_of
from bifocal.orthophotos.pull_push import fill_holes
from bifocal.orthophotos.tuning import BLENDING
from photocore.arrays import BoolArray, Float32Array, FloatArray, IntArray
from photocore.errors import InputError

#: Surroundings of a window that its blending needs; a multiple of 2^LEVELS. [px]
HALO = 2 ** (BLENDING.levels + 2)


#: A layer's values, shape (h, w, bands), and which of them are valid, shape (h, w).
Seen = tuple[NDArray[Any], BoolArray]


class Layer(Protocol):
    """One raster of a mosaic."""

    @property
    def grid(self) -> Grid:
        """Where its pixels are."""

    def read(self, column: int, row: int, width: int, height: int) -> Seen:
        """Return a window, shape (h, w, bands), and its validity; empty beyond the edges."""

    def reduced(self, width: int, height: int) -> Seen:
        """Return the whole raster shrunk to a size."""


@dataclass(frozen=True, slots=True, eq=False)
class SeamPlan:
    """Who fills which part of a mosaic, worked out on a coarse grid.

    Attributes
    ----------
    coarse : Grid
    labels : ndarray of int, shape of coarse
        Index of the layer from 0; -1 where there is none.
    rank : ndarray of float32, shape (layers, h, w)
        How deep within each layer a place lies: who comes next where the chosen one is empty.
    gains : ndarray, shape (layers, bands)
        Factors that make the colours equal.
    differences : dict of (int, int) to float
        Median difference of two layers on their overlap, before any gain; first band.
    likeness : dict of (int, int) to float
        Correlation of what two layers show on their overlap, where it is wide enough to tell.
    """

    coarse: Grid
    labels: IntArray
    rank: Float32Array
    gains: FloatArray
    differences: dict[tuple[int, int], float]
    likeness: dict[tuple[int, int], float]


def common_grid(
    layers: Sequence[Layer],
    *,
    gsd: float | None = None,
    bounds: Bounds | None = None,
) -> Grid:
    """Return a grid that covers all layers; on the lattice of the first of the finest if it can.

    Raises
    ------
    InputError
        If the layers lie too far apart to show one wall, or the box is empty.
    """
    _refuse_unrelated([layer.grid.bounds for layer in layers])
    finest = min(layers, key=lambda layer: layer.grid.gsd).grid
    gsd = gsd or finest.gsd
    if bounds is None:
        bounds = bounds_of(np.array([layer.grid.bounds for layer in layers]))
    if gsd > max(bounds[2] - bounds[0], bounds[3] - bounds[1]) > 0:
        raise InputError(f"gsd: a pixel of {gsd:g} m is larger than the mosaic; give a finer one.")
    if abs(gsd / finest.gsd - 1) > 1e-9:
        return Grid.from_bounds(bounds, gsd=gsd)
    left, _, _, top = finest.bounds
    c0 = math.floor((bounds[0] - left) / gsd + SAME_PIXEL)
    c1 = math.ceil((bounds[2] - left) / gsd - SAME_PIXEL)
    r0 = math.floor((top - bounds[3]) / gsd + SAME_PIXEL)
    r1 = math.ceil((top - bounds[1]) / gsd - SAME_PIXEL)
    if c1 <= c0 or r1 <= r0:
        raise InputError("bounds: the box is empty.")
    return finest.window(c0, r0, c1 - c0, r1 - r0)


def _refuse_unrelated(boxes: Sequence[Bounds]) -> None:
    """Refuse rasters with more room to all others than the larger of two is wide or high."""
    box = np.array(boxes)
    low, high = box[:, :2], box[:, 2:]
    gap = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).max(axis=2)
    side = (high - low).max(axis=1)
    joined, reached = gap <= np.maximum(side[:, None], side[None]), np.arange(len(box)) == 0
    for _ in boxes:
        reached = joined[reached].any(axis=0)
    if not reached.all():
        alone = int(np.argmin(reached))
        raise InputError(
            f"rasters 1 and {alone + 1} have nothing in common: they cover X, Y "
            f"{low[0].round(3).tolist()} to {high[0].round(3).tolist()} and "
            f"{low[alone].round(3).tolist()} to {high[alone].round(3).tolist()} m. A mosaic needs "
            "rasters of one wall in one frame."
        )


def _likeness(
    images: Sequence[Float32Array], valid: Sequence[BoolArray]
) -> dict[tuple[int, int], float]:
    """Return the correlation of layers that overlap widely and show something; refuse strangers."""
    likenesses = {}
    fine = [_detail(image, mask) for image, mask in zip(images, valid, strict=True)]
    for i, j in combinations(range(len(images)), 2):
        both = valid[i] & valid[j]
        if np.count_nonzero(both) < BLENDING.telling:
            continue
        a, b = fine[i][both], fine[j][both]
        spread = float(a.std()), float(b.std())
        if min(spread) < BLENDING.contrast:
            continue
        likeness = float(np.mean((a - a.mean()) * (b - b.mean()))) / (spread[0] * spread[1])
        if likeness < BLENDING.alike:
            raise InputError(
                f"rasters {i + 1} and {j + 1} overlap but have nothing in common (correlation "
                f"{likeness:+.2f}): their X and Y are not of one frame. Orient their pairs by "
                "control points in one system, then make them again."
            )
        likenesses[i, j] = likeness
    return likenesses


def _detail(image: Float32Array, visible: BoolArray) -> Float32Array:
    """Return the first band less its surroundings, from which light and tilt are gone."""
    band = np.where(visible, np.nan_to_num(image[:, :, 0]), np.float32(0))
    side = (max(band.shape) // 12 | 1,) * 2
    share = cv2.blur(visible.astype(np.float32), side)
    return np.asarray(band - cv2.blur(band, side) / np.maximum(share, 1e-6), np.float32)


def plan_mosaic(
    layers: Sequence[Layer],
    grid: Grid,
    *,
    priority: bool = False,
    gain: bool = True,
    relief: Callable[[Grid], Float32Array] | None = None,
) -> SeamPlan:
    """Work out seams and gains.

    Parameters
    ----------
    priority : bool
        Earlier layers cover later ones; otherwise seams are sought.
    gain : bool
        Make the colours equal to the first layer's.
    relief : callable, optional
        Gives the relief of the wall on a grid: seams keep away from its edges. [m]

    Raises
    ------
    InputError
        If two layers overlap and show different things.

    Notes
    -----
    The first layer keeps its exposure, and so does the first of any others that do not touch it.
    Each layer owns what it sees from deep within; between owners the seam is a watershed (after
    Soille, "Morphological image compositing", 2006) that runs where the layers agree, away from
    edges of the relief and from holes, which lie right behind such edges.
    """
    side = min(
        max(BLENDING.coarse_share * max(grid.shape), BLENDING.coarse_least), BLENDING.coarse_most
    )
    coarse = Grid.from_bounds(grid.bounds, gsd=grid.gsd * max(1.0, max(grid.shape) / side))
    images, valid = zip(*(_onto(layer, coarse) for layer in layers), strict=True)
    likeness = _likeness(images, valid)
    depth = np.stack([_depth(mask) for mask in valid])
    gains, differences = _gains(images, valid, wanted=gain)
    if priority:
        labels = np.where(np.any(valid, axis=0), np.argmax(valid, axis=0), -1)
        order = np.arange(len(layers), 0, -1, dtype=np.float32)
        rank = np.broadcast_to(order[:, None, None], (len(layers), *coarse.shape))
        return SeamPlan(coarse, labels, rank, gains, differences, likeness)
    even = [image * factor for image, factor in zip(images, gains, strict=True)]
    edges = None if relief is None else relief(coarse)
    labels = _seams(even, valid, depth, edges, coarse.gsd)
    return SeamPlan(coarse, labels, depth, gains, differences, likeness)


def mosaic_window(
    layers: Sequence[Layer], plan: SeamPlan, window: Grid, *, blend: bool
) -> tuple[NDArray[Any], IntArray]:
    """Return a window of the mosaic, shape (h, w, bands), and the layer of each pixel, -1 none."""
    halo = HALO if blend else 0
    wide = window.window(-halo, -halo, window.width + 2 * halo, window.height + 2 * halo)
    touching = [k for k, layer in enumerate(layers) if _overlap(layer.grid, wide)]
    parts = {k: window_of(layers[k], wide) for k in touching}
    owner = _owners(plan, wide, {k: mask for k, (_, mask) in parts.items()})
    core = np.s_[halo : halo + window.height, halo : halo + window.width]
    used = [k for k in touching if (owner == k).any()]
    if not used:
        bands = layers[0].read(0, 0, 1, 1)[0]
        return np.zeros((*window.shape, bands.shape[2]), bands.dtype), owner[core]
    dtype = parts[used[0]][0].dtype
    if dtype.kind == "f":
        # Values, not colours: never mixed, never scaled.
        values = np.full((*wide.shape, parts[used[0]][0].shape[2]), np.nan, dtype)
        for k in used:
            values[owner == k] = parts[k][0][owner == k]
        return values[core], owner[core]
    images = {k: parts[k][0].astype(np.float32) * plan.gains[k].astype(np.float32) for k in used}
    if blend and len(used) > 1:
        mixed = _blended(images, {k: parts[k][1] for k in used}, owner)
    else:
        mixed = np.zeros_like(images[used[0]])
        for k in used:
            mixed[owner == k] = images[k][owner == k]
    mixed[owner < 0] = 0
    limit = np.iinfo(dtype).max
    return np.clip(np.rint(mixed[core]), 0, limit).astype(dtype), owner[core]


def window_of(layer: Layer, grid: Grid) -> Seen:
    """Return a layer on a window's pixels; resampled (cubic) only if its own lie elsewhere."""
    offset = grid.whole_offset_in(layer.grid)
    if offset is not None:
        return layer.read(*offset, grid.width, grid.height)
    window, columns, rows = grid.resampling(layer.grid, 3)
    image, mask = layer.read(*window)
    values = image.dtype.kind == "f"
    if not values and not mask.all():
        image = np.where(mask[:, :, None], image, _around(image, mask))
    flag = cv2.INTER_NEAREST if values else cv2.INTER_CUBIC
    moved = cv2.remap(image, columns, rows, flag, borderMode=cv2.BORDER_REPLICATE)
    inside = cv2.remap(mask.astype(np.uint8), columns, rows, cv2.INTER_NEAREST)
    return moved.reshape(*grid.shape, -1), inside > 0


def _around(image: NDArray[Any], visible: BoolArray) -> NDArray[Any]:
    """Return the mean colour of what is seen within 3 px: cubic weights reach 2 px into holes."""
    share = cv2.blur(visible.astype(np.float32), (7, 7))[:, :, None]
    sums = np.atleast_3d(
        cv2.blur(np.where(visible[:, :, None], image, 0).astype(np.float32), (7, 7))
    )
    return (sums.reshape(image.shape) / np.maximum(share, 1e-6)).astype(image.dtype)


def _onto(layer: Layer, coarse: Grid) -> tuple[Float32Array, BoolArray]:
    """Return a layer on the coarse grid, colours 0..1 (values stay as they are)."""
    grid = layer.grid
    width = max(1, round(grid.width * grid.gsd / coarse.gsd))
    height = max(1, round(grid.height * grid.gsd / coarse.gsd))
    image, mask = layer.reduced(width, height)
    scale = 1.0 if image.dtype.kind == "f" else 1.0 / np.iinfo(image.dtype).max
    xmin, ymin, xmax, ymax = grid.bounds
    column = (coarse.columns_x - xmin) / (xmax - xmin) * width - 0.5
    row = (ymax - coarse.rows_y) / (ymax - ymin) * height - 0.5
    columns, rows = np.meshgrid(column.astype(np.float32), row.astype(np.float32))
    colours = np.nan_to_num(image.astype(np.float32)) * np.float32(scale)
    moved = cv2.remap(colours, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    inside = cv2.remap(mask.astype(np.uint8), columns, rows, cv2.INTER_NEAREST)
    return moved.reshape(*coarse.shape, -1), inside > 0


def _depth(visible: BoolArray) -> Float32Array:
    """Return how far a place is from the rim of a layer, holes within it not counted. [px]"""
    # A rim of zeros: the edge of the raster is an edge of the layer as well.
    padded = np.pad(visible.astype(np.uint8), 1)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((31, 31), np.uint8))
    closed[[0, -1]], closed[:, [0, -1]] = 0, 0
    depth = cv2.distanceTransform(closed, cv2.DIST_L2, 5)[1:-1, 1:-1]
    return np.asarray(depth, dtype=np.float32)


def _gains(
    images: Sequence[Float32Array], valid: Sequence[BoolArray], *, wanted: bool
) -> tuple[FloatArray, dict[tuple[int, int], float]]:
    """Return the factors that make common parts equal, by least squares over all overlaps.

    The first layer, and the first of each further group of layers, keeps its colours.
    """
    count, bands = len(images), images[0].shape[2]
    normal = np.eye(count) * 1e-3
    group = np.arange(count)
    right = np.zeros((count, bands))
    differences = {}
    for i, j in combinations(range(count), 2):
        both = valid[i] & valid[j]
        if np.count_nonzero(both) < BLENDING.least_overlap:
            continue
        a, b = images[i][both], images[j][both]
        differences[i, j] = float(np.median(a[:, 0] - b[:, 0]))
        usable = ((a > 0.02) & (a < 0.98) & (b > 0.02) & (b < 0.98)).all(axis=1)
        if not wanted or np.count_nonzero(usable) < BLENDING.least_overlap:
            continue
        ratio = np.median(np.log(a[usable]) - np.log(b[usable]), axis=0)
        weight = math.sqrt(np.count_nonzero(usable))
        group[group == group[j]] = group[i]
        normal[np.ix_([i, j], [i, j])] += weight * np.array([[1, -1], [-1, 1]])
        right[i] -= weight * ratio
        right[j] += weight * ratio
    if not wanted:
        return np.ones((count, bands)), differences
    first = np.unique(group, return_index=True)[1]
    normal[first, first] += 1e9
    return np.exp(np.linalg.solve(normal, right)), differences


def _seams(
    images: Sequence[Float32Array],
    valid: Sequence[BoolArray],
    depth: Float32Array,
    relief: Float32Array | None,
    gsd: float,
) -> IntArray:
    """Return the layer of every place, with seams where they are seen least."""
    from skimage.segmentation import watershed

    any_valid = np.logical_or.reduce(list(valid))
    best = depth.argmax(axis=0)
    second = np.partition(depth, -2, axis=0)[-2] if len(images) > 1 else np.zeros_like(depth[0])
    # Undisputed: nobody else near, or clearly deeper within its own layer than within any other.
    sure = (second <= 0) | (depth.max(axis=0) > 3 * second + 4)
    markers = np.where(sure & (depth.max(axis=0) > 0), best + 1, 0).astype(np.int32)
    cost = np.zeros(best.shape, np.float32)
    for i, j in combinations(range(len(images)), 2):
        apart = np.abs(images[i] - images[j]).mean(axis=2)
        cost = np.maximum(cost, np.where(valid[i] & valid[j], apart, 0))
    spread = float(np.percentile(cost[any_valid], 90)) if any_valid.any() else 0.0
    cost = cv2.GaussianBlur(cost / max(spread, 1e-3), (0, 0), 1.5)
    for mask in valid:
        holes = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((31, 31)))
        near = cv2.distanceTransform((~((holes > 0) & ~mask)).astype(np.uint8), cv2.DIST_L2, 3)
        cost += np.exp(-near / np.float32(BLENDING.shy))
    if relief is not None:
        dy, dx = np.gradient(np.nan_to_num(relief), gsd)
        edge = (np.hypot(dx, dy) > BLENDING.edge_slope).astype(np.uint8)
        near = cv2.distanceTransform(1 - edge, cv2.DIST_L2, 3)
        cost += 2 * np.exp(-near / np.float32(BLENDING.shy))
    # Watersheds run along crests, seams along the valleys of the cost: turn it over.
    level = (1e4 / (0.05 + cost)).astype(np.int32)
    flooded = watershed(level, markers, mask=any_valid)
    labels = np.where(flooded > 0, flooded - 1, np.where(any_valid, best, -1))
    return np.asarray(labels, dtype=np.int64)


def _overlap(a: Grid, b: Grid) -> bool:
    first, second = a.bounds, b.bounds
    return all(first[k] < second[k + 2] and second[k] < first[k + 2] for k in (0, 1))


def _owners(plan: SeamPlan, grid: Grid, visible: dict[int, BoolArray]) -> IntArray:
    """Return the layer of every pixel: the planned one, or the next that sees it."""
    coarse = plan.coarse
    column = np.rint((grid.columns_x - coarse.x0) / coarse.gsd).astype(int)
    row = np.rint((coarse.y0 - grid.rows_y) / coarse.gsd).astype(int)
    at = np.ix_(row.clip(0, coarse.height - 1), column.clip(0, coarse.width - 1))
    owner = plan.labels[at].copy()
    good = np.zeros(grid.shape, bool)
    for k, valid in visible.items():
        good |= (owner == k) & valid
    if good.all():
        return owner
    order = np.full(grid.shape, -1.0, np.float32)
    next_best = np.full(grid.shape, -1, np.int64)
    for k, valid in visible.items():
        better = valid & (plan.rank[k][at] > order)
        order = np.where(better, plan.rank[k][at], order)
        next_best[better] = k
    return np.where(good, owner, next_best)


def _blended(
    images: dict[int, Float32Array], valid: dict[int, BoolArray], owner: IntArray
) -> Float32Array:
    """Return the images mixed band by band (Burt and Adelson 1983)."""
    total: list[Float32Array] = []
    weights: list[Float32Array] = []
    # Beyond its rim a layer goes on as the plain mosaic: layers that agree blend into themselves.
    plain = np.zeros_like(next(iter(images.values())))
    for k, raw in images.items():
        plain[owner == k] = raw[owner == k]
    if (owner < 0).any():
        plain = np.nan_to_num(fill_holes(plain, owner >= 0, owner < 0)[0])
    for k, raw in images.items():
        image = np.where(valid[k][:, :, None], raw, plain)
        share = (owner == k).astype(np.float32)
        for level in range(BLENDING.levels + 1):
            last = level == BLENDING.levels
            small = image if last else cv2.pyrDown(image)
            size = (image.shape[1], image.shape[0])
            detail = image if last else image - cv2.pyrUp(small, dstsize=size).reshape(image.shape)
            part = detail * share[:, :, None]
            if level == len(total):
                total.append(part)
                weights.append(share.copy())
            else:
                total[level] += part
                weights[level] += share
            if not last:
                image = small.reshape(*small.shape[:2], -1)
                share = cv2.pyrDown(share)
    out = total[BLENDING.levels] / np.maximum(weights[BLENDING.levels], 1e-9)[:, :, None]
    for level in range(BLENDING.levels - 1, -1, -1):
        detail = total[level] / np.maximum(weights[level], 1e-9)[:, :, None]
        size = (detail.shape[1], detail.shape[0])
        out = cv2.pyrUp(out, dstsize=size).reshape(detail.shape) + detail
    return np.asarray(out, dtype=np.float32)
