"""Uneven light behind particles, and the noise of its grey values."""

from __future__ import annotations

import cv2
import numpy as np

from photocore.arrays import Float32Array, FloatArray

#: Rounds in which particles are cut off before the light is smoothed again.
_ROUNDS = 4
#: What stands out by so many standard deviations is cut off.
_CUT = 2.0
#: A Gaussian is drawn with so many pixels a standard deviation, or a few more.
_STEPS = 4
#: Grey values are whole numbers: of a noiseless image that is the noise.
_ROUNDING = 1.0 / np.sqrt(12.0)


def without_background(grey: FloatArray, scale: float) -> tuple[FloatArray, FloatArray]:
    """Return what stands out of the light behind it, and the noise of the light.

    Parameters
    ----------
    grey : ndarray, shape (h, w)
    scale : float
        Over how many pixels the light changes: standard deviation of the Gaussian that smooths it.

    Returns
    -------
    bright : ndarray, shape (h, w)
        Grey values less those of the light.
    noise : ndarray, shape (h, w)
        Standard deviation of the grey values of the light, from those darker than it, among which
        are no particles.
    """
    # Single precision, in place: most of the time goes to fetching memory.
    image = grey.astype(np.float32)
    light = _smooth(image, scale)
    bright = image - light
    noise = np.full_like(image, np.sqrt(np.mean(bright**2)))
    for _ in range(_ROUNDS):
        # What smoothing took off slopes, at the border above all, comes back turn by turn.
        noise *= _CUT
        light += _smooth(np.minimum(bright, noise, out=bright), scale)
        np.subtract(image, light, out=bright)
        darker = np.minimum(bright, 0.0)
        share = _smooth((darker < 0).astype(np.float32), scale)
        np.multiply(darker, darker, out=darker)
        noise = _smooth(darker, scale)
        noise /= np.maximum(share, 0.05, out=share)
        np.sqrt(noise, out=noise)
        np.maximum(noise, _ROUNDING, out=noise)
    return grey - light, noise.astype(np.float64)


def _smooth(image: Float32Array, scale: float) -> Float32Array:
    """Return an image smoothed by a Gaussian, in a smaller copy where the Gaussian is wide."""
    height, width = image.shape
    step = max(1, int(scale / _STEPS))
    size = -(-width // step), -(-height // step)
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if step > 1 else image
    small = cv2.GaussianBlur(small, (0, 0), scale / step, borderType=cv2.BORDER_REFLECT_101)
    smoothed: Float32Array = cv2.resize(small, (width, height)) if step > 1 else small
    return smoothed
