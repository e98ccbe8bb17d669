"""Every cell of a new workbook is what its formula gives, calculated without another program."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import openpyxl
import pytest

from bifocal.workbook.content import SurveyContent
from bifocal.workbook.making.book import write_book
from photocore.workbook.calculating.calculation import Calculation
from photocore.workbook.calculating.values import Unknown
from tests.bifocal.workbook.test_survey_workbook import ideal_content, of_turns, pair_content

CHANGES = {"d_1": 0.0, "d_2": 0.1, "c_1": 0.0, "c_2": 0.0, "pitch": 0.0}


def assert_stored_is_calculated(path: Path) -> int:
    """Compare all formulas with what is stored; return how many there are."""
    book, stored = openpyxl.load_workbook(path), openpyxl.load_workbook(path, data_only=True)
    calculation = Calculation(book)
    places = calculation.formulas()
    for sheet, row, column in places:
        cell, value = book[sheet].cell(row, column), calculation.value(sheet, row, column)
        shown = stored[sheet].cell(row, column).value
        where = f"{sheet}!{cell.coordinate} {cell.value}"
        if isinstance(value, float) and value != value:
            assert shown == "#N/A", where
        elif isinstance(value, float):
            rel, noise = of_turns(book[sheet], cell, stored)
            # Two engines round each in its way: LibreOffice and this one differ by so much too.
            assert shown == pytest.approx(value, rel=max(rel, 1e-9), abs=max(noise, 1e-9)), where
        else:
            assert (shown or "") == value, where
    assert not calculation.unknown
    return len(places)


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(lambda: replace(ideal_content(model="3D"), changes=CHANGES), id="ideal"),
        *(
            pytest.param(make, id=name, marks=pytest.mark.acceptance)
            for name, make in {
                "pair": lambda: pair_content(placed=True),
                "levelled": ideal_content,
                "2D": lambda: ideal_content(model="2D"),
                "plain": lambda: replace(ideal_content(), plain=True),
                "german": lambda: replace(ideal_content(), language="de"),
                "form": lambda: SurveyContent(rows=20, other_photos=1),
            }.items()
        ),
    ],
)
def test_every_cell_is_what_its_formula_gives(content, tmp_path):
    write_book(tmp_path / "survey.xlsx", content())
    assert assert_stored_is_calculated(tmp_path / "survey.xlsx") > 1500


#: Where IronCalc takes a blank cell that is reached by INDEX or a name for 0, and so answers for
#: another survey: all that hangs on control and check points, and what merely shows typed texts.
BLANKS_TAKEN_FOR_ZERO = {
    "Points": {"n_E", "n_N", "n_H", "cov_EN", "shared", "sigma_E", "sigma_N", "sigma_H"},
    "Results": {"E", "N", "H", "sigma_E", "sigma_N", "sigma_H"},
}


@pytest.mark.acceptance
def test_a_third_engine_agrees_wherever_it_obeys_blanks(tmp_path):
    ironcalc, path = pytest.importorskip("ironcalc"), tmp_path / "survey.xlsx"
    write_book(path, ideal_content())
    engine = ironcalc.load_from_xlsx(str(path), "en", "UTC", "en")
    engine.evaluate()
    stored, count = openpyxl.load_workbook(path, data_only=True), 0
    for sheet, column, row in formulas_of_tables(path, 4, BLANKS_TAKEN_FOR_ZERO):
        value = engine.get_cell_value(stored.sheetnames.index(sheet), row, column)
        shown = stored[sheet].cell(row, column).value
        if isinstance(shown, float):
            assert value == pytest.approx(shown, rel=1e-10, abs=1e-12), (sheet, row, column)
        else:
            assert (value or None) == (shown or None), (sheet, row, column)
        count += 1
    assert count > 1900


def formulas_of_tables(path, head, left_out):
    """Yield sheet, column and row of the formulas below the headings that are not left out."""
    book = openpyxl.load_workbook(path)
    for title, keys in left_out.items():
        for heading in book[title][head]:
            if heading.value not in keys:
                for (cell,) in book[title].iter_rows(
                    head + 1, None, heading.column, heading.column
                ):
                    if cell.data_type == "f":
                        yield title, cell.column, cell.row


def calculated(*formulas: str, **cells: object) -> list[object]:
    """Return what formulas give beside cells, each by its name."""
    book = openpyxl.Workbook()
    sheet = book.active
    for place, value in cells.items():
        sheet[place] = value
    for row, formula in enumerate(formulas, start=1):
        sheet.cell(row, 26, f"={formula}")
    calculation = Calculation(book)
    return [calculation.value("Sheet", row, 26) for row in range(1, len(formulas) + 1)]


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("1+2*3^2", 19.0),
        ("-2^2", 4.0),  # a sign binds more closely than a power, in spreadsheets
        ("2^-1", 0.5),
        ("10%*50", 5.0),
        ("A1+1", 1.0),
        ('A1&"x"', "x"),
        ('"10"+5', 15.0),
        ('"b">7', True),
        ('"A"="a"', True),
        ("COUNT(B1:B4)", 2.0),
        ("COUNTA(B1:B4)", 3.0),
        ("AVERAGE(B1:B4)", 3.0),
        ("MAX(A1:A4)", 0.0),
        ('IF(A1="","blank",1)', "blank"),
        ("IFERROR(1/0,7)", 7.0),
        ("ROUND(2.5,0)", 3.0),
        ("ROUND(-1.005,2)", -1.01),
        ("INDEX(B1:B4,MATCH(4,B1:B4,0))", 4.0),
        ('COUNTIF(B1:B4,">3")', 1.0),
        ("SUMPRODUCT(B1:B2,B1:B2)", 20.0),
        ("INDEX(MINVERSE(D1:E2),1,2)", -1.0),
        ("DEGREES(ATAN2(0,1))", 90.0),
        ("B5", 0.0),
    ],
)
def test_rules_are_those_of_spreadsheets(formula, value):
    cells = {"B1": 2, "B2": 4, "B3": "word", "D1": 1, "D2": 0, "E1": 1, "E2": 1}
    (found,) = calculated(formula, **cells)
    assert found == (pytest.approx(value) if isinstance(value, float) else value)


@pytest.mark.parametrize(
    ("formula", "why"),
    [("VLOOKUP(1,B1:B2,1)", "VLOOKUP"), ("Z1", "itself"), ("nobody+1", "nobody")],
)
def test_what_is_not_known_is_said(formula, why):
    with pytest.raises(Unknown, match=why):
        calculated(formula)
