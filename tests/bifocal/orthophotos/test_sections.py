"""Sections: where they begin and end, and the relief along them; contour lines."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import Grid, MapSurface
from bifocal.orthophotos.contour_lines import contour_labels, contours
from bifocal.orthophotos.sections import section, section_letter

GRID = Grid.from_bounds((0.0, 0.0, 3.0, 2.0), gsd=0.01)
SLOPE = MapSurface.of_array(
    (0.1 * GRID.columns_x[None, :] - 0.05 * GRID.rows_y[:, None]).astype(np.float32), GRID
)


@pytest.mark.parametrize(
    ("name", "ends"),
    [
        ("x=1.5", (0.0, 2.0)),
        ("y=0.5", (0.0, 3.0)),
        ("0.5,0.5 2.5,0.5 2.5,1.5", (0.0, 3.0)),
    ],
)
def test_a_section_runs_from_one_end_of_its_line_to_the_other(
    name: str, ends: tuple[float, float]
) -> None:
    found = section(SLOPE, GRID, name, step=0.07)
    assert (found.place[0], found.place[-1]) == pytest.approx(ends, abs=1e-12)
    assert np.diff(found.place).max() <= 0.07 + 1e-12
    assert len(found.place) == len(found.relief)


def test_a_broken_section_shows_the_relief_of_every_leg_to_its_corner() -> None:
    found = section(SLOPE, GRID, "0.5,0.5 2.5,0.5 2.5,1.5", step=0.07)
    first = found.place <= 2.0
    wanted = np.where(
        first, 0.1 * (0.5 + found.place) - 0.025, 0.25 - 0.05 * (0.5 + found.place - 2.0)
    )
    np.testing.assert_allclose(found.relief, wanted, atol=0.0011)
    assert (np.abs(found.place - 2.0) < 1e-12).sum() == 2


def test_a_corner_typed_twice_is_one_corner() -> None:
    once, twice = (section(SLOPE, GRID, line, step=0.01) for line in (
        "0.5,0.5 1,1.5", "0.5,0.5 0.5,0.5 1,1.5 1,1.5"))  # fmt: skip
    np.testing.assert_array_equal(twice.path, once.path)
    np.testing.assert_array_equal(twice.relief, once.relief)


def test_a_section_tells_what_was_measured_and_joins_what_was_not_to_it() -> None:
    relief = np.full(GRID.shape, 0.1, np.float32)
    partly = relief.copy()
    partly[:, 100:200] = np.nan
    found = section(
        MapSurface.of_array(relief, GRID), GRID, "y=1", step=0.01, letter="C",
        measured=MapSurface.of_array(partly, GRID),
    )  # fmt: skip
    assert found.title == "C-C  y=1"
    kinds = [measured for measured, _ in found.pieces()]
    assert kinds == [True, False, True]
    _, middle = found.pieces()[1]
    assert (middle[0, 0], middle[-1, 0]) == pytest.approx((0.995, 2.005), abs=0.0101)
    assert [section_letter(k) for k in (0, 25, 26)] == ["A", "Z", "A1"]


def noisy(relief: np.ndarray, sigma: float) -> MapSurface:
    """Return relief with noise that is alike over a few pixels, as matching leaves it."""
    import cv2

    noise = cv2.GaussianBlur(np.random.default_rng(8).normal(0, 1, relief.shape), (0, 0), 2.0)
    noise *= sigma / noise.std()
    return MapSurface.of_array((relief + noise).astype(np.float32), WALL)


WALL = Grid.from_bounds((0.0, 0.0, 6.0, 4.0), gsd=0.01)


def test_the_level_of_the_wall_itself_draws_no_noise() -> None:
    flat = noisy(np.zeros(WALL.shape), 0.003)
    precision = MapSurface.of_array(np.full(WALL.shape, 0.003, np.float32), WALL)
    assert contours(flat, WALL, interval=0.01, scale=50, sigma=precision) == ()
    # The step of a pilaster in the same noise is drawn, all along it.
    x = np.broadcast_to(WALL.columns_x, WALL.shape)
    step = noisy(np.where(x > 3, 0.055, 0.0), 0.003)
    lines = contours(step, WALL, interval=0.05, scale=50, sigma=precision)
    at = [line for line in lines if line.level == 0.05]
    assert sum(np.ptp(line.line[:, 1]) for line in at) > 3.8
    assert all(np.abs(line.line[:, 0] - 3).max() < 0.15 for line in lines)


def test_a_flat_strip_between_two_steps_bears_no_line_of_its_own_level() -> None:
    # 3 mm on paper: what lies 2 mm aside of a line is beyond the steps.
    x = np.broadcast_to(WALL.columns_x, WALL.shape)
    strip = noisy(np.select([x < 3, x > 3.15], [0.3, -0.3], 0.0), 0.003)
    precision = MapSurface.of_array(np.full(WALL.shape, 0.003, np.float32), WALL)
    lines = contours(strip, WALL, interval=0.1, scale=50, sigma=precision)
    amid = 0.0
    for line in lines:
        lengths = np.hypot(*np.diff(line.line, axis=0).T)
        amid += lengths[np.abs(line.line[1:, 0] - 3.075) < 0.03].sum()
    assert amid < 0.3  # 1.3 m of 4 if only what lies 2 mm aside is compared
    # The other levels are drawn at the steps, all along them.
    for level in (-0.2, -0.1, 0.1, 0.2):
        found = [line for line in lines if line.level == pytest.approx(level)]
        assert sum(np.ptp(line.line[:, 1]) for line in found) > 3.8


def test_a_label_says_its_level_to_the_last_decimal() -> None:
    slope = np.broadcast_to(0.02 * (WALL.columns_x - 3), WALL.shape).astype(np.float32)
    lines = contours(MapSurface.of_array(slope, WALL), WALL, interval=0.005, scale=50)
    words = {label.words for label in contour_labels(lines, 50)}
    assert words == {"-0.050", "-0.025", "0.000", "+0.025", "+0.050"}


def test_lines_on_a_slope_are_where_it_has_their_level_and_every_fifth_is_labelled() -> None:
    slope = MapSurface.of_array(
        np.broadcast_to(0.1 * WALL.columns_x, WALL.shape).astype(np.float32), WALL
    )
    lines = contours(slope, WALL, interval=0.05, scale=50)
    assert len(lines) == 11
    for line in lines:
        np.testing.assert_allclose(line.line[:, 0], line.level / 0.1, atol=1e-5)
    assert [line.level for line in lines if line.index] == [0.25, 0.5]
    labels = contour_labels(lines, 50)
    assert {label.words for label in labels} == {"+0.25", "+0.50"}
    # Along the line, readable from the right, centred on it.
    assert all(abs(label.angle) == pytest.approx(90) for label in labels)
    assert all(abs(label.place[0] - float(label.words) / 0.1) < 0.04 for label in labels)


def test_stones_of_one_level_near_each_other_share_a_label() -> None:
    x, y = np.meshgrid(WALL.columns_x, WALL.rows_y)
    # Two stones 30 mm apart on paper, one 160 mm away, of 0.25 m in lines of 0.05 m.
    stones = [np.hypot(x - at, y - 2) for at in (0.8, 2.3, 5.2)]
    relief = sum(np.clip(0.6 - distance, 0, 0.4) for distance in stones).astype(np.float32)
    lines = contours(MapSurface.of_array(relief, WALL), WALL, interval=0.05, scale=50)
    assert sum(line.level == 0.25 for line in lines) == 3
    places = [label.place[0] for label in contour_labels(lines, 50)]
    assert len(places) == 2
    assert sorted(place > 3.5 for place in places) == [False, True]


def test_a_line_shorter_than_eight_millimetres_on_paper_is_left_out() -> None:
    x, y = np.meshgrid(WALL.columns_x, WALL.rows_y)
    for radius, drawn in ((0.04, 0), (0.3, 1)):
        knob = np.where(np.hypot(x - 3, y - 2) < radius, 0.1, 0.01).astype(np.float32)
        found = contours(MapSurface.of_array(knob, WALL), WALL, interval=0.06, scale=50)
        assert len(found) == drawn
