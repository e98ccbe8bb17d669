"""The mask of hidden pixels without what no drawing can show: specks, hair lines, pinholes."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.orthophotos.tuning import TIDYING
from photocore.arrays import BoolArray


def tidied(hidden: BoolArray) -> BoolArray:
    """Return a mask of hidden pixels without parts too small or too thin to be a shadow.

    A shadow that is nowhere 3 x 3 px wide is what half a pixel of doubt about a step makes; a part
    of fewer than `least_area` pixels cannot be told. Pinholes in the mask are closed likewise.
    """
    if not hidden.any():
        return hidden
    core = cv2.erode(hidden.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1) > 0
    _, label, stats, _ = cv2.connectedComponentsWithStats(hidden.astype(np.uint8), connectivity=8)
    keep = np.zeros(len(stats), dtype=bool)
    keep[np.unique(label[core & hidden])] = True
    keep &= stats[:, cv2.CC_STAT_AREA] >= TIDYING.least_area
    keep[0] = False
    solid: BoolArray = keep[label]
    _, label, stats, _ = cv2.connectedComponentsWithStats((~solid).astype(np.uint8), connectivity=4)
    pinhole = stats[:, cv2.CC_STAT_AREA] < TIDYING.least_area
    pinhole[0] = False
    return solid | np.asarray(pinhole[label])
