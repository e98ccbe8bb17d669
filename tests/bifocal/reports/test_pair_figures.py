"""Figures of the report of a pair: what is drawn lies where it was measured."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from bifocal.reports.figures import draw_errors, draw_ties


@pytest.mark.parametrize("on_picture", [True, False], ids=["orthophoto", "white"])
def test_errors_are_drawn_over_the_part_of_the_wall_that_was_compared(on_picture) -> None:
    solved = np.array([[1.0, 10.0, 0.1], [3.0, 15.0, 0.2], [2.0, 12.0, 0.0]])
    check = SimpleNamespace(solved=solved, errors=np.full((3, 3), 0.01))
    bounds = (0.5, 9.0, 4.0, 16.0)
    picture = np.zeros((14, 7, 3), np.uint8)
    content = SimpleNamespace(
        solution=SimpleNamespace(check=check), ortho=(picture, bounds) if on_picture else None
    )
    figure = Figure(figsize=(4, 4))
    draw_errors(figure, content, lambda key, **_: key)
    axes = figure.axes[0]
    # Without a picture: 12 % of 5 m, the longer side of what the points cover, as margin.
    left, bottom, right, top = bounds if on_picture else (0.4, 9.4, 3.6, 15.6)
    assert axes.get_xlim() == pytest.approx((left, right))
    assert axes.get_ylim() == pytest.approx((bottom, top))


def test_ties_of_both_photos_are_drawn_side_by_side_in_one_scale_of_colours() -> None:
    rows = [[2, 1, 20, 0.2, 0.4], [0, 0, 5, 0.1, 0.7]]  # column, row, count, median, RMS [px]
    cells = [{"side": 64, "rows": rows}, {"side": 64, "rows": [[1, 1, 9, 0.5, 0.9]]}]
    photo = SimpleNamespace(picture=np.zeros((40, 60), np.uint8), reduction=4.0)
    content = SimpleNamespace(setup={"common_points": {"cells": cells}}, photos=(photo, photo))
    figure = Figure(figsize=(6, 3))
    draw_ties(figure, content, lambda key, **_: key)
    far, near, bar = (axes.get_position() for axes in figure.axes)
    assert 0 <= far.x0 < far.x1 <= near.x0 < bar.x0 < 1
    assert [axes.get_title() for axes in figure.axes[:2]] == ["far", "near"]
    for axes, places in zip(figure.axes, ([[40, 24], [8, 8]], [[24, 24]]), strict=False):
        (dots,) = axes.collections
        np.testing.assert_allclose(dots.get_offsets(), places)
        assert dots.get_clim() == (0, 0.9)
        assert (axes.get_xlim(), axes.get_ylim()) == ((0, 60), (40, 0))
