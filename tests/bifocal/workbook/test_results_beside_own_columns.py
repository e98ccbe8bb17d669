"""Results in the user's own table: live columns, values of the set-up, rows, macros."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import openpyxl
import pytest

from tests.bifocal.workbook.filled_forms import POINTS, fill, named, rows, run, write_csv
from tests.bifocal.workbook.kept_workbook import (
    DISTANCES,
    TABLE,
    own_table,
    slow,
    solved_in_place,
    with_own_chart,
)
from tests.bifocal.workbook.test_cli_solve import pixel_rows, write_pair
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached, parts
from tests.recalculate import recalculated

ALONE = {"d_1": 17.5, "d_2": 9.5, "c_1": 35, "c_2": 19}


def foreign(path, *, heads, table, head=1, title="Facciata", setup=()):
    """A workbook of the user's own, in any language, the table anywhere."""
    book = openpyxl.Workbook()
    book.active.title = "Note"
    for label, value in setup:
        book.active.append([label, value])
    sheet = book.create_sheet(title)
    sheet.cell(max(head - 2, 1), 1, "Rilievo 2026" if head > 2 else None)
    for row, values in enumerate([heads, *table], start=head):
        for column, value in enumerate(values, start=3):
            sheet.cell(row, column, value)
    book.save(path)
    return with_own_chart(path)


GON = [(n, *np.hypot([x1, x2], [y1, y2]), np.degrees(np.arctan2(x1, y1)) / 0.9)
       for n, x1, y1, x2, y2 in rows(POINTS)]  # fmt: skip
CM = [(name, *(value / 10 for value in values)) for name, *values in rows(POINTS)]
TEXT = [(name, *(f"{v:.12f}".replace(".", ",") for v in values)) for name, *values in rows(POINTS)]
FOREIGN = {
    "plain": (("id", "x1", "y1", "x2", "y2"), rows(POINTS), 1),
    "italian": (("Punto", "distanza radiale 1", "distanza radiale 2", "anomalia [gon]"), GON, 5),
    "german": (
        ("Punkt", "x Bild 1 [cm]", "y Bild 1 [cm]", "x Bild 2 [cm]", "y Bild 2 [cm]"),
        CM,
        9,
    ),
    "text": (("Punto", "x foto 1", "y foto 1", "x foto 2", "y foto 2"), TEXT, 3),
}


@pytest.mark.parametrize("name", [slow("plain"), "italian", slow("german"), slow("text")])
def test_results_are_new_live_columns_of_the_users_own_table(tmp_path, name):
    heads, table, head = FOREIGN[name]
    path = foreign(tmp_path / "own.xlsx", heads=heads, table=table, head=head)
    own = {name for name in parts(path) if "chart" in name or "drawing" in name or "sheet1" in name}
    stderr, changed = solved_in_place(path, *DISTANCES)
    assert "the results are new columns of your table" in stderr
    assert not own & changed
    book = openpyxl.load_workbook(path, data_only=True)
    assert book.sheetnames == ["Note", "Facciata", "My chart", "Setup"]
    found = {cell.value: cell.column for cell in book["Facciata"][head]}
    assert list(found)[: len(heads) + 2] == [None, *heads, "r [m]"][: len(heads) + 2]
    live = openpyxl.load_workbook(path)["Facciata"]
    for row, (_, x, y, r) in enumerate(POINTS, start=head + 1):
        values = [book["Facciata"].cell(row, found[f"{key} [m]"]).value for key in "XYrZ"]
        assert values == pytest.approx([x, y, r, r], abs=1e-9)
        assert live.cell(row, found["r [m]"]).value.startswith("=IF(")
    # Once more, with a point more: the same columns, no second Setup, options from its cells.
    book = openpyxl.load_workbook(path)
    row = head + 1 + len(table)
    for column, value in enumerate(("P9", *table[0][1:]), start=3):
        book["Facciata"].cell(row, column, value)
    book.save(path)
    solved_in_place(path, "--d1", 17.6)
    again = openpyxl.load_workbook(path, data_only=True)
    assert again.sheetnames == ["Note", "Facciata", "My chart", "Setup"]
    assert {cell.value: cell.column for cell in again["Facciata"][head]} == found
    values = [again["Facciata"].cell(i, found["r [m]"]).value for i in (head + 1, row)]
    assert values[0] == pytest.approx(values[1], rel=1e-12)


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize("name", FOREIGN)
def test_columns_in_the_users_own_table_recalculate_to_the_same(tmp_path, name):
    heads, table, head = FOREIGN[name]
    path = foreign(tmp_path / "own.xlsx", heads=heads, table=table, head=head)
    solved_in_place(path, *DISTANCES)
    assert_recalculated_equals_cached(path, tmp_path)


@pytest.mark.acceptance
@pytest.mark.office
def test_sigmas_in_the_world_are_live_in_the_users_own_table(tmp_path):
    heads, table, head = FOREIGN["plain"]
    path = foreign(tmp_path / "own.xlsx", heads=heads, table=table, head=head)
    book = openpyxl.load_workbook(path)
    sheet = book.create_sheet("Georeference")
    sheet.append(("id", "E", "N", "H"))
    for name, x, y, r in POINTS[:5]:
        sheet.append((name, 100 + x, 200 - r, 5 + y))
    book.save(path)
    answer = json.loads(run("solve", path, *DISTANCES, "--json").stdout)
    solved_in_place(path, *DISTANCES)
    assert_recalculated_equals_cached(path, tmp_path)
    shown = recalculated(path, tmp_path)["Facciata"]
    place = {cell.value: cell.column for cell in shown[head]}
    for row, point in enumerate(answer["points"], start=head + 1):
        for key in ("sigma_E", "sigma_N", "sigma_H"):
            cell = shown.cell(row, place[f"{key} [m]"])
            assert cell.value == pytest.approx(point[key], rel=1e-9, abs=1e-9)
    used = [
        row for row in range(head + 1, head + 6) if shown.cell(row, place["shared"]).value == -1
    ]
    assert len(used) >= 4


@pytest.mark.acceptance
@pytest.mark.office
def test_values_of_the_users_own_setup_stay_where_they_are_and_live(tmp_path):
    heads, table, head = FOREIGN["plain"]
    path = foreign(
        tmp_path / "own.xlsx", heads=heads, table=table, head=head, title="S", setup=ALONE.items()
    )
    solved_in_place(path)
    book = openpyxl.load_workbook(path)
    assert named(book, "d_1").value == "='Note'!$B$1"
    book["Note"]["B1"] = 17.6
    book.save(path)
    place = {cell.value: cell.column for cell in book["S"][1]}["r [m]"]
    fresh = recalculated(path, tmp_path)["S"].cell(2, place).value
    _, x1, y1, x2, y2 = table[0]
    s1, s2 = np.hypot(x1, y1), np.hypot(x2, y2) * (9.5 / 19) / (17.6 / 35)
    assert fresh == pytest.approx((s2 - s1) / (s2 / 9.5 - s1 / 17.6), rel=1e-12)


@pytest.mark.acceptance
@pytest.mark.office
def test_pixels_of_a_pair_in_the_users_own_table(tmp_path):
    pair = write_pair(tmp_path / "w.pair.json")
    lines = [line.split(",") for line in pixel_rows().splitlines()]
    table = [(name, *map(float, values)) for name, *values in lines[1:]]
    path = foreign(tmp_path / "own.xlsx", heads=lines[0], table=table)
    answer = json.loads(run("solve", path, "--pair", pair, "--json").stdout)
    solved_in_place(path, "--pair", pair)
    assert_recalculated_equals_cached(path, tmp_path)
    again = json.loads(run("solve", path, "--json").stdout)
    for one, other in zip(answer["points"], again["points"], strict=True):
        assert other["r"] == pytest.approx(one["r"], rel=1e-9)


def test_a_macro_workbook_of_the_users_own_keeps_its_macros(tmp_path):
    path, out = own_table(tmp_path / "own.xlsx"), tmp_path / "out.xlsm"
    macro = path.rename(tmp_path / "own.xlsm")
    with zipfile.ZipFile(macro, "a") as package:
        package.writestr("xl/vbaProject.bin", b"MACROS")
    result = run("solve", macro, "--out", out, *DISTANCES)
    assert result.exit_code == 0, result.stderr
    assert parts(out)["xl/vbaProject.bin"] == b"MACROS"


@pytest.mark.acceptance
@pytest.mark.office
def test_sheets_of_an_ods_are_not_dropped_without_a_word(tmp_path):
    path = foreign(tmp_path / "own.xlsx", heads=FOREIGN["plain"][0], table=rows(POINTS))
    from tests.office import convert

    ods = convert(path, tmp_path, "ods")
    kept = ods.read_bytes()
    result = run("solve", ods, "--out", tmp_path / "r.xlsx", *DISTANCES)
    assert result.exit_code == 0, result.stderr
    assert "what else it holds is not in the new one: Note, Facciata, My chart" in result.stderr
    assert ods.read_bytes() == kept


@pytest.mark.acceptance
@pytest.mark.office
def test_of_a_survey_workbook_saved_as_ods_only_own_sheets_are_told_of(tmp_path):
    from tests.office import convert

    path = fill(tmp_path / "survey.xlsx")
    book = openpyxl.load_workbook(path)
    book.create_sheet("Mine")["A1"] = "kept nowhere else"
    book.save(path)
    result = run("solve", convert(path, tmp_path, "ods"), "--out", tmp_path / "r.xlsx")
    assert result.exit_code == 0, result.stderr
    assert "what else it holds is not in the new one: Mine.\n" in result.stderr


def test_an_unused_point_shows_no_good_flag_on_the_screen(tmp_path):
    table = [(*row, 0 if row[0] == "P2" else None) for row in rows(POINTS)]
    lines = ["id,x1 [mm],y1 [mm],x2 [mm],y2 [mm],use"]
    lines += [",".join("" if v is None else str(v) for v in row) for row in table]
    path = tmp_path / "p.csv"
    path.write_text("\n".join(lines))
    result = run("solve", path, *DISTANCES)
    assert result.exit_code == 0, result.stderr
    shown = {line.split()[0]: line for line in result.stdout.splitlines() if line[:1] == "P"}
    assert shown["P1"].endswith(" OK")
    assert shown["P2"].endswith(", unused)")


def test_new_rows_name_no_column_that_the_user_took_away(tmp_path):
    """Excel would take the file for a damaged one."""
    path = tmp_path / "s.xlsx"
    table = write_csv(tmp_path / "p.csv", TABLE)
    assert run("solve", table, "--out", path, *DISTANCES).exit_code == 0
    book = openpyxl.load_workbook(path)
    points = book["Points"]
    heads = {cell.value: cell.column for cell in points[4]}
    points.cell(4, heads["cov_XX"]).value = "mine"
    points.tables["tblPoints"].tableColumns[heads["cov_XX"] - 1].name = "mine"
    for row in range(points.max_row + 1, points.max_row + 5):
        for number in range(1, 6):
            points.cell(row, number).value = points.cell(5, number).value
        points.cell(row, 1).value = f"Q{row}"
    book.save(path)
    solved_in_place(path)
    points = openpyxl.load_workbook(path)["Points"]
    assert points.cell(points.max_row, heads["X"]).value.startswith("=")
    assert "cov_XX" not in str(points.cell(points.max_row, heads["sigma_X"]).value)


def test_the_setup_of_an_earlier_version_in_the_users_own_workbook_is_refused(tmp_path):
    heads, table, head = FOREIGN["plain"]
    path = foreign(tmp_path / "own.xlsx", heads=heads, table=table, head=head)
    solved_in_place(path, *DISTANCES)
    book = openpyxl.load_workbook(path)
    before = book.sheetnames
    for name in ("project", "client"):  # the user's to delete
        del book.defined_names[name]
    book.save(path)
    solved_in_place(path, *DISTANCES)
    assert openpyxl.load_workbook(path).sheetnames == before
    for name in ("enlargement_1", "setup_missing"):
        del book.defined_names[name]
    book.save(path)
    result = run("solve", path, *DISTANCES, "--out", path, "--overwrite")
    assert result.exit_code == 1
    assert "was made by an earlier version" in result.stderr
    assert "--out own-result.xlsx" in result.stderr
    out = tmp_path / "own-result.xlsx"
    assert run("solve", path, "--out", out, *DISTANCES).exit_code == 0
