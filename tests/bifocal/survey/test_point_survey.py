"""Points of ideal and general pairs against rays drawn with plain trigonometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bifocal import Measuring, Pair, Photo, PointObservations, SurveySetup, Taking
from bifocal.survey.point_survey import solve_points
from multimedia import GeometryError, InputError


def solve_ideal(setup, points):
    return solve_points(setup.pair(), setup.in_millimetres(points), limits=setup.measuring.limits)


SETUP = SurveySetup(taking=Taking(d1=17.5, d2=9.5, c1=35.0, c2=19.0))


def seen(xyz, *, c, d):
    """Image coordinates [mm] of points in front of a camera at the nadir: similar triangles."""
    xyz = np.asarray(xyz, dtype=float)
    return c * xyz[:, :2] / (d - xyz[:, 2:])


def observed(xyz, setup=SETUP, **more):
    return PointObservations(
        ids=tuple(f"P{i}" for i in range(len(xyz))),
        xy1=seen(xyz, c=setup.taking.c1, d=setup.taking.d1),
        xy2=seen(xyz, c=setup.taking.c2, d=setup.taking.d2),
        **more,
    )


def grid():
    rng = np.random.default_rng(5)
    return np.column_stack(
        [rng.uniform(-5, 5, 200), rng.uniform(-3, 3, 200), rng.uniform(-2, 3, 200)]
    )


def test_points_come_back_from_their_images_in_every_quadrant():
    xyz = grid()
    table = solve_ideal(SETUP, observed(xyz))
    assert table.xyz == pytest.approx(xyz, abs=1e-11)


def test_displacement_is_the_share_r_over_d_of_the_radial_distance():
    # By hand: 2 m off the nadir, 1 m out: s1 = 35*2/16.5, e1 = s1/17.5, s' = 35*2/17.5 = 4 mm.
    table = solve_ideal(SETUP, observed([[2.0, 0.0, 1.0]]))
    assert table["e1"][0] == pytest.approx(35 * 2 / 16.5 / 17.5, rel=1e-12)
    assert table["e2"][0] == pytest.approx(19 * 2 / 8.5 / 9.5, rel=1e-12)
    assert table["s_c"][0] == pytest.approx(4.0, rel=1e-12)


def test_radial_distances_with_a_direction_give_the_same_as_coordinates():
    xyz = grid()
    points = observed(xyz)
    polar = np.column_stack(
        [
            np.hypot(*points.xy1.T),
            np.hypot(*points.xy2.T),
            np.degrees(np.arctan2(xyz[:, 0], xyz[:, 1])),
        ]
    )
    table = solve_ideal(SETUP, PointObservations(ids=points.ids, polar=polar))
    assert table.xyz == pytest.approx(xyz, abs=1e-11)
    assert np.isnan(table["q"]).all()


def test_theta_runs_clockwise_from_the_y_axis():
    table = solve_ideal(SETUP, PointObservations(ids=("A",), polar=[[4.0, 4.0, 90.0]]))
    assert table.xyz[0] == pytest.approx([4.0 * 17.5 / 35, 0.0, 0.0], abs=1e-12)


def test_unequal_scales_are_taken_out():
    setup = SurveySetup(taking=Taking(d1=17.5, d2=9.5, c1=35.0, c2=19.1))
    xyz = grid()
    assert solve_ideal(setup, observed(xyz, setup)).xyz == pytest.approx(xyz, abs=1e-11)


def test_pixels_are_counted_down_from_the_nadir_row():
    pitch, nadir = 0.0074, (1536.0, 1024.0)
    setup = SETUP.but(pitch=pitch, unit="px", nadir1=nadir, nadir2=nadir)
    xyz = np.array([[2.0, 1.0, 0.5]])
    pixels = [nadir + seen(xyz, c=c, d=d) / [pitch, -pitch] for c, d in ((35, 17.5), (19, 9.5))]
    assert pixels[0][0, 1] < nadir[1]  # above the nadir: a smaller row
    table = solve_ideal(setup, PointObservations(ids=("A",), xy1=pixels[0], xy2=pixels[1]))
    assert table.xyz == pytest.approx(xyz, abs=1e-11)


def test_the_nadir_point_has_no_relief_and_says_so():
    table = solve_ideal(SETUP, PointObservations(ids=("A",), xy1=[[0, 0]], xy2=[[0, 0]]))
    assert table.flags == ("NADIR",)
    assert np.isnan(table["r"][0])


def test_rays_that_do_not_meet_before_the_near_camera_are_uncertain():
    # s2/s1 below d2/d1: the rays diverge.
    points = PointObservations(ids=("A",), polar=[[10.0, 5.0, 0.0]])
    table = solve_ideal(SETUP, points)
    assert table.flags == ("UNCERTAIN",)
    assert np.isnan(table["r"][0])


def test_a_point_of_the_plane_is_told_from_one_that_stands_out():
    table = solve_ideal(SETUP, observed([[4.0, 2.0, 0.0], [4.0, 2.0, 0.5]]))
    assert table.flags == ("ON-PLANE", "OK")


def test_picks_that_are_not_on_one_radius_are_off_radial():
    points = observed([[4.0, 2.0, 0.5]])
    beside = points.xy2 + 0.05 * np.array([[-2.0, 4.0]]) / np.sqrt(20)
    table = solve_ideal(SETUP, PointObservations(ids=("A",), xy1=points.xy1, xy2=beside))
    assert table.flags == ("OFF-RADIAL",)
    assert abs(table["q"][0]) == pytest.approx(0.05, rel=1e-9)
    # By hand: q has sigma 0.004 mm sqrt(1 + (s2/s1)^2).
    ratio = table["s2_used"][0] / table["s1_used"][0]
    expected = 0.05 / (0.004 * np.sqrt(1 + ratio**2))
    assert abs(table.standardised[0]) == pytest.approx(expected, rel=1e-9)


def test_precision_agrees_with_ten_thousand_noisy_measurements():
    rng = np.random.default_rng(11)
    xyz = np.repeat([[3.0, 2.0, 0.7]], 10_000, axis=0)
    points = observed(xyz)
    noisy = PointObservations(
        ids=points.ids,
        xy1=points.xy1 + rng.normal(0, 0.004, (10_000, 2)),
        xy2=points.xy2 + rng.normal(0, 0.004, (10_000, 2)),
    )
    table = solve_ideal(SETUP, noisy)
    assert table["r"].std() / solve_ideal(SETUP, points)["sigma_r"][0] == pytest.approx(1, abs=0.03)


@given(st.floats(-6, 6), st.floats(-4, 4), st.floats(-5, 8))
def test_turning_the_axes_turns_the_coordinates_and_keeps_relief(x, y, r):
    if np.hypot(x, y) < 0.05:
        return
    straight = solve_ideal(SETUP, observed([[x, y, r]]))
    turned = solve_ideal(SETUP, observed([[-y, x, r]]))
    assert turned["r"][0] == pytest.approx(straight["r"][0], rel=1e-9, abs=1e-11)
    assert turned["X"][0] == pytest.approx(-straight["Y"][0], rel=1e-9, abs=1e-11)


def general_pair():
    def homography(a, b, c):
        return np.array([[4e-3, a, -6.0], [b, -4e-3, 4.0], [c, 2e-6, 1.0]])

    return Pair(
        image1=Photo(
            plane_from_pixel=homography(2e-4, 1e-4, 5e-6), nadir=np.array([0.4, -0.3]), distance=18
        ),
        image2=Photo(
            plane_from_pixel=homography(-1e-4, 3e-4, -3e-6), nadir=np.array([-0.2, 0.5]), distance=9
        ),
    )


def test_general_pair_gives_what_intersecting_its_rays_gives():
    pair, xyz = general_pair(), grid()
    rng = np.random.default_rng(3)
    pixels = [p + rng.normal(0, 0.5, p.shape) for p in pair.project(xyz)]
    points = PointObservations(
        ids=tuple(map(str, range(len(xyz)))), pixels1=pixels[0], pixels2=pixels[1]
    )
    table, expected = solve_points(pair, points), pair.intersect(*pixels)
    assert table.xyz == pytest.approx(expected.xyz, rel=1e-9, abs=1e-9)
    assert table["sigma_r"] == pytest.approx(expected.sigma[:, 2], rel=1e-9)
    assert table["e1"] == pytest.approx(expected.e1, rel=1e-9, abs=1e-9)  # scale 1:1000: mm = m
    assert table["e2"] == pytest.approx(expected.e2, rel=1e-9, abs=1e-9)
    assert table.standardised == pytest.approx(expected.standardised, rel=1e-9, abs=1e-9)
    assert table.flags == expected.flags


def test_exact_picks_of_an_offset_tilted_pair_give_the_points_back():
    pair, xyz = general_pair(), grid()
    first, second = pair.project(xyz)
    points = PointObservations(ids=tuple(map(str, range(200))), pixels1=first, pixels2=second)
    assert solve_points(pair, points).xyz == pytest.approx(xyz, abs=1e-8)


def test_millimetres_of_a_general_pair_are_those_of_image_1():
    # 1:500 and 1:450: seen in both photos at the scale of image 1, as in the workbook.
    metres = np.diag([0.004, -0.004, 1.0])
    far, near = (
        Photo(plane_from_pixel=metres, nadir=[0, 0], distance=d, principal_distance=c)
        for d, c in ((17.5, 35.0), (9.0, 20.0))
    )
    pair, xyz = Pair(image1=far, image2=near), np.array([[2.0, 0.0, 1.0]])
    pixels1, pixels2 = pair.project(xyz)
    table = solve_points(pair, PointObservations(ids=("A",), pixels1=pixels1, pixels2=pixels2))
    assert table.image_scale == 500
    assert table["s1_used"][0] == pytest.approx(35 * 2 / 16.5, rel=1e-9)
    assert table["s2_used"][0] == pytest.approx(18 * 2 / 8, rel=1e-9)
    assert table["e1"][0] == pytest.approx(35 * 2 / 16.5 / 17.5, rel=1e-9)
    assert table["e2"][0] == pytest.approx(18 * 2 / 8 / 9, rel=1e-9)
    assert table.xyz == pytest.approx(xyz, abs=1e-9)


def test_equal_distances_are_refused():
    with pytest.raises(GeometryError, match="same distance"):
        SurveySetup(taking=Taking(d1=9.5, d2=9.5)).pair()


def test_scales_that_differ_too_much_are_refused_with_the_size_of_the_fault():
    with pytest.raises(GeometryError, match=r"47\.4%.*tolerance 2\.0%"):
        SurveySetup(taking=Taking(d1=17.5, d2=14.0, c1=35.0, c2=19.0)).check_scales()


def test_exchanged_distances_are_named():
    with pytest.raises(GeometryError, match="Exchange d_1 and d_2") as refused:
        SurveySetup(taking=Taking(d1=9.5, d2=17.5, c1=35.0, c2=19.0)).check_scales()
    assert "tolerance" not in str(refused.value)


def test_pixels_without_the_size_of_a_pixel_are_refused():
    with pytest.raises(InputError, match="pitch"):
        SurveySetup(taking=Taking(d1=17.5, d2=9.5), measuring=Measuring(unit="px")).pair()
