"""The derivative of a homography against differences of the map itself."""

from __future__ import annotations

import numpy as np

from bifocal.model.homography import apply_homography, homography_jacobian

#: Far from affine: the denominator changes by half over the points.
MATRIX = np.array([[1.2, -0.3, 40.0], [0.2, 0.9, -25.0], [8e-4, -5e-4, 1.0]])
POINTS = np.array([[0.0, 0.0], [300.0, 10.0], [-120.0, 240.0], [410.0, -350.0]])


def test_the_derivative_of_a_homography_is_the_difference_of_the_map():
    step = 1e-3
    found = homography_jacobian(MATRIX, POINTS)
    for axis in range(2):
        off = step * np.eye(2)[axis]
        ahead, behind = (apply_homography(MATRIX, POINTS + sign * off) for sign in (1, -1))
        np.testing.assert_allclose(found[:, :, axis], (ahead - behind) / (2 * step), rtol=1e-7)


def test_points_on_the_horizon_have_no_image():
    horizon = np.array([[-1 / 8e-4, 0.0]])
    assert np.isnan(apply_homography(MATRIX, horizon)).all()
    assert not np.isfinite(homography_jacobian(MATRIX, horizon)).any()
