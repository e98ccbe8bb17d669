"""Doubtful relief runs on from what is validated beside it, up to edges of photo 1."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from bifocal.relief_maps import between_edges
from bifocal.relief_maps.between_edges import BETWEEN_EDGES
from bifocal.relief_maps.frame import Frame, zoom_map
from tests.scenes.even_frames import NEAR, SIDE, frame_of


def two_surfaces(noise: float = 0.0) -> tuple[Frame, np.ndarray]:
    """Return photos of two even surfaces, dark at 0 m and light at 0.3 m, and their relief."""
    rng = np.random.default_rng(3)
    relief = np.zeros((SIDE, SIDE), np.float32)
    relief[:, 50:] = 0.3
    image2 = np.full((SIDE, SIDE), 60, np.uint8)
    texture = cv2.GaussianBlur(rng.normal(0, noise, relief.shape), (0, 0), 1.0)
    image2 = np.clip(image2 + texture, 0, 255).astype(np.uint8)
    frame = frame_of(image2, image2)
    columns, rows = zoom_map(frame, relief)
    # Photo 1 is what photo 2 shows at the true relief, with the light surface painted in.
    image1 = cv2.remap(image2, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    light = relief > 0
    image1[light] = np.minimum(image1[light].astype(int) + 120, 255).astype(np.uint8)
    return frame_of(image1, image2), relief


def smoothed(frame: Frame, relief: np.ndarray, believed: np.ndarray) -> np.ndarray:
    swept = np.zeros(relief.shape, bool)
    return between_edges.smoothed(frame, relief.astype(np.float32), believed, swept)


def test_one_sweep_solves_the_equation_of_weighted_least_squares_row_by_row():
    rng = np.random.default_rng(1)
    stiff = rng.uniform(0, 5, (6, 9)).astype(np.float32)
    stiff[:, -1] = 0
    values = rng.normal(0, 1, (6, 9)).astype(np.float32)
    factors = between_edges._factored(stiff)
    solved = between_edges.spttrs(*factors, values.reshape(1, -1).T)[0].reshape(6, 9)
    for row in range(6):
        off = -stiff[row, :-1].astype(float)
        hold = np.append(-off, 0) + np.append(0, -off)
        matrix = sparse.diags([off, 1 + hold, off], [-1, 0, 1], format="csc")
        np.testing.assert_allclose(solved[row], spsolve(matrix, values[row]), atol=2e-6)


def test_a_mean_of_equal_values_is_that_value_whatever_the_weights():
    rng = np.random.default_rng(2)
    rows, columns = rng.uniform(0, 1, (2, 30, 40)).astype(np.float32)
    rows[:, -1], columns[-1] = 0, 0
    weight = rng.uniform(0.01, 1, (30, 40)).astype(np.float32)
    mean = between_edges.Smoother(rows, columns).mean(np.full((30, 40), 1.25, np.float32), weight)
    np.testing.assert_allclose(mean, 1.25, rtol=1e-5)


@pytest.mark.parametrize("rise", [-0.08, 0.08])
def test_doubtful_relief_takes_the_surface_it_lies_on_and_not_the_one_beyond_an_edge(rise):
    frame, truth = two_surfaces()
    relief, believed = truth.copy(), np.ones(truth.shape, bool)
    block = np.s_[60:90, 30:46]
    relief[block] += rise
    believed[55:95, 25:50] = False
    result = smoothed(frame, relief, believed)
    assert np.abs(result[block] - truth[block]).max() < 0.25 * abs(rise)
    np.testing.assert_array_equal(result[believed], relief[believed])


def test_what_the_photos_object_to_stays():
    frame, truth = two_surfaces(noise=60.0)
    believed = np.ones(truth.shape, bool)
    # A part that truly stands out, though nothing validates it: photo 2 shows it there.
    true = truth.copy()
    part = np.s_[60:90, 20:40]
    true[part] = 0.5
    columns, rows = zoom_map(frame, true)
    image1 = cv2.remap(frame.image2, columns, rows, cv2.INTER_LINEAR)
    believed[part] = False
    stands_out = frame_of(image1, frame.image2)
    result = smoothed(stands_out, true, believed)
    assert (np.abs(result[part] - 0.5) < 0.05).mean() > 0.9


def test_a_plain_part_is_not_raised_far():
    frame, truth = two_surfaces()
    relief, believed = truth.copy(), np.ones(truth.shape, bool)
    # A dark pane of 0.8 m depth within an even dark wall: any relief fits.
    pane = np.s_[60:90, 20:40]
    relief[pane] = -0.8
    believed[pane] = False
    assert BETWEEN_EDGES.rise * NEAR.distance < 0.8
    np.testing.assert_array_equal(smoothed(frame, relief, believed)[pane], relief[pane])


def test_steps_between_validated_pixels_stay_steps():
    frame, truth = two_surfaces()
    relief, believed = truth.copy(), np.ones(truth.shape, bool)
    relief[100:, :50] = 0.8  # no edge of photo 1 shows it, but two pixels of parallax
    believed[90:98, 2:22] = False
    result = smoothed(frame, relief, believed)
    np.testing.assert_allclose(result[90:98, 2:22], 0, atol=0.01)


def test_where_nothing_is_known_relief_is_left_alone():
    frame, truth = two_surfaces()
    nothing = np.zeros(truth.shape, bool)
    np.testing.assert_array_equal(smoothed(frame, truth, nothing), truth)
