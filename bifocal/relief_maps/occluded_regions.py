"""Regions that camera 2 cannot see: too wide for a ramp, and nothing supports what flow found.

Beside a step as deep as a porch camera 2 sees nothing of a strip that photo 1 shows: flow there is
chance. A few lost pixels lie on ramps that the photos tell apart (`edges`); wide regions do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.relief_maps import forward_projection
from bifocal.relief_maps.edges import EDGES
from bifocal.relief_maps.evidence import EVIDENCE
from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.forward_projection import PROJECTION, MapBands
from bifocal.relief_maps.frame import Frame
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionBlockTuning:
    """Regions that camera 2 cannot see."""

    #: Side of the blocks that regions consist of, half of whose pixels are lost. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: church +0.00 / +0.00.
    block: int = 8
    #: A part that camera 2 cannot see counts from so many blocks a side on.
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    fewest_blocks: int = 3


REGIONS = RegionBlockTuning()
#: Regions of fewer blocks a side are two ramps, one from either rim, that meet.
NARROWEST = 2 * (2 * EDGES.reach) // REGIONS.block + 1


def put_behind(
    frame: Frame, relief: Float32Array, matched: Measurement, support: BoolArray
) -> Float32Array:
    """Return relief whose occluded regions stand on the lower of the surfaces beside them.

    Parameters
    ----------
    frame : Frame
    relief : ndarray of float32, shape (height, width)
        Of the pixels of photo 1. [m]
    matched : Measurement
        Flow between the photos.
    support : ndarray of bool
        Pixels to be believed; they are left alone.

    Notes
    -----
    Only regions are moved that camera 2 cannot see behind what is not lost, were they there, and
    what lies beside such: that explains why they are lost. Church_1 has a door 1.4 m behind the
    wall of which photo 2 shows half; in photo 1 the other half was torn into bars at any relief
    between both. All lost regions moved would tear the colonettes of church_2 (1.0 to 1.1 % beyond
    10 cm, empty 5.1 to 5.3 %).
    """
    least = forward_projection.covering(frame, PROJECTION.covers)
    lost = ((matched.loop > EVIDENCE.lost_loop) & ~support & frame.seen1).astype(np.uint8)
    blocks = _block_means(lost) > 0.5
    square = np.ones((NARROWEST, NARROWEST), np.uint8)
    wide = cv2.morphologyEx(blocks.astype(np.uint8), cv2.MORPH_OPEN, square)
    if not wide.any():
        return relief
    surface = surface_behind(frame, relief, support)
    behind = np.where(np.isfinite(surface), surface, relief)
    hidden = forward_projection.hidden_in_second(frame, behind, least, lost == 0)
    unseen = (_block_means(hidden.astype(np.uint8)) > 0.5).astype(np.uint8)
    near = cv2.morphologyEx(
        unseen, cv2.MORPH_OPEN, np.ones((REGIONS.fewest_blocks, REGIONS.fewest_blocks), np.uint8)
    )
    reach = np.ones((2 * NARROWEST - 1, 2 * NARROWEST - 1), np.uint8)
    region = _enlarged(wide & cv2.dilate(near, reach), relief.shape) > 0
    stands_out = region & ~support & (relief > behind + least)
    return np.where(stands_out, behind, relief)


def _enlarged(blocks: np.ndarray, shape: tuple[int, int]) -> Any:
    """Return values of blocks at the pixels of an image."""
    size = (blocks.shape[1] * REGIONS.block, blocks.shape[0] * REGIONS.block)
    return cv2.resize(blocks, size, interpolation=cv2.INTER_NEAREST)[: shape[0], : shape[1]]


def _block_means(values: np.ndarray) -> Float32Array:
    """Return the mean of every block; those at the far edges are continued."""
    height, width = values.shape
    rows, columns = -(-height // REGIONS.block), -(-width // REGIONS.block)
    whole = cv2.copyMakeBorder(
        values,
        0,
        rows * REGIONS.block - height,
        0,
        columns * REGIONS.block - width,
        cv2.BORDER_REPLICATE,
    )
    means = cv2.resize(whole.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(means)


def surface_behind(frame: Frame, relief: Float32Array, support: BoolArray) -> Float32Array:
    """Return supported relief by blocks, between them the lower one along the radius. [m]

    Parameters
    ----------
    frame : Frame
    relief : ndarray of float32, shape (height, width)
        Of the pixels of photo 1. [m]
    support : ndarray of bool
        Pixels to be believed.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Infinite where the radius meets none.
    """
    share = _block_means(support.astype(np.float32))
    sums = _block_means(np.where(support, relief, np.float32(0)))
    supported = share * REGIONS.block**2 >= EVIDENCE.fewest
    values = (sums / np.maximum(share, np.float32(1e-3))).astype(np.float32)
    nothing = np.zeros(values.shape, np.float32)
    bands = MapBands(values, nothing, nothing.astype(np.uint8))
    gsd, shift = frame.grid.gsd, (REGIONS.block - 1) / 2 * frame.grid.gsd
    rows, columns = values.shape
    grid = Grid(
        x0=frame.grid.x0 + shift, y0=frame.grid.y0 - shift, gsd=gsd * REGIONS.block, width=columns,
        height=rows,
    )  # fmt: skip
    filled = forward_projection.fill_from_behind(bands, ~supported, grid, frame.foot(1).nadir)
    bands.r[~(supported | filled)] = np.inf
    # Chance supports blocks in the midst of a lost region.
    return np.asarray(_enlarged(cv2.medianBlur(bands.r, 5), relief.shape))
