"""Homographies between a photo and the wall: points mapped, and the derivative of the map."""

from __future__ import annotations

import numpy as np

from photocore.arrays import FloatArray


def apply_homography(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Return points mapped by a 3x3 homography, shape (..., 2); NaN at the horizon."""
    scale = points[..., 0] * matrix[2, 0] + points[..., 1] * matrix[2, 1] + matrix[2, 2]
    x = points[..., 0] * matrix[0, 0] + points[..., 1] * matrix[0, 1] + matrix[0, 2]
    y = points[..., 0] * matrix[1, 0] + points[..., 1] * matrix[1, 1] + matrix[1, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(
            (scale == 0)[..., None], np.nan, np.stack([x, y], axis=-1) / scale[..., None]
        )


def homography_jacobian(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Return the derivative of a homography at points, shape (n, 2, 2)."""
    scale = points @ matrix[2, :2] + matrix[2, 2]
    mapped = apply_homography(matrix, points)
    with np.errstate(divide="ignore", invalid="ignore"):
        return (matrix[None, :2, :2] - mapped[:, :, None] * matrix[None, None, 2, :2]) / (
            scale[:, None, None]
        )
