"""A sheet of ours that the user deleted is added again, with its charts, and that is said."""

from __future__ import annotations

import openpyxl
import pytest

from tests.bifocal.workbook.filled_forms import POINTS, fill, run
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached

ROW, COLUMN = 5, 17


def solved(path):
    result = run("solve", path, "--out", path, "--overwrite")
    assert result.exit_code == 0, result.stderr
    return result.stderr


def changed(path, change):
    book = openpyxl.load_workbook(path)
    change(book)
    book.save(path)
    return path


def numbers(path, title):
    """X and Y that the charts draw."""
    sheet = openpyxl.load_workbook(path, data_only=True)[title]
    return [tuple(sheet.cell(ROW + i, COLUMN + k).value for k in (0, 1)) for i in range(4)]


XY = [pytest.approx((x, y), abs=1e-9) for _, x, y, _ in POINTS]


@pytest.mark.acceptance
def test_charts_that_were_deleted_are_there_again(tmp_path):
    path = changed(fill(tmp_path / "s.xlsx"), lambda book: book.remove(book["Charts"]))
    assert "missing sheets were added again, behind all others: Charts; the workb" in solved(path)
    book = openpyxl.load_workbook(path)
    assert book.sheetnames[-1] == "Charts"
    assert len(book["Charts"]._charts) == 5
    assert numbers(path, "Charts") == XY
    assert "missing" not in solved(path)


@pytest.mark.acceptance
def test_charts_under_another_title_are_the_same_sheet(tmp_path):
    path = changed(fill(tmp_path / "s.xlsx"), lambda book: setattr(book["Charts"], "title", "G"))
    assert "missing" not in solved(path)
    assert numbers(path, "G") == XY
    assert "Charts" not in openpyxl.load_workbook(path).sheetnames


@pytest.mark.office
@pytest.mark.acceptance
def test_what_is_added_again_calculates_and_stands_beside_what_is_the_users(tmp_path):
    def change(book):
        for title in ("Charts", "Planning", "Check"):
            del book[title]
        book.create_sheet("Charts")["A1"] = "mine"

    path = changed(fill(tmp_path / "s.xlsx"), change)
    assert "behind all others: Check, Planning, Charts;" in solved(path)
    assert openpyxl.load_workbook(path)["Charts"]["A1"].value == "mine"
    assert numbers(path, "Charts 2") == XY
    assert_recalculated_equals_cached(path, tmp_path)
