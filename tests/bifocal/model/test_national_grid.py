"""Pairs in a national grid give what they give near the origin, to 0.1 mm and far below."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import GeometryError, Pair, Photo

CORNER = np.array([652345.0, 6862123.0])
NEAR = Pair.ideal(d1=17.5, d2=9.5)


def moved(photo: Photo, corner) -> Photo:
    shift = np.eye(3)
    shift[:2, 2] = corner
    matrix = shift @ photo.plane_from_pixel
    return replace(photo, plane_from_pixel=matrix, nadir=photo.nadir + corner)


def test_a_pair_at_e_652345_n_6862123_measures_as_at_the_origin(tmp_path):
    far = replace(NEAR, image1=moved(NEAR.image1, CORNER), image2=moved(NEAR.image2, CORNER))
    far.write(tmp_path / "far.pair.json")
    points = np.array([[0.3, -0.2, 0.1], [1.0, 1.5, 0.4], [-2.0, 0.8, -0.2]])
    pixels = NEAR.project(points)
    for pair in (far, Pair.read(tmp_path / "far.pair.json")):
        solved = pair.intersect(*pixels).xyz
        assert np.abs(solved - points - [*CORNER, 0.0]).max() < 1e-6
        for there, here in zip(pair.project(points + np.append(CORNER, 0)), pixels, strict=True):
            np.testing.assert_allclose(there, here, atol=1e-4)


@pytest.mark.parametrize("corner", [np.zeros(2), CORNER])
def test_a_homography_of_a_line_is_singular_wherever_it_lies(corner):
    photo = moved(NEAR.image1, corner)
    shift = np.eye(3)
    shift[:2, 2] = corner
    flat = np.array([[1e-3, 0, 0], [1e-3, 0, 0], [0, 0, 1.0]])
    with pytest.raises(GeometryError, match="singular"):
        replace(photo, plane_from_pixel=shift @ flat)
