"""Roto-translations with scale against known ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from bifocal import GeometryError, InputError
from photocore.camera.similarity import fit_levelled, fit_plane, fit_similarity

WALL = np.array([[0, 0, 0], [6, 0, 0.1], [6, 4, -0.3], [0, 4, 0.4], [3, 2, 1.0]], dtype=float)
UTM = np.array([351234.567, 4123456.789, 33.21])


def levelled(angle, scale):
    cos, sin = np.cos(angle), np.sin(angle)
    return UTM + scale * WALL @ np.array([[cos, 0, sin], [sin, 0, -cos], [0, 1, 0]]).T


def test_seven_parameters_come_back_at_utm_size():
    rotation = Rotation.from_euler("xyz", [0.3, -0.5, 2.0]).as_matrix()
    found = fit_similarity(WALL, UTM + 1.02 * WALL @ rotation.T)
    assert found.rotation == pytest.approx(rotation, abs=1e-9)
    assert found.scale == pytest.approx(1.02, rel=1e-9)
    assert found(WALL) == pytest.approx(UTM + 1.02 * WALL @ rotation.T, abs=1e-8)


def test_points_in_one_plane_never_give_a_mirror_image():
    flat = WALL * [1, 1, 0]
    rotation = Rotation.from_euler("xyz", [0.3, -0.5, 2.0]).as_matrix()
    rng = np.random.default_rng(1)
    found = fit_similarity(flat, flat @ rotation.T + rng.normal(0, 0.01, flat.shape))
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)


def test_noisy_points_give_the_least_sum_of_squares():
    rng = np.random.default_rng(2)
    target = levelled(0.7, 1.1) - UTM + rng.normal(0, 0.05, WALL.shape)

    def residuals(p):
        return (p[3:6] + p[6] * WALL @ Rotation.from_rotvec(p[:3]).as_matrix().T - target).ravel()

    found = fit_similarity(WALL, target)
    start = [*Rotation.from_matrix(found.rotation).as_rotvec(), 0, 0, 0, 1]
    best = least_squares(residuals, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert ((found(WALL) - target) ** 2).sum() == pytest.approx(2 * best.cost, rel=1e-9)


def test_levelled_wall_needs_two_points_only():
    target = levelled(-2.1, 0.98)
    found = fit_levelled(WALL[[0, 4]], target[[0, 4]])
    assert found(WALL) == pytest.approx(target, abs=1e-8)


def test_levelled_solution_equals_an_iterative_least_squares():
    rng = np.random.default_rng(4)
    target = levelled(0.4, 1.0) - UTM + rng.normal(0, 0.03, WALL.shape)

    def residuals(p):
        cos, sin = np.cos(p[0]), np.sin(p[0])
        turn = np.array([[cos, 0, sin], [sin, 0, -cos], [0, 1, 0]])
        return (p[2:5] + p[1] * WALL @ turn.T - target).ravel()

    best = least_squares(residuals, [0.3, 1, 0, 0, 0], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    found = fit_levelled(WALL, target)
    assert found.scale == pytest.approx(best.x[1], abs=1e-8)
    assert found(WALL) == pytest.approx((best.fun.reshape(-1, 3) + target), abs=1e-7)


def test_plane_similarity_leaves_heights_to_the_scale():
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    target = np.column_stack([2.0 * WALL[:, :2] @ turn.T + [10, 20], np.zeros(5)])
    found = fit_plane(WALL, target)
    assert found(WALL)[:, :2] == pytest.approx(target[:, :2], abs=1e-12)
    assert found(WALL)[:, 2] == pytest.approx(2.0 * WALL[:, 2], abs=1e-12)


def test_inverse_goes_back():
    found = fit_levelled(WALL, levelled(1.0, 1.3))
    assert found.inverse()(found(WALL)) == pytest.approx(WALL, abs=1e-8)


def test_two_points_are_too_few_for_seven_parameters():
    with pytest.raises(GeometryError, match="2 control points: at least 3"):
        fit_similarity(WALL[:2], WALL[:2])


def test_points_on_one_line_are_refused():
    line = np.outer(np.arange(4.0), [1, 2, 3])
    with pytest.raises(GeometryError, match="on one line"):
        fit_similarity(line, line)


def test_points_one_above_the_other_do_not_tell_the_direction():
    tower = np.array([[0, 0, 0], [0, 5, 0]], dtype=float)
    with pytest.raises(GeometryError, match="one above the other"):
        fit_levelled(tower, tower[:, [0, 2, 1]])


def test_upside_down_heights_are_refused():
    target = levelled(0.4, 1.0) * [1, 1, -1]
    with pytest.raises(GeometryError, match="upside down"):
        fit_levelled(WALL * [0.01, 1, 0.01], target * [0.01, 0.01, 1])


def test_coinciding_points_are_refused():
    with pytest.raises(GeometryError, match="coincide"):
        fit_plane(np.ones((3, 3)), np.ones((3, 3)))


def test_different_numbers_of_points_are_refused():
    with pytest.raises(InputError, match=r"\(5, 3\) and target \(4, 3\)"):
        fit_plane(WALL, WALL[:4])
