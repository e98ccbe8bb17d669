"""A person with the workbook alone: typed millimetres, recalculated by LibreOffice, no program."""

from __future__ import annotations

import sys
import zipfile

import numpy as np
import openpyxl
import pytest

from tests.bifocal.workbook.filled_forms import fill, named, rows, run
from tests.recalculate import recalculated, rows_of

pytestmark = [pytest.mark.office, pytest.mark.acceptance]
#: Prepared rows: few, since LibreOffice recalculates them all.
ROWS = 15
#: Name, X, Y, r of a wall; the last stands behind it.
WALL = [
    *(("A", -5, -3, 0.4), ("B", 5, -3, 0.0), ("C", 5, 3, 0.6), ("D", -5, 3, -0.3)),
    *(("E", 0.5, -3.2, 0.8), ("F", 4.6, 0.4, 0.2), ("G", -4.8, 0.3, 0.1), ("H", -0.6, 3.1, 0.9)),
    *(
        ("K1", 2.5, 1.5, 0.5),
        ("K2", -2.5, 1.2, 0.3),
        ("K3", 2.2, -1.9, -0.2),
        ("K4", -2.1, -2, 0.7),
    ),
]


def typed(path, *, points, control=(), known=(), language="en"):
    """Type into an empty template what is read off with a ruler: hundredths of a millimetre."""
    read = [(name, *(round(pick, 2) for pick in picks)) for name, *picks in points]
    form = ("--rows", ROWS, "--lang", language)
    return fill(path, read, template=form, Georeference=control, Check=known)


def world(points, *, off=()):
    """Return E, N, H of a wall that faces south, the points in ``off`` one metre too far east."""
    return [(n, 1000 + x + (n in off), 2000 - r, 50 + y) for n, x, y, r in points]


def test_from_the_template_to_coordinates_and_their_errors(tmp_path):
    known = [(name, x, y, r) for name, x, y, r in WALL[8:]]
    path = typed(tmp_path / "s.xlsx", points=rows(WALL), control=world(WALL[:8]), known=known)
    book = recalculated(path, tmp_path)
    found = {row["id"]: row for row in rows_of(book, "Results", 4) if row["id"]}
    for name, x, y, r in WALL:
        assert found[name]["X"] == pytest.approx(x, abs=0.02)
        assert found[name]["Z"] == pytest.approx(r, abs=0.15)
        assert found[name]["E"] == pytest.approx(1000 + x, abs=0.05)
        assert found[name]["H"] == pytest.approx(50 + y, abs=0.05)
    assert named(book, "world_state").value.startswith("World coordinates by 8 control points")
    assert named(book, "title_world").value == named(book, "world_state").value
    assert {row["fit"] for row in rows_of(book, "Georeference", 12)[:8]} == {"OK"}
    assert named(book, "check_n_Z").value == 4
    assert named(book, "check_rmse_Z").value < 0.05
    assert named(book, "check_flagged").value == 0
    assert sum(row["counted"] for row in charted(book, "tblBins")) == 12


@pytest.mark.parametrize(
    ("language", "said"),
    [
        ("en", "Control point F contradicts the others"),
        ("it", "Il punto d'appoggio F contraddice"),
        ("de", "Passpunkt F widerspricht"),
    ],
)
def test_one_of_eight_control_points_a_metre_off_turns_red_and_is_named(language, said, tmp_path):
    control = world(WALL[:8], off="F")
    path = typed(tmp_path / "s.xlsx", points=rows(WALL), control=control, language=language)
    book = recalculated(path, tmp_path)
    fits = {row["id"]: row for row in rows_of(book, "Georeference", 12)[:8]}
    assert [name for name, row in fits.items() if row["fit"] == "CHECK"] == ["F"]
    assert min(fits, key=lambda name: fits[name]["s0"]) == "F"
    assert said in named(book, "title_world").value
    assert named(book, "g_alarm").value == 1
    sheet = openpyxl.load_workbook(path)["Georeference"]
    rules = {str(area.sqref): area.rules[0] for area in sheet.conditional_formatting}
    (marked,) = (rule for area, rule in rules.items() if area.startswith("A13"))
    assert marked.formula[0].endswith('13="CHECK"')
    # Left out by hand, all is well again.
    control[5] = (*control[5], 0)
    path = typed(tmp_path / "t.xlsx", points=rows(WALL), control=control, language=language)
    assert named(recalculated(path, tmp_path), "g_alarm").value == 0


def test_a_wrong_distance_shows_in_the_scale(tmp_path):
    path = typed(tmp_path / "s.xlsx", points=rows(WALL), control=world(WALL[:8]))
    book = openpyxl.load_workbook(path)
    named(book, "c_1").value, named(book, "c_2").value = 38.5, 20.9
    book.save(path)
    book = recalculated(path, tmp_path)
    assert named(book, "g_k").value == pytest.approx(1.1, abs=0.01)
    assert named(book, "world_state").value.startswith("The scale is 1.09")
    assert named(book, "g_alarm").value == 1


def test_flagged_check_points_are_left_out_and_large_errors_are_told_in_sigmas(tmp_path):
    picks = rows(WALL)
    picks[8] = (*picks[8][:2], picks[8][2] + 3, *picks[8][3:])
    known = [(name, x, y, r) for name, x, y, r in WALL[8:]]
    known[1] = ("K2", WALL[9][1] + 0.2, None, None)
    book = recalculated(typed(tmp_path / "s.xlsx", points=picks, known=known), tmp_path)
    shown = {row["id"]: row for row in rows_of(book, "Check", 12)[:4]}
    assert shown["K1"]["flag"] == "OFF-RADIAL"
    assert shown["K1"]["dX"] in (None, "")
    assert named(book, "check_flagged").value == 1
    assert named(book, "check_n_X").value == 3
    assert shown["K2"]["sigmas"] > 3
    assert shown["K3"]["sigmas"] < 3
    assert charted(book, "tblBins")[0]["counted"] == 1
    ends = charted(book, "tblVectors")
    assert [row["X_from"] for row in ends[2:4]] == [WALL[10][1], WALL[11][1]]
    assert ends[0]["X_from"] == "#N/A"


def test_forty_check_points_have_an_arrow_each(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "ROWS", 45)
    places = np.random.default_rng(4).uniform((-5, -3, -0.3), (5, 3, 0.6), (40, 3)).round(3)
    wall = [(f"C{i}", *place) for i, place in enumerate(places.tolist())]
    known = [(name, x + 0.02, y - 0.01, r) for name, x, y, r in wall]
    path = typed(tmp_path / "s.xlsx", points=rows(wall), known=known)
    assert run("solve", path, "--out", tmp_path / "out.xlsx").exit_code == 0
    ends = charted(recalculated(tmp_path / "out.xlsx", tmp_path), "tblVectors")
    drawn = [row["X_from"] for row in ends if isinstance(row["X_to"], float)]
    shown = openpyxl.load_workbook(tmp_path / "out.xlsx", data_only=True)
    counted = named(shown, "check_n_X").value
    assert counted > 35
    assert len(drawn) == counted
    assert {round(x, 6) for x in drawn} <= {round(x, 6) for _, x, _, _ in known}
    with zipfile.ZipFile(tmp_path / "out.xlsx") as book:
        charts = [book.read(name) for name in book.namelist() if "charts/chart" in name]
    assert max(chart.count(b"<ser>") for chart in charts) > 40
    assert named(shown, "chart_vectors").value.encode() in b"".join(charts)
    assert named(shown, "vector_scale").value > 10


def test_one_book_worked_row_rows_below_the_table_and_a_point_at_the_nadir(tmp_path):
    """Three things of the sheets that touch each other nowhere, in one recalculation."""
    worked, nadir = ("TEST", 4.2424, 0, 4.4706, 0), ("N", 0, 0, 0, 0)
    path = typed(tmp_path / "s.xlsx", points=[])
    book = openpyxl.load_workbook(path)
    points = book["Points"]
    for row, (name, *picks) in enumerate([worked, *rows(WALL), nadir], start=5):
        for column, value in enumerate([name, *picks], start=1):
            points.cell(row, column).value = value
    for row, name in enumerate(("1-2", "007"), start=5 + ROWS):
        points.cell(row, 1).value = name
    book["Log"]["H5"] = "=SUM(tblPoints[r])+SUM(tblPoints[sigma_r])+SUM(tblResults[Z])"
    book.save(path)
    fresh = recalculated(path, tmp_path)
    assert named(fresh, "worked_row").value.startswith("OK")
    assert "2 rows below the table wait for formulas" in named(fresh, "unprinted_Points").value
    assert named(fresh, "title_world").value.startswith(
        named(fresh, "unprinted_Points").value.strip()
    )
    assert named(openpyxl.load_workbook(path), "unprinted_Points").font.b
    columns = openpyxl.load_workbook(path)["Points"].column_dimensions
    assert not columns["A"].protection.locked
    assert columns["L"].protection.locked
    shown = {row["id"]: row for row in rows_of(fresh, "Points", 4)}
    assert shown["N"]["flag"] == "NADIR"
    assert isinstance(fresh["Log"]["H5"].value, float)
    named(book, "d_2").value = 9.0
    book.save(path)
    assert named(recalculated(path, tmp_path), "worked_row").value.startswith("CHECK")


def charted(book, table):
    """Return the rows of a table of the sheet Charts, which stands below the other numbers."""
    sheet = book["Charts"]
    first = {"tblBins": "bin", "tblVectors": "check_row"}[table]
    head = next(cell for row in sheet.iter_rows() for cell in row if cell.value == first)
    found, keys = [], []
    for cells in sheet.iter_rows(min_row=head.row, min_col=head.column, max_col=head.column + 4):
        values = [cell.value for cell in cells]
        if not keys:
            keys = values
        elif values[0] is None:
            break
        else:
            found.append(dict(zip(keys, values, strict=True)))
    return found
