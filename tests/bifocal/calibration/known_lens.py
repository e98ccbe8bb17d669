"""A lens whose formulas are known by hand."""

from __future__ import annotations

import numpy as np

from bifocal import Lens

MATRIX = np.array([[900.0, 0, 511.5], [0, 905.0, 383.5], [0, 0, 1]])
BROWN = Lens(
    camera_matrix=MATRIX, coefficients=[-0.2, 0.06, 1e-3, -5e-4, 0.0], image_size=(1024, 768)
)
GRID = np.stack(np.meshgrid(np.linspace(0, 1023, 9), np.linspace(0, 767, 7)), axis=-1)


def brown_by_hand(pixels, lens):
    """Return distorted pixels, written out from the textbook."""
    k1, k2, p1, p2, k3 = lens.coefficients
    fx, fy, cx, cy = MATRIX[0, 0], MATRIX[1, 1], MATRIX[0, 2], MATRIX[1, 2]
    x, y = (pixels[..., 0] - cx) / fx, (pixels[..., 1] - cy) / fy
    q = x * x + y * y
    radial = 1 + k1 * q + k2 * q**2 + k3 * q**3
    u = x * radial + 2 * p1 * x * y + p2 * (q + 2 * x * x)
    v = y * radial + p1 * (q + 2 * y * y) + 2 * p2 * x * y
    return np.stack([fx * u + cx, fy * v + cy], axis=-1)
