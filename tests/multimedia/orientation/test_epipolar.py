"""Epipolar curves: exact vertices, the chord error promised, and the candidates."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from multimedia import InputError, epipolar_candidates, epipolar_curve, image_rays, project
from tests.multimedia.tank import LAYERS, cameras, control, images

VIEWS = cameras()
POINTS = control(40)
IMAGE = images(VIEWS, POINTS)
DEPTHS = (-190.0, -10.0)


def distance_to(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of points from a polygon, one segment after the other."""
    least = np.full(len(points), np.inf)
    for a, b in pairwise(polygon):
        along = b - a
        share = np.clip((points - a) @ along / (along @ along), 0, 1)
        least = np.minimum(least, np.linalg.norm(points - a - share[:, None] * along, axis=1))
    return least


def test_the_curve_of_a_point_goes_through_its_image():
    curve = epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=DEPTHS, chord_error=1e-5)
    for k in range(len(POINTS)):
        assert distance_to(curve.image[k, : curve.counts[k]], IMAGE[2, k : k + 1]) < 1e-5


def test_vertices_are_images_of_points_on_the_ray():
    curve = epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=DEPTHS)
    assert np.abs(project(VIEWS[2], curve.points, LAYERS) - curve.image).max() < 1e-10
    # and every one of these points is seen at the one place in the first image
    back = project(VIEWS[1], curve.points, LAYERS)
    assert np.abs(back - IMAGE[1][:, None]).max() < 1e-10
    assert {round(z, 6) for z in curve.points[:, [0, -1], 2].ravel()} == set(DEPTHS)


@pytest.mark.parametrize("chord", [1e-3, 1e-4, 1e-5])
def test_the_polygon_stays_within_the_chord_error(chord):
    curve = epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=DEPTHS, chord_error=chord)
    fine = epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=DEPTHS, vertices=301)
    worst = max(
        distance_to(curve.image[k, : curve.counts[k]], fine.image[k]).max()
        for k in range(len(POINTS))
    )
    assert worst <= chord
    assert worst > 0.1 * chord  # and not by many needless vertices


def test_without_media_the_curve_is_the_straight_epipolar_line():
    straight = [c for c in cameras() if c.name in ("cam2", "cam3")]
    plain = [type(c)(centre=c.centre, rotation=c.rotation, principal_distance=25.0)
             for c in straight]  # fmt: skip
    image = project(plain[0], POINTS)
    curve = epipolar_curve(plain[0], image, plain[1], z_range=DEPTHS, vertices=5).image
    a, b = curve[:, 1:] - curve[:, :1], curve[:, -1:] - curve[:, :1]
    assert np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]).max() < 1e-10


def test_through_the_water_it_bends_by_more_than_a_pixel_of_the_tank():
    two = epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=DEPTHS, vertices=2)
    bent = [distance_to(two.image[k], IMAGE[2, k : k + 1])[0] for k in range(len(POINTS))]
    assert max(bent) > 0.005


def test_the_true_partner_is_a_candidate_and_gives_the_point():
    curve = epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=DEPTHS, chord_error=1e-5)
    found = epipolar_candidates(curve, IMAGE[2], tolerance=2e-4)
    own = found.curves == found.targets
    assert own.sum() == len(POINTS)
    assert (
        np.abs(found.points[own] - POINTS[found.curves[own]]).max() < 0.3
    )  # linear between vertices
    wide = epipolar_candidates(curve, IMAGE[2], tolerance=0.2)
    assert len(wide.curves) > len(found.curves)
    assert (wide.distance <= 0.2).all()
    assert (np.diff(wide.curves) >= 0).all()


def test_one_point_gives_one_polygon():
    one = epipolar_curve(VIEWS[1], IMAGE[1, 0], VIEWS[2], LAYERS, z_range=DEPTHS)
    assert one.image.ndim == 2
    assert one.image.shape[0] == one.counts


def test_depths_before_the_interface_are_not_seen():
    curve = epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=(20.0, 40.0))
    assert np.isnan(curve.image).all()


def test_an_empty_depth_range_and_a_zero_chord_are_named():
    with pytest.raises(InputError, match="z_range"):
        epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=(-5.0, -5.0))
    with pytest.raises(InputError, match="chord_error"):
        epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=DEPTHS, chord_error=0.0)
    with pytest.raises(InputError, match="vertices"):
        epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=DEPTHS, vertices=1)


def test_a_range_that_reaches_above_the_water_begins_where_the_ray_enters_it():
    """Every vertex is there; the first is the image of the point on the last face."""
    over = epipolar_curve(VIEWS[1], IMAGE[1], VIEWS[2], LAYERS, z_range=(DEPTHS[0], 30.0))
    assert np.isfinite(over.image).all()
    entry, _ = image_rays(VIEWS[1], IMAGE[1], LAYERS)
    below = entry - np.array([0.0, 0.0, 1e-9])
    np.testing.assert_allclose(over.image[:, 0], project(VIEWS[2], below, LAYERS), atol=1e-9)
