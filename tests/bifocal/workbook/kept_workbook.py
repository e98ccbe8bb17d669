"""Workbooks of a user's own that results go into."""

from __future__ import annotations

import openpyxl
import pytest
from openpyxl.chart import BarChart, Reference

from tests.bifocal.workbook.filled_forms import POINTS, rows, run
from tests.bifocal.workbook.test_survey_workbook import parts

TABLE = "\n".join(["id,x1,y1,x2,y2", *(",".join(map(str, row)) for row in rows(POINTS))])
DISTANCES = ("--d1", 17.5, "--d2", 9.5, "--c1", 35, "--c2", 19)


def with_own_chart(path):
    """Add a sheet with a chart, as a user does in the spreadsheet program."""
    book = openpyxl.load_workbook(path)
    sheet = book.create_sheet("My chart")
    sheet.append([1, 2, 3])
    chart = BarChart()
    chart.add_data(Reference(sheet, min_col=1, max_col=3, min_row=1))
    sheet.add_chart(chart, "A3")
    book.save(path)
    return path


def own_table(path):
    """A table of the user's own, not our template."""
    book = openpyxl.Workbook()
    for row in [("id", "x1", "y1", "x2", "y2"), *rows(POINTS)]:
        book.active.append(row)
    book.save(path)
    return with_own_chart(path)


def solved_in_place(path, *options):
    """Solve a workbook in place; return stderr, and which of its parts are not as they were."""
    before = parts(path)
    result = run("solve", path, "--out", path, "--overwrite", *options)
    assert result.exit_code == 0, result.stderr
    after = parts(path)
    assert before.keys() <= after.keys()
    assert "is kept as" in result.stderr
    return result.stderr, {name for name in after if before.get(name) != after[name]}


def slow(*values):
    """A case that runs with the acceptance tests: one like it runs with every test."""
    return pytest.param(*values, marks=pytest.mark.acceptance)
