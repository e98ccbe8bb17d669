"""Which side of a step doubtful relief is on: the upper surface, or the one behind.

Outside the rim of a raised part camera 2 sees nothing of what photo 1 shows, so flow carries the
upper surface on over it, in teeth and scraps. Photo 1 draws the rim: pixels belong to the side
from which a walk at random that shuns its edges reaches them (Grady 2006, "Random walks for image
segmentation"), unless the photos say otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.relief_maps.between_edges import BETWEEN_EDGES, Smoother, conductances
from bifocal.relief_maps.edges import PhotoFit
from bifocal.relief_maps.forward_projection import PROJECTION, covering, hidden_in_second
from bifocal.relief_maps.frame import Frame, offsets, parallax_per_metre
from bifocal.relief_maps.occluded_regions import REGIONS, surface_behind
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SidesTuning:
    """Sides of steps. All were varied on balconies, street, arcade 5001 and on castle_B."""

    #: Where camera 2 could see the surface behind, a pixel must stand so far before it. [px]
    #: Evidence: 8 and 16: castle_B, tears 146 and 166 m, lines bent by a far pixel 2.9 and 3.0 %.
    wide: float = 8.0
    #: There it stays, too, where relief goes on as high so far out on the radius: both cameras see
    #: the inner rim of a raised part. [px]
    #: Evidence: 0, 16 and 30: castle_B, tears 139, 147, 138 m, its column bitten with 0; street,
    #: painted and wrong by 2 px 8.52, 8.50, 8.48 %.
    rim: int = 30
    #: The photos' misfit, above that at the surface behind, by which a pixel goes there. [grey
    #: levels]
    misfit: float = 4.0
    #: Weight of what the photos say of a pixel against that of a believed one.
    weight: float = 0.05
    #: Majority for the surface behind, -1 to 1.
    #: Evidence: balconies, painted and wrong by 2 px, 0 and 0.1: 4.55 and 4.52 %; street 8.62 and
    #: 8.64; arcade 3.17 and 3.13.
    majority: float = 0.1


SIDES = SidesTuning()


def settled(
    frame: Frame, relief: Float32Array, support: BoolArray, swept: BoolArray
) -> Float32Array:
    """Return relief whose doubtful raised pixels lie behind where photo 1 draws them so.

    Parameters
    ----------
    frame : Frame
    relief : ndarray of float32, shape (height, width)
        Of the pixels of photo 1. [m]
    support, swept : ndarray of bool
        Pixels to be believed, and those that a sweep found: they are left alone.
    """
    believed = support | swept
    if not believed.any():
        return relief
    per_relief = parallax_per_metre(frame)
    behind = np.minimum(relief, _lowest(surface_behind(frame, relief, support)))
    parallax = (relief - behind) * per_relief
    raised = ~believed & frame.seen1 & (parallax > BETWEEN_EDGES.step)
    lowered = np.where(raised, behind, relief)
    hidden = hidden_in_second(frame, lowered, covering(frame, PROJECTION.covers))
    goes_on = np.abs(_farther_out(frame, relief) - relief) * per_relief < 2 * BETWEEN_EDGES.step
    doubtful = raised & (hidden | (~goes_on & (parallax > SIDES.wide)))
    if not doubtful.any():
        return relief
    vote = _vote(frame, relief, behind, hidden, believed)
    threshold = _of_nearest((relief + behind) * np.float32(0.5), doubtful)
    side = np.where(doubtful, vote, np.where(relief > threshold, np.float32(-1), np.float32(1)))
    del vote, threshold  # photos may be large
    weight = np.where(believed, np.float32(1), np.float32(BETWEEN_EDGES.doubtful))
    weight[doubtful] = SIDES.weight
    smoother = Smoother(*conductances(frame, relief * per_relief, believed))
    return np.where(doubtful & (smoother.mean(side, weight) > SIDES.majority), behind, relief)


def _vote(
    frame: Frame, relief: Float32Array, behind: Float32Array, hidden: BoolArray, believed: BoolArray
) -> Float32Array:
    """Return how far the photos speak for what is behind, -1 to 1."""
    fit = PhotoFit(frame, 0.0)
    misfit = fit.misfit(relief)
    # Of what camera 2 cannot see the photos say nothing: as good as what is validated.
    misfit_behind = np.where(hidden, np.median(misfit[believed]), fit.misfit(behind))
    return np.clip((misfit - misfit_behind) / np.float32(SIDES.misfit), -1, 1)


def _lowest(surface: Float32Array) -> Float32Array:
    """Return the lowest of a surface of blocks within half a block: a rim runs through one."""
    return np.asarray(cv2.erode(surface, np.ones((REGIONS.block + 1,) * 2, np.uint8)))


def _farther_out(frame: Frame, relief: Float32Array) -> Float32Array:
    """Return at each pixel the relief of the one `SIDES.rim` farther from the zoom centre. [m]"""
    x, y = frame.from_centre()
    step = np.float32(SIDES.rim) / np.maximum(np.hypot(x, y), 1)
    column, row = offsets(relief.shape)
    maps = (column + step * x, row + step * y)
    mode = cv2.BORDER_REPLICATE
    return np.asarray(cv2.remap(relief, *maps, cv2.INTER_NEAREST, borderMode=mode))


def _of_nearest(values: Float32Array, where: BoolArray) -> Float32Array:
    """Return at each pixel the value of the nearest of some."""
    gap = (~where).astype(np.uint8)
    _, label = cv2.distanceTransformWithLabels(
        gap, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    table = np.zeros(int(label.max()) + 1, np.float32)
    table[label[where]] = values[where]
    return table[label]
