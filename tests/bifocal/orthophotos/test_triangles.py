"""Relief between points."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import Grid, InputError
from bifocal.orthophotos.triangles import TriangleSurface

CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], dtype=float)


def test_a_plane_through_points_is_kept_inside_and_unknown_outside() -> None:
    rng = np.random.default_rng(2)
    xy = rng.uniform(0, 2, (50, 2))
    xyz = np.column_stack([xy, 0.2 * xy[:, 0] - 0.1 * xy[:, 1] + 0.3])
    surface = TriangleSurface(xyz)
    grid = Grid.from_bounds((-0.5, -0.5, 2.5, 2.5), gsd=0.01)
    found = surface.window(grid)
    expected = 0.2 * grid.columns_x[None, :] - 0.1 * grid.rows_y[:, None] + 0.3
    known = np.isfinite(found)
    np.testing.assert_allclose(found[known], expected[known], atol=1e-3)
    assert not known[:40].any()
    assert known[150, 150]


def test_a_breakline_keeps_triangles_from_crossing_a_ridge() -> None:
    # A ridge at x = 1, r = 1; Delaunay alone would join the flanks' points (0.9 and 1.1 | r = 0)
    # right across it where the ridge has points only at its ends.
    flank = np.linspace(0.1, 1.9, 9)
    left = np.column_stack([np.full(9, 0.9), flank, np.zeros(9)])
    right = np.column_stack([np.full(9, 1.1), flank, np.zeros(9)])
    ridge = np.array([[1.0, 0.0, 1.0], [1.0, 2.0, 1.0]])
    points = np.concatenate([CORNERS, left, right, ridge])
    line = [len(points) - 2, len(points) - 1]
    grid = Grid.from_bounds((0.995, 0.5, 1.005, 1.5), gsd=0.01)
    without = TriangleSurface(points).window(grid)
    with_line = TriangleSurface(points, [line]).window(grid)
    assert without.min() < 0.1
    np.testing.assert_allclose(with_line, 1.0, atol=1e-5)


def test_windows_agree_with_the_whole() -> None:
    rng = np.random.default_rng(8)
    surface = TriangleSurface(rng.uniform(0, 2, (40, 3)))
    grid = Grid.from_bounds((0.0, 0.0, 2.0, 2.0), gsd=0.005)
    whole = surface.window(grid)
    part = surface.window(grid.window(100, 150, 64, 80))
    # On an edge either triangle may own a pixel: it lies in the plane of both to half a pixel.
    np.testing.assert_allclose(part, whole[150:230, 100:164], atol=0.05)
    low, high = surface.extremes(grid.window(100, 150, 64, 80).bounds)
    assert low - 0.05 <= np.nanmin(part)
    assert high + 0.05 >= np.nanmax(part)


def test_too_few_or_aligned_points_are_refused() -> None:
    with pytest.raises(InputError, match="too few"):
        TriangleSurface(CORNERS[:2])
    with pytest.raises(InputError, match="too few"):
        TriangleSurface(np.repeat(CORNERS[:1], 5, axis=0))
    with pytest.raises(InputError, match="straight line"):
        TriangleSurface(np.array([[0, 0, 0], [1, 1, 0], [2, 2, 1.0]]))
    with pytest.raises(InputError, match="must be a number"):
        TriangleSurface(np.array([[0, 0, 0], [1, 0, np.nan], [2, 2, 1.0]]))
