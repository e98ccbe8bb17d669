"""Midulla: equations (1) to (7), the camera scheme, and the claims of sections 2.4 and 2.5."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bifocal import (
    FlagLimits,
    GeometryError,
    InputError,
    Pair,
    PlanePicks,
    plane_coordinates,
    rays,
    relief,
    relief_displacement,
    relief_displacements,
    relief_from_displacement,
)
from bifocal.model.intersection import intersect
from bifocal.precision import (
    base_factor,
    false_relief_of_scale,
    point_covariance,
    sigma_displacements,
    sigma_relief,
    uncertainty_radius,
)
from tests.rounding import EPS

PAIRS = {"35/19": (35.0, 17.5, 19.0, 9.5), "35/28": (35.0, 17.5, 28.0, 14.0)}


def seen(c1, d1, c2, d2, radius, r):
    """Return s1, s2 [mm] of a point, by similar triangles at each camera."""
    return c1 * radius / (d1 - r), c2 * radius / (d2 - r)


def test_equation_1_by_hand():
    # s = 8 mm, r = 0.5 m, d = 10 m: e = 8 * 0.5 / 10 = 0.4 mm.
    assert relief_displacement(8.0, 0.5, d=10.0) == pytest.approx(0.4, rel=4 * EPS)


def test_equation_2_is_the_inverse_of_equation_1():
    assert relief_from_displacement(8.0, 0.4, d=10.0) == pytest.approx(0.5, rel=4 * EPS)


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("r", [-3.0, -0.5, -0.01, 0.0, 0.01, 0.5, 1.0, 4.0])
def test_equations_5_and_6_are_exact_for_every_sign_of_relief(pair, r):
    c1, d1, c2, d2 = PAIRS[pair]
    s1, s2 = seen(c1, d1, c2, d2, 2.0, r)
    assert relief(s1, s2, d1=d1, d2=d2) == pytest.approx(r, abs=2e-13)
    e1, e2 = relief_displacements(s1, s2, d1=d1, d2=d2)
    assert e1 == pytest.approx(s1 - c1 * 2.0 / d1, abs=1e-13)
    assert e2 - e1 == pytest.approx(s2 - s1, abs=1e-13)


@given(
    d2=st.floats(0.5, 50), gap=st.floats(0.2, 50), share=st.floats(-2, 0.9),
    radius=st.floats(0.05, 100),
)  # fmt: skip
def test_relief_equals_a_fifty_digit_solution(d2, gap, share, radius):
    d1, r = d2 + gap, share * d2
    with mpmath.workdps(50):
        s1 = mpmath.mpf(d1) * radius / (mpmath.mpf(d1) - r)
        s2 = mpmath.mpf(d2) * radius / (mpmath.mpf(d2) - r)
        f1, f2 = float(s1), float(s2)
        exact = (mpmath.mpf(f2) - f1) / (mpmath.mpf(f2) / d2 - mpmath.mpf(f1) / d1)
        rate = abs(float(mpmath.mpf(f2) / d2 - mpmath.mpf(f1) / d1))
    # Rounding of s2/d2 - s1/d1 relative to its size is all that may be lost.
    allowed = 2 * EPS * (f2 / d2 + f1 / d1) / rate * (abs(float(exact)) + d2 * 1e-3) + 4 * EPS
    assert abs(float(relief(f1, f2, d1=d1, d2=d2)) - float(exact)) <= allowed


def test_equation_7_has_the_sine_with_x_because_theta_is_an_azimuth():
    x, y = plane_coordinates(5.0, 1.0, np.radians(30.0))
    assert (float(x), float(y)) == pytest.approx((2.0, 4 * np.cos(np.radians(30.0))), abs=1e-14)
    x, y = plane_coordinates(5.0, 1.0, np.radians(90.0))
    assert (float(x), float(y)) == pytest.approx((4.0, 0.0), abs=1e-14)


def test_points_on_the_plane_have_the_same_coordinates_in_both_photos():
    s1, s2 = seen(*PAIRS["35/19"], np.linspace(0.1, 5, 9), 0.0)
    np.testing.assert_allclose(s1, s2, rtol=4 * EPS)
    np.testing.assert_array_equal(relief(s1, s1, d1=17.5, d2=9.5), 0.0)


def test_relief_is_nan_at_the_nadir_point():
    assert np.isnan(relief(0.0, 0.0, d1=17.5, d2=9.5))
    assert np.isnan(relief_from_displacement(0.0, 0.0, d=9.5))


def test_shapes_broadcast_and_scalars_equal_arrays_of_one():
    s1, s2 = seen(*PAIRS["35/19"], np.linspace(0.1, 5, 6).reshape(2, 3), 0.3)
    grid = relief(s1, s2, d1=17.5, d2=9.5)
    assert grid.shape == (2, 3)
    assert grid[1, 2] == relief(s1[1, 2], s2[1, 2], d1=17.5, d2=9.5)


def test_unit_of_the_image_does_not_matter():
    s1, s2 = seen(*PAIRS["35/19"], 2.0, 0.7)
    assert relief(s1 * 1000, s2 * 1000, d1=17.5, d2=9.5) == pytest.approx(0.7, abs=1e-13)


@pytest.mark.parametrize(
    ("s1", "s2"),
    [
        (10.0, 5.0),  # meet behind both cameras
        (17.5, 9.4),
        (17.5, 9.5),  # parallel
        (1.0, -1.0),  # no distance is negative
        (-4.0, -5.0),
        (0.0, 5.0),  # in the near camera itself
    ],
)
def test_relief_is_nan_where_no_rays_meet_before_the_near_camera(s1, s2):
    assert np.isnan(relief(s1, s2, d1=17.5, d2=9.5))
    assert np.isnan(relief_displacements(s1, s2, d1=17.5, d2=9.5)).all()


def test_equal_and_exchanged_distances_are_refused():
    with pytest.raises(GeometryError, match="different distances"):
        relief(4.0, 5.0, d1=10.0, d2=10.0)
    with pytest.raises(GeometryError, match="camera 1 is the far one"):
        relief(4.0, 4.2, d1=9.5, d2=17.5)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_a_distance_that_is_no_distance_is_refused(bad):
    with pytest.raises(InputError, match="d1"):
        relief(4.0, 5.0, d1=bad, d2=9.5)


def test_text_among_the_numbers_is_refused_by_name():
    with pytest.raises(InputError, match="s1"):
        relief("wide", 5.0, d1=17.5, d2=9.5)


# Precision


@pytest.mark.parametrize(("pair", "expected"), [("35/19", 0.0275), ("35/28", 0.093)])
def test_one_pixel_picks_at_the_rms_radius_give_the_known_sigma(pair, expected):
    _, d1, _, d2 = PAIRS[pair]
    pixel = 22.7 / 3072 * 17.5 / 35  # 3.69 mm on the wall
    radius = np.hypot(3072, 2048) * pixel / np.sqrt(12)
    found = sigma_relief(radius, radius, d1=d1, d2=d2, sigma_1=pixel, sigma_2=pixel)
    assert found == pytest.approx(expected, rel=0.01)


def test_sigma_at_the_plane_is_the_base_factor_over_the_radius():
    found = sigma_relief(2.0, 2.0, d1=17.5, d2=9.5, sigma_1=0.0, sigma_2=0.003)
    assert found == pytest.approx(0.003 * 17.5 * 9.5 / 8 / 2.0, rel=1e-14)


def plane_picks(point, distance, sigma):
    """Return the picks of one point by a camera over the origin of the plane, 1 px = 1 m."""
    foot = rays.Foot(np.zeros(2), distance)
    position = np.array([point[:2]]) * distance / (distance - point[2])
    return PlanePicks(
        positions=position, metres_per_pixel=np.eye(2)[None], sigma_px=sigma, foot=foot
    )


def rough_across(picks, direction):
    """Return picks that say no more than how far from the nadir a point lies."""
    across = np.array([direction[1], -direction[0]])
    return replace(picks, metres_per_pixel=(np.eye(2) + 1e4 * np.outer(across, across))[None])


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("r", [-0.6, 0.0, 1.0])
def test_closed_forms_agree_with_monte_carlo(pair, r):
    c1, d1, c2, d2 = PAIRS[pair]
    rng = np.random.default_rng(20240601)
    radius, theta, noise, draws = 3.1, 0.7, 0.0074, 100_000
    s1, s2 = seen(c1, d1, c2, d2, radius, r)
    # Picks are x, y with equal noise in both images [mm]; s and theta follow from them.
    direction = np.array([np.sin(theta), np.cos(theta)])
    pick1 = s1 * direction + rng.normal(0, noise, (draws, 2))
    pick2 = s2 * direction + rng.normal(0, noise, (draws, 2))
    n1, n2 = np.hypot(*pick1.T), np.hypot(*pick2.T)
    e1, e2 = relief_displacements(n1, n2, d1=d1, d2=d2)
    x, y = plane_coordinates(n1, e1, np.arctan2(pick1[:, 0], pick1[:, 1]))
    drawn = [np.std(v) for v in (relief(n1, n2, d1=d1, d2=d2), e1, e2, x, y)]
    both = {"d1": d1, "d2": d2, "sigma_1": noise, "sigma_2": noise}
    # In the image plane's scale the cameras stand c from the wall, all lengths in mm. x' and y' of
    # Eq. (7) have their direction from image 1 alone.
    at_scale = np.array([*radius * direction, r]) * c1 / d1
    exact = [plane_picks(at_scale, c, noise) for c in (c1, c2)]
    alone = intersect(exact[0], rough_across(exact[1], direction), limits=FlagLimits()).sigma[0]
    formal = [sigma_relief(s1, s2, **both), *sigma_displacements(s1, s2, **both), *alone[:2]]
    np.testing.assert_allclose(np.array(drawn) / np.array(formal), 1.0, atol=0.05)
    assert alone[2] * d1 / c1 == pytest.approx(float(formal[0]), rel=1e-6)
    # All four coordinates by least squares, as the program solves them.
    free = [
        replace(
            pick,
            positions=drawn_picks,
            metres_per_pixel=np.broadcast_to(np.eye(2), (draws, 2, 2)),
        )
        for pick, drawn_picks in zip(exact, (pick1, pick2), strict=True)
    ]
    xyz = intersect(*free, limits=FlagLimits()).xyz
    adjusted = intersect(*exact, limits=FlagLimits()).sigma[0]
    np.testing.assert_allclose(xyz.std(axis=0) / adjusted, 1.0, atol=0.05)


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("r", [-3.0, 0.5, 4.0])
def test_sigmas_of_the_displacements_propagate_equation_5(pair, r):
    c1, d1, c2, d2 = PAIRS[pair]
    s1, s2 = seen(c1, d1, c2, d2, 2.0, r)
    sigma_1, sigma_2 = 0.003, 0.005  # unequal, so that no term hides behind another
    with mpmath.workdps(50):

        def displaced(which, first, second):
            depth = (second - first) / (second / d2 - first / d1)
            return (first / d1, second / d2)[which] * depth

        for which, sigma in enumerate(
            sigma_displacements(s1, s2, d1=d1, d2=d2, sigma_1=sigma_1, sigma_2=sigma_2)
        ):
            at = (mpmath.mpf(s1), mpmath.mpf(s2))
            by_1, by_2 = (
                mpmath.diff(lambda *s, which=which: displaced(which, *s), at, order)
                for order in ((1, 0), (0, 1))
            )
            expected = float(mpmath.hypot(by_1 * sigma_1, by_2 * sigma_2))
            assert sigma == pytest.approx(expected, rel=1e-12)


def test_across_the_radius_a_point_moves_as_far_as_relief_leaves_of_its_distance():
    # Towards +y only the pick across the radius moves x', by (1 - r / d1): 2 m before the wall,
    # camera at 16 m, 7/8 of 4 um, 2 m behind it 9/8. Towards +x it is y'. The other photo's picks
    # are too rough to help.
    for r, wanted in ((2.0, 0.0035), (-2.0, 0.0045)):
        for axis, point in enumerate(([0.0, 3.0, r], [3.0, 0.0, r])):
            picks = plane_picks(point, 16.0, 0.004), plane_picks(point, 8.0, 40.0)
            found = intersect(*picks, limits=FlagLimits()).sigma[0, axis]
            assert found == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("r", [-0.6, 0.0, 0.8])
def test_sigma_r_of_both_forms_agrees(r):
    picks = plane_picks([2.0, 0.0, r], 17.5, 0.004), plane_picks([2.0, 0.0, r], 9.5, 0.007)
    s1, s2 = (pick.positions[0, 0] for pick in picks)
    found = intersect(*picks, limits=FlagLimits()).sigma[0, 2]
    both = {"d1": 17.5, "d2": 9.5, "sigma_1": 0.004, "sigma_2": 0.007}
    assert sigma_relief(s1, s2, **both) == pytest.approx(found, rel=1e-9)


def test_strongly_different_lenses_are_preferable():
    assert base_factor(d1=17.5, d2=9.5) < base_factor(d1=17.5, d2=14.0) / 3


@pytest.mark.parametrize(("d2", "expected"), [(9.5, 0.21), (14.0, 0.70)])
def test_one_percent_of_scale_mismatch_is_a_known_false_relief(d2, expected):
    assert false_relief_of_scale(0.01, d1=17.5, d2=d2) == pytest.approx(expected, abs=0.005)
    # The same from the equations: a point on the plane, image 2 a millionth too large.
    assert relief(4.0, 4.000004, d1=17.5, d2=d2) * 1e4 == pytest.approx(
        false_relief_of_scale(0.01, d1=17.5, d2=d2), rel=1e-5
    )


@pytest.mark.parametrize("r", [-0.5, 0.0, 0.9])
def test_at_the_uncertainty_radius_sigma_is_the_wanted_one(r):
    one_pick, wanted = 0.002, 0.03
    radius = uncertainty_radius(wanted, d1=17.5, d2=9.5, sigma_m=one_pick * np.sqrt(2), r=r)
    s1, s2 = 17.5 * radius / (17.5 - r), 9.5 * radius / (9.5 - r)
    found = sigma_relief(s1, s2, d1=17.5, d2=9.5, sigma_1=one_pick, sigma_2=one_pick)
    assert found == pytest.approx(wanted, rel=1e-12)


def test_the_area_of_uncertainty_of_the_papers_camera_matches_the_field():
    # 0.05 px and 1 cm: 104 px for 35/19 and 350 px for 35/28.
    assert uncertainty_radius(0.01, d1=17.5, d2=9.5, sigma_m=0.05) == pytest.approx(104, abs=0.5)
    assert uncertainty_radius(0.01, d1=17.5, d2=14.0, sigma_m=0.05) == pytest.approx(350, abs=0.5)


def test_precision_refuses_a_near_camera_farther_than_the_far_one():
    with pytest.raises(GeometryError, match="greater"):
        base_factor(d1=9.5, d2=17.5)


#: An ideal pair, a point off the nadir, its relief: what every form of the equations must agree on.
IDEAL = given(
    d2=st.floats(0.5, 50), gap=st.floats(0.2, 50), share=st.floats(-2, 0.9),
    radius=st.floats(0.05, 100), theta=st.floats(-3.1, 3.1),
)  # fmt: skip


@IDEAL
def test_both_rays_of_an_ideal_pair_give_equation_6(d2, gap, share, radius, theta):
    d1, r = d2 + gap, share * d2
    s1, s2 = seen(d1, d1, d2, d2, radius, r)
    direction, nadir = np.array([np.sin(theta), np.cos(theta)]), np.array([0.3, -0.7])
    far, near = rays.Foot(nadir, d1), rays.Foot(nadir, d2)
    q1, q2 = nadir + s1 * direction, nadir + s2 * direction
    point = np.array([*(nadir + radius * direction), r])
    np.testing.assert_allclose(rays.plane_position(point, far), q1, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(rays.plane_position(point, near), q2, rtol=1e-12, atol=1e-12)
    wanted = relief(s1, s2, d1=d1, d2=d2)
    # |q2 - q1| is what r is read from: it is known to its rounding, the base factor magnifies it.
    slack = 64 * EPS * (1 + s2) * d1 * d2 / (d1 - d2) / radius * (1 + abs(r))
    assert rays.relief_of_rays(q1, q2, far, near) == pytest.approx(wanted, abs=slack)
    assert rays.relief_from_zoom(s2 / s1, d1=d1, d2=d2) == pytest.approx(wanted, abs=slack)
    assert rays.relief_from_zoom(rays.zoom_factor(r, d1=d1, d2=d2), d1=d1, d2=d2) == pytest.approx(
        r, abs=slack
    )
    np.testing.assert_allclose(rays.point_on_ray(q1, np.array(r), far), point, rtol=0, atol=1e-11)


@IDEAL
def test_magnification_is_equation_1(d2, gap, share, radius, theta):  # noqa: ARG001
    r = share * d2
    s = radius * float(rays.magnification(r, d2))
    # s' = s - e with Eq. (1), and back.
    assert s - relief_displacement(s, r, d=d2) == pytest.approx(radius, rel=1e-13)
    assert s * rays.reduction(r, d2) == pytest.approx(radius, rel=1e-13)


def test_magnification_is_nan_level_with_the_camera_and_behind_it():
    assert np.isnan(rays.magnification(np.array([9.5, 10.0]), 9.5)).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_forms_for_images_keep_their_precision(dtype):
    r = np.array([0.5], dtype)
    assert rays.magnification(r, 9.5).dtype == dtype
    assert rays.zoom_factor(r, d1=17.5, d2=9.5).dtype == dtype
    assert rays.relief_from_zoom(r + 1, d1=17.5, d2=9.5).dtype == dtype
    assert rays.relief_per_zoom(r, d1=17.5, d2=9.5).dtype == dtype


@IDEAL
def test_the_sigma_of_dense_relief_is_that_of_image_2_alone(d2, gap, share, radius, theta):  # noqa: ARG001
    d1, r = d2 + gap, share * d2
    s1, s2 = seen(d1, d1, d2, d2, radius, r)
    sigma = sigma_relief(s1, s2, d1=d1, d2=d2, sigma_1=0.0, sigma_2=0.001)
    # k = s2 / s1: an error of s2 is one of k, s1 times smaller.
    assert rays.relief_per_zoom(r, d1=d1, d2=d2) * 0.001 / s1 == pytest.approx(sigma, rel=1e-9)


def test_relief_per_zoom_is_the_base_factor_on_the_plane():
    assert rays.relief_per_zoom(0.0, d1=17.5, d2=9.5) == pytest.approx(
        base_factor(d1=17.5, d2=9.5), rel=4 * EPS
    )


def test_each_point_may_have_distances_of_its_own():
    s1, s2 = 35 * 2 / np.array([16.5, 16.5]), np.array([19 * 2 / 8.5, 28 * 2 / 13.0])
    d2 = np.array([9.5, 14.0])
    assert relief(s1, s2, d1=17.5, d2=d2) == pytest.approx([1.0, 1.0])
    e1, e2 = relief_displacements(s1, s2, d1=[17.5, 17.5], d2=d2)
    assert e1 == pytest.approx(s1 / 17.5)
    assert e2 == pytest.approx(s2 / d2)
    with pytest.raises(GeometryError, match="d1 = 9 m is shorter than d2 = 14 m"):
        relief(s1, s2, d1=[17.5, 9.0], d2=d2)
    with pytest.raises(InputError, match=r"d2\[1\]: must be above zero \[m\].*got -1"):
        relief(s1, s2, d1=17.5, d2=[9.5, -1.0])


def test_arrays_of_different_length_are_refused_by_name():
    with pytest.raises(InputError, match=r"s1 \(3,\), s2 \(2,\).* do not fit together"):
        relief([1, 2, 3], [1, 2], d1=17.5, d2=9.5)
    with pytest.raises(InputError, match=r"theta \(2,\)"):
        plane_coordinates([1, 2, 3], 0.0, [1, 2])


def test_masked_values_are_unknown():
    s1 = np.ma.masked_array([35 * 2 / 16.5, 1e30], mask=[False, True])
    found = relief(s1, [19 * 2 / 8.5] * 2, d1=17.5, d2=9.5)
    assert found[0] == pytest.approx(1.0)
    assert np.isnan(found[1])


class Column(np.ndarray):
    """A stand-in for a pandas column, which is no dependency: values with an index."""

    def __new__(cls, values, index):
        column = np.asarray(values, dtype=float).view(cls)
        column.index = index
        return column


class Index(tuple):
    """A stand-in for a pandas index."""

    def equals(self, other):
        return self == other


Column.__module__ = "pandas.core.series"


def test_the_index_of_columns_is_kept_and_must_agree():
    names = Index(("P7", "P9"))
    s1, s2 = Column([35 * 2 / 16.5] * 2, names), Column([19 * 2 / 8.5] * 2, names)
    found = relief(s1, s2, d1=17.5, d2=9.5)
    assert isinstance(found, Column)
    assert found.index == names
    e1, _ = relief_displacements(s1, s2, d1=17.5, d2=9.5)
    assert e1.index == names
    with pytest.raises(InputError, match="different indices"):
        relief(s1, Column(s2, Index(("P9", "P7"))), d1=17.5, d2=9.5)


def test_points_of_any_shape_intersect():
    pair = Pair.ideal(d1=17.5, d2=9.5, c1=35, c2=19)
    xyz = np.random.default_rng(2).uniform([-4, -3, -0.5], [4, 3, 0.8], (2, 3, 3))
    found = pair.intersect(*pair.project(xyz))
    assert found.xyz == pytest.approx(xyz)
    assert found.covariance.shape == (2, 3, 3, 3)
    assert found.sigma.shape == (2, 3, 3)
    assert len(found) == len(found.flags) == 6
    assert pair.intersect(*(p[0, 0] for p in pair.project(xyz))).xyz == pytest.approx(xyz[0, 0])


@pytest.mark.parametrize("d2", [9.5, 14.0])
def test_sigma_of_x_and_y_and_their_covariance_agree_with_monte_carlo(d2):
    rng = np.random.default_rng(5)
    c2, m, sigma = d2 / 0.5, 0.5, 0.002
    x, y, r = 3.1, -1.7, 0.6
    n = 200_000
    xy1 = np.array([x, y]) * 35 / (17.5 - r) + rng.normal(0, sigma, (n, 2))
    xy2 = np.array([x, y]) * c2 / (d2 - r) + rng.normal(0, sigma, (n, 2))
    s1, s2 = np.hypot(*xy1.T), np.hypot(*xy2.T)
    found = relief(s1, s2, d1=17.5, d2=d2)
    # Eq. (7) with the direction of image 1.
    place = xy1 * ((1 - found / 17.5) * m)[:, None]
    sample = np.cov(np.column_stack([place, found]).T)
    theta = np.arctan2(x, y)
    stated = point_covariance(
        [35 * np.hypot(x, y) / (17.5 - r)], [c2 * np.hypot(x, y) / (d2 - r)], [theta],
        d1=17.5, d2=d2, sigma_1=sigma, sigma_2=sigma, metres=m,
    )[0]  # fmt: skip
    scale = np.sqrt(np.outer(np.diagonal(stated), np.diagonal(stated)))
    assert (sample - stated) / scale == pytest.approx(np.zeros((3, 3)), abs=0.02)
