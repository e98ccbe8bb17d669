"""Pixel (column, row) <-> image coordinates (mm, x right, y up); the only place y is flipped."""

from __future__ import annotations

from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_floats, as_points


def image_from_pixel(pixels: ArrayLike, *, origin: ArrayLike, pitch: ArrayLike) -> FloatArray:
    """Return image coordinates, shape (..., 2). [mm]

    Parameters
    ----------
    pixels : array_like, shape (..., 2)
        (column, row), integers at pixel centres. [px]
    origin : array_like, shape (2,)
        (column, row) of the origin of the image coordinates. [px]
    pitch : array_like, shape (2,)
        Width and height of a pixel. [mm]

    Examples
    --------
    >>> image_from_pixel([639.5, 500.0], origin=[639.5, 511.5], pitch=[0.012, 0.012]).tolist()
    [0.0, 0.138]
    """
    offset = as_points(pixels, "pixels", dimension=2) - as_floats(origin, "origin")
    return offset * (as_floats(pitch, "pitch") * (1.0, -1.0))


def pixel_from_image(image: ArrayLike, *, origin: ArrayLike, pitch: ArrayLike) -> FloatArray:
    """Return (column, row) of image coordinates, shape (..., 2): undoes `image_from_pixel`. [px]

    Examples
    --------
    >>> pixel_from_image([0.0, 0.138], origin=[639.5, 511.5], pitch=[0.012, 0.012]).tolist()
    [639.5, 500.0]
    """
    scaled = as_points(image, "image", dimension=2) / (as_floats(pitch, "pitch") * (1.0, -1.0))
    return scaled + as_floats(origin, "origin")
