"""Sheets that are odd, though some program may write them: nothing is misread, nothing lost."""

from __future__ import annotations

import zipfile

import pytest

from bifocal import InputError
from photocore.workbook.changing.changes import replaced_outside_cells
from photocore.workbook.changing.editor import WorkbookEditor
from photocore.workbook.changing.result_columns import head_row
from photocore.workbook.reading.ods import open_ods
from photocore.workbook.reading.xlsx import open_xlsx
from tests.bare_workbook import write

#: What the plain form takes, and what is left to the XML parser.
WAYS = pytest.mark.parametrize("end", ["", "<!-- -->"], ids=["plain", "parser"])


def sheet(tmp_path, rows, strings=()):
    text = f"<worksheet><sheetData>{rows}</sheetData></worksheet>"
    return write(tmp_path / "s.xlsx", text, strings=strings)


def grid(path):
    return open_xlsx(path, max_rows=2**20).grid("S")


@WAYS
def test_a_row_that_stands_twice_is_read_whole(tmp_path, end):
    rows = '<row r="1"><c r="A1"><v>1</v></c></row><row r="1"><c r="B1"><v>2</v></c></row>'
    assert grid(sheet(tmp_path, rows + end)).rows == {1: {1: 1.0, 2: 2.0}}


@WAYS
def test_hidden_rows_are_seen_however_yes_is_written(tmp_path, end):
    row = '<row r="{0}" hidden="{1}"><c r="A{0}"><v>1</v></c></row>'
    words = ["1", "true", "on", "0", "false"]
    rows = "".join(row.format(*pair) for pair in enumerate(words, start=1))
    assert grid(sheet(tmp_path, rows + end)).hidden == {1, 2, 3}


@WAYS
def test_a_shared_string_that_is_none_is_refused_with_its_row(tmp_path, end):
    row = '<row r="{0}"><c r="A{0}" t="s"><v>{1}</v></c></row>'
    rows = row.format(7, 0) + row.format(8, -1)
    path = sheet(tmp_path, rows + end, ["first", "last"])
    with pytest.raises(InputError, match="damaged near row 8"):
        grid(path)


@WAYS
def test_a_blank_value_with_many_spaces_is_none(tmp_path, end):
    rows = '<row r="1"><c r="A1"><v        /></c><c r="B1"><v>2</v></c></row>'
    assert grid(sheet(tmp_path, rows + end)).rows == {1: {2: 2.0}}


ROW1, ROW3 = '<row r="1"><c r="A1"><v>1</v></c></row>', '<row r="3"><c r="A3"><v>3</v></c></row>'
DISORDER = [
    ROW3 + ROW1,
    ROW1 + ROW1,
    '<row r="1"><c r="C1"><v>3</v></c><c r="A1"><v>1</v></c></row>',
    '<row r="1"><c r="A1"><v>3</v></c><c r="A1"><v>1</v></c></row>',
]


@WAYS
@pytest.mark.parametrize("rows", DISORDER)
def test_no_second_cell_is_put_into_a_sheet_out_of_order(tmp_path, rows, end):
    path = sheet(tmp_path, rows + end)
    before = path.read_bytes()
    editor = WorkbookEditor(path)
    editor.set_value("S", 1, 1, 9.0)
    with pytest.raises(InputError, match="not in their order"):
        editor.save(overwrite=True)
    assert path.read_bytes() == before
    assert [own.name for own in tmp_path.iterdir()] == ["s.xlsx"]


@WAYS
@pytest.mark.parametrize("kind", ["array", "dataTable"])
def test_nothing_is_typed_over_a_result_of_an_array_formula(tmp_path, kind, end):
    rows = (
        f'<row r="1"><c r="A1"><f t="{kind}" ref="A1:B2">C1:D2</f><v>1</v></c>'
        '<c r="C1"><v>5</v></c></row><row r="2"><c r="B2"><v>4</v></c></row>'
    )
    path = sheet(tmp_path, rows + end)
    editor = WorkbookEditor(path)
    editor.set_value("S", 2, 2, 9.0)
    with pytest.raises(InputError, match="B2: is part of an array formula"):
        editor.changed_parts()
    editor = WorkbookEditor(path)
    editor.set_value("S", 2, 2, 4.0)
    editor.set_value("S", 1, 3, 6.0)
    assert b'<c r="C1"><v>6</v></c>' in editor.changed_parts()["xl/s.xml"]


@pytest.mark.parametrize("prefix", ["", "x:"])
def test_texts_outside_the_cells_are_replaced_there_alone(prefix):
    cells = f"<{prefix}sheetData><{prefix}t>Points</{prefix}t></{prefix}sheetData>"
    data = f"{cells}<{prefix}oddFooter>Points</{prefix}oddFooter>".encode()
    changed = replaced_outside_cells(data, b"Points", b"Punkte")
    assert changed == f"{cells}<{prefix}oddFooter>Punkte</{prefix}oddFooter>".encode()
    chart = b"<c:v>Points</c:v>"
    assert replaced_outside_cells(chart, b"Points", b"Punkte") == b"<c:v>Punkte</c:v>"


def test_what_is_drawn_upon_a_cell_of_an_ods_is_no_text_of_it(tmp_path):
    spaces = {
        "office": "office", "table": "table", "text": "text", "draw": "drawing", "dr3d": "dr3d"
    }  # fmt: skip
    names = "".join(
        f' xmlns:{key}="urn:oasis:names:tc:opendocument:xmlns:{name}:1.0"'
        for key, name in spaces.items()
    )
    drawn = "<draw:frame><draw:text-box><text:p>arrow</text:p></draw:text-box></draw:frame>"
    content = (
        f"<office:document-content{names}><office:body><office:spreadsheet>"
        f'<table:table table:name="S"><table:table-row><table:table-cell>{drawn}</table:table-cell>'
        f'<table:table-cell office:value-type="string"><text:p>P1</text:p>{drawn}'
        "</table:table-cell></table:table-row></table:table></office:spreadsheet></office:body>"
        "</office:document-content>"
    )
    with zipfile.ZipFile(tmp_path / "s.ods", "w") as package:
        package.writestr("content.xml", content)
    assert open_ods(tmp_path / "s.ods", max_rows=99).grid("S").rows == {1: {2: "P1"}}


def test_headings_are_found_above_blank_rows_and_below_other_words():
    cells = {1: {2: "A survey"}, 2: {1: 5.0, 2: " r [m] "}, 3: {2: "metres"}}
    columns, headings = {"id": 1, "r": 2}, {"id": "id", "r": "r [m]"}
    assert head_row(cells, columns, headings, 6) == 2
    assert head_row({1: cells[1]}, columns, headings, 6) == 5
