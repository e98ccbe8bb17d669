"""Results beside a table of the user's own: what was asked for first, steps folded, all in view."""

from __future__ import annotations

import openpyxl
import pytest
from openpyxl.worksheet.dimensions import ColumnDimension

from tests.bifocal.workbook.filled_forms import run
from tests.bifocal.workbook.test_cli_solve import DISTANCES
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached
from tests.workbook_lint import lint

FIRST = ["r [m]", "flag", "X [m]", "Y [m]", "sigma_r [m]"]


@pytest.fixture
def solved(tmp_path):
    """Return the sheet of an own table after results went into it."""
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["Point", "x1 [mm]", "y1 [mm]", "x2 [mm]", "y2 [mm]"])
    sheet.append(["A", 4.2424, 0, 4.4706, 0])
    sheet.append(["B", 6.1, 2.2, 6.3, 2.27])
    sheet.column_dimensions["A"].width = 21
    # As programs leave it: one width for all columns to the last.
    rest = ColumnDimension(sheet, index="B", min=2, max=16384, width=11.5, customWidth=True)
    sheet.column_dimensions["B"] = rest
    sheet.print_area = "A1:E3"
    path = tmp_path / "own.xlsx"
    book.save(path)
    in_place(path, *DISTANCES, "--lang", "it")
    return path


def in_place(path, *options):
    done = run("solve", path, *options, "--out", path, "--overwrite")
    assert done.exit_code == 0, done.stderr


def widths(sheet):
    """Return width, and whether it is folded, of each column by number."""
    return {
        number: (known.width, known.hidden, known.outlineLevel)
        for known in sheet.column_dimensions.values()
        for number in range(known.min, min(known.max, 60) + 1)
    }


def test_results_come_first_and_the_steps_are_folded(solved):
    sheet = openpyxl.load_workbook(solved)["Sheet"]
    heads = [cell.value for cell in sheet[1]]
    assert heads[5:10] == FIRST
    known = widths(sheet)
    for number, head in enumerate(heads[5:], start=6):
        width, hidden, level = known[number]
        assert width >= len(head) + 1
        assert (hidden, level) == ((False, 0) if head in FIRST else (True, 1))
    assert any(head.startswith("s1_used") for head in heads)
    assert sheet.sheet_format.outlineLevelCol == 1


def test_other_columns_and_the_print_area_are_as_they_were(solved):
    sheet = openpyxl.load_workbook(solved)["Sheet"]
    known, last = widths(sheet), sheet.max_column
    assert known[1] == (21, False, 0)
    assert {known[number] for number in (2, 5, last + 1, 60)} == {(11.5, False, 0)}
    assert sheet.print_area == "'Sheet'!$A$1:$E$3"
    assert lint(solved) == []


def test_widths_that_the_user_chose_later_stay(solved):
    book = openpyxl.load_workbook(solved)
    book["Sheet"].column_dimensions["F"].width = 33
    book["Sheet"].column_dimensions["K"].hidden = False
    book.save(solved)
    # Formulas that openpyxl left without results are calculated by the program that opens the file.
    in_place(solved)
    known = widths(openpyxl.load_workbook(solved)["Sheet"])
    assert known[6][0] == 33
    assert not known[11][1]


@pytest.mark.acceptance
@pytest.mark.office
def test_formulas_of_reordered_columns_recalculate_to_the_same(solved, tmp_path):
    assert assert_recalculated_equals_cached(solved, tmp_path) > 40


def test_the_sheet_that_is_added_is_called_in_the_language_and_found_again(solved):
    assert openpyxl.load_workbook(solved).sheetnames == ["Sheet", "Assetto"]
    in_place(solved, "--d2", 9.6)
    book = openpyxl.load_workbook(solved, data_only=True)
    assert book.sheetnames == ["Sheet", "Assetto"]
    assert book.defined_names["d_2"].attr_text == "'Assetto'!$C$7"
    assert book["Assetto"]["C7"].value == 9.6
