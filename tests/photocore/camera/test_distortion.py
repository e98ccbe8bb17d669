"""Brown's formula by hand, both ways, in all conventions."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import InputError, RadialDivision
from multimedia import Convention
from photocore.camera.distortion import NAMES, Brown
from tests.rounding import EPS

LENS = dict(k1=1e-4, k2=-2e-7, k3=1e-10, p1=3e-5, p2=-2e-5, scale=1.002, shear=0.001)
POINT = np.array([[0.3, -0.2]])
GRID = np.stack(np.meshgrid(np.linspace(-8, 8, 9), np.linspace(-6, 6, 7)), axis=-1)


def test_formula_by_hand():
    # r2 = 9 + 16 = 25; q = 1e-4 * 25 = 0.0025
    # x' = 3 (1.0025) + 1e-3 (25 + 18) + 2 * 2e-3 * 12 = 3.0075 + 0.043 + 0.048 = 3.0985
    # y' = 4 (1.0025) + 2e-3 (25 + 32) + 2 * 1e-3 * 12 = 4.01 + 0.114 + 0.024 = 4.148
    lens = Brown(k1=1e-4, p1=1e-3, p2=2e-3)
    assert lens.measured([3.0, 4.0], [0.0, 0.0]) == pytest.approx([3.0985, 4.148], rel=4 * EPS)


@pytest.mark.parametrize("convention", Convention)
def test_ideal_undoes_measured(convention):
    lens = Brown(**LENS, convention=convention)
    back = lens.ideal(lens.measured(GRID, POINT[0]), POINT[0])
    assert np.abs(back - GRID).max() < 1e-13


def test_the_conventions_apply_the_formula_where_they_say():
    plain = Brown(**LENS).measured(GRID, [0.0, 0.0])
    about_point = Brown(**LENS).measured(GRID, POINT[0])
    size = np.abs(GRID).max()
    assert np.abs(about_point - (plain + POINT)).max() < 4 * EPS * size
    certificate = Brown(**LENS, convention=Convention.PHOTOGRAMMETRIC)
    assert np.abs(certificate.ideal(GRID + POINT, POINT[0]) - plain).max() < 4 * EPS * size
    sensor = Brown(**LENS, convention=Convention.OPENPTV)
    assert np.abs(sensor.measured(GRID - POINT, POINT[0]) - plain).max() < 4 * EPS * size


def test_opencv_coefficients_give_opencvs_pixels():
    cv2 = pytest.importorskip("cv2")
    c, coefficients = 25.0, (-0.2, 0.05, 0.001, -0.002, 0.01)
    lens = Brown.from_opencv(coefficients, principal_distance=c)
    rays = np.dstack([GRID / c * (1, -1), np.ones(GRID.shape[:2])]).reshape(-1, 1, 3)
    seen, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.eye(3), np.array(coefficients))
    want = seen.reshape(*GRID.shape) * (c, -c)
    assert np.abs(lens.measured(GRID, [0.0, 0.0]) - want).max() < 1e-12


def test_more_opencv_coefficients_are_refused():
    with pytest.raises(InputError, match="k1 k2 p1 p2 k3"):
        Brown.from_opencv([0.1, 0, 0, 0, 0, 0.3], principal_distance=25.0)


@pytest.mark.parametrize("convention", Convention)
def test_derivatives_equal_differences(convention):
    lens = Brown(**LENS, convention=convention)
    ideal, names = GRID.reshape(-1, 2), (*NAMES, "xh", "yh")
    _, by_ideal, by_names = lens.measured_with_jacobian(ideal, POINT[0], names)
    h = 1e-5
    for k in range(2):
        step = h * np.eye(2)[k]
        both = [lens.measured(ideal + s * step, POINT[0]) for s in (1, -1)]
        assert np.abs((both[0] - both[1]) / (2 * h) - by_ideal[..., k]).max() < 1e-9
    sizes = dict(k1=1e-7, k2=1e-9, k3=1e-11, p1=1e-6, p2=1e-6, scale=1e-5, shear=1e-5)
    for k, name in enumerate(names):
        size = sizes.get(name, 1e-5)
        if name in NAMES:
            lenses = [
                Brown(**(LENS | {name: LENS[name] + s * size}), convention=convention)
                for s in (1, -1)
            ]
            both = [other.measured(ideal, POINT[0]) for other in lenses]
        else:
            step = size * np.eye(2)["xy".index(name[0])]
            both = [lens.measured(ideal, POINT[0] + s * step) for s in (1, -1)]
        want = (both[0] - both[1]) / (2 * size)
        assert np.abs(want - by_names[..., k]).max() < 1e-7 * max(1.0, np.abs(want).max())


def test_a_lens_that_folds_the_image_over_gives_nan_not_a_wrong_point():
    lens = Brown(k1=-1e-2)  # x (1 - 0.01 x^2) never exceeds 3.85
    assert np.isnan(lens.ideal([[9.0, 0.0]], [0.0, 0.0])).all()


def test_scale_far_from_one_is_refused():
    with pytest.raises(InputError, match="scale 100"):
        Brown(scale=100.0)


@pytest.mark.parametrize("k", [0.15, 0.0, -0.15])
def test_the_division_model_by_hand_and_back(k: float) -> None:
    lens = RadialDivision(k, np.array([500.0, 300.0]), 1000.0)
    # Seen 400 px off the centre, rho = 0.4: 400 / (1 + 0.16 k).
    assert lens.undistort([900.0, 300.0]) == pytest.approx([500 + 400 / (1 + 0.16 * k), 300.0])
    pixels = np.random.default_rng(0).uniform(0, 900, (40, 2))
    np.testing.assert_allclose(lens.distort(lens.undistort(pixels)), pixels, atol=1e-9)


def test_derivatives_of_the_division_model() -> None:
    centre = np.array([500.0, 300.0])
    lens = RadialDivision(0.1, centre, 1000.0, -0.05)
    pixels = np.random.default_rng(1).uniform(0, 900, (20, 2))
    for axis, step in enumerate(1e-3 * np.eye(2)):
        slope = (lens.distort(pixels + step) - lens.distort(pixels - step)) / 2e-3
        np.testing.assert_allclose(lens.distorted_by_ideal(pixels)[..., axis], slope, atol=1e-8)
        slope = (lens.undistort(pixels + step) - lens.undistort(pixels - step)) / 2e-3
        np.testing.assert_allclose(lens.undistorted_by_seen(pixels)[..., axis], slope, atol=1e-8)
    for term, (by_k1, by_k2) in enumerate(1e-6 * np.eye(2)):
        more, less = (
            RadialDivision(0.1 + s * by_k1, centre, 1000.0, -0.05 + s * by_k2).undistort(pixels)
            for s in (1, -1)
        )
        slope = (more - less) / 2e-6
        np.testing.assert_allclose(lens.undistorted_by_k(pixels)[..., term], slope, atol=1e-6)


def test_the_division_model_with_two_terms_by_hand_and_back() -> None:
    lens = RadialDivision(-0.24, np.array([500.0, 300.0]), 1000.0, 0.29)
    # Seen 500 px off the centre, rho = 0.5: 500 / (1 - 0.24 / 4 + 0.29 / 16).
    assert lens.undistort([1000.0, 300.0]) == pytest.approx([500 + 500 / 0.958125, 300.0])
    pixels = np.random.default_rng(0).uniform(0, 900, (40, 2))
    np.testing.assert_allclose(lens.distort(lens.undistort(pixels)), pixels, atol=1e-9)
