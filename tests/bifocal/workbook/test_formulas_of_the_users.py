"""A survey workbook whose formulas the user changed: they count, and what is stored follows."""

from __future__ import annotations

from pathlib import Path

import openpyxl
import pytest

from tests.bifocal.workbook.filled_forms import POINTS, run, write_csv
from tests.bifocal.workbook.kept_workbook import DISTANCES, TABLE
from tests.bifocal.workbook.test_cells_are_calculated import assert_stored_is_calculated
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("book")
    path, table = folder / "survey.xlsx", write_csv(folder / "points.csv", TABLE)
    assert run("solve", table, *DISTANCES, "--out", path).exit_code == 0
    book = openpyxl.load_workbook(path)
    head = int(book["Check"].tables["tblCheck"].ref.partition(":")[0].strip("ABC"))
    keys = {cell.value: cell.column for cell in book["Check"][head]}
    for row, (name, x, y, r) in enumerate(POINTS, start=head + 1):
        known = {"id": name, "X_ref": x + 0.001, "Y_ref": y - 0.002, "Z_ref": r}
        for key, value in known.items():
            book["Check"].cell(row, keys[key]).value = value
    book.save(path)
    return path.read_bytes()


@pytest.fixture
def survey(written: bytes, tmp_path: Path) -> Path:
    (tmp_path / "survey.xlsx").write_bytes(written)
    return tmp_path / "survey.xlsx"


def change(path: Path, **formulas: str) -> None:
    """Put formulas into cells of `Points` by key, each in the first row."""
    book = openpyxl.load_workbook(path)
    sheet = book["Points"]
    heads = {cell.value: cell.column for cell in sheet[4]}
    for key, text in formulas.items():
        cell = sheet.cell(5, heads[key])
        cell.value = text.format(own=str(cell.value).removeprefix("="))
    book.save(path)


def solved(path: Path) -> str:
    result = run("solve", path, "--out", path, "--overwrite")
    assert result.exit_code == 0, result.stderr
    return result.stderr + result.stdout


def test_a_formula_that_was_changed_counts_and_all_that_follows_from_it(survey: Path) -> None:
    change(survey, Z="={own}+1")
    told = solved(survey)
    after = openpyxl.load_workbook(survey, data_only=True)
    heads = {cell.value: cell.column for cell in after["Points"][4]}
    relief = POINTS[0][3]
    assert after["Points"].cell(5, heads["r"]).value == pytest.approx(relief, abs=1e-9)
    assert after["Points"].cell(5, heads["Z"]).value == pytest.approx(relief + 1, abs=1e-9)
    assert f"stay and count: Points!{after['Points'].cell(5, heads['Z']).coordinate}." in told
    assert_stored_is_calculated(survey)


@pytest.mark.acceptance
@pytest.mark.office
def test_what_follows_from_a_changed_formula_is_what_libreoffice_calculates(
    survey: Path, tmp_path: Path
) -> None:
    change(survey, Z="={own}+1", sigma_r="=2*({own})")
    solved(survey)
    assert_recalculated_equals_cached(survey, tmp_path, worth=1e-9)


def test_a_function_that_is_not_known_is_kept_and_named(survey: Path) -> None:
    change(survey, Z="=BESSELJ({own},1)")
    told = solved(survey)
    assert "Not known here: BESSELJ (Points!" in told
    sheet = openpyxl.load_workbook(survey)["Points"]
    assert "BESSELJ" in str([cell.value for cell in sheet[5]])


def test_a_workbook_as_it_was_made_is_not_calculated(survey: Path) -> None:
    assert "stay and count" not in solved(survey)
    assert "stay and count" not in solved(survey)
