"""The multimedia workbook looks, speaks and prints like the survey workbook."""

from __future__ import annotations

from pathlib import Path

import openpyxl
import pytest
from click.testing import CliRunner

from tests.bifocal.workbook.test_workbook_look import dimension, inputs
from tests.builders.commands import multimedia_command as main
from tests.workbook_lint import lint
from tests.workbook_page import sizes_of

LANGUAGES = ("en", "it", "de")


@pytest.fixture(scope="module")
def books(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return a template in each language."""
    folder = tmp_path_factory.mktemp("tanks")
    for code in LANGUAGES:
        path = folder / f"{code}.xlsx"
        arguments = ["template", str(path), "--lang", code, "--rows", "8"]
        assert CliRunner().invoke(main, arguments).exit_code == 0
    return {code: folder / f"{code}.xlsx" for code in LANGUAGES}


@pytest.mark.parametrize("code", LANGUAGES)
def test_face_sizes_protection_and_prompts_are_those_of_the_survey(
    code: str, books: dict[str, Path]
) -> None:
    assert lint(books[code]) == []
    book = openpyxl.load_workbook(books[code])
    for sheet in book:
        cells = [cell for row in sheet.iter_rows() for cell in row]
        assert {cell.font.name for cell in cells} == {"Arial"}
        assert {cell.font.sz for cell in cells} <= {9, 10, 14}
        assert min(sizes_of(sheet)) >= 8, sheet.title
        assert sheet.protection.sheet == (sheet.title != "Readme")
        typed, said = inputs(sheet)
        assert len(typed) > 4 or sheet.title == "Readme"
        for cell in typed:
            assert len(said[cell.row, cell.column].prompt) > 3, cell.coordinate


def test_words_are_in_three_languages_and_keys_in_one(books: dict[str, Path]) -> None:
    said = {}
    keys = set()
    for code in LANGUAGES:
        book = openpyxl.load_workbook(books[code])
        sheet = book["Multimedia"]
        head = int(sheet.tables["tblMM"].ref[1:].partition(":")[0])
        said[code] = [sheet["A1"].value, sheet.cell(head - 1, 1).value, book["Readme"]["A1"].value]
        keys.add(tuple(cell.value for cell in sheet[head]))
    assert said["en"][1:] == ["Point", "Photogrammetry through water"]
    assert said["it"][1:] == ["Punto", "Fotogrammetria attraverso l'acqua"]
    assert said["de"][1:] == ["Punkt", "Photogrammetrie durch Wasser"]
    assert len(keys) == 1


def test_steps_are_folded_and_shift_and_index_are_drawn(books: dict[str, Path]) -> None:
    book = openpyxl.load_workbook(books["en"])
    sheet = book["Multimedia"]
    head = int(sheet.tables["tblMM"].ref[1:].partition(":")[0])
    hidden = [cell.value for cell in sheet[head] if dimension(sheet, cell.column).hidden]
    assert hidden == ["R_u", "ZP_u", *(f"u{i}" for i in range(7))]
    assert [len(book[title]._charts) for title in ("Multimedia", "RefractiveIndex")] == [1, 1]
