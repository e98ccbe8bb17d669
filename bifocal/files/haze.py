"""Grey values to match photos by that were taken through water: weighted, contrast restored.

On its way through water light is lost, red first, and what the water scatters back lies over the
photo like a veil: the light ``J exp(-c d) + B (1 - exp(-b d))`` of a place at distance d (Jaffe
1990). Paths to both cameras differ by nearly the same everywhere, so the veil is smooth, and the
exposure of photo 2 is brought to that of photo 1 as in air. What is lost is contrast, in some
channels more than in others: their mean has the noise of all and the texture of few.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.model import Pair, as_grey, as_photo, local_contrast, noise
from photocore.arrays import ByteArray, Float32Array
from photocore.images import read_grey, read_image
from photocore.large_photos import Pixels

#: Grey values that all but these percentiles are stretched to.
DARKEST, BRIGHTEST, TAILS = 18.0, 238.0, (0.5, 99.5)
#: Variance that white noise keeps of itself blurred by one pixel: 1 / (4 pi). [px]
BLURRED = 1 / (4 * np.pi)
#: Contrast that no channel is taken to fall below. [grey levels]
LEAST = 0.03


def greys_through_water(
    image1: NDArray[np.generic],
    image2: NDArray[np.generic],
    names: tuple[str, str] = ("image1", "image2"),
) -> tuple[ByteArray, ByteArray]:
    """Return both photos in grey, for matching.

    Parameters
    ----------
    image1, image2 : ndarray of uint8 or uint16, shape (height, width[, 3])
        Far and near photo.
    names : pair of str
        What to call them.

    Returns
    -------
    ndarray of uint8, shape (height, width)

    Raises
    ------
    InputError
        If one is no photo.

    Notes
    -----
    Channels weigh as ``contrast / noise²`` of the far photo, the hazier one: of all weighted means
    the one with the most texture for its noise. Façade 11 through a port, rendered in coastal,
    turbid and murky water (1 MP; light of 400 to 600 nm lost by 0.2, 0.5 and 0.75 per metre): mean
    error 3.6 to 3.3, 5.1 to 4.4 and 9.2 to 8.7 mm, measured 91 to 91, 90 to 88 and 63 to 79 %; in
    clear water as before, 3.1 mm and 91 %. Points of `match`: docs/through-water.md.
    """
    for image, name in zip((image1, image2), names, strict=True):
        as_grey(image, name)  # refused by its name if it is no photo
    photos = [as_photo(image) for image in (image1, image2)]
    if any(photo.ndim == 2 for photo in photos):
        plain = [np.asarray(p if p.ndim == 2 else p.mean(-1), np.float32) for p in photos]
        return _stretched(plain[0]), _stretched(plain[1])
    weights = _weights(photos[0])
    first, second = (cv2.transform(photo.astype(np.float32), weights[None]) for photo in photos)
    return _stretched(np.asarray(first)), _stretched(np.asarray(second))


def greys_of_pair(pair: Pair, image1: Pixels, image2: Pixels) -> tuple[ByteArray, ByteArray]:
    """Return both photos of a pair in grey, for matching, in air or through its media.

    Raises
    ------
    InputError
        If one is no photo, or of another size than the pair was made from.
    """
    greys = as_grey(image1, "image1"), as_grey(image2, "image2")
    for number, grey in enumerate(greys, start=1):
        pair.photo(number).check_size(grey.shape[::-1], f"image{number}")
    if not pair.refracted:
        return greys
    return greys_through_water(np.asarray(image1), np.asarray(image2))


def read_greys(
    path1: Path | str, path2: Path | str, *, in_water: bool
) -> tuple[ByteArray, ByteArray]:
    """Return far and near photo in grey, for matching; see `greys_through_water`.

    Raises
    ------
    InputError
        If a file is no photo.
    """
    if not in_water:
        return read_grey(path1), read_grey(path2)
    names = str(path1), str(path2)
    return greys_through_water(read_image(path1), read_image(path2), names)


def _weights(photo: NDArray[np.generic]) -> Float32Array:
    """Return contrast / noise² of the channels, of sum one."""
    level = 257.0 if photo.dtype == np.uint16 else 1.0
    shares = []
    for channel in np.moveaxis(photo, -1, 0):
        grey = np.asarray(channel, np.float32) / np.float32(level)
        sigma = noise(grey)
        variance = float(np.median(local_contrast(grey))) ** 2 - BLURRED * sigma**2
        shares.append(np.sqrt(max(variance, LEAST**2)) / sigma**2)
    return np.asarray(shares, np.float32) / np.float32(sum(shares))


def _stretched(grey: Float32Array) -> ByteArray:
    """Return grey values stretched to eight bits."""
    low, high = np.percentile(grey[::4, ::4], TAILS)
    share = (BRIGHTEST - DARKEST) / max(float(high - low), 1.0)
    stretched = (grey - np.float32(low)) * np.float32(share) + np.float32(DARKEST)
    return np.clip(np.rint(stretched), 0, 255).astype(np.uint8)
