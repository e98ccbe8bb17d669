"""The workbook lint finds every fault that makes Excel offer a repair."""

import zipfile

import openpyxl
import pytest
from openpyxl.workbook.defined_name import DefinedName
from openpyxl.worksheet.datavalidation import DataValidation
from openpyxl.worksheet.table import Table

from tests.golden import make_rich_workbook
from tests.workbook_lint import formula_faults, lint


@pytest.fixture
def found(tmp_path):
    """Return a function that lints a sound workbook after one change."""

    def run(change=None, replace=None):
        book = openpyxl.Workbook()
        sheet = book.active
        sheet.title = "Points"
        for row in (["id", "s1", "r"], ["P1", 1.5, "=tblPoints[[#This Row],[s1]]*c_1"]):
            sheet.append(row)
        table = Table(displayName="tblPoints", ref="A1:C2")
        sheet.add_table(table)
        table._initialise_columns()
        for column, name in zip(table.tableColumns, ("id", "s1", "r"), strict=True):
            column.name = name
        book.defined_names["c_1"] = DefinedName("c_1", attr_text="Points!$B$2")
        if change:
            change(book, sheet, table)
        path = tmp_path / "book.xlsx"
        book.save(path)
        if replace:
            name, old, new = replace
            with zipfile.ZipFile(path) as package:
                parts = {n: package.read(n) for n in package.namelist()}
            assert old in parts[name]
            parts[name] = parts[name].replace(old, new)
            with zipfile.ZipFile(path, "w") as package:
                for part, data in parts.items():
                    package.writestr(part, data)
        return lint(path)

    return run


def test_a_sound_workbook_has_no_fault(found):
    assert found() == []


def test_the_rich_fixture_has_no_fault(tmp_path):
    assert lint(make_rich_workbook.write(tmp_path / "rich.xlsm")) == []


def put(cell, value):
    def change(_, sheet, __):
        sheet[cell] = value

    return change


def rename(_, __, table):
    table.displayName = table.name = "tbl1"


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (put("B1", "S1 "), "B1: holds 'S1 ', but its table column is \"s1\""),
        (put("B1", 7), "B1: holds None, but its table column is"),
        (put("C2", "=SUMME(B2,1)"), "SUMME is not an English function name"),
        (put("C2", "=tblPoints[@s1]"), r"\[@column\] is \[#This Row\]"),
        (put("C2", "=SUM(B2;1)"), '";" separates arguments'),
        (put("C2", "=STDEV.S(B2:B3)"), "STDEV.S is not an English function name"),
        (put("C2", "=LET(a,1,a)"), "LET is not understood everywhere"),
        (put("C2", '=TEXT(B2,"0.0")'), "TEXT is not understood everywhere"),
        (put("C2", "=SUM(B2"), "brackets do not match"),
        (rename, '"tbl1" looks like a cell'),
    ],
)
def test_faults_of_cells_and_tables_are_found(found, change, fault):
    import re

    assert any(re.search(fault, line) for line in found(change)), found(change)


@pytest.mark.parametrize("name", ["c1", "d1", "S2", "r", "R1C1", "C", "AB12"])
def test_names_that_look_like_cells_are_found(found, name):
    def change(book, _, __):
        book.defined_names[name] = DefinedName(name, attr_text="Points!$B$2")

    assert found(change) == [f'the name "{name}" looks like a cell']


@pytest.mark.parametrize("name", ["c_1", "delta_d", "sigma_r_max", "k_12"])
def test_names_of_the_workbook_are_allowed(found, name):
    def change(book, _, __):
        book.defined_names[name] = DefinedName(name, attr_text="Points!$B$2")

    assert found(change) == []


def test_names_that_lead_nowhere_or_exist_twice_are_found(found):
    def change(book, _, __):
        book.defined_names["a_b"] = DefinedName("a_b", attr_text="Setup!$B$2")
        book.defined_names["tblpoints"] = DefinedName("tblpoints", attr_text="Points!$B$2")

    faults = found(change)
    assert 'the name "a_b" leads to a missing sheet (Setup!$B$2)' in faults
    assert 'the name "tblpoints" is used 2 times' in faults


def test_headings_with_brackets_line_breaks_or_a_twin_are_found(found):
    def change(_, sheet, table):
        for cell, name in (("A1", "s [mm]"), ("B1", "s1"), ("C1", "s1")):
            sheet[cell] = name
        for column, name in zip(table.tableColumns, ("s [mm]", "s1", "s1"), strict=True):
            column.name = name

    faults = found(change)
    assert any('A1: the heading "s [mm]" has characters' in fault for fault in faults)
    assert any('has the column "s1" twice' in fault for fault in faults)


def test_rules_that_name_tables_and_long_prompts_are_found(found):
    def change(_, sheet, __):
        rule = DataValidation(type="custom", formula1="tblPoints[s1]>0", prompt="x" * 300)
        choices = DataValidation(type="list", formula1=f'"{",".join(["choice"] * 40)}"')
        for validation in (rule, choices):
            validation.add("B2")
            sheet.add_data_validation(validation)

    faults = found(change)
    assert any("a rule may not name a table" in fault for fault in faults)
    assert any("the list of a validation is longer" in fault for fault in faults)
    assert any('dataValidation prompt="xxx' in fault for fault in faults)


def test_overlapping_tables_and_merged_ranges_are_found(found):
    def change(_, sheet, __):
        sheet.add_table(Table(displayName="tblOther", ref="C1:D4"))
        sheet["D1"] = "other"
        sheet.merge_cells("E1:F2")
        sheet.merge_cells("F2:G3")

    faults = found(change)
    assert any("the tables tblPoints and tblOther overlap" in fault for fault in faults)
    assert any("merged ranges overlap" in fault for fault in faults)


@pytest.mark.parametrize(
    ("part", "old", "new", "fault"),
    [
        ("xl/worksheets/sheet1.xml", b'r="B2"', b'r="A2"', "A2 comes after A2"),
        ("xl/worksheets/sheet1.xml", b'r="B2"', b'r="B2" s="9"', "cell format 9 does not exist"),
        ("xl/tables/table1.xml", b'autoFilter ref="A1:C2"', b'autoFilter ref="A1:B2"', "filter"),
        ("xl/tables/table1.xml", b' ref="A1:C2"', b' ref="A1:D2"', "names 3 columns but is 4"),
        ("[Content_Types].xml", b"/xl/styles.xml", b"/xl/other.xml", "other.xml has a content"),
        (
            "xl/worksheets/sheet1.xml",
            b"<sheetViews>",
            b"<tableParts/><sheetViews>",
            "in this order",
        ),
        ("xl/worksheets/sheet1.xml", b'r="A1"', b'r="a1"', 'c r="a1"'),
        ("xl/tables/table1.xml", b' displayName="tblPoints"', b"", "table lacks displayName"),
        ("xl/_rels/workbook.xml.rels", b"theme/theme1.xml", b"theme/no.xml", "which is missing"),
    ],
)
def test_faults_of_the_package_are_found(found, part, old, new, fault):
    faults = found(replace=(part, old, new))
    assert any(fault in line for line in faults), faults


def test_texts_in_formulas_are_not_taken_for_formulas():
    assert list(formula_faults("IF(A1=\";[@x] SUMME(\",1,'a;b'!A1)")) == []
    assert list(formula_faults("SUM({1;2})+_xlfn.STDEV.S(A1:A2)")) == []
