"""What `bifocal solve` says about surveys that solve, but not as the surveyor meant."""

from __future__ import annotations

import numpy as np

from tests.bifocal.test_cli_solve import POINTS, fill, rows, run, solved

WORLD = [(name, 1000 + x, 2000 - r, 50 + y) for name, x, y, r in POINTS]


def test_a_control_point_of_unknown_name_is_said(tmp_path):
    _, said = solved(fill(tmp_path / "s.xlsx", Georeference=[*WORLD, ("P99", 1, 2, 3)]))
    assert "Georeference: no measured point is called P99" in said


def test_control_points_that_fit_need_no_remark(tmp_path):
    _, said = solved(fill(tmp_path / "s.xlsx", Georeference=WORLD))
    assert "Georeference" not in said


def test_a_scale_far_from_one_and_large_residuals_are_warned_of(tmp_path):
    shift = {"P1": 0.3, "P2": -0.2, "P3": -0.5, "P4": 0.4}
    world = [(name, 3.5 * e + shift[name], 3.5 * n, 3.5 * h) for name, e, n, h in WORLD]
    _, said = solved(fill(tmp_path / "s.xlsx", Georeference=world))
    assert "WARNING: scale 3.4" in said or "WARNING: scale 3.5" in said
    assert "WARNING: residuals of up to 0." in said


def test_the_worst_control_point_is_named(tmp_path):
    # With noise on all of them the F test cannot tell which one is wrong.
    table = [("A", -4, -3, 0.0), ("B", 4, -3, 0.2), ("C", 0.5, 3, 0.1)]
    world = [("A", 996.2, 2000, 47.1), ("B", 1004, 1999.9, 46.8), ("C", 1000.5, 1998.9, 53)]
    path = fill(tmp_path / "s.xlsx", rows(table), Georeference=world)
    _, said = solved(path, "--georeference", "levelled")
    assert "m, the largest at C" in said


def test_auto_says_when_it_leaves_the_levelled_model(tmp_path):
    lean = np.radians(5.0)
    world = [
        (n, 1000 + x, 2000 - r * np.cos(lean) - y * np.sin(lean),
         50 + y * np.cos(lean) - r * np.sin(lean))
        for n, x, y, r in POINTS
    ]  # fmt: skip
    answer, said = solved(fill(tmp_path / "s.xlsx", Georeference=world))
    assert answer["georeference"]["model"] == "3D"
    assert "auto took the model 3D" in said
    assert "leans 5.00 deg" in said
    flat = [(name, e, n) for name, e, n, _ in WORLD]
    assert "model 2D was taken" in solved(fill(tmp_path / "f.xlsx", Georeference=flat))[1]


def test_one_point_is_called_a_point(tmp_path):
    path = fill(tmp_path / "s.xlsx", Check=[("P1", None, None, 1.005)])
    assert "Check Z: 1 point, RMSE" in run("solve", path).stdout
