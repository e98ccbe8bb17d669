"""The workbooks that ship ready-made have none of the faults that make Excel offer a repair."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.workbook_lint import lint

TEMPLATES = sorted((Path(__file__).parents[1] / "templates").glob("*.xlsx"))


def test_every_language_ships():
    names = {path.name for path in TEMPLATES}
    assert {"survey-en.xlsx", "survey-it.xlsx", "survey-de.xlsx", "multimedia.xlsx"} <= names


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: path.name)
def test_templates_have_no_repair_traps(path):
    assert lint(path) == []
