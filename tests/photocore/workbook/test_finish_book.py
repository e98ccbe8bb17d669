"""Prototype rows multiplied and results filled in, read back by an independent reader."""

from __future__ import annotations

import io
import math
from xml.etree.ElementTree import fromstring

import numpy as np
import openpyxl
import pytest

from bifocal import InputError
from photocore.provenance import Provenance
from photocore.workbook.changing.cells import ROW_MARK, NewColumn, NewRows, RowText
from photocore.workbook.making import newbook
from photocore.workbook.making.newbook import RowBlock, finish_book


def book():
    package = io.BytesIO()
    workbook = openpyxl.Workbook()
    sheet = workbook.active
    sheet.title = "T"
    sheet["A1"], sheet["B1"], sheet["E9"] = "id", "twice", "=1/3"
    sheet["A2"], sheet["B2"] = None, "=A2*2"
    sheet["A2"].number_format, sheet["D9"] = "0.00", 0.1 + 0.2
    workbook.save(package)
    return package


def finished(tmp_path, block, results=None):
    finish_book(book(), tmp_path / "t.xlsx", blocks={"T": block}, results={"T": results or {}})
    return tmp_path / "t.xlsx"


def test_rows_carry_values_formulas_and_formats(tmp_path):
    block = RowBlock(row=2, columns=[[1.5, None, "a&b"], [3.0, float("nan"), "x"]])
    path = finished(tmp_path, block)
    values, formulas = openpyxl.load_workbook(path, data_only=True)["T"], None
    assert [cell.value for cell in values["A"][1:4]] == [1.5, None, "a&b"]
    assert [cell.value for cell in values["B"][1:4]] == [3.0, "#N/A", "x"]
    formulas = openpyxl.load_workbook(path)["T"]
    assert formulas["B4"].value == "=A2*2"
    assert formulas["A3"].number_format == "0.00"


def test_formulas_may_change_from_row_to_row(tmp_path):
    double = RowText(f"A{ROW_MARK}*2")
    block = RowBlock(row=2, columns=[[1.0, 2.0], [2.0, 4.0]], formulas={1: double})
    sheet = openpyxl.load_workbook(finished(tmp_path, block))["T"]
    assert [sheet["B2"].value, sheet["B3"].value] == ["=A2*2", "=A3*2"]


def test_formulas_with_marks_make_the_rows_that_functions_make():
    values = [
        -0.0,
        math.nan,
        "",
        "a<b\x00",
        None,
        True,
        1,
        np.float64(-0.0),
        np.float64(0.1),
        "",
        1.0,
    ]
    text = RowText(f'IF(A{ROW_MARK}<4,"&",0)').escaped()

    def function(row):
        return f'IF(A{row}&lt;4,"&amp;",0)'

    made = []
    for formula in (text, function):
        columns = [NewColumn(3, values, "7", formula), NewColumn(28, values, "", "B1")]
        columns.append(NewColumn(30, values))
        block = NewRows(6, len(values), columns)
        made.append([*block.xml(range(7, 17), "")])
        assert formula(9) == function(9)
    assert made[0] == made[1]
    assert made[0][1].startswith('<c r="C8" s="7" t="str"><f>IF(A8&lt;4,"&amp;",0)</f>')


def test_single_results_and_numbers_keep_every_digit(tmp_path):
    third = 1 / 3
    block = RowBlock(row=2, columns=[[1.0], [2.0]])
    path = finished(tmp_path, block, {"E9": third, "D9": 0.1 + 0.2})
    sheet = openpyxl.load_workbook(path, data_only=True)["T"]
    assert sheet["E9"].value == third
    assert sheet["D9"].value == 0.1 + 0.2


def test_texts_that_look_like_formulas_stay_texts(tmp_path):
    path = finished(tmp_path, RowBlock(row=2, columns=[["=1+1", "+1", "tab\there\x01"]]))
    sheet = openpyxl.load_workbook(path)["T"]
    assert [sheet[f"A{i}"].data_type for i in (2, 3, 4)] == ["s", "s", "s"]
    assert sheet["A4"].value == "tab\there"


def test_a_missing_prototype_row_is_said(tmp_path):
    with pytest.raises(InputError, match="row 7: no prototype"):
        finished(tmp_path, RowBlock(row=7, columns=[[1.0]]))


def test_properties_are_xml_however_openpyxl_declares_their_prefixes(monkeypatch):
    made = Provenance(program="bifocal 1.0", date="2026-01-02", command="bifocal template o.xlsx")
    monkeypatch.setattr(newbook, "provenance", lambda: made)
    core = "http://schemas.openxmlformats.org/package/2006/metadata/core-properties"
    dublin = 'xmlns:dc="http://purl.org/dc/elements/1.1/"'
    by_lxml = (
        f'<cp:coreProperties xmlns:cp="{core}"><dc:creator {dublin}>x</dc:creator>'
        f"<dc:description {dublin}>y</dc:description></cp:coreProperties>"
    )
    plain = (
        f'<cp:coreProperties xmlns:cp="{core}" {dublin}><dc:creator>x</dc:creator>'
        "<dc:description>y</dc:description></cp:coreProperties>"
    )
    for text in (by_lxml, plain):
        stated = fromstring(newbook._stated_properties(text.encode()))
        assert [element.text[:5] for element in stated] == ["x", "bifoc"]
