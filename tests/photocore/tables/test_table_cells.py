"""Cells of tables: numbers typed as text, wrong units, dates, errors, hidden rows."""

import datetime
import zipfile

import numpy as np
import pytest

from bifocal import WorkbookError
from photocore.tables import Column, open_tables, read_table
from tests.photocore.tables.small_book import POLAR, check_samples, polar_rows


def test_ids_stay_text_and_whole_numbers_lose_their_point(book):
    rows = [("id", "s1", "s2"), ("001", 1, 2), (1, 1, 2), (2.0, 1, 2), ("=x", 1, 2), (1.5, 1, 2)]

    def as_text(workbook):
        workbook.worksheets[0]["A5"].data_type = "s"

    table = read_table(book(rows, edit=as_text), POLAR)
    assert table.texts("id") == ["001", "1", "2", "=x", "1.5"]


def test_numbers_typed_as_text_are_read_with_commas_spaces_minus_signs_and_units(book):
    cells = ["12,5", " 1 250,5 ", "\u22123,25", "7\u00a0mm", "1\u202f000,5", "0,125"]
    rows = [("id", "s1 [mm]", "s2"), *((f"P{i}", cell, 1) for i, cell in enumerate(cells))]
    table = read_table(book(rows), POLAR)
    assert table.numbers("s1").tolist() == [12.5, 1250.5, -3.25, 7.0, 1000.5, 0.125]
    assert table.remarks == ["s1: the unit typed into 1 cells was taken off."]


def test_a_wrong_unit_in_a_cell_is_refused_with_the_converted_number(book):
    path = book([("id", "s1 [mm]", "s2"), ("P1", "1,24 cm", 1)])
    with pytest.raises(WorkbookError, match=r'Sheet1!B2 \(s1\): found "1,24 cm".* Write 12.4; the'):
        read_table(path, POLAR)


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        (
            ["12,4 cm", 3.5, 4.5],
            r'Sheet1!B2 \(s1\): found "12,4 cm", while other cells say no unit',
        ),
        ([3.5, "12,4 cm", "7 cm"], r'B3 \(s1\): found "12,4 cm" \(and 1 more with a unit'),
        (["12,4 cm", "7 mm"], r'B2 \(s1\): found "12,4 cm" \(and 1 more .* other cells say mm\.'),
        (["12,4 cm", "7 mm", 3.0], r"B2 .* other cells say mm or none\. Type all numbers in one"),
    ],
)
def test_the_unit_of_a_cell_is_never_applied_to_the_others(book, cells, message):
    columns = [POLAR[0], Column("s1")]
    rows = [("id", "s1"), *((f"P{i}", cell) for i, cell in enumerate(cells))]
    with pytest.raises(WorkbookError, match=message) as caught:
        read_table(book(rows), columns)
    assert str(caught.value).count("Sheet1!") == 1


def test_one_cell_of_another_unit_is_the_one_complained_of(book):
    rows = [("id", "s1"), ("P1", "12 mm"), ("P2", "13 mm"), ("P3", "1.4 cm")]
    with pytest.raises(WorkbookError, match=r"B4 \(s1\): found \"1.4 cm\".* Write 14;") as caught:
        read_table(book(rows), [POLAR[0], Column("s1")])
    assert str(caught.value).count("Sheet1!") == 1


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("abc", 'found "abc", expected a number in mm'),
        ("n/a", "Leave the cell empty"),
        (True, "holds TRUE"),
        ("1,250", "may mean 1.25 or 1250.*--decimal"),
        (datetime.date(2026, 5, 1), "holds the date 2026-05-01.*probably 1.5"),
        (datetime.time(1, 30), "time of day"),
        ("=1/0", "never been calculated"),
    ],
)
def test_a_bad_number_is_named_with_its_cell(book, cell, message):
    path = book([("id", "s1", "s2"), ("P1", 1, 2), ("P2", cell, 2)])
    with pytest.raises(WorkbookError, match=rf"survey.xlsx › Sheet1!B3 \(s1\): .*{message}"):
        read_table(path, POLAR)


def test_january_2025_was_typed_as_a_number_with_two_decimals(book):
    def style(workbook):
        workbook.worksheets[0]["B2"].number_format = "mmm-yy"

    path = book([("id", "s1", "s2"), ("P1", datetime.date(2025, 1, 1), 2)], edit=style)
    with pytest.raises(WorkbookError, match=r"probably 1\.25"):
        read_table(path, POLAR)


def test_a_format_with_a_unit_is_not_taken_for_a_date(book):
    def style(workbook):
        workbook.worksheets[0]["B2"].number_format = '0.00" mm"'

    table = read_table(book([("id", "s1", "s2"), ("P1", 12.5, 2)], edit=style), POLAR)
    assert table.numbers("s1").tolist() == [12.5]


def test_a_name_that_its_format_makes_is_read_as_it_is_shown(book):
    def style(workbook):
        workbook.worksheets[0]["A2"].number_format = '"P"000'

    table = read_table(book([("id", "s1", "s2"), (7, 1, 2)], edit=style), POLAR)
    assert list(table.texts("id")) == ["P007"]


def test_all_bad_cells_are_reported_at_once_in_the_order_of_the_sheet(book):
    path = book([("id", "s1", "s2"), ("P1", "a", "b"), ("P2", 1, "c")])
    with pytest.raises(WorkbookError) as caught:
        read_table(path, POLAR)
    assert [error.cell for error in caught.value.errors] == ["B2", "C2", "C3"]


def test_bad_cells_of_several_tables_can_be_gathered(book):
    opened = open_tables(book([("id", "s1", "s2"), ("P1", "a", 1)], [("X", "Y"), ("b", 1)]))
    errors = []
    table = read_table(opened, POLAR, errors=errors)
    read_table(opened, (Column("X"), Column("Y")), sheet="Sheet2", errors=errors)
    assert [(error.sheet, error.cell) for error in errors] == [("Sheet1", "B2"), ("Sheet2", "A2")]
    assert np.isnan(table.numbers("s1")).all()


def test_the_user_decides_what_an_ambiguous_number_means(book):
    path = book([("id", "s1", "s2"), ("P1", "1,250", 2)])
    assert read_table(path, POLAR, decimal="comma").numbers("s1").tolist() == [1.25]
    assert read_table(path, POLAR, decimal="point").numbers("s1").tolist() == [1250.0]


def test_another_number_of_the_table_settles_what_an_ambiguous_one_means(book):
    path = book([("id", "s1", "s2"), ("P1", "1,250", "2,5")])
    assert read_table(path, POLAR).numbers("s1").tolist() == [1.25]


def test_point_and_comma_in_one_column_are_refused(book):
    rows = [("id", "s1", "s2"), ("P1", "1,25", 2), ("P2", "1,5", 2), ("P3", "1.75", 2)]
    with pytest.raises(WorkbookError, match=r'B4 \(s1\): found "1.75", while .*comma. Write 1,75'):
        read_table(book(rows), POLAR)


def test_error_values_are_named_and_cached_results_of_formulas_are_read(tmp_path, book):
    path = book([("id", "s1", "s2"), ("P1", 1, "=B2*2"), ("P2", 2, "=1/0")])
    with zipfile.ZipFile(path) as package:
        parts = {name: package.read(name) for name in package.namelist()}
    sheet = parts["xl/worksheets/sheet1.xml"]
    sheet = sheet.replace(b"<f>B2*2</f><v></v>", b"<f>B2*2</f><v>2.5</v>")
    sheet = sheet.replace(b"<f>B2*2</f><v />", b"<f>B2*2</f><v>2.5</v>")
    sheet = sheet.replace(b'<c r="C3"><f>1/0</f>', b'<c r="C3" t="e"><f>1/0</f>')
    for empty in (b"<v></v>", b"<v />"):
        sheet = sheet.replace(b"1/0</f>" + empty, b"1/0</f><v>#DIV/0!</v>")
    parts["xl/worksheets/sheet1.xml"] = sheet
    with zipfile.ZipFile(tmp_path / "cached.xlsx", "w") as package:
        for name, data in parts.items():
            package.writestr(name, data)
    with pytest.raises(WorkbookError, match=r"C3 \(s2\): holds the error #DIV/0!") as caught:
        read_table(tmp_path / "cached.xlsx", POLAR)
    assert len(caught.value.errors) == 1


def test_hidden_rows_are_used_with_a_remark_unless_only_visible_ones_are_wanted(book):
    def hide(workbook):
        workbook.worksheets[0].row_dimensions[2].hidden = True

    path = book(polar_rows(), edit=hide)
    table = read_table(path, POLAR)
    check_samples(table)
    assert table.remarks == [
        "1 hidden or filtered rows are used too; `no` in a column `use` leaves a row out, and "
        "--visible-only of `solve` all of them."
    ]
    assert read_table(path, POLAR, visible_only=True).texts("id") == ["P2"]


def test_merged_cells_in_the_data_are_refused(book):
    def merge(workbook):
        workbook.worksheets[0].merge_cells("B2:B3")

    with pytest.raises(WorkbookError, match=r"B2:B3 are merged"):
        read_table(book(polar_rows(), edit=merge), POLAR)
