"""Picks held against the photos: whose pixels they are, of which copy, counted from where."""

import numpy as np
import pytest

from bifocal.matching.pick_evidence import held_against_photos

SIZE = (420, 300)
#: Places in photo 1, and by how much photo 2 shows them elsewhere: off the wall, and on it.
PLACES = np.array([[60, 50], [200, 60], [350, 50], [70, 240], [210, 150], [340, 230.0]])
AWAY = np.array([[9, 4], [-8, 6], [0, 0], [11, -5], [-9, -7], [0, 0.0]])
NEAR = PLACES + AWAY


def walls() -> tuple[np.ndarray, np.ndarray]:
    """Return two photos of one textured wall; what stands off it is moved in the second."""
    rng = np.random.default_rng(5)
    first = rng.integers(20, 235, SIZE[::-1]).astype(np.uint8)
    second = first.copy()
    for (column, row), (right, down) in zip(PLACES.astype(int), AWAY.astype(int), strict=True):
        board = first[row - 12 : row + 13, column - 12 : column + 13]
        second[row + down - 12 : row + down + 13, column + right - 12 : column + right + 13] = board
    return first, second


def turned(pixels: np.ndarray) -> np.ndarray:
    return pixels * [1, -1] + [0, SIZE[1] - 1]


@pytest.mark.parametrize("transfer", [None, np.eye(3)])
def test_right_picks_are_contradicted_by_nothing(transfer) -> None:
    verdict = held_against_photos(walls(), PLACES, NEAR, transfer)
    assert not verdict.words
    assert np.nanmin(verdict.likeness) > 0.95


@pytest.mark.parametrize(
    ("picks", "said"),
    [
        ((NEAR, PLACES), "photo 1 and photo 2 exchanged"),
        ((turned(PLACES), turned(NEAR)), "count from the bottom"),
        (((PLACES + 0.5) / 2 - 0.5, (NEAR + 0.5) / 2 - 0.5), "pixels twice as large"),
        (((PLACES + 0.5) / 4 - 0.5, (NEAR + 0.5) / 4 - 0.5), "pixels four times as large"),
        ((PLACES, NEAR - [20, 12]), "with +20, +12 px added to col2, row2"),
    ],
)
def test_what_the_picks_were_meant_as_is_named(picks, said) -> None:
    assert said in held_against_photos(walls(), *picks).words


def test_photos_exchanged_are_as_picks_exchanged() -> None:
    first, second = walls()
    verdict = held_against_photos((second, first), PLACES, NEAR)
    assert verdict.slip is not None
    assert verdict.slip.key == "picks"


def test_points_of_the_wall_tell_no_order() -> None:
    """Nothing stands off it: exchanged or not, both photos show the same there."""
    first, _ = walls()
    assert held_against_photos((first, first), PLACES, PLACES).slip is None
    on = AWAY.any(axis=1) == 0
    assert held_against_photos(walls(), NEAR[on], PLACES[on], np.eye(3)).slip is None


def test_one_point_alone_overrules_nobody() -> None:
    one = np.where(np.arange(6)[:, None] == 3, NEAR, np.nan)
    assert held_against_photos(walls(), one, PLACES, np.eye(3)).slip is None


def test_photos_of_something_else_are_said() -> None:
    first, _ = walls()
    other = np.random.default_rng(8).integers(0, 255, SIZE[::-1]).astype(np.uint8)
    assert "show different things" in held_against_photos((first, other), PLACES, NEAR).words
