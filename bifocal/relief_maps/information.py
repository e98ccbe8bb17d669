"""What noise leaves of relief: the pair's own noise, and the texture that both photos share.

Texture counts only as far as both photos show it alike: neither photo's noise, nor the dirt of
JPEG, is taken for information.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps import flow, forward_projection
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame, radial_stretch, values_at, zoom_map
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class InformationTuning:
    """What noise leaves of relief."""

    #: Blur of the photos before their gradients. [px]
    blur: float = 0.8
    #: Side of the window in which information is summed. [px]
    #: Evidence: error/sigma 99 % of white and palazzo (5001, a quarter): 15 px 7.6 and 5.6, 7 px
    #: 5.9 and 4.1, without 7.9 and 7.0.
    window: int = 7
    #: Most that noise adds to sigma. [px]
    most: float = 3.0
    #: Side of the tiles in which the noise of the pair is estimated. [px]
    tile: int = 64
    #: A tile with fewer matched pixels takes the usual noise. [px]
    fewest: int = 60
    #: Least noise: that of whole grey levels. [grey levels]
    least_noise: float = 0.35


INFORMATION = InformationTuning()


def sigma_of_noise(frame: Frame, relief: Float32Array, matched: BoolArray) -> Float32Array:
    """Return what noise makes of matching along the radius at the pixels of photo 1. [px]

    With radial gradients g1, g2 of the photos laid on each other by a relief, the normal equation
    of a shift along the radius has the weight S12 = sum g1 g2 over a window, so that
    sigma = s_e / sqrt(S12); s_e is the deviation of the photos' difference where they ``matched``.
    """
    x, y = frame.from_centre()
    radius = np.maximum(np.hypot(x, y), np.float32(1))
    border = cv2.BORDER_REPLICATE
    first = frame.image1.astype(np.float32)
    second = frame.image2.astype(np.float32)
    second = cv2.remap(second, *zoom_map(frame, relief), cv2.INTER_LINEAR, borderMode=border)
    noise = _noise(np.asarray(first - second), matched)
    slopes = []
    for image in (first, second):
        smooth = cv2.GaussianBlur(image, (0, 0), INFORMATION.blur)
        across, down = (
            cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3, scale=0.125)
            for order in ((1, 0), (0, 1))
        )
        slopes.append((across * x + down * y) / radius)
    n = INFORMATION.window
    shared = np.maximum(cv2.blur(slopes[0] * slopes[1], (n, n)), np.float32(1e-4))
    return np.asarray(np.minimum(noise / np.sqrt(shared) / n, np.float32(INFORMATION.most)))


def with_sigma_of_noise(
    frame: Frame, source: MapBands, valid: BoolArray, bands: MapBands, grid: Grid
) -> MapBands:
    """Return the map with what noise adds to the sigma of what was measured."""
    sigma_px = sigma_of_noise(frame, source.r, valid) * radial_stretch(frame)
    places = forward_projection.seen_by_first(frame, grid, np.nan_to_num(bands.r))
    noise = values_at(flow.sigma_of_relief(frame, source.r, sigma_px), places, cv2.INTER_NEAREST)
    measured = bands.quality == Quality.MEASURED
    return bands._replace(sigma=np.where(measured, np.hypot(bands.sigma, noise), bands.sigma))


def _noise(apart: Float32Array, matched: BoolArray) -> Float32Array:
    """Return the robust deviation of a difference in tiles, interpolated. [grey levels]"""
    every, side = np.s_[::2, ::2], INFORMATION.tile // 2
    fine, matched = np.abs(apart[every] - cv2.blur(apart, (5, 5))[every]), matched[every]
    tiles = np.full([-(-length // side) for length in fine.shape], np.nan, np.float32)
    for i, j in np.ndindex(tiles.shape):
        box = np.s_[i * side : (i + 1) * side, j * side : (j + 1) * side]
        values = fine[box][matched[box]]
        if len(values) > INFORMATION.fewest:
            tiles[i, j] = 1.4826 * np.median(values)
    finite = np.isfinite(tiles)
    tiles[~finite] = np.median(tiles[finite]) if finite.any() else np.median(1.4826 * fine)
    tiles = np.maximum(tiles, np.float32(INFORMATION.least_noise))
    if min(tiles.shape) > 2:
        tiles = cv2.medianBlur(tiles, 3)
    return np.asarray(cv2.resize(tiles, apart.shape[::-1], interpolation=cv2.INTER_LINEAR))
