"""What both photos tell of relief: their noise, and the texture that they share.

The noise is that of the registered pair, and texture counts only as far as both photos show it
alike: neither photo's noise, nor the dirt of JPEG, is taken for information.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps import flow, forward_projection
from bifocal.relief_maps.evidence import EVIDENCE
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame, radial_stretch, values_at, zoom_map
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class InformationTuning:
    """What both photos tell of relief."""

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
    #: Window over which the photos must fit better than a pixel farther on. [px]
    #: Evidence: measured, wrong by 3 cm, of all pixels [%], white, palazzo, arcade, street (5001, a
    #: quarter): none 6.7, 4.3, 6.8, 8.2; 7 px 2.9, 2.3, 6.0, 7.0, but arcade and street lose 8 and
    #: 5 points of what is measured; 11 px 3.7, 2.6, 6.6, 7.6 (3 and 3); 15 px 4.2, 2.9, 6.6, 7.8.
    fit: tuple[int, int] = (11, 11)
    #: Window over which a difference of exposure is none of relief. [px]
    exposure: tuple[int, int] = (31, 31)
    #: A difference counts for no more than this. [noise]
    outlier: float = 4.0


INFORMATION = InformationTuning()


class Information(NamedTuple):
    """What the photos tell at the pixels of photo 1.

    Attributes
    ----------
    sigma_px : ndarray of float32
        Of matching along the radius, by noise and the texture that both photos share. [px]
    distinct : ndarray of bool
        Whether the photos fit better there than a pixel of parallax farther in or out.
    """

    sigma_px: Float32Array
    distinct: BoolArray


def information(frame: Frame, relief: Float32Array, matched: BoolArray) -> Information:
    """Return what the photos tell at a relief [m]; ``matched`` says where they show one thing.

    With radial gradients g1, g2 the normal equation of a shift along the radius has the weight
    S12 = sum g1 g2 over a window, so that sigma = s_e / sqrt(S12).
    """
    columns, rows = zoom_map(frame, relief)
    x, y = frame.from_centre()
    radius = np.maximum(np.hypot(x, y), np.float32(1))
    out_x, out_y = x / radius, y / radius
    first, second = (
        cv2.GaussianBlur(image.astype(np.float32), (0, 0), INFORMATION.blur)
        for image in (frame.image1, frame.image2)
    )

    def laid(image: Float32Array, outwards: int = 0) -> Float32Array:
        places = (columns + outwards * out_x, rows + outwards * out_y)
        border = cv2.BORDER_REPLICATE
        return np.asarray(cv2.remap(image, *places, cv2.INTER_LINEAR, borderMode=border))

    raw = frame.image1.astype(np.float32) - laid(frame.image2.astype(np.float32))
    noise = _noise(raw, matched)
    here = laid(second)
    slopes = []
    for image in (first, here):
        across, down = (
            cv2.Sobel(image, cv2.CV_32F, *order, ksize=3, scale=0.125) for order in ((1, 0), (0, 1))
        )
        slopes.append(across * out_x + down * out_y)
    n = INFORMATION.window
    shared = np.maximum(cv2.blur(slopes[0] * slopes[1], (n, n)), np.float32(1e-4))

    def misfit(image: Float32Array) -> Float32Array:
        apart = first - image
        apart -= cv2.blur(apart, INFORMATION.exposure)  # what exposure leaves
        square = np.minimum(apart * apart, (INFORMATION.outlier * noise) ** 2)
        return np.asarray(cv2.blur(square, INFORMATION.fit))

    rival = np.minimum(misfit(laid(second, 1)), misfit(laid(second, -1)))
    return Information(noise / np.sqrt(shared) / n, rival > misfit(here))


def measured_by_texture(
    frame: Frame, source: MapBands, valid: BoolArray, bands: MapBands, grid: Grid
) -> MapBands:
    """Return the map whose measured pixels are those that both photos tell.

    Stages build on more: what is smooth between edges is believed, but not measured. Sigma of what
    they called measured has its share of the noise.
    """
    found = information(frame, source.r, valid)
    places = forward_projection.seen_by_first(frame, grid, np.nan_to_num(bands.r))
    sigma_px = np.minimum(found.sigma_px, np.float32(INFORMATION.most)) * radial_stretch(frame)
    noise = values_at(flow.sigma_of_relief(frame, source.r, sigma_px), places, cv2.INTER_NEAREST)
    measured = bands.quality == Quality.MEASURED
    sigma = np.where(measured, np.hypot(bands.sigma, noise), bands.sigma)
    enough = values_at(found.distinct.view(np.uint8), places, cv2.INTER_NEAREST) > 0
    enough &= sigma < EVIDENCE.sigma_share * frame.distances[1]
    quality = np.where(measured & ~enough, np.uint8(Quality.INTERPOLATED), bands.quality)
    return bands._replace(sigma=sigma, quality=quality)


def _noise(apart: Float32Array, matched: BoolArray) -> Float32Array:
    """Return the robust deviation of a difference in tiles, interpolated. [grey levels]"""
    fine, side = np.abs(apart - cv2.blur(apart, (5, 5))), INFORMATION.tile
    tiles = np.full([-(-length // side) for length in apart.shape], np.nan, np.float32)
    for i, j in np.ndindex(tiles.shape):
        box = np.s_[i * side : (i + 1) * side : 2, j * side : (j + 1) * side : 2]
        values = fine[box][matched[box]]
        if len(values) > INFORMATION.fewest:
            tiles[i, j] = 1.4826 * np.median(values)
    known = np.isfinite(tiles)
    tiles[~known] = np.median(tiles[known]) if known.any() else np.median(1.4826 * fine)
    tiles = np.maximum(tiles, np.float32(INFORMATION.least_noise))
    if min(tiles.shape) > 2:
        tiles = cv2.medianBlur(tiles, 3)
    return np.asarray(cv2.resize(tiles, apart.shape[::-1], interpolation=cv2.INTER_LINEAR))
