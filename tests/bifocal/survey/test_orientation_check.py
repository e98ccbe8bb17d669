"""Plane points reveal scale, rotation, shift and tilt between the photos."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import Measuring, Pair, Photo, Taking, solve
from bifocal.survey.orientation_check import OrientationParameter, check_orientation
from multimedia import GeometryError, InputError
from tests.scenes import SetupErrors, bifocal_cameras

METRES = np.array([[0.00369, 0, -5.67], [0, -0.00369, 3.78], [0, 0, 1.0]])
IDEAL = Pair(
    image1=Photo(plane_from_pixel=METRES, nadir=[0, 0], distance=17.5),
    image2=Photo(plane_from_pixel=METRES, nadir=[0, 0], distance=9.5),
)

PICKS = Measuring(sigma_px=0.5)


def picks(distortion, count=12, seed=3, noise=0.0):
    """Return picks of plane points whose image 2 is mapped by a homography on the plane."""
    rng = np.random.default_rng(seed)
    xyz = np.column_stack(
        [rng.uniform(-5, 5, count), rng.uniform(-3.5, 3.5, count), np.zeros(count)]
    )
    wrong = replace(
        IDEAL, image2=replace(IDEAL.image2, plane_from_pixel=np.linalg.inv(distortion) @ METRES)
    )
    first, second = wrong.project(xyz)
    return first + rng.normal(0, noise, first.shape), second + rng.normal(0, noise, first.shape)


def by_name(check):
    return {p.name: p for p in check.parameters}


def test_a_scale_mismatch_is_found_and_read_as_false_relief():
    check = check_orientation(IDEAL, *picks(np.diag([1.01, 1.01, 1.0])))
    scale = by_name(check)["scale"]
    assert scale.value == pytest.approx(1.0, abs=1e-6)
    assert scale.false_relief == pytest.approx(0.21, abs=0.01)
    assert scale.is_significant


def test_rotation_shift_and_tilt_are_found_together():
    turn, p = np.radians(0.2), np.array([1e-3, -5e-4])
    distortion = np.array(
        [
            [np.cos(turn), np.sin(turn), 0.02],
            [-np.sin(turn), np.cos(turn), -0.03],
            [p[0], p[1], 1.0],
        ]
    )
    check = check_orientation(IDEAL, *picks(distortion))
    found = by_name(check)
    assert found["rotation"].value == pytest.approx(0.2, abs=2e-3)
    assert found["rotation"].false_relief == 0
    assert found["shift X"].value == pytest.approx(20, abs=0.2)
    assert found["shift Y"].value == pytest.approx(-30, abs=0.2)
    # The projective term of a tilt is its tangent over the distance.
    assert found["tilt X"].value == pytest.approx(np.degrees(1e-3 * 9.5), rel=0.01)
    # The inverse of tilt and shift together has a shear of their product: 0.1 mm here.
    assert np.abs(check.residuals).max() < 2e-4


def test_the_corrected_pair_gives_no_relief_on_the_plane():
    first, second = picks(np.array([[1.01, 0.003, 0.02], [-0.003, 1.01, 0.01], [4e-4, 0, 1.0]]))
    check = check_orientation(IDEAL, first, second)
    away = np.hypot(*IDEAL.image1.plane_from_pixels(first).T) > 1
    assert np.abs(IDEAL.intersect(first, second).xyz[away, 2]).max() > 0.1
    assert np.abs(check.corrected.intersect(first, second).xyz[away, 2]).max() < 5e-4


def test_formal_sigmas_match_the_spread_of_repeated_picks():
    pulls = []
    for seed in range(150):
        check = check_orientation(IDEAL, *picks(np.eye(3), seed=seed, noise=0.5), sigma_px=0.5)
        pulls.append([p.value / p.sigma for p in check.parameters])
    spread = np.sqrt(np.mean(np.square(pulls), axis=0))
    np.testing.assert_allclose(spread, 1.0, atol=0.25)


def test_a_point_that_is_not_on_the_plane_is_named_and_left_out():
    first, second = picks(np.diag([1.002, 1.002, 1.0]), noise=0.2)
    second[4] += 25
    check = check_orientation(
        IDEAL, first, second, names=[f"P{i}" for i in range(12)], sigma_px=0.2
    )
    assert check.outliers == ("P4",)
    assert by_name(check)["scale"].value == pytest.approx(0.2, abs=0.02)
    assert any("P4" in line for line in check.remarks)


def test_few_points_say_that_tilt_is_not_determined():
    check = check_orientation(IDEAL, *picks(np.eye(3), count=3))
    assert len(check.parameters) == 4
    assert any("tilt: not determined" in line for line in check.remarks)


def test_one_point_is_refused():
    with pytest.raises(InputError, match="at least 2"):
        check_orientation(IDEAL, [[10, 10]], [[10, 10]])


def test_coinciding_points_are_refused():
    with pytest.raises(GeometryError, match="spread over the photo"):
        check_orientation(IDEAL, np.full((6, 2), 300.0), np.full((6, 2), 301.0))


@pytest.mark.parametrize(("noise", "limit"), [(0.0, 0.006), (0.35, 0.025)])
def test_points_off_the_plane_show_the_centre_of_zoom(noise, limit):
    """58 mm of relief without it; typed distances up to 1 % wrong leave a few."""
    rng = np.random.default_rng(6)
    cameras = bifocal_cameras(errors=SetupErrors(), rng=rng)
    span = (rng.uniform(-5, 5, 60), rng.uniform(-3, 3, 60), rng.uniform(-0.5, 0.6, 60))
    xyz = np.column_stack(span)
    xyz[:14, 2] = 0.0
    seen = [p + rng.normal(0, noise, p.shape) for p in cameras.exact.project(xyz)]
    data = dict(zip(("col1", "row1", "col2", "row2"), np.hstack(seen).T, strict=True))
    data |= {"id": [str(i) for i in range(60)], "code": ["PLANE"] * 14 + [""] * 46}
    survey = solve(data, pair=cameras.nominal, measuring=PICKS, adjust_setup=True)
    error = (survey.table["r"] - xyz[:, 2])[np.hypot(xyz[:, 0], xyz[:, 1]) > 1.5]
    assert np.sqrt(np.mean(error**2)) < limit
    assert any("relief spreads from a point" in text for text in survey.remarks)
    # Without points off the plane nothing shows it.
    plane = {key: values[:14] for key, values in data.items()}
    flat = solve(plane, pair=cameras.nominal, measuring=PICKS, adjust_setup=True)
    assert not any("relief spreads" in text for text in flat.remarks)


def test_an_ideal_survey_in_millimetres_finds_the_same_centre():
    rng = np.random.default_rng(8)
    near = replace(IDEAL.image2, nadir=[0.06, -0.04])
    span = (rng.uniform(-5, 5, 60), rng.uniform(-3, 3, 60), rng.uniform(-0.5, 0.6, 60))
    xyz = np.column_stack(span)
    xyz[:14, 2] = 0.0
    photos = (IDEAL.image1, near)
    positions = [
        photo.nadir + (xyz[:, :2] - photo.nadir) * (d / (d - xyz[:, 2]))[:, None]
        for photo, d in zip(photos, (17.5, 9.5), strict=True)
    ]
    millimetres = np.hstack([positions[0] * 35 / 17.5, positions[1] * 19 / 9.5])
    data = dict(zip(("x1", "y1", "x2", "y2"), millimetres.T, strict=True))
    data |= {"id": [str(i) for i in range(60)], "code": ["PLANE"] * 14 + [""] * 46}
    taking, measuring = Taking(d1=17.5, d2=9.5, c1=35, c2=19), Measuring(sigma_s=0.002)
    survey = solve(data, taking=taking, measuring=measuring, adjust_setup=True)
    assert any("in mm at the scale of image 1." in remark for remark in map(str, survey.remarks))
    away = np.hypot(xyz[:, 0], xyz[:, 1]) > 1.5
    np.testing.assert_allclose(survey.table["r"][away], xyz[away, 2], atol=2e-4)


@pytest.mark.parametrize(("value", "says_something"), [(-0.2, True), (0.14, False)])
def test_a_difference_says_something_from_three_of_its_sigmas_on(value, says_something):
    about = {"name": "shift X", "unit": "mm", "false_relief": 0.0}
    assert OrientationParameter(value=value, sigma=0.05, **about).is_significant == says_something
