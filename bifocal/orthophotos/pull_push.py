"""Close holes smoothly with what is around them, by a pyramid of averages."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.orthophotos.tuning import COLOURS, WHOLE
from photocore.arrays import BoolArray, Float32Array


def fill_holes(
    image: NDArray[Any], valid: BoolArray, holes: BoolArray
) -> tuple[NDArray[Any], BoolArray]:
    """Return the image with holes closed, and which of them were.

    Parameters
    ----------
    image : ndarray, shape (h, w) or (h, w, c)
    valid : ndarray of bool, shape (h, w)
        Pixels that hold colours.
    holes : ndarray of bool, shape (h, w)
        Pixels to close; those too far from any known one stay as they are.

    Notes
    -----
    Pull: known colours are averaged over 2 x 2 pixels again and again until averages reach into
    the holes. Push: each level takes its unknown pixels from the next coarser one.
    """
    filled = _pushed(image, valid, COLOURS.halvings)
    done: BoolArray = holes & np.isfinite(filled.reshape(*valid.shape, -1)).all(axis=-1)
    out = image.copy()
    if image.dtype.kind == "f":
        out[done] = filled[done]
    else:
        limit = np.iinfo(image.dtype).max
        out[done] = np.clip(np.rint(filled[done]), 0, limit).astype(image.dtype)
    return out, done


def membrane(values: Float32Array, valid: BoolArray) -> Float32Array:
    """Return a smooth sheet through known values, where each other is the mean of those around.

    Laplace's equation, relaxed at every level of the pyramid; the rim of the picture is free.
    """
    return _pushed(values, valid, 16, WHOLE.sweeps)


def _pushed(image: NDArray[Any], valid: BoolArray, halvings: int, sweeps: int = 0) -> Float32Array:
    """Return the image with what is unknown from coarser levels, relaxed so many times at each."""
    weight = valid.astype(np.float32)
    colour: NDArray[Any] = image.astype(np.float32)
    colour[~valid] = 0
    levels = [(colour, weight)]
    for _ in range(halvings):
        if min(weight.shape) < 2:
            break
        size = ((weight.shape[1] + 1) // 2, (weight.shape[0] + 1) // 2)
        colour = cv2.resize(colour, size, interpolation=cv2.INTER_AREA)
        weight = cv2.resize(weight, size, interpolation=cv2.INTER_AREA)
        levels.append((colour, weight))
    filled = _plain(*levels[-1])
    for level in range(len(levels) - 2, -1, -1):
        colour, weight = levels[level]
        height, width = weight.shape
        coarse = cv2.resize(filled, (width, height), interpolation=cv2.INTER_LINEAR)
        missing = weight <= 0
        filled = _plain(colour, weight)
        filled[missing] = coarse[missing]
        # On the finest levels the coarser ones have done the work.
        for _ in range(sweeps if level > 1 else sweeps // 3):
            mean = cv2.blur(filled, (3, 3), borderType=cv2.BORDER_REPLICATE)
            filled[missing] = mean[missing]
    return filled


def _plain(colour: Float32Array, weight: Float32Array) -> Float32Array:
    """Return the colours themselves; NaN where nothing is known."""
    divisor = np.where(weight > 0, weight, np.float32(np.nan)).astype(np.float32)
    divisor = divisor.reshape(weight.shape + (1,) * (colour.ndim - 2))
    return np.asarray(colour / divisor, dtype=np.float32)
