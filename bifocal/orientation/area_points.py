"""Points spread evenly over the area that both photos show, for the choice of the wall.

Features crowd on mouldings and joints; smooth plaster has few. A quick dense flow between both
photos, carried to the present plane, counts area instead.
"""

from __future__ import annotations

import cv2
import numpy as np

from bifocal import rays
from bifocal.model import Images
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.orientation.adjustment.pair_observations import PairObservations
from bifocal.orientation.tuning import AREA
from photocore.arrays import BoolArray, ByteArray, FloatArray
from photocore.camera import project


def even_points(
    observations: PairObservations, adjusted: AdjustedPair, images: Images
) -> tuple[FloatArray, FloatArray]:
    """Return points spread evenly over the wall's area, where either photo sees them.

    Parameters
    ----------
    observations, adjusted : PairObservations, AdjustedPair
        Cameras in the frame of any face of the wall.
    images : two ndarrays, shape (h, w), uint8

    Returns
    -------
    pixels1, pixels2 : ndarray, shape (n, 2)
        Raw pixels, to a pixel or so: to be refined.
    """
    far, near = adjusted.cameras
    grid, gsd = _grid(observations, adjusted)
    first, second = (resampled(images[n], _pixels(observations, adjusted, grid, n)) for n in (0, 1))
    flow = _flow(first, second)
    # Rows run down, Y up.
    q2 = grid + flow * np.array([gsd, -gsd])
    feet = [rays.Foot(c.centre[:2], float(c.centre[2])) for c in (far, near)]
    trusted = _trusted(first, second, flow, grid, rays.zoom_centre(feet[0], feet[1]))
    step = max(2, round(np.sqrt(grid.shape[0] * grid.shape[1] / AREA.points)))
    chosen = np.zeros_like(trusted)
    chosen[step // 2 :: step, step // 2 :: step] = True
    chosen &= trusted
    pixels1 = _pixels(observations, adjusted, grid[chosen], 0)
    pixels2 = _pixels(observations, adjusted, q2[chosen], 1)
    fine = np.isfinite(pixels1).all(axis=1) & np.isfinite(pixels2).all(axis=1)
    return pixels1[fine], pixels2[fine]


def _grid(observations: PairObservations, adjusted: AdjustedPair) -> tuple[FloatArray, float]:
    """Return plane positions over what both photos show, and their spacing. [m]"""
    ties = observations.straight_ties(adjusted.radial)[0][observations.tie_used]
    plane = adjusted.media.on_plane(0, adjusted.cameras[0], ties)[:, :2]
    low, high = np.nanpercentile(plane, [1, 99], axis=0)
    gsd = float(np.sqrt(np.prod(high - low) / AREA.pixels))
    x = np.arange(low[0], high[0], gsd)
    y = np.arange(high[1], low[1], -gsd)
    return np.stack(np.meshgrid(x, y), axis=-1), gsd


def _pixels(
    observations: PairObservations, adjusted: AdjustedPair, positions: FloatArray, number: int
) -> FloatArray:
    """Return raw pixels of positions on the reference plane, shape (..., 2)."""
    camera, flat = adjusted.cameras[number], np.zeros((*positions.shape[:-1], 1))
    if adjusted.media:
        foot = adjusted.media.foot(number, camera)
        positions = rays.plane_position(np.concatenate([positions, flat], axis=-1), foot)
    ideal = project(camera, np.concatenate([positions, flat], axis=-1))
    interior = observations.interiors[number]
    return interior.raw(interior.radial(*adjusted.radial[number]).distort(ideal))


def resampled(image: ByteArray, pixels: FloatArray) -> ByteArray:
    """Return a photo's grey values at pixels (h, w, 2), reduced without aliasing; 0 outside."""
    steps = np.linalg.norm(np.diff(pixels, axis=1), axis=-1)
    steps = steps[np.isfinite(steps)]
    reduction = max(1, round(float(np.median(steps)))) if len(steps) else 1
    if reduction > 1:
        image = cv2.blur(image, (reduction, reduction)).astype(np.uint8)
    maps = np.nan_to_num(pixels, nan=-10.0).astype(np.float32)
    moved = cv2.remap(image, maps, None, cv2.INTER_LINEAR, borderValue=0)
    return np.asarray(moved, dtype=np.uint8)


def _flow(first: ByteArray, second: ByteArray) -> FloatArray:
    """Return the flow from the far to the near rectified photo. [px]"""
    equal = cv2.createCLAHE(2.0, (8, 8))
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    return np.asarray(flow.calc(equal.apply(first), equal.apply(second), None), dtype=np.float64)


def _trusted(
    first: ByteArray, second: ByteArray, flow: FloatArray, grid: FloatArray, centre: FloatArray
) -> BoolArray:
    """Return where the flow is along the radius, far from the centre, on something visible."""
    away = grid - centre
    # Picture rows run against Y.
    away = away * np.array([1.0, -1.0])
    radius = np.linalg.norm(away, axis=-1)
    across = np.abs(flow[..., 0] * away[..., 1] - flow[..., 1] * away[..., 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        straight = across / radius < 0.5
    size = np.linalg.norm(grid[0, 0] - grid[-1, -1])
    shown = cv2.erode(np.minimum(first, second), np.ones((9, 9), np.uint8)) > 0
    return straight & (radius > 0.12 * size) & shown
