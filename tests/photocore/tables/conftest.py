"""Fixtures of this folder."""

import openpyxl
import pytest


@pytest.fixture
def book(tmp_path):
    """Return a function that writes rows to a workbook and returns its path."""

    def write(*sheets, name="survey.xlsx", edit=None):
        workbook = openpyxl.Workbook()
        workbook.remove(workbook.active)
        for number, rows in enumerate(sheets, start=1):
            sheet = workbook.create_sheet(f"Sheet{number}")
            for row in rows:
                sheet.append(row)
        if edit:
            edit(workbook)
        workbook.save(tmp_path / name)
        return tmp_path / name

    return write
