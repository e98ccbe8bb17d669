"""Doubtful relief at a step is on the side that photo 1 draws it on."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bifocal.relief_maps import sides
from bifocal.relief_maps.frame import Frame, zoom_map
from tests.scenes.even_frames import SIDE, frame_of

#: Relief of a light board before a dark wall, and where photo 1 shows it.
RISE = 2.0
BOARD = np.s_[50:110, 95:125]
#: Outside its outer rim, where camera 2 sees the board and not the wall.
STRIP = np.s_[55:105, 125:128]


def board() -> tuple[Frame, np.ndarray]:
    """Return photos of a board before a wall, and the relief that photo 1 shows."""
    rng = np.random.default_rng(4)
    texture = cv2.GaussianBlur(rng.normal(0, 20, (SIDE, SIDE)), (0, 0), 1.0)
    wall = np.clip(70 + texture, 0, 255).astype(np.uint8)
    light = np.clip(170 + texture.T, 0, 255).astype(np.uint8)
    relief = np.zeros((SIDE, SIDE), np.float32)
    relief[BOARD] = RISE
    image1 = np.where(relief > 0, light, wall)
    # On the plane photo 2 shows the wall at the same place, and the board about the zoom centre.
    columns, _ = zoom_map(frame_of(wall, wall), np.full_like(relief, RISE))
    middle = (SIDE - 1) / 2
    factor = (columns[0, -1] - columns[0, 0]) / (SIDE - 1)
    back = np.array([[1 / factor, 0, middle - middle / factor]])
    matrix = np.vstack([back, np.roll(back[:, [1, 0, 2]], 0)])
    zoomed = [
        cv2.warpAffine(one, matrix, (SIDE, SIDE), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        for one in (light, relief)
    ]
    return frame_of(image1, np.where(zoomed[1] > RISE / 2, zoomed[0], wall)), relief


def settled(frame: Frame, relief: np.ndarray, believed: np.ndarray) -> np.ndarray:
    return sides.settled(frame, relief, believed, np.zeros(relief.shape, bool))


def test_teeth_of_a_rim_that_camera_2_hides_the_wall_behind_lie_on_the_wall():
    frame, truth = board()
    relief, believed = truth.copy(), np.ones(truth.shape, bool)
    believed[50:110, 123:136] = False
    relief[STRIP][::6] = relief[STRIP][1::6] = RISE
    result = settled(frame, relief, believed)
    np.testing.assert_allclose(result[STRIP], 0, atol=0.01)
    # The board stays as it is up to its rim, and what is believed wherever it is.
    np.testing.assert_array_equal(result[BOARD], truth[BOARD])
    np.testing.assert_array_equal(result[believed], relief[believed])


def test_a_scrap_of_much_parallax_goes_though_camera_2_could_see_the_wall():
    frame, truth = board()
    relief, believed = truth.copy(), np.ones(truth.shape, bool)
    scrap = np.s_[20:30, 20:30]
    believed[15:35, 15:35] = False
    relief[scrap] = 3.0
    np.testing.assert_allclose(settled(frame, relief, believed)[scrap], 0, atol=0.01)


@pytest.mark.parametrize(("width", "height"), [(38, 4.5), (8, 0.0)])
def test_what_goes_on_as_high_farther_out_is_the_inner_rim_of_a_raised_part(width, height):
    frame, truth = board()
    relief, believed = truth.copy(), np.ones(truth.shape, bool)
    # No photo shows anything so high here, but a wide band is no scrap.
    believed[40:120, :45] = False
    relief[40:120, 38 - width : 38] = 4.5
    np.testing.assert_allclose(settled(frame, relief, believed)[60:100, 31:37], height, atol=0.01)


def test_a_board_that_nothing_validates_stays_where_both_photos_show_it():
    frame, truth = board()
    believed = np.ones(truth.shape, bool)
    believed[52:108, 97:123] = False
    np.testing.assert_array_equal(settled(frame, truth, believed), truth)


@pytest.mark.parametrize("believed", [False, True])
def test_where_nothing_or_all_is_known_relief_is_left_alone(believed):
    frame, truth = board()
    everywhere = np.full(truth.shape, believed)
    np.testing.assert_array_equal(settled(frame, truth, everywhere), truth)
