"""Corners: edges are read at the same place however strong they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import spline_filter

from bifocal.matching.corners import _line
from bifocal.matching.tuning import CORNERS


def test_an_edge_lies_in_the_middle_of_its_weak_and_its_strong_parts() -> None:
    """Blocks of four rows, in turn 0.2 px to the right and half as strong, 0.2 px to the left."""
    rows, columns = np.mgrid[0:81, 0:81]
    weak = rows // 4 % 2 == 0
    edge = 40.3 + np.where(weak, 0.2, -0.2)
    blurred = 0.5 + np.arctan((columns - edge) / 1.5) / np.pi
    grey = 100 + np.where(weak, 50, 100) * blurred
    found = _line(spline_filter(grey), np.array([40.0, 30.0]), np.pi / 2, 2.0)
    assert found is not None
    read = slice(32, 30 + int(CORNERS.farthest) + 1)
    # Profiles are compared to first order: 0.04 px here; by strength times place it were 0.2 px.
    assert found.centre[0] == pytest.approx(edge[read, 0].mean(), abs=0.06)
