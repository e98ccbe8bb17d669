"""Noise taken out of a field whose standard deviation is known, steps left alone."""

from __future__ import annotations

import cv2
import numpy as np

from photocore.arrays import Float32Array

#: Half windows, small to large. [px]
WINDOWS = (8, 18)
#: Standard deviations beyond these count alike: weights 1/sigma² of a wider range lose all digits
#: in float32, and threw the relief of one plain wall to -446 m. [m]
SIGMA_RANGE = (1e-4, 0.3)


def shrink_noise(
    relief: Float32Array, sigma: Float32Array, windows: tuple[int, ...] = WINDOWS
) -> Float32Array:
    """Return relief smoothed where its variance is no more than sigma explains.

    Parameters
    ----------
    relief : ndarray of float32, shape (height, width)
        Measured relief; what is unknown (NaN) stays so and has no say. [m]
    sigma : ndarray of float32, shape (height, width)
        Its standard deviation: large near the nadir and on plain plaster. [m]
    windows : tuple of int
        Half sides of the windows, small to large. [px]

    Notes
    -----
    A guided filter (He et al. 2013) guided by the relief itself, with the squared standard
    deviation as its regularisation and the weights 1/sigma²: Wiener's shrinkage in each window.
    Smoothing acts on r, not on flow: near the nadir a small flow is a large relief.
    """
    unknown = ~np.isfinite(relief)
    if unknown.any():
        relief = np.where(unknown, np.float32(0), relief)
        sigma = np.where(unknown, np.float32(0), sigma)
    weight = (1 / np.clip(sigma, *SIGMA_RANGE) ** 2).astype(np.float32, copy=False)
    weight[unknown] = np.float32(1e-6)
    for half in windows:
        side = (2 * half + 1, 2 * half + 1)
        total = cv2.blur(weight, side)
        mean = cv2.blur(weight * relief, side) / total
        spread = cv2.blur(weight * relief * relief, side) / total - mean * mean
        spread = np.maximum(spread, 0)
        keep = np.maximum(spread - 1 / total, 0) / (spread + np.float32(1e-12))
        level = cv2.blur(total * (1 - keep) * mean, side)
        slope = cv2.blur(total * keep, side)
        again = cv2.blur(total, side)
        relief = (slope * relief + level) / again
    return np.where(unknown, np.float32(np.nan), relief)
