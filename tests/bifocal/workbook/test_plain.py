"""Workbooks of plain formulas: A1 references only, the same numbers, read back as any other."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import openpyxl
import pytest

from bifocal.workbook.making.book import write_book
from tests.bifocal.workbook.filled_forms import fill, rows, run
from tests.bifocal.workbook.test_survey_workbook import (
    assert_recalculated_equals_cached,
    ideal_content,
    pair_content,
)
from tests.workbook_lint import lint


def names_in_formulas(path):
    """Return the cells whose formulas name a table or a cell, or fill several cells."""
    book = openpyxl.load_workbook(path)
    names, found = {name.casefold() for name in book.defined_names}, []
    for sheet in book:
        for cell in (cell for row in sheet.iter_rows() for cell in row if cell.data_type == "f"):
            text = re.sub(r'"[^"]*"', "", str(cell.value)).casefold()
            if "[" in text or "tbl" in text or names & set(re.findall(r"\w+", text)):
                found.append(f"{sheet.title}!{cell.coordinate}: {cell.value}")
    return found


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize("content", [ideal_content, pair_content])
def test_plain_formulas_recalculated_equal_the_library(content, tmp_path):
    path = tmp_path / "plain.xlsx"
    write_book(path, replace(content(), plain=True))
    assert names_in_formulas(path) == []
    assert lint(path) == []
    assert assert_recalculated_equals_cached(path, tmp_path) > 2000


def relieved(count):
    """Return points of r = 1 m as they are typed."""
    return rows([(f"P{i}", 0.5 + i / 10, 0, 1) for i in range(count)])


@pytest.mark.acceptance
def test_a_plain_template_is_read_back_also_when_its_tables_are_gone(tmp_path):
    path, out = tmp_path / "plain.xlsx", tmp_path / "out.xlsx"
    assert run("template", path, "--plain", "--media", 2, "--rows", 5).exit_code == 0
    assert names_in_formulas(path) == []
    typed = fill(tmp_path / "typed.xlsx", relieved(2), template=("--plain", "--rows", 20))
    book = openpyxl.load_workbook(typed)
    for sheet in book:
        for name in list(sheet.tables):
            del sheet.tables[name]
    book.save(tmp_path / "exported.xlsx")
    for name in ("typed", "exported"):
        done = run("solve", tmp_path / f"{name}.xlsx", "--json")
        assert done.exit_code == 0, done.stderr
        points = json.loads(done.stdout)["points"]
        assert [round(point["r"], 9) for point in points] == [1, 1]
    assert run("solve", tmp_path / "typed.xlsx", "--out", out).exit_code == 0
    assert names_in_formulas(out) == []
    done = run("solve", tmp_path / "exported.xlsx", "--out", tmp_path / "again.xlsx")
    assert done.exit_code == 0, done.stderr


@pytest.mark.acceptance
@pytest.mark.office
def test_rows_below_the_prepared_ones_get_plain_formulas_and_all_ranges_reach_them(tmp_path):
    path, out = tmp_path / "plain.xlsx", tmp_path / "out.xlsx"
    fill(path, relieved(9), template=("--plain", "--rows", 4))
    assert run("solve", path, "--out", out).exit_code == 0
    assert names_in_formulas(out) == []
    assert lint(out) == []
    assert_recalculated_equals_cached(out, tmp_path)
    results = openpyxl.load_workbook(out, data_only=True)["Results"]
    assert [round(results.cell(row, 4).value, 9) for row in range(5, 14)] == [1] * 9
    assert "$13" in openpyxl.load_workbook(out)["Results"]["D13"].value
