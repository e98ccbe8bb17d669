"""Intersection: exact points, statistics, ragged visibility, and OpenPTV's way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from multimedia import (
    Brown,
    InputError,
    Interfaces,
    Plane,
    PointStatus,
    Sphere,
    image_rays,
    intersect,
    intersect_pairs,
    intersect_rays,
    project,
)
from multimedia.orientation.pose_kernel import seen_points
from tests.multimedia.tank import LAYERS, cameras, control, images

VIEWS = cameras()
POINTS = control(60)
EXACT = images(VIEWS, POINTS)


@pytest.mark.parametrize("method", [intersect_rays, intersect_pairs, intersect])
def test_exact_image_points_give_exact_points(method):
    found = method(VIEWS, EXACT, LAYERS)
    xyz = found.xyz if hasattr(found, "xyz") else found[0] if isinstance(found, tuple) else found
    assert np.abs(xyz - POINTS).max() < 1e-9


def test_rays_come_back_to_the_points_they_were_projected_from():
    origins, directions = image_rays(VIEWS[2], EXACT[2], LAYERS)
    assert np.abs(origins[:, 2]).max() < 1e-12  # on the water side of the glass
    towards = POINTS - origins
    assert np.abs(np.cross(towards, directions)).max() < 1e-10
    assert ((towards * directions).sum(axis=1) > 0).all()


def test_rays_through_layers_equal_the_ray_tracer():
    surfaces = Interfaces.parallel(LAYERS)
    for flat, traced in zip(
        image_rays(VIEWS[1], EXACT[1], LAYERS),
        image_rays(VIEWS[1], EXACT[1], surfaces),
        strict=True,
    ):
        assert np.abs(flat - traced).max() < 1e-10


def test_noisy_points_minimise_the_image_residuals():
    image = images(VIEWS, POINTS[:3], noise=0.01)
    found = intersect(VIEWS, image, LAYERS, sigma=0.01)

    for k in range(3):

        def residuals(point, k=k):
            return np.concatenate(
                [(project(c, point, LAYERS) - image[i, k]) / 0.01 for i, c in enumerate(VIEWS)]
            )

        want = least_squares(
            residuals, POINTS[k], jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15
        )
        assert found.xyz[k] == pytest.approx(want.x, abs=1e-6)
        cofactor = np.linalg.inv(want.jac.T @ want.jac)
        assert found.covariance[k] == pytest.approx(cofactor, rel=1e-5, abs=1e-9)
        assert found.sigma0[k] == pytest.approx(np.sqrt(2 * want.cost / 5), rel=1e-6)


def test_standard_deviations_and_test_statistics_are_honest():
    points = control(4000, seed=9)
    found = intersect(VIEWS, images(VIEWS, points, noise=0.003), LAYERS, sigma=0.003)
    normed = (found.xyz - points) / found.sigma
    assert normed.std() == pytest.approx(1.0, abs=0.03)
    assert np.mean(found.sigma0**2) == pytest.approx(1.0, abs=0.03)
    assert np.nanstd(found.standardised) == pytest.approx(1.0, abs=0.02)
    # The test calls one honest point in a thousand a gross error.
    assert (found.status == PointStatus.GROSS_ERROR).mean() < 0.004


def test_weights_follow_sigma():
    image = images(VIEWS, POINTS, noise=0.002)
    image[3] += 0.05
    sigma = np.full(image.shape, 0.002)
    sigma[3] = 1e3
    heavy = intersect(VIEWS, image, LAYERS, sigma=sigma).xyz
    without = intersect(VIEWS[:3], image[:3], LAYERS, sigma=0.002).xyz
    assert np.abs(heavy - without).max() < 1e-6


def test_points_seen_by_some_cameras_only():
    image = EXACT.copy()
    image[0, 0] = image[1, 1] = np.nan
    image[1:, 2] = np.nan
    image[:, 3] = np.nan
    found = intersect(VIEWS, image, LAYERS)
    assert found.rays[:5].tolist() == [3, 3, 1, 0, 4]
    good = found.status == PointStatus.OK
    assert np.flatnonzero(~good).tolist() == [2, 3]
    assert found.status[2:4].tolist() == [PointStatus.ONE_RAY, PointStatus.NO_RAY]
    assert np.isnan(found.xyz[2:4]).all()
    assert np.isnan(found.covariance[2:4]).all()
    assert np.abs(found.xyz[good] - POINTS[good]).max() < 1e-9
    rays = intersect_rays(VIEWS, image, LAYERS)
    assert np.isnan(rays[2:4]).all()
    assert np.abs(rays[good] - POINTS[good]).max() < 1e-9


def test_a_wrong_match_is_found_and_its_camera_named():
    image = images(VIEWS, POINTS, noise=0.001)
    image[2, 11] += (0.05, 0.03)
    found = intersect(VIEWS, image, LAYERS, sigma=0.001)
    assert np.flatnonzero(found.status == PointStatus.GROSS_ERROR).tolist() == [11]
    assert found.worst_camera[11] == 2


def test_the_angle_of_two_rays_and_nearly_parallel_rays():
    found = intersect(VIEWS[1:3], EXACT[1:3], LAYERS)
    one, two = (image_rays(VIEWS[k], EXACT[k], LAYERS)[1] for k in (1, 2))
    assert found.angle == pytest.approx(np.arccos((one * two).sum(axis=1)), abs=1e-9)
    beside = replace(VIEWS[1], centre=VIEWS[1].centre + np.array([3.0, 0, 0]), name="beside")
    near = [VIEWS[1], beside]
    image = np.stack([project(c, POINTS, LAYERS) for c in near])
    assert (intersect(near, image, LAYERS).status == PointStatus.WEAK).all()


def test_rays_that_meet_before_the_glass_have_a_status():
    # What both cameras see of a point above the water, in air, as if it were in the water.
    high = np.stack([project(c, (5.0, 3.0, 60.0)) for c in VIEWS[1:3]])[:, None]
    found = intersect(VIEWS[1:3], high, LAYERS)
    assert found.status[0] == PointStatus.BEHIND
    assert np.isnan(found.xyz).all()


def test_points_are_independent_of_each_other_and_of_their_order():
    image = images(VIEWS, POINTS, noise=0.01)
    whole = intersect(VIEWS, image, LAYERS).xyz
    order = np.random.default_rng(0).permutation(len(POINTS))
    assert np.abs(intersect(VIEWS, image[:, order], LAYERS).xyz - whole[order]).max() < 1e-9
    assert np.abs(intersect(VIEWS, image[:, :1], LAYERS).xyz - whole[:1]).max() < 1e-9


def test_no_points_give_no_points():
    assert intersect(VIEWS, np.empty((4, 0, 2)), LAYERS).xyz.shape == (0, 3)


def test_wrong_shapes_one_camera_and_pixels_are_named():
    with pytest.raises(InputError, match="two or more, found 1"):
        intersect(VIEWS[:1], EXACT[:1], LAYERS)
    with pytest.raises(InputError, match="4 cameras"):
        intersect(VIEWS, EXACT[:3], LAYERS)
    with pytest.raises(InputError, match="Are these pixels"):
        intersect(VIEWS, EXACT / 0.012 + 640, LAYERS)
    with pytest.raises(InputError, match="above zero"):
        intersect(VIEWS, EXACT, LAYERS, sigma=0.0)


def test_points_through_a_wedge_of_glass_and_behind_domes_are_exact():
    wedge = Interfaces(
        surfaces=(
            Plane(point=(0, 0, 10), normal=(0.02, 0.01, 1)),
            Plane(point=(0, 0, 0), normal=(0, 0, 1)),
        ),
        indices=(1.0, 1.5, 1.337),
    )
    dome = Interfaces(
        surfaces=tuple(Sphere(centre=(2, -1, 5), radius=r) for r in (80, 85)),
        indices=(1.0, 1.5, 1.337), with_camera=(True, True),
    )  # fmt: skip
    media = [wedge, dome, wedge]
    image = np.stack([project(c, POINTS[:8], m) for c, m in zip(VIEWS[:3], media, strict=True)])
    found = intersect(VIEWS[:3], image, media)
    assert np.abs(found.xyz - POINTS[:8]).max() < 1e-9
    assert (found.status == PointStatus.OK).all()


def test_rows_of_layers_equal_the_general_road_for_any_lens_and_obliquely(monkeypatch):
    """Every third point is taken for one that the rows cannot say: seen very obliquely."""
    room = "multimedia.orientation.intersection"

    def rows(*given):
        seen, image, by_point = seen_points(*given)
        seen[::3], image[:, ::3], by_point[..., ::3] = False, np.nan, np.nan
        return seen, image, by_point

    bent = Brown(k1=2e-4, p1=1e-5, shear=1e-4)
    views = [replace(VIEWS[0], distortion=Brown()), *(replace(v, distortion=bent) for v in VIEWS)]
    image = images(views, POINTS, noise=0.002)
    image[1, 4] = np.nan
    monkeypatch.setattr(f"{room}.seen_points", rows)
    mixed = intersect(views, image, LAYERS, sigma=0.002)
    monkeypatch.setattr(f"{room}.layering_of", lambda _: None)
    general = intersect(views, image, LAYERS, sigma=0.002)
    assert mixed.status.tolist() == general.status.tolist()
    assert np.isnan(mixed.residuals[1, 4]).all()
    for name in ("xyz", "residuals", "standardised", "sigma0", "covariance"):
        one, other = getattr(mixed, name), getattr(general, name)
        assert np.nanmax(np.abs(one - other)) < 1e-10
        assert np.array_equal(np.isnan(one), np.isnan(other))
