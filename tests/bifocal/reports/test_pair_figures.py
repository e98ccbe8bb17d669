"""Figures of the report of a pair: what is drawn lies where it was measured."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from bifocal.reports.figures import draw_errors


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
