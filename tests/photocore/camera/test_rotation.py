"""Angles, matrices and rotation vectors."""

from __future__ import annotations

import numpy as np
import pytest

from photocore.camera.rotation import (
    angle_rates,
    angles_from_rotation,
    by_rotation,
    nearest_rotation,
    rotation_from_vector,
    skew,
    world_from_camera,
)
from tests.rounding import EPS


def about(axis: int, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def test_the_matrix_is_three_turns_about_x_y_and_z():
    want = about(0, 0.3) @ about(1, -0.7) @ about(2, 2.1)
    assert np.abs(world_from_camera(0.3, -0.7, 2.1) - want).max() < 8 * EPS


def test_angles_come_back():
    rng = np.random.default_rng(5)
    for _ in range(50):
        angles = rng.uniform((-3, -1.5, -3), (3, 1.5, 3))
        assert angles_from_rotation(world_from_camera(*angles)) == pytest.approx(angles, abs=1e-12)


def test_gimbal_lock_still_gives_the_same_matrix():
    matrix = world_from_camera(0.3, np.pi / 2, 0.4)
    assert np.abs(world_from_camera(*angles_from_rotation(matrix)) - matrix).max() < 1e-12


def test_angle_rates_are_the_axes_of_the_turns():
    angles, h = np.array([0.3, -0.7, 2.1]), 1e-7
    base = world_from_camera(*angles)
    axes = np.linalg.inv(angle_rates(base))
    for k in range(3):
        turned = world_from_camera(*(angles + h * np.eye(3)[k])) @ base.T
        vector = np.array([turned[2, 1], turned[0, 2], turned[1, 0]]) / h
        assert vector == pytest.approx(axes[:, k], abs=1e-6)


def test_a_rotation_vector_turns_about_itself():
    assert np.abs(rotation_from_vector([0, 0, 0.4]) - about(2, 0.4)).max() < 8 * EPS
    assert rotation_from_vector([0, 0, 0]).tolist() == np.eye(3).tolist()


def test_nearest_rotation_mends_rounding():
    rng = np.random.default_rng(12)
    for angles in [(0.3, -0.7, 2.1), *rng.uniform(-3, 3, (500, 3))]:
        matrix = world_from_camera(*angles)
        mended = nearest_rotation(matrix.round(5))
        assert np.abs(mended @ mended.T - np.eye(3)).max() < 8 * EPS
        assert np.abs(mended - matrix).max() < 1e-5


def test_the_derivative_by_a_turn_is_the_change_of_a_row_times_the_turned_arm():
    rng = np.random.default_rng(8)
    rows, arms, turn = rng.normal(size=(4, 2, 3)), rng.normal(size=(4, 3)), rng.normal(size=3)
    wanted = np.einsum("nmi,ni->nm", rows, np.cross(turn, arms))
    np.testing.assert_allclose(by_rotation(rows, arms) @ turn, wanted, atol=40 * EPS)
    np.testing.assert_allclose(skew(turn) @ arms[0], np.cross(turn, arms[0]), atol=8 * EPS)
    np.testing.assert_allclose((skew(arms) @ turn), np.cross(arms, turn), atol=8 * EPS)
