"""OpenDocument spreadsheets, by hand and as LibreOffice writes them."""

import datetime
import zipfile

import openpyxl
import pytest

from bifocal import WorkbookError
from photocore.tables import Column, read_named_values, read_table
from tests import office

COLUMNS = (Column("id", kind="text"), Column("s1"), Column("s2"))
CONTENT = """<?xml version="1.0" encoding="UTF-8"?>
<office:document-content xmlns:office="o" xmlns:table="t" xmlns:text="x" xmlns:style="s">
<office:body><office:spreadsheet>
<table:table table:name="Notes"><table:table-row table:number-rows-repeated="1048576">
<table:table-cell table:number-columns-repeated="16384"/></table:table-row></table:table>
<table:table table:name="My points">
<table:table-row table:number-rows-repeated="2"><table:table-cell/></table:table-row>
<table:table-row><table:table-cell/>{heading}</table:table-row>
{rows}
</table:table>
<table:named-expressions><table:named-range table:name="c_1"
 table:cell-range-address="$'My points'.$C$4"/></table:named-expressions>
</office:spreadsheet></office:body></office:document-content>"""


def text(value):
    return (
        '<table:table-cell office:value-type="string"><office:annotation><text:p>note</text:p>'
        f"</office:annotation><text:p>{value}</text:p></table:table-cell>"
    )


def number(value, more=""):
    return f'<table:table-cell office:value-type="float" office:value="{value}" {more}/>'


def row(*cells, more=""):
    return f"<table:table-row {more}><table:table-cell/>{''.join(cells)}</table:table-row>"


@pytest.fixture
def file(tmp_path):
    """Return a function that writes rows to an .ods file and returns its path."""

    def write(*rows):
        path = tmp_path / "survey.ods"
        heading = "".join(map(text, ("id", "s1 [mm]", "s2")))
        with zipfile.ZipFile(path, "w") as package:
            package.writestr("content.xml", CONTENT.format(heading=heading, rows="\n".join(rows)))
        return path

    return write


def test_values_names_units_and_places_are_read(file):
    path = file(
        row(text("P<text:s text:c='2'/>1"), number(0.1), number(7)), row(number(2), number(3))
    )
    table = read_table(path, COLUMNS)
    assert table.texts("id") == ["P  1", "2"]
    assert table.numbers("s1").tolist() == [0.1, 3.0]
    assert (table.sheet, table.cell(1, "s1"), table.units) == ("My points", "C5", {"s1": "mm"})
    assert read_named_values(path, [Column("c_1")]).number("c_1") == 0.1


def test_repeated_rows_and_cells_are_repeated(file):
    again = row(
        text("P"),
        number(5, 'table:number-columns-repeated="2"'),
        more='table:number-rows-repeated="3"',
    )
    table = read_table(file(again), COLUMNS)
    assert table.numbers("s1").tolist() == table.numbers("s2").tolist() == [5.0] * 3


def test_hidden_rows_are_used_with_a_remark(file):
    hidden = row(text("P2"), number(2), number(2), more='table:visibility="filter"')
    path = file(row(text("P1"), number(1), number(1)), hidden)
    assert "1 hidden or filtered rows are used too" in read_table(path, COLUMNS).remarks[0]
    assert read_table(path, COLUMNS, visible_only=True).texts("id") == ["P1"]


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ('<table:table-cell office:value-type="date" office:date-value="2026-05-01"/>', "1.5"),
        ('<table:table-cell office:value-type="time" office:time-value="PT01H"/>', "time of day"),
        ('<table:table-cell office:value-type="boolean" office:boolean-value="true"/>', "TRUE"),
        (
            '<table:table-cell table:formula="of:=1/0" office:value-type="string">'
            "<text:p>#DIV/0!</text:p></table:table-cell>",
            "holds the error #DIV/0!",
        ),
        (number(1, 'table:number-rows-spanned="2"'), "are merged"),
    ],
)
def test_bad_cells_are_named(file, cell, message):
    path = file(row(text("P1"), cell, number(1)), row(text("P2"), number(1), number(1)))
    with pytest.raises(WorkbookError, match=rf"survey.ods › My points!C4 \(s1\): .*{message}"):
        read_table(path, COLUMNS)


@pytest.mark.acceptance
@pytest.mark.office
def test_what_libreoffice_writes_reads_the_same_as_the_workbook(tmp_path):
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Points"
    for cells in (["id", "s1", "s2"], ["001", 0.1, "=B2*3"], [" a  b ", "2,5", 1 / 3]):
        sheet.append(cells)
    sheet.row_dimensions[3].hidden = True
    book.create_sheet("Dates")["A1"] = datetime.date(2026, 5, 1)
    path = tmp_path / "book.xlsx"
    book.save(path)
    table = read_table(office.convert(path, tmp_path, "ods"), COLUMNS)
    again = read_table(office.convert(path, tmp_path / "again"), COLUMNS)
    assert table.texts("id") == again.texts("id") == ["001", "a  b"]
    assert table.numbers("s1").tolist() == again.numbers("s1").tolist() == [0.1, 2.5]
    assert table.numbers("s2") == pytest.approx(again.numbers("s2"), rel=1e-14)
    assert table.remarks == again.remarks
