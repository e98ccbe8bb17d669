"""Existing workbooks changed in place: nothing but the cells asked for may differ."""

import io
import math
import re
import zipfile
from pathlib import Path

import openpyxl
import pytest
from openpyxl.workbook.defined_name import DefinedName

from bifocal import InputError
from photocore.tables import Column, read_table
from photocore.workbook.changing.cells import NewCell, NewColumn, NewRows, RowFormula
from photocore.workbook.changing.changes import SheetChanges
from photocore.workbook.changing.editor import WorkbookEditor
from photocore.workbook.changing.splice import splice_sheet
from photocore.workbook.making.newbook import finished_parts
from photocore.workbook.reading.package import open_package
from tests import office
from tests.bare_workbook import parts
from tests.golden import make_rich_workbook

# What openpyxl says it would lose is the point of these tests.
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning:openpyxl")

POINTS = "xl/worksheets/sheet1.xml"
NOTES = "xl/worksheets/sheet2.xml"
BOOK = "xl/workbook.xml"
COLUMNS = (Column("id", kind="text"), Column("s1"), Column("s2"), Column("ds"), Column("twice"))


def differing(first, second):
    one, two = parts(first), parts(second)
    assert list(one) == list(two)
    return {name for name in one if one[name] != two[name]}


@pytest.fixture(params=["", "x"], ids=["plain", "prefixed"])
def rich(request, tmp_path):
    return make_rich_workbook.write(tmp_path / "rich.xlsm", request.param)


def splice(xml, **changes):
    data = xml.encode()
    found = splice_sheet(None, "sheet", data, SheetChanges(**changes))
    return found.joined(strip=False).decode()


def append_rows(editor, table, rows, results=()):
    """Add rows given one by one."""
    listed = (
        {key: [row[key] for row in own] for key in own[0]} if own else {} for own in (rows, results)
    )
    return editor.append_columns(table, *listed)


def set_results(editor, title, first, columns):
    """Store the results of columns."""
    for column, values in columns.items():
        for row, value in enumerate(values, start=first):
            editor.set_result(title, row, column, value)


def test_a_result_changes_only_its_sheet(rich, tmp_path):
    editor = WorkbookEditor(rich)
    editor.set_result("Points", 3, 4, 0.5)
    editor.save(tmp_path / "out.xlsm")
    assert differing(rich, tmp_path / "out.xlsm") == {POINTS}
    before, after = parts(rich)[POINTS], parts(tmp_path / "out.xlsm")[POINTS]
    assert after == before.replace(b"v>0.75<", b"v>0.5<", 1)


def test_saving_without_a_change_changes_no_part(rich, tmp_path):
    editor = WorkbookEditor(rich)
    editor.set_value("Points", 3, 1, "P1")
    editor.set_value("Points", 4, 1, "P2 é <&>")
    editor.set_value("Points", 3, 2, 12.5)
    editor.save(tmp_path / "out.xlsm")
    assert differing(rich, tmp_path / "out.xlsm") == set()


def test_a_typed_value_takes_the_results_that_depend_on_it_out(rich, tmp_path):
    out = tmp_path / "out.xlsm"
    editor = WorkbookEditor(rich)
    editor.set_value("Points", 3, 2, 12.25)
    editor.set_result("Points", 3, 4, 1.0)
    editor.save(out)
    assert differing(rich, out) == {POINTS, NOTES, BOOK}
    assert b'fullCalcOnLoad="1"' in parts(out)[BOOK]
    book = openpyxl.load_workbook(out, data_only=True)
    assert [c.value for c in book["Points"][3]][:5] == ["P1", 12.25, 13.25, 1.0, None]
    assert book["My notes"]["B1"].value is None  # SUM(all_s1), a name that leads to Points
    assert book["Far away"]["A1"].value == 2  # depends on nothing that changed
    formulas = openpyxl.load_workbook(out)
    assert formulas["Points"]["D3"].value == "=C3-B3"
    assert formulas["My notes"]["B1"].value == "=SUM(all_s1)"


def test_texts_come_back_as_they_went_in(rich, tmp_path):
    texts = ["001", "=1+1", "a\nb", "  x ", "é<&>\"'", "_x0041_", "tab\there", "#N/A", "\x0b!"]
    editor = WorkbookEditor(rich)
    for row, text in enumerate(texts, start=10):
        editor.set_value("My notes", row, 3, text)
    editor.save(tmp_path / "out.xlsm")
    grid = WorkbookEditor(tmp_path / "out.xlsm").grid("My notes")
    assert [grid.rows[row][3] for row in range(10, 10 + len(texts))] == texts
    assert differing(rich, tmp_path / "out.xlsm") == {NOTES, BOOK}


def test_numbers_come_back_to_the_last_bit(rich, tmp_path):
    numbers = [0.1, 1 / 3, 1e-300, -2.5e17, 5.0, math.pi * 1e5]
    editor = WorkbookEditor(rich)
    for row, number in enumerate(numbers, start=10):
        editor.set_value("My notes", row, 1, number)
    editor.save(tmp_path / "out.xlsm")
    grid = WorkbookEditor(tmp_path / "out.xlsm").grid("My notes")
    assert [grid.rows[row][1] for row in range(10, 10 + len(numbers))] == numbers


def test_a_formula_is_never_overwritten(rich, tmp_path):
    editor = WorkbookEditor(rich)
    editor.set_value("Points", 3, 4, 1.0)
    with pytest.raises(InputError, match=r"rich.xlsm.*D3: holds a formula"):
        editor.save(tmp_path / "out.xlsm")
    assert not (tmp_path / "out.xlsm").exists()


def test_a_value_the_user_put_in_place_of_a_formula_stays(rich, tmp_path):
    editor = WorkbookEditor(rich)
    editor.set_result("Points", 3, 2, 99.0)
    editor.save(tmp_path / "out.xlsm")
    assert differing(rich, tmp_path / "out.xlsm") == set()


def test_no_result_is_stored_as_not_available_and_infinity_is_refused(rich, tmp_path):
    editor = WorkbookEditor(rich)
    set_results(editor, "Points", 3, {4: [math.nan, 0.5], 5: ["text", True]})
    editor.save(tmp_path / "out.xlsm")
    sheet = openpyxl.load_workbook(tmp_path / "out.xlsm", data_only=True)["Points"]
    assert [sheet[c].value for c in ("D3", "D4", "E3", "E4")] == ["#N/A", 0.5, "text", True]
    with pytest.raises(InputError, match=r"Points!B3: inf is not a number"):
        editor.set_value("Points", 3, 2, math.inf)


def test_rows_are_added_to_a_table_with_formulas_formats_and_all_that_reaches_there(rich, tmp_path):
    out = tmp_path / "out.xlsm"
    editor = WorkbookEditor(rich)
    rows = append_rows(
        editor,
        "tblpoints",
        [{"id": "P3", "s1": 1.5, "s2": 2.0}, {"id": "P4", "s1": 3.0, "s2": 4.5}],
        [{"ds": 0.5, "twice": 1.0}, {"ds": 1.5, "twice": 3.0}],
    )
    assert rows == [5, 6]
    set_results(editor, "Points", 3, {4: [0.75, 0.75]})
    editor.save(out)
    changed = {POINTS, NOTES, BOOK, "xl/tables/table1.xml", "xl/charts/chart1.xml"}
    assert differing(rich, out) == changed
    new = parts(out)
    assert new["xl/tables/table1.xml"].count(b'ref="A2:E6"') == 2
    assert b"Points!$B$3:$B$6" in new["xl/charts/chart1.xml"]
    assert b"Points!$B$3:$B$6" in new[BOOK]
    assert new[POINTS].count(b'sqref="B3:C6"') == 2
    assert b"<xm:sqref>D3:D6</xm:sqref>" in new[POINTS]
    assert b'ref="A1:E6"' in new[POINTS]
    formulas = openpyxl.load_workbook(out)["Points"]
    assert [formulas[c].value for c in ("D5", "D6")] == ["=C5-B5", "=C6-B6"]
    assert formulas["E6"].value == "=tblPoints[[#This Row],[ds]]*2"
    assert formulas["B6"].number_format == "0.000"
    table = read_table(out, COLUMNS[:4], name="Points")
    assert table.texts("id") == ["P1", "P2 é <&>", "P3", "P4"]
    assert table.numbers("ds").tolist() == [0.75, 0.75, 0.5, 1.5]


def test_a_table_does_not_grow_over_other_cells(rich):
    editor = WorkbookEditor(rich)
    editor.set_value("Points", 6, 2, "my remark")
    editor.save()
    with pytest.raises(InputError, match=r"Points!B6: is not empty, so the table tblPoints"):
        WorkbookEditor(rich).append_columns("tblPoints", {}, count=2)


def test_unknown_tables_columns_and_sheets_are_named(rich):
    editor = WorkbookEditor(rich)
    with pytest.raises(InputError, match='has no table "tblX"; it has tblPoints'):
        editor.append_columns("tblX", {})
    with pytest.raises(InputError, match='tblPoints has no column "s9"'):
        editor.append_columns("tblPoints", {"s9": [1]})
    with pytest.raises(InputError, match='no sheet "X"; it has "Points", "My notes"'):
        editor.set_value("X", 1, 1, 1)


def test_in_place_a_backup_is_kept_and_macros_stay(rich):
    before = parts(rich)
    editor = WorkbookEditor(rich)
    editor.set_result("Points", 3, 4, 0.5)
    editor.save(overwrite=True)
    backup = rich.with_name("rich.xlsm.bak")
    assert parts(backup) == before
    assert parts(rich)["xl/vbaProject.bin"] == before["xl/vbaProject.bin"]


def test_the_same_changes_give_the_same_bytes(rich, tmp_path):
    for name in ("a.xlsm", "b.xlsm"):
        editor = WorkbookEditor(rich)
        editor.set_value("Points", 3, 2, 1.0)
        editor.save(tmp_path / name)
    assert (tmp_path / "a.xlsm").read_bytes() == (tmp_path / "b.xlsm").read_bytes()


@pytest.mark.parametrize(
    ("lock", "program"), [("~$rich.xlsm", "Excel"), (".~lock.rich.xlsm#", "LibreOffice")]
)
def test_a_workbook_open_elsewhere_is_left_alone(rich, lock, program):
    (rich.parent / lock).touch()
    editor = WorkbookEditor(rich)
    editor.set_value("Points", 3, 2, 1.0)
    with pytest.raises(InputError, match=rf"is open in {program}.*name another file"):
        editor.save()


def test_a_macro_workbook_stays_one(rich, tmp_path):
    with pytest.raises(InputError, match=r"must end in \.xlsm"):
        WorkbookEditor(rich).save(tmp_path / "out.xlsx")


def test_a_signed_workbook_is_refused(rich):
    with zipfile.ZipFile(rich, "a") as package:
        package.writestr("_xmlsignatures/sig1.xml", "<Signature/>")
    with pytest.raises(InputError, match="digitally signed"):
        WorkbookEditor(rich)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (
            "<w><sheetData/></w>",
            '<w><sheetData><row r="2"><c r="B2"><v>7</v></c></row></sheetData></w>',
        ),
        (
            '<w><sheetData><row r="2"/></sheetData></w>',
            '<w><sheetData><row r="2"><c r="B2"><v>7</v></c></row></sheetData></w>',
        ),
        (
            '<w><sheetData><row r="1"/><row><c/><c s="3"/><c/></row></sheetData></w>',
            '<w><sheetData><row r="1"/><row><c/><c r="B2" s="3"><v>7</v></c><c/></row>'
            "</sheetData></w>",
        ),
        (
            '<w><sheetData><row r="2"><c r="A2"/><c r="C2"/></row><row r="3"/></sheetData></w>',
            '<w><sheetData><row r="2"><c r="A2"/><c r="B2"><v>7</v></c><c r="C2"/></row>'
            '<row r="3"/></sheetData></w>',
        ),
        (
            '<w><sheetData><row r="3" ht="1>0"><c r="B3" t="s"><v>0</v></c></row></sheetData></w>',
            '<w><sheetData><row r="2"><c r="B2"><v>7</v></c></row><row r="3" ht="1>0">'
            '<c r="B3" t="s"><v>0</v></c></row></sheetData></w>',
        ),
        (
            '<x:w><x:sheetData><x:row r="2"><x:c r="B2" t="inlineStr"><x:is><x:t>a</x:t></x:is>'
            "</x:c></x:row></x:sheetData><y:row/></x:w>",
            '<x:w><x:sheetData><x:row r="2"><x:c r="B2"><x:v>7</x:v></x:c></x:row></x:sheetData>'
            "<y:row/></x:w>",
        ),
    ],
)
def test_a_cell_is_put_in_its_place_whatever_is_left_implied(before, after):
    assert splice(before, inputs={2: {2: 7.0}}) == after


@pytest.mark.parametrize("text", ["a <b> & c", "&lt;", "_x0041_", "1 < 2"])
def test_a_text_that_stands_there_already_is_no_change(text):
    empty = b"<worksheet><sheetData/></worksheet>"
    changes = SheetChanges(inputs={1: {1: text}})
    once = splice_sheet(Path("b.xlsx"), "s", empty, changes)
    assert once.inputs_changed
    again = splice_sheet(Path("b.xlsx"), "s", once.joined(strip=False), changes)
    assert not again.inputs_changed


def test_clearing_a_cell_keeps_its_format():
    before = '<w><sheetData><row r="2"><c r="B2" s="4" t="s"><v>0</v></c></row></sheetData></w>'
    assert '<c r="B2" s="4"/>' in splice(before, inputs={2: {2: None}})


def test_a_result_keeps_the_formula_of_an_array_to_the_byte():
    before = (
        '<w><sheetData><row r="2"><c r="B2" cm="1" t="e"><f t="array" ref="B2:B3" >A1&amp;"x"</f>'
        "<v>#N/A</v></c></row></sheetData></w>"
    )
    after = splice(before, cached={2: {2: "y"}})
    assert '<c r="B2" cm="1" t="str"><f t="array" ref="B2:B3" >A1&amp;"x"</f><v>y</v></c>' in after


def test_utf_16_sheets_and_damaged_ones_are_refused(tmp_path):
    with pytest.raises(InputError, match="not stored as UTF-8"):
        splice_sheet(tmp_path, "s", '<?xml version="1.0"?><w/>'.encode("utf-16"), SheetChanges())
    with pytest.raises(InputError, match="not valid XML"):
        splice_sheet(tmp_path, "s", b"<w><sheetData>", SheetChanges())


def test_a_damaged_part_is_named_with_the_users_file_not_with_a_temporary_one(tmp_path):
    path = tmp_path / "book.xlsx"
    workbook = openpyxl.Workbook()
    workbook.active["A1"] = 1.5
    workbook.create_sheet("Other")["A1"] = "kept"
    workbook.save(path)
    with zipfile.ZipFile(path) as package:
        start = package.getinfo(NOTES).header_offset + 30 + len(NOTES)
    data = bytearray(path.read_bytes())
    data[start + 5 : start + 25] = bytes(20)
    path.write_bytes(data)
    editor = WorkbookEditor(path)
    editor.set_value("Sheet", 1, 1, 2.5)
    with pytest.raises(InputError, match=f"^{path}: damaged, the part {NOTES} cannot be unpacked"):
        editor.save(tmp_path / "out.xlsx")
    assert not (tmp_path / "out.xlsx").exists()


@pytest.mark.acceptance
@pytest.mark.office
def test_libreoffice_opens_the_changed_workbook_and_calculates_the_new_rows(rich, tmp_path):
    out = tmp_path / "out.xlsm"
    editor = WorkbookEditor(rich)
    append_rows(editor, "tblPoints", [{"id": "P3", "s1": 1.5, "s2": 2.0}])
    editor.save(out)
    values = office.recalculated(out, tmp_path / "office")
    assert values["Points"]["D5"] == 0.5
    assert values["Points"]["E5"] == 1.0
    assert values["My notes"]["B1"] == 12.5 + 14.75 + 1.5


def test_an_editor_reads_the_real_samples_and_changes_one_sheet(data_dir, tmp_path):
    for path in sorted((data_dir / "spreadsheets").glob("*.xlsx")):
        editor = WorkbookEditor(path)
        editor.set_value(editor.titles[0], 5, 1, 0.125)
        editor.save(tmp_path / path.name)
        assert differing(path, tmp_path / path.name) == {"xl/worksheets/sheet1.xml"}
        with open_package(tmp_path / path.name):
            grid = WorkbookEditor(tmp_path / path.name).grid(editor.titles[0])
        assert grid.rows[5][1] == 0.125


def test_many_rows_are_added_by_columns_and_read_back_to_the_bit(rich, tmp_path):
    import numpy as np

    random = np.random.default_rng(3)
    s1, s2 = random.normal(size=(2, 5000))
    s2[7] = math.nan
    editor = WorkbookEditor(rich)
    inputs = {"id": [f"Q{i}" for i in range(5000)], "s1": s1, "s2": [*s2[:7], None, *s2[8:]]}
    editor.append_columns("tblPoints", inputs, {"ds": s2 - s1})
    set_results(editor, "Points", 3, {4: [0.75, 0.75]})
    editor.save(tmp_path / "out.xlsm")
    sheet = WorkbookEditor(tmp_path / "out.xlsm").grid("Points")
    assert [sheet.rows[row][2] for row in range(5, 5005)] == s1.tolist()
    assert 3 not in sheet.rows[12]
    assert sheet.rows[12][4].text == "#N/A"
    assert sheet.rows[5004][4] == s2[-1] - s1[-1]


def test_another_reader_sees_the_stored_results(rich, tmp_path):
    import python_calamine

    editor = WorkbookEditor(rich)
    append_rows(editor, "tblPoints", [{"id": "=P3", "s1": 0.1, "s2": 1 / 3}], [{"ds": 7 / 30}])
    set_results(editor, "Points", 3, {4: [0.5, math.nan], 5: ["text", 1e-9]})
    editor.save(tmp_path / "out.xlsm")
    book = python_calamine.CalamineWorkbook.from_path(tmp_path / "out.xlsm")
    rows = book.get_sheet_by_name("Points").to_python()[-3:]
    assert rows[0][:5] == ["P1", 12.5, 13.25, 0.5, "text"]
    assert rows[1][4] == 1e-9
    assert rows[2][:4] == ["=P3", 0.1, 1 / 3, 7 / 30]


def test_blocks_and_typed_cells_meet_in_rows_that_exist_or_not():
    before = '<w><sheetData><row r="3"><c r="A3" s="5"/><c r="C3"/></row></sheetData></w>'
    columns = [
        NewColumn(1, [1.0, 2.0, None], "7"),
        NewColumn(2, [5.0, None, 6.0], "", RowFormula("A1*$A$1", 1).at),
    ]
    changes = SheetChanges(added=[NewRows(2, 3, columns)], inputs={4: {4: "note"}})
    after = splice_sheet(None, "s", before.encode(), changes).joined(strip=False).decode()
    assert after == (
        '<w><sheetData><row r="2"><c r="A2" s="7"><v>1</v></c><c r="B2"><f>A2*$A$1</f><v>5</v></c>'
        '</row><row r="3"><c r="A3" s="5"><v>2</v></c><c r="B3"><f>A3*$A$1</f></c><c r="C3"/></row>'
        '<row r="4"><c r="A4" s="7"/><c r="B4"><f>A4*$A$1</f><v>6</v></c><c r="D4" '
        't="inlineStr"><is><t xml:space="preserve">note</t></is></c></row></sheetData></w>'
    )


@pytest.mark.parametrize(
    ("formula", "moved"),
    [
        ("A2+B$2+$C2", "A7+B$2+$C7"),
        ("SUM(A1:A2)-SUM(2:2)", "SUM(A6:A7)-SUM(7:7)"),
        ("'A2 sheet'!A2&\"A2\"", "'A2 sheet'!A7&\"A2\""),
        ("tbl_A2[[#This Row],[A2]]*c_1*LOG10(A2)", "tbl_A2[[#This Row],[A2]]*c_1*LOG10(A7)"),
        ("Sheet2!A2*XFD2+A2_x+A2.x", "Sheet2!A7*XFD7+A2_x+A2.x"),
    ],
)
def test_a_formula_copied_downwards_moves_its_relative_rows_only(formula, moved):
    from openpyxl.formula.translate import Translator

    assert RowFormula(formula, 2).at(7) == moved
    if "_x" not in formula:
        assert Translator(f"={formula}", "F2").translate_formula("F7") == f"={moved}"


PLAIN_CHANGES = [
    {"inputs": {2: {1: "new", 3: 7.5}, 9: {2: True}}},
    {"cached": {3: {4: 0.25, 2: 5.0}, 4: {4: math.nan}}, "restates": True},
    {"added": [("filled", 2, 4)], "inputs": {3: {2: 9.0}}},
    {"added": [("filled", 2, 2)]},
    {"added": [("filled", 2, 2)], "inputs": {2: {2: 1.5}, 3: {2: 2.25}}},
    {"added": [("filled", 2, 2)], "inputs": {2: {3: 1.5}, 3: {3: 2.25}}},
    {"added": [("filled", 3, 1)]},
    {"placed": {2: {4: 1.5}, 3: {1: "over"}, 12: {4: 2.5}}},
]


@pytest.mark.parametrize("changes", PLAIN_CHANGES)
def test_a_plain_sheet_changes_as_by_the_parser(changes):
    cells = (
        '<row r="2" spans="1:4"><c r="A2" t="inlineStr"><is><t>P1 &amp; Ö</t></is></c>'
        '<c r="B2" s="3"><v>1.5</v></c><c r="C2"><v/></c>'
        '<c r="D2" s="1"><f>A2&lt;B2</f><v>0.5</v></c></row>'
        '<row r="3" hidden="1"><c r="A3" t="s"><v>0</v></c><c r="B3"><v>2</v></c>'
        '<c r="C3"><v></v></c> <c r="D3" s="4" t="str"><f>"x"</f><v>x</v></c></row>'
        '<row r="4"><c r="D4"><f>1/0</f></c></row><row r="5"/><row r="7"><c r="B7" s="2"/></row>'
    )
    plain = f'<worksheet><dimension ref="A2:D7"/><sheetData>{cells}</sheetData></worksheet>'
    # A comment is beyond the plain form: the XML parser takes over.
    other = plain.replace("</sheetData>", "<!-- --></sheetData>")
    kinds = dict(changes)
    if "added" in kinds:
        rule, first, size = kinds["added"][0]
        columns = [NewColumn(4, [1.0, "", None, 4.0], "5", lambda row: f"B{row}*2")]
        kinds["added"] = [NewRows(first, size, columns, rule)]
    if "placed" in kinds:
        kinds["placed"] = {
            row: {column: NewCell(value, "B2*3", "6", "over") for column, value in given.items()}
            for row, given in kinds["placed"].items()
        }

    def spliced(text):
        found = splice_sheet(None, "s", text.encode(), SheetChanges(**kinds), lambda: ["P2"])
        return [found.joined(strip=strip).replace(b"<!-- -->", b"") for strip in (False, True)] + [
            found.inputs_changed,
            found.formula_lost,
        ]

    assert spliced(plain) == spliced(other)
    assert spliced(plain)[0] != plain.encode()


def test_a_sheet_added_under_another_title_prints_its_own_headings(tmp_path):
    made = openpyxl.Workbook()
    made.active.title = "Dose's"
    made.active.print_title_rows, made.active.print_area = "4:5", "A1:C9"
    package = io.BytesIO()
    made.save(package)
    own = openpyxl.Workbook()
    own.active.title = "Dose's"
    own.save(tmp_path / "own.xlsx")
    editor = WorkbookEditor(tmp_path / "own.xlsx")
    title = editor.free_title("Dose's")
    editor.add_sheets(finished_parts(package, results={}), {"Dose's": title})
    editor.save(tmp_path / "out.xlsx", overwrite=False)
    with zipfile.ZipFile(tmp_path / "out.xlsx") as file:
        book = file.read("xl/workbook.xml").decode()
    names = re.findall(r"<definedName [^>]*localSheetId=\"1\"[^>]*>([^<]*)<", book)
    assert sorted(names) == ["'Dose''s 2'!$4:$5", "'Dose''s 2'!$A$1:$C$9"]


def test_names_of_a_sheet_added_under_another_title_lead_to_it_and_those_of_others_stay(tmp_path):
    """The user's own sheet has the title; "own" led to it before, "more" leads elsewhere."""
    made, user = openpyxl.Workbook(), openpyxl.Workbook()
    user.create_sheet("Else")
    for book in (made, user):
        book.worksheets[0].title = "Dose"
    for book, names in (
        (made, {"own": "'Dose'!$B$2", "more": "'Dose'!$B$3", "new": "'Dose'!$B$4"}),
        (user, {"own": "'Dose'!$A$1", "more": "'Else'!$C$3"}),
    ):
        for name, place in names.items():
            book.defined_names[name] = DefinedName(name, attr_text=place)
    made.save(package := io.BytesIO())
    user.save(tmp_path / "own.xlsx")
    editor = WorkbookEditor(tmp_path / "own.xlsx")
    editor.add_sheets(finished_parts(package, results={}), {"Dose": "Dose 2"})
    editor.save(tmp_path / "out.xlsx", overwrite=False)
    names = openpyxl.load_workbook(tmp_path / "out.xlsx").defined_names
    assert {name: names[name].attr_text for name in ("own", "more", "new")} == {
        "own": "'Dose 2'!$B$2", "more": "'Else'!$C$3", "new": "'Dose 2'!$B$4",
    }  # fmt: skip
