"""Lists beside a survey: points of the field into Georeference and Check, picks a row a photo."""

from __future__ import annotations

import csv

import numpy as np
import openpyxl
import pytest

import bifocal
from bifocal import Pair
from multimedia import InputError, WorkbookError
from tests.bifocal.workbook.filled_forms import POINTS, fill, rows, run
from tests.recalculate import rows_of

WALL = [*POINTS, ("P5", 3, 2.5, 0.2), ("P6", -2, -2.2, 0.6)]


def listed(path, heading, lines):
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([heading, *lines])
    return path


def station(path, *more):
    """A wall that faces south in a total station's list, with points that nobody picked."""
    lines = [(n, 1000 + x, 2000 - r, 50 + y) for n, x, y, r in WALL]
    return listed(path, ("Name", "E", "N", "H"), [*lines, *more])


def test_a_list_of_the_field_fills_georeference_in_place_and_leaves_strange_points_out(tmp_path):
    path = fill(tmp_path / "s.xlsx", rows(WALL), Georeference=[("P1", 5, 5, 5), ("P2", 1, 1, 1, 0)])
    field = station(tmp_path / "station.csv", ("T1", 990, 1980, 51))
    found = run("solve", path, "--control", field, "--out", path, "--overwrite")
    assert found.exit_code == 0, found.stderr
    assert "Georeference: 6 of 7 points of the list are measured here" in found.stderr
    book = openpyxl.load_workbook(path, data_only=True)
    control = {row["id"]: row for row in rows_of(book, "Georeference", 12) if row["id"]}
    assert [*control] == [name for name, *_ in WALL]
    # What stood there keeps its place and its mark, and takes the coordinates of the list.
    assert (control["P1"]["E"], control["P2"]["use"], control["P5"]["H"]) == (1002, 0, 52.5)
    shown = {row["id"]: row for row in rows_of(book, "Results", 4) if row["id"]}
    for name, x, y, r in WALL:
        near = [1000 + x, 2000 - r, 50 + y]
        assert [shown[name][axis] for axis in "ENH"] == pytest.approx(near, abs=1e-6)
    assert run("solve", path).stderr == ""


def test_x_y_and_relief_of_a_list_fill_check_below_the_prepared_rows_too(tmp_path):
    wall = [(f"Q{i}", x, y, 0.1) for i, (x, y) in enumerate(np.mgrid[1:6, 1:7].reshape(2, -1).T)]
    path = fill(tmp_path / "s.xlsx", rows(wall))
    field = listed(
        tmp_path / "wall.csv", ("id", "X", "Y", "r"), [(n, x, y, 0.11) for n, x, y, _ in wall]
    )
    out = tmp_path / "out.xlsx"
    assert run("solve", path, "--control", field, "--out", out).exit_code == 0
    check = [
        row
        for row in rows_of(openpyxl.load_workbook(out, data_only=True), "Check", 12)
        if row["id"]
    ]
    assert len(check) == 30
    assert [row["dZ"] for row in check] == pytest.approx([-0.01] * 30, abs=1e-9)
    book = openpyxl.load_workbook(out)
    assert book["Check"].tables["tblCheck"].ref.endswith("42")
    assert str(book["Check"]["I42"].value).startswith("=")


def gsi(name, *place):
    words = (f"8{i}..00+{round(1000 * v):08d} " for i, v in enumerate(place, start=1))
    return f"110001+{name:0>8} {''.join(words)}\n"


@pytest.mark.parametrize(
    ("form", "order"),
    [
        (lambda n, e, no, h: f"{n},{no},{e},{h},CORNER\n", "PNEZD"),
        (lambda n, e, no, h: f"{n},{e},{no},{h},CORNER\n", "PENZD"),
        (gsi, None),
        (
            lambda n, e, no, h: f"{e} {no} {h} 10 20 far.jpg {n}\n{e} {no} {h} 1 2 near.jpg {n}\n",
            None,
        ),
    ],
    ids=["PNEZD", "PENZD", "GSI", "gcp_list"],
)
def test_lists_of_instruments_and_programs_fill_georeference(form, order, tmp_path):
    lines = [form(n, 1000 + x, 2000 - r, 50 + y) for n, x, y, r in WALL]
    head = "EPSG:25832\n" if "far.jpg" in lines[0] else ""
    (tmp_path / "field.txt").write_text(head + "".join(lines), encoding="utf-8")
    path = fill(tmp_path / "s.xlsx", rows(WALL))
    solved = bifocal.solve(path, control=tmp_path / "field.txt", control_order=order)
    near = [[1000 + x, 2000 - r, 50 + y] for _, x, y, r in WALL]
    np.testing.assert_allclose(solved.world, near, atol=1e-6)
    assert solved.georeference.used.sum() == len(WALL)


def test_x_y_z_that_no_wall_reaches_are_taken_for_the_world(tmp_path):
    path = fill(tmp_path / "s.xlsx", rows(WALL))
    lines = [(n, 1000 + x, 2000 - r, 50 + y) for n, x, y, r in WALL]
    field = listed(tmp_path / "world.csv", ("Name", "X", "Y", "Z"), lines)
    solved = bifocal.solve(path, control=field)
    assert solved.georeference.used.sum() == len(WALL)
    assert not len(solved.check.ids)


def test_a_point_of_two_coordinates_is_named(tmp_path):
    lines = [("P1", 1, 2, 3), ("P1", 1, 2, 4)]
    field = listed(tmp_path / "two.csv", ("id", "E", "N", "H"), lines)
    with pytest.raises(WorkbookError, match=r'"P1" stands in .* already, with other'):
        bifocal.solve(fill(tmp_path / "s.xlsx"), control=field)


def test_a_list_of_other_points_is_refused(tmp_path):
    path = fill(tmp_path / "s.xlsx")
    field = listed(tmp_path / "far.csv", ("id", "E", "N", "H"), [("Z", 1, 2, 3)])
    with pytest.raises(InputError, match="no point of the list has coordinates and was measured"):
        bifocal.solve(path, control=field)


def picked(path, lines):
    return listed(path, ("id", "photo", "col", "row"), lines)


def a_pair():
    return Pair.ideal(d1=17.5, d2=9.5, c1=35, c2=19)


PICKS = [
    ("A", "far.JPG", 100.0, 80.0), ("A", "near", 120.0, 96.0),
    ("B", "2", 30.0, 40.0), ("B", "1", 25.0, 33.0),
]  # fmt: skip


def test_picks_in_a_row_a_photo_are_those_of_a_row_a_point(tmp_path):
    pair = a_pair()
    long = picked(tmp_path / "long.csv", PICKS)
    found = bifocal.solve(long, pair=pair).table
    wide = {
        "id": ["A", "B"],
        "col1": [100, 25],
        "row1": [80, 33],
        "col2": [120, 30],
        "row2": [96, 40],
    }
    np.testing.assert_array_equal(found["r"], bifocal.solve(wide, pair=pair).table["r"])
    assert found.ids == ("A", "B")


def test_control_points_of_realitycapture_are_pixels_and_millimetres_are_refused(tmp_path):
    lines = [(photo, name, *pixel) for name, photo, *pixel in PICKS]
    rows = listed(tmp_path / "rc.csv", ("#image", "name", "x", "y"), lines)
    long = picked(tmp_path / "long.csv", PICKS)
    found = [bifocal.solve(path, pair=a_pair()).table["r"] for path in (rows, long)]
    np.testing.assert_array_equal(*found)
    rows = listed(tmp_path / "mm.csv", ("image", "name", "x [mm]", "y [mm]"), lines)
    with pytest.raises(WorkbookError, match=r"x \[mm\]. says \[mm\], expected \[px\]"):
        bifocal.solve(rows, pair=a_pair())


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (("C", "DSC_1", 1, 2), "expected one of far, near"),
        (("A", "far", 1, 2), 'A" is picked in this photo'),
    ],
)
def test_a_row_of_a_strange_photo_or_a_second_pick_is_named(line, said, tmp_path):
    long = picked(tmp_path / "long.csv", [*PICKS, line])
    with pytest.raises(WorkbookError, match=said) as caught:
        bifocal.solve(long, pair=a_pair())
    assert "long.csv" in str(caught.value)


def test_pixels_that_programs_write_for_not_seen_are_no_picks_in_a_row_a_photo(tmp_path):
    unseen = [(name, "near", -1, -1) for name in ("C", "D")]
    picks = [*PICKS, ("C", "far", 50, 60), ("D", "far", 60, 70), *unseen]
    found = bifocal.solve(picked(tmp_path / "long.csv", picks), pair=a_pair())
    assert np.isnan(found.table["r"][2:]).all()
    assert any("C, D" in text for text in found.remarks)


def test_heights_of_a_list_that_are_not_understood_are_asked_about(tmp_path):
    path = fill(tmp_path / "s.xlsx", rows(WALL))
    lines = [(n, 1000 + x, 2000 - r, 50 + y) for n, x, y, r in WALL]
    field = listed(tmp_path / "field.csv", ("Name", "E", "N", "Quota punto"), lines)
    refused = run("solve", path, "--control", field)
    assert refused.exit_code == 1
    assert '"Quota punto" is not understood' in refused.stderr
    assert '--control-order "H=HEADING"' in refused.stderr


@pytest.mark.parametrize(
    "headings",
    [("Name", "E", "N", "Z"), ("Name", "X", "Y", "elevation"), ("#name", "x", "y", "alt")],
)
def test_heights_stay_beside_their_plan_whatever_both_are_called(tmp_path, headings):
    lines = [(n, 1000 + x, 2000 - r, 50 + y) for n, x, y, r in WALL]
    path = fill(tmp_path / "s.xlsx", rows(WALL))
    solved = bifocal.solve(path, control=listed(tmp_path / "mixed.csv", headings, lines))
    np.testing.assert_allclose(solved.world, [line[1:] for line in lines], atol=1e-6)
    assert not len(solved.check.ids)


def test_y_before_x_beside_a_height_is_geodetic_and_a_height_alone_no_place(tmp_path):
    lines = [(n, 1000 + x, 2000 - r, 50 + y) for n, x, y, r in WALL]
    path = fill(tmp_path / "s.xlsx", rows(WALL))
    for third in "HZ":
        control = listed(tmp_path / "g.csv", ("id", "Y", "X", third), lines)
        solved = bifocal.solve(path, control=control)
        np.testing.assert_allclose(solved.world, [line[1:] for line in lines], atol=1e-6)
        assert any("Y is taken as east" in text for text in solved.remarks)
    field = listed(tmp_path / "d.csv", ("Name", "Longitude", "Latitude", "Height"), lines)
    with pytest.raises(InputError, match=r'E, N is missing.*understood: "Longitude", "Latitude"'):
        bifocal.solve(path, control=field)
