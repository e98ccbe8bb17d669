"""Exposure of photo 2 brought to that of photo 1, for matching only; no picture is changed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from bifocal.relief_maps.frame import Frame, zoom_map
from bifocal.relief_maps.registration import least_absolute
from photocore.arrays import Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureTuning:
    """Photos brought to one exposure."""

    #: Darker values are noise, and values as near to white are clipped: they do not take part.
    #: [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: church +0.00 / -0.05.
    darkest: float = 12.0
    #: Exposures that agree to this are left alone. [grey levels]
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    worthwhile: float = 1.0
    #: Pixels on a side of the comparison. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: church -0.13 / +0.11.
    samples: int = 160


EXPOSURE = ExposureTuning()


def match_exposure(frame: Frame, coarse: Float32Array) -> Frame:
    """Return the frame with photo 2 exposed like photo 1.

    Parameters
    ----------
    frame : Frame
    coarse : ndarray of float32
        First relief: says which pixels show the same. [m]

    Notes
    -----
    ``log I1 = a + b x + c y + d (x² + y²) + e log I2``, robustly fitted to a few thousand blurred
    pixels: gain, a gradient, vignetting and gamma. Only smooth differences are taken out, so no
    texture is made or lost.
    """
    height, width = frame.grid.shape
    step_x, step_y = max(1, width // EXPOSURE.samples), max(1, height // EXPOSURE.samples)
    part = (slice(step_y // 2, None, step_y), slice(step_x // 2, None, step_x))
    relief = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    columns, rows = (axis[part] for axis in zoom_map(frame, relief))
    first = cv2.blur(frame.image1, (9, 9))[part].astype(np.float64)
    blurred = cv2.blur(frame.image2, (9, 9))
    columns, rows = np.ascontiguousarray(columns), np.ascontiguousarray(rows)
    second = cv2.remap(blurred, columns, rows, cv2.INTER_LINEAR).astype(np.float64)
    content = cv2.remap(frame.seen2.astype(np.uint8), columns, rows, cv2.INTER_NEAREST) > 0
    use = content & frame.seen1[part]
    for grey in (first, second):
        use &= (grey > EXPOSURE.darkest) & (grey < 255 - EXPOSURE.darkest)
    if use.sum() < 200:
        return frame
    # Vignetting belongs to photo 2's own pixels, so the terms are taken at its positions.
    u, v = columns[use] / width * 2 - 1, rows[use] / height * 2 - 1
    terms = np.column_stack([np.ones_like(u), u, v, u * u + v * v, np.log(second[use])])
    solution = least_absolute(terms, np.log(first[use]), rounds=12, floor=0.01)
    change = np.abs(np.exp(terms @ solution) - second[use])
    if np.median(change) < EXPOSURE.worthwhile:
        return frame
    level, across, down, vignetting, gamma = solution
    x = np.arange(width)[None, :] / width * 2 - 1
    y = np.arange(height)[:, None] / height * 2 - 1
    smooth = np.exp(level + across * x + down * y + vignetting * (x * x + y * y))
    curve = np.exp(gamma * np.log(np.maximum(np.arange(256), 0.5))).astype(np.float32)
    exposed = np.clip(np.rint(curve[frame.image2] * smooth.astype(np.float32)), 0, 255)
    return replace(frame, image2=exposed.astype(np.uint8))
