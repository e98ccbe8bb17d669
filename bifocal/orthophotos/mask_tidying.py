"""The mask of hidden pixels without what no drawing can show: specks, hair lines, pinholes."""

from __future__ import annotations

import cv2
import numpy as np

from photocore.arrays import BoolArray

#: Parts of fewer pixels are neither masked nor left unmasked by themselves: at 1:50 they are a
#: quarter of a millimetre. Of 2450 holes of an oblique church photo 2200 were smaller. [px]
LEAST_AREA = 25
#: A part of the mask reaches no farther than this: a window with such a margin is tidied as a whole
#: picture would be. [px]
MARGIN = 24


def tidied(hidden: BoolArray) -> BoolArray:
    """Return a mask of hidden pixels without parts too small or too thin to be a shadow.

    A shadow that is nowhere 3 x 3 px wide is what half a pixel of doubt about a step makes; a part
    of fewer than `LEAST_AREA` pixels cannot be told. Pinholes in the mask are closed likewise.
    """
    if not hidden.any():
        return hidden
    core = cv2.erode(hidden.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1) > 0
    _, label, stats, _ = cv2.connectedComponentsWithStats(hidden.astype(np.uint8), connectivity=8)
    keep = np.zeros(len(stats), dtype=bool)
    keep[np.unique(label[core & hidden])] = True
    keep &= stats[:, cv2.CC_STAT_AREA] >= LEAST_AREA
    keep[0] = False
    solid: BoolArray = keep[label]
    _, label, stats, _ = cv2.connectedComponentsWithStats((~solid).astype(np.uint8), connectivity=4)
    pinhole = stats[:, cv2.CC_STAT_AREA] < LEAST_AREA
    pinhole[0] = False
    return solid | np.asarray(pinhole[label])
