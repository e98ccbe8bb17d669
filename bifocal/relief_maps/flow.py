"""Seeded optical flow between both photos, read along and across the radius."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from bifocal import rays
from bifocal.model.image import QUIET_BLUR, local_contrast, noise
from bifocal.relief_maps.flow_refinement import refined
from bifocal.relief_maps.frame import Frame, offsets, radial_stretch, zoom_map
from photocore.arrays import BoolArray, ByteArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowTuning:
    """Flow between the photos."""

    #: Weight of smoothness.
    #: Evidence: 30 is as good before noise is taken out, 20 keeps more detail for it.
    alpha: float = 20.0
    #: The same on plain walls, between blurred photos: the texture lies in the noise.
    #: Evidence: plaster, façade 62: 6.4 to 6.1 mm of median error, measured RMSE 14 to 11.6 mm;
    #: textured façades get worse by it.
    plain_alpha: float = 60.0
    #: A photo is plain if this share of it has less contrast within 15 px, blurred, than its noise
    #: is. [per cent]
    #: Evidence: 0.4 to 0.7 times on plaster (façades 12 and 62, loggia 302), whose median edges and
    #: bars can lift to 4; at half the resolution, where a smoother flow does harm, 1.2 and more;
    #: 2.9 to 10 on textured façades and churches.
    plain_share: int = 30
    #: Weight of constant grey value, against 10 for constant gradient.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.99 / -0.84, plaster facade +0.32 / -1.14,
    #: church +0.76 / -0.44.
    delta: float = 10.0
    #: Stride of the inverse search's patches. [px]
    stride: int = 3
    #: The same in small frames: a little better and half as slow again. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.03 / +0.43, plaster facade +1.01 / -0.42,
    #: church -0.24 / -0.16.
    fine_stride: int = 2
    #: The pyramid starts this many halvings down: the seed replaces what lies above.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.00 / -0.13,
    #: church +0.00 / +0.10.
    coarsest: int = 3
    #: Photos that miss the radius by more, in the median, are not refined: they fit no better than
    #: that. [px]
    #: Evidence: fast, church_2: 0.45 px, refined 2.5 instead of 2.0 % beyond 10 cm; semireal
    #: church: 0.04 px.
    fit: float = 0.3
    #: Window of the local error across the radius. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.30 / +0.38, plaster facade -1.48 / +1.94,
    #: church -0.50 / +0.44.
    window: int = 31
    #: Errors across the radius count no more than this. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.02 / +0.24, plaster facade -0.76 / +0.59,
    #: church -0.04 / +0.08.
    clip: float = 2.0
    #: The local error across the radius is no less than this. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.09 / +0.39, plaster facade -0.03 / +0.09,
    #: church -0.03 / +0.09.
    floor: float = 0.02
    #: Larger photos are matched in bands of about so many pixels: each pixel takes 0.22 kB.
    #: Evidence: standard, whole and in two bands, each on two grids: church_1 2.0 and 1.4 GB,
    #: median 4.6 and 4.5 mm, beyond 10 cm or missing 8.55 and 8.74 %, beyond 3 cm 14.6 both;
    #: church_2 7.5 and 7.3 mm, 1.0 and 1.1, 7.1 and 6.9 %; castle_B, in bands it does not need,
    #: 5.5 and 5.7 mm, .6 and .4, 4.1 and 4.2 %.
    most: int = 5_000_000
    #: Bands begin at multiples of this: the pyramid's pixels and the patches are then those of the
    #: whole photo. [px]
    #: Evidence: church_1 in two bands that begin anywhere: 9.2 in place of 8.7 % beyond 10 cm.
    lattice: int = 48
    #: Rows that a band is matched with beyond its own, and beyond how far they move there. [px]
    #: Evidence: church_1, standard in two bands: 30 and 400 px are no better.
    beyond: int = 96


FLOW = FlowTuning()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measurement:
    """Relief of the pixels of photo 1.

    Attributes
    ----------
    r : ndarray of float32, shape (height, width)
        Relief. [m]
    across : ndarray of float32
        Flow across the radius: zero but for errors. [px]
    loop : ndarray of float32
        Distance between a pixel and itself after flow there and back. [px]
    sigma_px : ndarray of float32
        Local RMS of ``across``, times `radial_stretch`: matching precision along the radius. [px]
    plain : bool
        Whether a good part of photo 1 has less contrast than noise.
    refined : bool
        Whether photos of twice the resolution refined the flow: its noise is that of their pixels.
    """

    r: Float32Array
    across: Float32Array
    loop: Float32Array
    sigma_px: Float32Array
    plain: bool = False
    refined: bool = False


def seeded_flow(
    first: ByteArray,
    second: ByteArray,
    seed: Float32Array,
    *,
    finest: int,
    stride: int = FLOW.stride,
    alpha: float = FLOW.alpha,
) -> Float32Array:
    """Return the displacement of every pixel of one image in the other, (height, width, 2). [px]

    Parameters
    ----------
    first, second : ndarray of uint8
    seed : ndarray of float32, shape (height, width, 2)
        First displacement; kept.
    finest : int
        0 runs to full resolution, 1 to half of it.
    stride : int
        Between patches. [px]
    alpha : float
        Weight of smoothness.

    Notes
    -----
    Dense inverse search with variational refinement (Kroeger et al. 2016), OpenCV's "medium".
    Windowed matchers, log-polar and ortho-space sweeps were three to six times less precise.
    """
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow.setFinestScale(finest)
    flow.setVariationalRefinementAlpha(alpha)
    flow.setVariationalRefinementDelta(FLOW.delta)
    flow.setPatchStride(stride)
    if hasattr(flow, "setCoarsestScale"):  # OpenCV below 4.13 begins where a quarter fits
        flow.setCoarsestScale(max(FLOW.coarsest, finest))
    photos = first, second, np.ascontiguousarray(seed)
    parts = []
    for low, start, stop, high in _bands(seed):
        matched = flow.calc(*(np.ascontiguousarray(photo[low:high]) for photo in photos))
        parts.append(np.asarray(matched, np.float32)[start - low : stop - low])
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _bands(seed: Float32Array) -> Iterator[tuple[int, int, int, int]]:
    """Yield the rows matched at a time: where they begin for the matcher, themselves, its end.

    Whatever lies beside a band's edge is matched with it as far as the seed says that it moves.
    """
    height, width = seed.shape[:2]
    count = -(-height * width // FLOW.most)
    inner = (round(height * k / count / FLOW.lattice) * FLOW.lattice for k in range(1, count))
    edges = [0, *inner, height]
    reach = [0]
    for row in edges[1:-1]:
        near = seed[max(0, row - 4 * FLOW.beyond) : row + 4 * FLOW.beyond, :, 1]
        reach.append(FLOW.lattice * math.ceil((FLOW.beyond + np.abs(near).max()) / FLOW.lattice))
    reach.append(0)
    for (start, above), (stop, below) in pairwise(zip(edges, reach, strict=True)):
        yield max(0, start - above), start, stop, min(height, stop + below)


def measure(
    frame: Frame, coarse: Float32Array, *, stride: int = FLOW.stride, finer: Frame | None = None
) -> Measurement:
    """Match both photos and return the relief of the pixels of photo 1.

    Parameters
    ----------
    frame : Frame
    coarse : ndarray of float32
        First relief, of any size. [m]
    stride : int
        Between patches. [px]
    finer : Frame, optional
        The same at twice the resolution, for a last step; left alone where the walls are plain
        or the photos do not fit well.
    """
    seed, photos, alpha = _seed(frame, coarse), frame, FLOW.alpha
    plain = _is_plain(frame)
    if plain:
        first, second = (
            cv2.GaussianBlur(image, (0, 0), QUIET_BLUR) for image in (frame.image1, frame.image2)
        )
        photos, alpha = replace(frame, image1=first, image2=second), FLOW.plain_alpha
    flow = seeded_flow(photos.image1, photos.image2, seed, finest=0, stride=stride, alpha=alpha)
    loop = _loop(photos, flow, alpha)
    relief, across = split(frame, flow)
    refine = not plain and float(np.median(np.abs(across[::8, ::8]))) < FLOW.fit
    if finer is not None and refine:
        flow = refined(flow, finer.image1, finer.image2)
        relief, across = split(frame, flow)
    refine &= finer is not None
    stretched = radial_stretch(frame)
    side = FLOW.window // 2 if refine else FLOW.window
    rms = cv2.blur(np.minimum(across * across, FLOW.clip * FLOW.clip), (side, side))
    sigma_px = np.sqrt(rms + np.float32(FLOW.floor**2)) * stretched
    return Measurement(
        r=relief, across=across, loop=loop, sigma_px=sigma_px, plain=plain, refined=refine
    )


def _seed(frame: Frame, coarse: Float32Array) -> Float32Array:
    """Return the flow of a relief of any size, (height, width, 2). [px]"""
    height, width = frame.grid.shape
    relief = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    columns, rows = zoom_map(frame, relief)
    x, y = offsets((height, width))
    return np.asarray(cv2.merge([columns - x, rows - y]), np.float32)


def _is_plain(frame: Frame) -> bool:
    """Return whether a good part of photo 1 has less contrast than noise."""
    contrast = local_contrast(frame.image1)[frame.seen1][::7]  # it varies slowly
    return bool(np.percentile(contrast, FLOW.plain_share) < noise(frame.image1, frame.seen1))


def split(frame: Frame, flow: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Return relief [m] and the flow across the radius [px] of a flow from photo 1."""
    if frame.pair.refracted:
        return _split_bent(frame, flow)
    x, y = frame.from_centre()
    square = x * x + y * y
    np.maximum(square, np.float32(1e-3), out=square)
    d1, d2 = frame.distances
    factor = 1 + (flow[..., 0] * x + flow[..., 1] * y) / square
    relief = rays.relief_from_zoom(factor, d1=d1, d2=d2).astype(np.float32)
    across = (flow[..., 1] * x - flow[..., 0] * y) / np.sqrt(square)
    return relief, across.astype(np.float32)


def _rates(
    frame: Frame, column: Float32Array, row: Float32Array
) -> tuple[Float32Array, Float32Array]:
    """Return how rays of photo 2 at (column, row) and those of photo 1 part with relief. [px/m]

    Along columns and rows.
    """
    x1, y1 = frame.slopes(1, *offsets(frame.grid.shape))
    x2, y2 = frame.slopes(2, column, row)
    return x1 - x2, y1 - y2


def _split_bent(frame: Frame, flow: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Return `split` for rays through media: linear in r, as `rays.relief_of_rays`."""
    x, y = offsets(frame.grid.shape)
    rate_x, rate_y = _rates(frame, x + flow[..., 0], y + flow[..., 1])
    square = np.maximum(rate_x * rate_x + rate_y * rate_y, np.float32(1e-6))
    relief = (flow[..., 0] * rate_x + flow[..., 1] * rate_y) / square
    across = (flow[..., 1] * rate_x - flow[..., 0] * rate_y) / np.sqrt(square)
    relief[~(relief < frame.pair.highest_relief)] = np.nan
    return relief.astype(np.float32), across.astype(np.float32)


def sigma_of_relief(frame: Frame, relief: Float32Array, sigma_px: Float32Array) -> Float32Array:
    """Return the standard deviation of r from a matching precision in pixels. [m]

    ``sigma_r = sigma_m B / s'`` at r = 0 with B = d1 d2 / (d1 - d2): `precision.sigma_relief`
    with all error in image 2.
    """
    if frame.pair.refracted:
        rate_x, rate_y = _rates(frame, *zoom_map(frame, relief))
        away = np.maximum(np.hypot(rate_x, rate_y), np.float32(0.5 / frame.pair.base_factor))
        share = np.abs(rays.reduction(relief, np.float32(frame.distances[1])))
        return np.asarray(share * sigma_px / away, dtype=np.float32)
    x, y = frame.from_centre()
    reach = np.maximum(np.sqrt(x * x + y * y), np.float32(0.5))
    d1, d2 = frame.distances
    rate = rays.relief_per_zoom(relief, d1=d1, d2=d2)
    return np.asarray(np.abs(rate) * sigma_px / reach, dtype=np.float32)


def _loop(frame: Frame, flow: Float32Array, alpha: float) -> Float32Array:
    """Return how far a pixel lands from itself after the flow there and back. [px]"""
    x, y = offsets(frame.grid.shape)
    ends = (flow[..., 0] + x, flow[..., 1] + y)
    seed = _turned_round(flow)
    back = seeded_flow(frame.image2, frame.image1, seed, finest=1, alpha=alpha)
    moved = cv2.remap(back, *ends, cv2.INTER_LINEAR, borderValue=(1e3, 1e3))
    away: Float32Array = np.hypot(flow[..., 0] + moved[..., 0], flow[..., 1] + moved[..., 1])
    return away


def _turned_round(flow: Float32Array) -> Float32Array:
    """Return a smooth estimate of the flow the other way, for a seed.

    Each coarse pixel of photo 2 takes the flow of the pixels that land there; the fixed point of
    ``back(q) = -flow(q + back(q))`` is reached in a few steps where the flow is smooth.
    """
    height, width = flow.shape[:2]
    size = (max(8, width // 8), max(8, height // 8))
    small = cv2.medianBlur(cv2.resize(flow, size, interpolation=cv2.INTER_AREA), 5)
    scale = np.array([size[0] / width, size[1] / height], dtype=np.float32)
    x, y = offsets(small.shape[:2])
    back = -small
    for _ in range(6):
        columns, rows = x + back[..., 0] * scale[0], y + back[..., 1] * scale[1]
        back = -cv2.remap(small, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(back, (width, height), interpolation=cv2.INTER_LINEAR))


def is_inside(frame: Frame, relief: Float32Array) -> BoolArray:
    """Return which pixels of photo 1 fall on photo 2's content at their relief."""
    columns, rows = zoom_map(frame, relief)
    content = cv2.remap(frame.seen2.astype(np.uint8), columns, rows, cv2.INTER_NEAREST)
    return np.asarray(frame.seen1 & (content > 0))
