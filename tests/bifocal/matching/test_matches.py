"""Homologous points as a text table."""

from __future__ import annotations

import numpy as np

from bifocal import Matches
from bifocal.matching.matching import normals_of


def test_points_come_back_from_their_table(tmp_path) -> None:
    points = Matches(
        pixels1=np.array([[10.25, 20.5], [30.0, 40.125]]),
        pixels2=np.array([[11.5, 21.0], [29.75, 41.0]]),
        sigma=np.array([0.05, 0.25]),
        misfit=np.array([-0.125, 0.5]),
        agreement=np.array([0.875, 0.999]),
        ids=("M0001", "T007"),
        kinds=("feature", "disc"),
    )
    points.write(tmp_path / "points.csv")
    again = Matches.read(tmp_path / "points.csv")
    assert (again.ids, again.kinds) == (points.ids, points.kinds)
    for name in ("pixels1", "pixels2", "sigma", "misfit", "agreement"):
        np.testing.assert_array_equal(getattr(again, name), getattr(points, name))


def test_what_lies_square_to_lines_is_a_quarter_turn_from_them() -> None:
    along = np.array([[1.0, 0.0], [0.0, 1.0], [-0.6, 0.8]])
    np.testing.assert_array_equal(normals_of(along), [[0.0, 1.0], [-1.0, 0.0], [-0.8, -0.6]])
