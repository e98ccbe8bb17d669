"""Noise taken out of relief where the surface is flatter than the noise, steps left alone."""

from __future__ import annotations

import numpy as np

from bifocal.solvers.dense.frame import Float32Array

#: Half windows, small to large. [px]
WINDOWS = (8, 16)


def shrink_noise(relief: Float32Array, sigma: Float32Array) -> Float32Array:
    """Return relief smoothed where its variance is no more than sigma explains.

    Parameters
    ----------
    relief : ndarray of float32, shape (height, width)
        Measured relief. [m]
    sigma : ndarray of float32, shape (height, width)
        Its standard deviation: large near the nadir and on plain plaster. [m]

    Notes
    -----
    A guided filter (He et al. 2013) guided by the relief itself, with the squared standard
    deviation as its regularisation and the weights 1/sigma²: Wiener's shrinkage in each window.
    Smoothing acts on r, not on flow: near the nadir a small flow is a large relief.
    """
    import cv2

    weight = 1 / np.maximum(sigma, np.float32(1e-6)) ** 2
    for half in WINDOWS:
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
    return np.asarray(relief, dtype=np.float32)
