"""Tables of people's own: what is their set-up, their names and their angles, and what is not."""

import numpy as np
import openpyxl
import pytest

import bifocal
from bifocal.workbook.output import write_result
from bifocal.workbook.reading.reader import read_survey
from multimedia import InputError, WorkbookError

#: Name, X, Y and r [m] of points seen by 35 mm at 17.5 m and 19 mm at 9.5 m.
WALL = {"A": (2.0, 1.0, 0.5), "B": (-1.5, 2.0, -0.1), "C": (1.0, -2.0, 0.3), "D": (3.0, 2.5, 0.2)}
OPTIONS = {"taking": bifocal.Taking(d1=17.5, d2=9.5, c1=35.0, c2=19.0)}
LABELS = [("c_1", 35), ("c_2", 19), ("d_1", 17.5), ("d_2", 9.5)]
DOORS = [("D1", 2.10), ("D2", 0.90)]
XY = ("x1", "y1", "x2", "y2")
PICKS = [
    tuple(c * value / (d - r) for c, d in ((35, 17.5), (19, 9.5)) for value in (x, y))
    for x, y, r in WALL.values()
]
TABLE = [("id", *XY), *((name, *pick) for name, pick in zip(WALL, PICKS, strict=True))]
RELIEF = [r for _, _, r in WALL.values()]


@pytest.fixture
def book(tmp_path):
    """Return a function that writes a workbook of sheets, formats by column A, and names it."""

    def write(form="General", **sheets):
        workbook = openpyxl.Workbook()
        workbook.remove(workbook.active)
        for title, rows in sheets.items():
            sheet = workbook.create_sheet(title)
            for row in rows:
                sheet.append(row)
                sheet.cell(sheet.max_row, 1).number_format = form
        workbook.save(tmp_path / "own.xlsx")
        return tmp_path / "own.xlsx"

    return write


def named(names, heading="Punto", tail=()):
    """Return a table of picks with these names, in a column left of them."""
    rows = [(name, *pick) for name, pick in zip(names, PICKS, strict=True)]
    return [(heading, *XY), *rows, *tail]


def known(names, heading="Punto"):
    """Return a sheet of check points with these names."""
    rows = [(name, *place) for name, place in zip(names, WALL.values(), strict=True)]
    return [(heading, "X_ref", "Y_ref", "Z_ref"), *rows]


def test_doors_are_no_distances_where_the_set_up_stands_on_another_sheet(book):
    solved = bifocal.solve(book(Doors=DOORS, Picks=TABLE, Camera=LABELS))
    assert solved.table["r"] == pytest.approx(RELIEF)
    said = "Read beside labels: c_1 = 35 (Camera!B1), c_2 = 19 (Camera!B2), d_1 = 17.5 (Camera!B3)"
    assert any(remark.startswith(said) for remark in solved.remarks)


def test_doors_alone_are_refused_with_what_was_not_read(book):
    with pytest.raises(InputError, match='Not read: "D1", "D2" on the sheet "Doors"'):
        bifocal.solve(book(Doors=DOORS, Picks=TABLE))


def test_a_series_that_goes_on_with_a_third_is_no_set_up(book):
    rows = [("Abstand 1", 17.5), ("Abstand 2", 9.5), ("Abstand 3", 4.0)]
    with pytest.raises(InputError, match="no value for d_1, d_2"):
        bifocal.solve(book(Bolzen=rows, Picks=TABLE))


@pytest.mark.parametrize(
    "rows",
    [
        [("d1", 17.5), ("d2", 9.5)],
        [("Distanza 1 [m]", 17.5), ("Distanza 2 [m]", "9,5")],
        [("C1", 35), ("C2", 19), ("D1", 17.5), ("D2", 9.5)],
        [("Abstand der Kamera 2 von der Bezugsebene", 9.5), ("delta_d", 8)],
    ],
)
def test_several_labels_of_a_set_up_are_read_from_any_sheet(book, rows):
    assert bifocal.solve(book(Note=rows, Picks=TABLE)).table["r"] == pytest.approx(RELIEF)


def test_labels_above_the_only_table_are_read(book):
    path = book(Picks=[("D1", 17.5), ("D2", 9.5), (), *TABLE])
    assert bifocal.solve(path).table["r"] == pytest.approx(RELIEF)


def test_points_called_like_distances_are_no_set_up(book):
    path = book(Picks=named(("C1", "C2", "D1", "D2")))
    with pytest.raises(InputError, match="no value for d_1, d_2"):
        bifocal.solve(path)


@pytest.mark.parametrize("title", ["Posti", "Setup"])
def test_options_win_over_cells_that_hold_texts(book, title):
    path = book(**{title: [("C1", "Rossi"), ("D1", "Bianchi")], "Picks": TABLE})
    solved = bifocal.solve(path, **OPTIONS)
    assert solved.table["r"] == pytest.approx(RELIEF)
    assert not any("label" in remark for remark in solved.remarks)
    if title == "Setup":
        with pytest.raises(WorkbookError, match=r"Setup!B2 \(d_1\): found \"Bianchi\""):
            bifocal.solve(path, taking=bifocal.Taking(d2=9.5, c1=35, c2=19))


@pytest.mark.parametrize("heading", ["Winkel [gon]", "Angolo", "angle [deg]"])
def test_how_an_angle_is_read_is_said(book, heading):
    picks = np.array(PICKS)
    theta = np.degrees(np.arctan2(picks[:, 0], picks[:, 1])) / (0.9 if "gon" in heading else 1.0)
    s1, s2 = np.hypot(picks[:, 0], picks[:, 1]), np.hypot(picks[:, 2], picks[:, 3])
    rows = zip(WALL, s1.tolist(), s2.tolist(), theta.tolist(), strict=True)
    path = book(Picks=[("id", "s1", "s2", heading), *rows])
    solved = bifocal.solve(path, **OPTIONS)
    assert solved.table.xyz == pytest.approx(np.array([*WALL.values()]))
    said = [remark for remark in solved.remarks if "clockwise from up" in remark]
    assert len(said) == 1
    assert said[0].startswith(f'D2: "{heading}"')


@pytest.mark.parametrize(
    "heading",
    [
        "N.",
        "PUNTO N.",
        "ID punto",
        "numero punto",
        "Bezeichnung",
        "Target",
        "Vertice",
        "Label",
        "#",
    ],
)
@pytest.mark.parametrize("names", [("V1", "V2", "V3", "V4"), (11, 12, 13, 14)])
def test_a_column_of_names_under_any_heading_names_the_points(book, heading, names):
    solved = bifocal.solve(book(Misure=named(names, heading), Check=known(names)), **OPTIONS)
    assert solved.table.ids == tuple(map(str, names))
    assert solved.check.axes["X"].n == 4
    assert solved.check.axes["X"].max_abs < 1e-9
    assert f'"{heading}" (column A) is taken for the point names.' in solved.remarks


def test_check_points_are_named_by_what_their_column_holds(book):
    path = book(Misure=TABLE, Check=known(WALL, "Target"))
    assert bifocal.solve(path, **OPTIONS).check.axes["X"].n == 4


def test_a_heading_that_speaks_of_points_wins_over_running_numbers(book):
    rows = [(i, name, *pick) for i, (name, pick) in enumerate(zip(WALL, PICKS, strict=True))]
    assert read_survey(book(Misure=[("N.", "Target", *XY), *rows])).points.ids == tuple(WALL)
    rows = [(*pick, name) for name, pick in zip(WALL, PICKS, strict=True)]
    assert read_survey(book(Misure=[(*XY, "Target"), *rows])).points.ids == tuple(WALL)


@pytest.mark.parametrize(
    ("heading", "values"),
    [
        ("Typ", ("a", "a", "b", "c")),
        ("Abstand [m]", (1, 2, 3, 4)),
        ("X", (100, 200, 300, 400)),
        ("Tiefe", (1.5, 2.5, 3.5, 4.5)),
        ("Ora", ("10:00", "10:05", "10:10", "10:15")),
        ("Datum", ("1.5.2026", "2.5.2026", "3.5.2026", "4.5.2026")),
        ("Tiefe", ("1 mm", "2 mm", "3 mm", "4 mm")),
    ],
)
def test_what_is_no_name_names_no_point(book, heading, values):
    points = read_survey(book(Misure=named(values, heading))).points
    assert points.ids == ("1", "2", "3", "4")


def test_names_that_stand_twice_far_below_are_no_names(tmp_path):
    names = [*range(300), *range(300)]
    lines = [f"{name};{';'.join(map(str, PICKS[0]))}" for name in names]
    (tmp_path / "long.csv").write_text("\n".join([";".join(("N.", *XY)), *lines]))
    survey = read_survey(tmp_path / "long.csv")
    assert survey.points.ids == tuple(map(str, range(1, 601)))
    assert survey.remarks == ()


def test_names_in_a_text_table_keep_their_zeros(tmp_path):
    lines = [f"00{i};{';'.join(map(str, pick))}" for i, pick in enumerate(PICKS, start=7)]
    lines += ["Mittel;1,5;2,5;3,5;4,5"]
    head = ";".join(("Bezeichnung", *XY))
    (tmp_path / "own.csv").write_text("\n".join([head, *lines]).replace(".", ","))
    assert read_survey(tmp_path / "own.csv").points.ids == ("007", "008", "009", "0010")


@pytest.mark.parametrize(("form", "first"), [("000", "007"), ('"P"000', "P007"), ("\\V0", "V7")])
def test_the_format_of_a_number_is_part_of_the_name(book, form, first):
    typed = (7, 8, 9, 10)
    path = book(form, Misure=named(typed), Check=known(typed))
    solved = bifocal.solve(path, **OPTIONS)
    assert (solved.table.ids[0], solved.check.axes["X"].n) == (first, 4)
    path = book(form, Misure=named(typed), Check=known(solved.table.ids))
    assert bifocal.solve(path, **OPTIONS).check.axes["X"].n == 4


def test_names_that_differ_in_leading_zeros_only_are_joined(book):
    for points, checks in (
        ((7, 8, 9, 10), ("007", "008", "009", "010")),
        (("01", 2, 3, 4), "1234"),
    ):
        path = book(Misure=named(points), Check=known(checks))
        assert bifocal.solve(path, **OPTIONS).check.axes["X"].n == 4
    path = book(Misure=named(("7", "07", "8", "9")), Check=known(("7", "007", "8", "9")))
    assert bifocal.solve(path, **OPTIONS).check.missing == ()


@pytest.mark.parametrize("word", ["Mean", "Summe", "Mittel:", "Media", "TOTAL"])
def test_a_mean_or_a_sum_is_no_point(book, word):
    tail = [(word, 1.0, 2.0, 3.0, 4.0)]
    survey = read_survey(book(Misure=named(WALL, tail=tail)))
    assert survey.points.ids == tuple(WALL)
    assert "Row 6 is left out: a mean, a sum or the like is no point." in survey.remarks


@pytest.mark.parametrize(
    ("tail", "said"),
    [
        ([("mean of x1", 2.1)], "lack numbers: row 7"),
        ([("media di x1", 1, 2, 3, 4), ("Totale punti", 3, 3, 3, 3)], "Row 8 is left out"),
        ([("Scarto quadratico medio", 0.1, 0.2, 0.3, 0.4)], "Row 7 is left out"),
        ([(), *(("d1", 17.5), ("d2", 9.5), ("c1", 35), ("c2", 19))], "lack numbers: row 8, 9, 10"),
    ],
)
def test_what_stands_apart_below_the_points_is_none_and_is_said(book, tail, said):
    path = book(Picks=named([*WALL], tail=[(), *tail]))
    solved = bifocal.solve(path, **({} if len(tail) > 2 else OPTIONS))
    assert solved.table.ids == tuple(WALL)
    assert solved.table["r"] == pytest.approx(RELIEF)
    assert any(said in remark for remark in solved.remarks)


def test_a_point_that_lacks_a_number_is_none_the_less_complained_of(book):
    for tail in ([(), ("E", 1.0, 2.0, None, 3.0)], [("E", 1.0)]):
        with pytest.raises(WorkbookError, match="point E lacks"):
            bifocal.solve(book(Picks=named([*WALL], tail=tail)), **OPTIONS)


def test_a_column_of_unlike_units_is_complained_of_once(book):
    cells = ["2.1 mm", "2.2 cm", "2.3 mm", "2.4 cm"]
    rows = [(f"P{i}", cell, 1.0, 2.4, 1.2) for i, cell in enumerate(cells)]
    with pytest.raises(WorkbookError) as caught:
        bifocal.solve(book(Picks=[("id", *XY), *rows]), **OPTIONS)
    assert str(caught.value).count("Picks!") == 1


def test_a_point_called_like_a_mean_among_others_stays(book):
    names = ("Media", "Total", "Max", "Z")
    assert read_survey(book(Misure=named(names))).points.ids == names


def test_the_mean_of_each_block_is_no_point(book):
    rows, mean = named(WALL), ("Mean", 1.0, 2.0, 3.0, 4.0)
    survey = read_survey(book(Misure=[*rows[:3], mean, ("Sum", 1, 2, 3, 4), (), *rows[3:], mean]))
    assert survey.points.ids == tuple(WALL)


def test_the_number_of_a_point_is_told_from_its_north(book):
    names = (11, 12, 13, 14)
    rows = [(i, 500 + x, 900 + y, r) for i, (x, y, r) in zip(names, WALL.values(), strict=True)]
    path = book(Misure=named(names, "N."), Georeference=[("N.", "E", "N", "H"), *rows])
    world = bifocal.solve(path, **OPTIONS).georeference
    assert world.ids == ("11", "12", "13", "14")
    assert np.nanmax(np.abs(world.residuals)) < 1e-6
    left = [(7 * i, 3 * i, i, *pick) for i, pick in enumerate(PICKS, start=1)]
    assert read_survey(book(Misure=[("E", "N", "H", *XY), *left])).points.ids == (
        "1",
        "2",
        "3",
        "4",
    )


def test_a_table_of_angles_without_points_says_what_is_missing(book):
    with pytest.raises(InputError, match="there is no point"):
        bifocal.solve(book(Picks=[("id", "s1", "s2", "Winkel")]), **OPTIONS)


def test_centimetres_typed_into_the_cells_become_the_millimetres_that_formulas_see(book):
    rows = [(name, *(f"{value / 10!r} cm" for value in pick)) for name, *pick in TABLE[1:]]
    path = book(Camera=LABELS, Picks=[TABLE[0], *rows])
    write_result(path, bifocal.solve(path), overwrite=True)
    sheet = openpyxl.load_workbook(path)["Picks"]
    cells = [[cell.value for cell in row] for row in sheet["B2:E5"]]
    np.testing.assert_allclose(cells, PICKS, rtol=1e-14)
