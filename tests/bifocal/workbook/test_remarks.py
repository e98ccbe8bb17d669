"""What `bifocal solve` says about surveys that solve, but not as the surveyor meant."""

from __future__ import annotations

import numpy as np
import openpyxl
import pytest

from tests.bifocal.workbook.filled_forms import POINTS, fill, rows, run, solved, write_csv
from tests.bifocal.workbook.test_cli_solve import pixel_rows, write_pair

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


def as_csv(path, table):
    """Points with measured relief, without principal distances."""
    lines = ["id,x1,y1,x2,y2,r measured"]
    known = {name: r for name, _, _, r in POINTS}
    lines += [f"{row[0]},{','.join(map(str, row[1:]))},{known[row[0]]}" for row in table]
    return write_csv(path, "\n".join(lines))


def test_swapped_distances_alone_are_not_called_right(tmp_path):
    path = as_csv(tmp_path / "p.csv", rows(POINTS))
    _, said = solved(path, "--d1", 9.5, "--d2", 17.5)
    assert "photos 1 and 2 were exchanged together with their distances" in said
    assert "nothing else tells which photo is the far one" in said
    assert "exchange d_1 and d_2" in said
    assert "results are right" not in said


def test_exchanged_coordinates_are_told_by_the_signs_of_known_relief(tmp_path):
    table = [(name, x2, y2, x1, y1) for name, x1, y1, x2, y2 in rows(POINTS)]
    _, said = solved(as_csv(tmp_path / "p.csv", table), "--d1", 17.5, "--d2", 9.5)
    assert "relief has the wrong sign at 3 of 3 points" in said
    assert "(at P1 -1.194 m, measured +1.000 m): photos 1 and 2 look exchanged" in said
    right = solved(as_csv(tmp_path / "q.csv", rows(POINTS)), "--d1", 17.5, "--d2", 9.5)
    assert "wrong sign" not in right[1]


def test_one_wrong_sign_among_many_is_left_to_the_check(tmp_path):
    checks = [("P1", None, None, -1.0), ("P2", None, None, 0.5), ("P3", None, None, -0.4)]
    assert "wrong sign" not in solved(fill(tmp_path / "s.xlsx", Check=checks))[1]


@pytest.mark.parametrize(
    ("setup", "message"),
    [
        ({"c_1": 35, "c_2": 19, "d_2": 9500, "delta_d": 8000}, "d_1 = 17500 m"),
        ({"c_1": 35, "c_2": 19, "d_2": 950, "d_1": 17.5}, "d_2 = 950 m"),
        ({"c_1": 35, "c_2": 19, "d_2": 9.5, "delta_d": 8000}, "d_1 = 8009.5 m"),
    ],
)
def test_distances_in_millimetres_are_refused(tmp_path, setup, message):
    result = run("solve", fill(tmp_path / "s.xlsx", setup=setup))
    assert result.exit_code == 1
    assert f"Setup: {message}: distances to the wall are in metres" in result.stderr


def test_options_in_millimetres_are_refused_by_name(tmp_path):
    path = as_csv(tmp_path / "p.csv", rows(POINTS))
    result = run("solve", path, "--d1", 17500, "--d2", 9500)
    assert result.exit_code == 1
    assert "--d1 = 17500 m" in result.stderr
    assert "looks like millimetres. Type 17.5" in result.stderr


def test_a_name_that_is_an_uncalculated_formula_is_said_once(tmp_path):
    path = fill(tmp_path / "s.xlsx", Check=[("P1", None, None, 1.0)])
    book = openpyxl.load_workbook(path)
    book["Points"]["A6"], book["Check"]["A13"] = '="P"&2', '="P"&1'
    book.save(path)
    result = run("solve", path)
    assert result.exit_code == 1
    assert "Points!A6 (id): its formula has never been calculated" in result.stderr
    assert "no name" not in result.stderr
    assert "without the name" not in result.stderr


def test_export_of_an_unsolved_survey_is_one_line(tmp_path):
    result = run("export", fill(tmp_path / "en.xlsx"), "--out", tmp_path / "p.dxf")
    assert result.exit_code == 1
    assert "Solve it first: bifocal solve en.xlsx --out result.xlsx" in result.stderr
    assert result.stderr.strip().count("\n") == 0
    assert not (tmp_path / "p.dxf").exists()


def test_the_footer_has_room_below_the_printed_table(tmp_path):
    for sheet in openpyxl.load_workbook(fill(tmp_path / "s.xlsx")).worksheets:
        margins = sheet.page_margins
        assert margins.bottom - margins.footer >= 0.4


@pytest.mark.parametrize(
    ("language", "text"),
    [("en", "One pixel on the wall, typical"), ("de", "Ein Pixel auf der Wand, typisch")],
)
def test_setup_describes_the_pixel_in_one_language(tmp_path, language, text):
    pair = write_pair(tmp_path / "w.pair.json")
    points, out = write_csv(tmp_path / "p.csv", pixel_rows()), tmp_path / "r.xlsx"
    assert run("solve", points, "--pair", pair, "--out", out, "--lang", language).exit_code == 0
    sheet = openpyxl.load_workbook(out)["Setup"]
    words = {row[0].value: row[1].value for row in sheet.iter_rows(min_row=5, max_col=2)}
    assert words["pixel_wall"] == text
