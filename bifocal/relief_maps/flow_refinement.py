"""A last step of flow at twice its resolution: what half the resolution rounded off."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.relief_maps.frame import offsets
from photocore.arrays import ByteArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class RefinementTuning:
    """The last step of flow of `fast`."""

    #: Side of the window, in pixels of the flow. [px]
    #: Evidence: of 3, 5 and 9 the best on façades 71 and 83.
    window: int = 5
    #: Residual at which a pixel counts half: more is another surface. [grey levels]
    outlier: float = 10.0
    #: Texture weaker than this moves nothing: added to the mean squared derivative. [(grey
    #: levels/px)²]
    #: Evidence: façades 71 and 83, fast, median: 0.53 and 1.96 mm, with 10 0.55 and 2.25.
    softness: float = 0.5
    #: Farthest move: a linearised image reaches no farther. [px]
    farthest: float = 0.5


REFINEMENT = RefinementTuning()
#: Rows of flow worked on at once.
STRIP = 32


def refined(flow: Float32Array, first: ByteArray, second: ByteArray) -> Float32Array:
    r"""Return flow improved by one step on photos of twice its resolution.

    Parameters
    ----------
    flow : ndarray of float32, shape (height, width, 2)
        Displacement of the pixels of the first photo in the second. [px of the flow]
    first, second : ndarray of uint8, shape (2 height or one more, 2 width or one more)

    Notes
    -----
    The step of Lucas and Kanade (1981), reweighted for residuals e of another surface:

    .. math:: \sum w\, g g^T d = -\sum w\, e\, g, \qquad w = 1 / (1 + e^2 / \tau^2),

    g the mean of both photos' gradients. Sums are taken over the pixels of the flow, so that it
    costs a twentieth of matching at twice the resolution.
    """
    height, width = flow.shape[:2]
    sums = np.empty((5, height, width), dtype=np.float32)
    for top in range(0, height, STRIP):  # strips stay in the processor's cache
        bottom = min(top + STRIP, height)
        above, below = max(top - 1, 0), min(bottom + 1, height)
        strip = _products(flow[above:below], above, first, second)
        sums[:, top:bottom] = [p[top - above : bottom - above] for p in strip]
    xx, xy, yy, ex, ey = (cv2.blur(p, (REFINEMENT.window, REFINEMENT.window)) for p in sums)
    xx += np.float32(REFINEMENT.softness)
    yy += np.float32(REFINEMENT.softness)
    share = 1 / (xx * yy - xy * xy)
    move = cv2.merge([(xy * ey - yy * ex) * share, (xy * ex - xx * ey) * share])
    # Pixels of the photos are half those of the flow.
    return np.asarray(flow + 0.5 * np.clip(move, -REFINEMENT.farthest, REFINEMENT.farthest))


def _products(
    flow: Float32Array, top: int, first: ByteArray, second: ByteArray
) -> list[Float32Array]:
    """Return w g g^T (xx, xy, yy) and w e g of a strip of flow, means over its pixels."""
    size = (flow.shape[1], flow.shape[0])
    whole = (2 * size[0], 2 * size[1])
    x, y = offsets((whole[1], whole[0]), (0, -2 * top))
    large = cv2.resize(2 * flow, whole, interpolation=cv2.INTER_LINEAR)
    first = np.ascontiguousarray(first[2 * top : 2 * top + whole[1], : whole[0]])
    moved = cv2.remap(
        second, large[..., 0] + x, large[..., 1] + y, cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    mean = cv2.addWeighted(first, 0.5, moved, 0.5, 0)
    across = cv2.Sobel(mean, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
    down = cv2.Sobel(mean, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
    off = cv2.subtract(moved, first, dtype=cv2.CV_32F)
    weight = 1 / (1 + off * off * np.float32(REFINEMENT.outlier**-2))
    u, v = weight * across, weight * down
    pairs = (u, across), (u, down), (v, down), (u, off), (v, off)
    return [cv2.resize(a * b, size, interpolation=cv2.INTER_AREA) for a, b in pairs]
