"""Files that are no workbooks, damaged ones and hostile ones: one clear message."""

import io
import resource
import time
import zipfile
from functools import partial

import pytest

from bifocal import InputError
from photocore.tables import Column, read_named_values, read_table
from photocore.workbook.changing.editor import WorkbookEditor
from photocore.workbook.reading import package
from tests.golden import make_rich_workbook

COLUMNS = (Column("id", kind="text"), Column("s1", required=True), Column("s2"))
SHEET = "xl/worksheets/sheet1.xml"
MAIN = make_rich_workbook.MAIN


def rebuilt(**replaced):
    """Return the bytes of a workbook with parts replaced (None leaves a part out)."""
    parts = make_rich_workbook.parts() | replaced.pop("parts", {})
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in parts.items():
            if data is not None:
                file.writestr(name, data)
    return stream.getvalue()


def sheet(body):
    return rebuilt(parts={SHEET: f'<worksheet xmlns="{MAIN}">{body}</worksheet>'.encode()})


def rows(*cells):
    return sheet(f"<sheetData><row r='1'>{''.join(cells)}</row></sheetData>")


def ods(content, **more):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        file.writestr("content.xml", content)
        for name, data in more.items():
            file.writestr(name.replace("_", "/").replace("|", "."), data)
    return stream.getvalue()


BOMB = b"<worksheet>" + b" " * 30_000_000 + b"</worksheet>"
LAUGHS = (
    b'<!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>'
    b"<worksheet><sheetData><row><c><v>&b;</v></c></row></sheetData></worksheet>"
)
EXTERNAL = b'<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><worksheet>&a;</worksheet>'
ODS_HEAD = (
    '<o:document xmlns:o="o" xmlns:t="t"><o:body><o:spreadsheet><t:table t:name="S">'
    '<t:table-row t:number-rows-repeated="{rows}"><t:table-cell o:value-type="float" o:value="1" '
    't:number-columns-repeated="{columns}"/></t:table-row></t:table></o:spreadsheet></o:body>'
    "</o:document>"
)

MALFORMED = {
    "empty": (b"", "the file is empty"),
    "text": (b"id,s1\nP1,2\n", "is not a workbook"),
    "html": (b"<html><table></table></html>", "is not a workbook"),
    "image": (b"\x89PNG\r\n\x1a\n0000", "is not a workbook"),
    "pdf": (b"%PDF-1.7 ...", "is not a workbook"),
    "ole": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "protected by a password or of the"),
    "cut short": (rebuilt()[:-300], "not a workbook or is damaged"),
    "only PK": (b"PK\x03\x04" + bytes(50), "not a workbook or is damaged"),
    "other zip": (
        rebuilt(parts={"[Content_Types].xml": None}),
        "not a workbook",
    ),
    "no root relations": (rebuilt(parts={"_rels/.rels": None}), "not a workbook"),
    "no workbook part": (rebuilt(parts={"xl/workbook.xml": None}), "not a workbook"),
    "no sheet part": (
        rebuilt(parts={f"xl/worksheets/sheet{i}.xml": None for i in (1, 2, 3)}),
        "no sheet with cells",
    ),
    "document instead": (rebuilt(parts={"xl/workbook.xml": b"<document/>"}), "another kind of"),
    "broken XML": (sheet("<sheetData><row>"), "not valid XML"),
    "broken workbook XML": (rebuilt(parts={"xl/workbook.xml": b"<workbook"}), "not valid XML"),
    "broken relations": (rebuilt(parts={"_rels/.rels": b"&&"}), "not valid XML"),
    "broken strings": (rebuilt(parts={"xl/sharedStrings.xml": b"<sst><si>"}), "not valid XML"),
    "broken table": (rebuilt(parts={"xl/tables/table1.xml": b"<table/>"}), "has no range"),
    "broken table range": (
        rebuilt(parts={"xl/tables/table1.xml": b'<table ref="A:"/>'}),
        "has no range",
    ),
    "binary sheet": (rebuilt(parts={SHEET: bytes(range(256))}), "not valid XML"),
    "billion laughs": (rebuilt(parts={SHEET: LAUGHS}), "document type"),
    "external entity": (rebuilt(parts={SHEET: EXTERNAL}), "document type"),
    "entities in the strings": (rebuilt(parts={"xl/sharedStrings.xml": LAUGHS}), "document type"),
    "zip bomb": (partial(rebuilt, parts={SHEET: BOMB}), "grows .*-fold"),
    "bomb elsewhere": (
        partial(rebuilt, parts={"xl/media/image1.png": bytes(40_000_000)}),
        "grows .*-fold",
    ),
    "path out": (rebuilt(parts={"../evil.xml": b"x"}), "lies outside"),
    "absolute path": (rebuilt(parts={"/etc/evil": b"x"}), "lies outside"),
    "too many parts": (
        partial(rebuilt, parts={f"x/{i}": b"" for i in range(10_001)}),
        r"\d+ parts, more than 10000",
    ),
    "no such string": (rows("<c r='A1' t='s'><v>99</v></c>"), "Points: damaged near row 1"),
    "string number text": (rows("<c r='A1' t='s'><v>x</v></c>"), "Points: damaged near row 1"),
    "number not a number": (rows("<c r='A1'><v>x</v></c>"), "Points: damaged near row 1"),
    "bad row number": (sheet("<sheetData><row r='x'/></sheetData>"), "Points: damaged near"),
    "bad merge": (
        sheet("<sheetData/><mergeCells><mergeCell ref='??'/></mergeCells>"),
        "Points: damaged near",
    ),
    "bad style number": (
        rebuilt(parts={"xl/styles.xml": b"<s><numFmt numFmtId='x' formatCode='d'/></s>"}),
        "styles have a number format",
    ),
    "openDocument as xlsx": (ods("<a/>"), "OpenDocument file; give it the ending .ods"),
}


MALFORMED_ODS = [
    (b"", "empty"),
    (b"text", "not a workbook"),
    (ods("<a>"), "not valid XML"),
    (ods("<a/>"), "has no sheet"),
    (rebuilt(), "not an OpenDocument"),
    (ods(ODS_HEAD.format(rows=1, columns=10**9)), "beyond the size of any real sheet"),
    (ods(ODS_HEAD.format(rows=10**9, columns=10**4)), "beyond the size of any real sheet"),
    (ods(ODS_HEAD.format(rows="x", columns=1)), "damaged"),
    (ods(LAUGHS), "document type"),
    (
        ods("<a/>", **{"META-INF_manifest|xml": "<m:encryption-data/>"}),
        "protected by a password",
    ),
]

MALFORMED_TEXT = [
    (b"", "empty"),
    (b"  \n \n", "empty"),
    (rebuilt(), "is a workbook, not a text table"),
    (b"id,s1\n\x00\x00\x00", "is not a text table"),
    (b"\xff\xfei\x00d\x00,", "broken UTF-16"),
    (b'id,s1\nP1,"1\n' + b"x" * 200_000, "quotation mark"),
    (b"id,s2\nP1,1\n", 'no column s1; the headings are "id"'),
]

HEADING = "<row r='1'><c r='A1' t='inlineStr'><is><t>s1</t></is></c></row>"


def with_a_cell_in_the_last_corner():
    return sheet(
        f"<sheetData>{HEADING}<row r='2'><c r='A2'><v>5</v></c></row>"
        "<row r='1048576'><c r='XFD1048576'><v>1</v></c></row></sheetData>"
    )


def of_many_rows():
    body = "".join(f"<row r='{r}'><c r='A{r}'><v>{r}</v></c></row>" for r in range(2, 400_000))
    return sheet(f"<sheetData>{HEADING}{body}</sheetData>")


def check(path, message):
    with pytest.raises(InputError, match=message) as caught:
        read_table(path, COLUMNS)
    with pytest.raises(InputError):
        read_named_values(path, [Column("c_1", required=True)])
    assert path.name in str(caught.value)


@pytest.mark.parametrize("name", MALFORMED)
def test_a_file_that_is_no_sound_workbook_is_refused_with_its_reason(tmp_path, name):
    content, message = MALFORMED[name]
    path = tmp_path / "survey.xlsx"
    path.write_bytes(content() if callable(content) else content)
    check(path, message)


@pytest.mark.parametrize("name", ["empty", "ole", "zip bomb", "path out", "cut short", "text"])
def test_the_editor_refuses_the_same_files(tmp_path, name):
    content, message = MALFORMED[name]
    path = tmp_path / "survey.xlsx"
    path.write_bytes(content() if callable(content) else content)
    with pytest.raises(InputError, match=message):
        WorkbookEditor(path)


@pytest.mark.parametrize(("content", "message"), MALFORMED_ODS)
def test_a_file_that_is_no_sound_opendocument_is_refused(tmp_path, content, message):
    path = tmp_path / "survey.ods"
    path.write_bytes(content)
    check(path, message)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("survey.xls", "save the workbook as .xlsx"),
        ("survey.xlsb", "save the workbook as .xlsx"),
        ("survey.pages", 'the ending ".pages" is not known'),
        ("missing.xlsx", "no such file"),
        ("missing.csv", "no such file"),
    ],
)
def test_other_kinds_of_files_are_named(tmp_path, name, message):
    if "missing" not in name:
        (tmp_path / name).write_bytes(rebuilt())
    check(tmp_path / name, message)


def test_a_folder_is_no_table(tmp_path):
    for ending in ("xlsx", "csv", "ods"):
        (tmp_path / f"folder.{ending}").mkdir()
        check(tmp_path / f"folder.{ending}", "is a folder")


@pytest.mark.parametrize(("content", "message"), MALFORMED_TEXT)
def test_a_file_that_is_no_text_table_is_refused(tmp_path, content, message):
    path = tmp_path / "survey.csv"
    path.write_bytes(content)
    check(path, message)


def test_an_encrypted_member_is_a_password(tmp_path):
    content = bytearray(rebuilt())
    start = content.rfind(b"PK\x01\x02")
    content[start + 8] |= 1
    path = tmp_path / "survey.xlsx"
    path.write_bytes(content)
    check(path, "protected by a password")


def test_a_cell_in_the_last_corner_of_the_sheet_is_no_row(tmp_path):
    path = tmp_path / "survey.xlsx"
    path.write_bytes(with_a_cell_in_the_last_corner())
    assert read_table(path, COLUMNS).numbers("s1").tolist() == [5.0]


def test_formatted_empty_rows_do_not_count_as_rows(tmp_path):
    path = tmp_path / "survey.xlsx"
    empty = "".join(f"<row r='{r}'><c r='A{r}' s='1'/></row>" for r in range(3, 60_000))
    path.write_bytes(
        sheet(f"<sheetData>{HEADING}<row r='2'><c r='A2'><v>5</v></c></row>{empty}</sheetData>")
    )
    assert len(read_table(path, COLUMNS, max_rows=100)) == 1


@pytest.mark.acceptance
def test_a_sheet_of_a_million_rows_leads_to_csv_before_it_is_read_whole(tmp_path):
    path = tmp_path / "survey.xlsx"
    path.write_bytes(of_many_rows())
    check(path, r"more than 100000 rows. Save the sheet as .csv")


def test_strict_workbooks_are_read(tmp_path):
    strict = "http://purl.oclc.org/ooxml/spreadsheetml/main"
    parts = make_rich_workbook.parts()
    names = ("xl/workbook.xml", SHEET, "xl/_rels/workbook.xml.rels", "_rels/.rels")
    changed = {
        name: parts[name]
        .replace(MAIN.encode(), strict.encode())
        .replace(
            make_rich_workbook.OFFICE.encode(),
            b"http://purl.oclc.org/ooxml/officeDocument/relationships",
        )
        for name in names
    }
    path = tmp_path / "survey.xlsx"
    path.write_bytes(rebuilt(parts=changed))
    assert read_table(path, COLUMNS).numbers("s1").tolist() == [12.5, 14.75]


def test_values_from_other_workbooks_are_used_as_stored_with_a_remark(tmp_path):
    relations = make_rich_workbook.parts()["xl/_rels/workbook.xml.rels"]
    link = f'<Relationship Id="x" Type="{make_rich_workbook.OFFICE}/externalLink" Target="y.xml"/>'
    relations = relations.replace(b"</Relationships>", f"{link}</Relationships>".encode())
    path = tmp_path / "survey.xlsx"
    path.write_bytes(rebuilt(parts={"xl/_rels/workbook.xml.rels": relations}))
    assert "refers to other workbooks" in read_table(path, COLUMNS).remarks[0]


def test_the_limits_are_those_of_the_documentation():
    assert package.LARGEST_RATIO == 250
    assert package.LARGEST_PART == 256 * 2**20
    assert package.LARGEST_TOTAL == 512 * 2**20
    assert package.MOST_MEMBERS == 10_000


@pytest.mark.parametrize("seed", range(4))
def test_damaged_bytes_never_raise_anything_but_an_input_error(tmp_path, seed):
    import numpy as np

    random = np.random.default_rng(seed)
    original = rebuilt()
    plain = make_rich_workbook.parts()
    for number in range(60):
        if number % 2:
            content = bytearray(original)
            for position in random.integers(0, len(content), 6):
                content[position] = random.integers(256)
        else:
            names = [SHEET, "xl/workbook.xml", "xl/styles.xml", "xl/tables/table1.xml"]
            name = names[random.integers(len(names))]
            part = bytearray(plain[name])
            for position in random.integers(60, len(part), 2):
                part[position] = b"<>\"'= 0A1Z&/"[random.integers(12)]
            content = rebuilt(parts={name: bytes(part)})
        path = tmp_path / f"{number}.xlsx"
        path.write_bytes(content)
        try:
            read_table(path, COLUMNS)
            editor = WorkbookEditor(path)
            editor.set_value(editor.titles[0], 3, 2, 7.0)
            editor.append_columns("tblPoints", {"s1": [1.0]})
            editor.save(tmp_path / "out.xlsx", overwrite=True)
        except InputError:
            pass


def cost(path, message):
    """Return the processor time [s] and the growth of the peak memory [MiB] of a refusal."""
    begin, memory = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    check(path, message)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
    return time.process_time() - begin, grown / 1024


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("ending", "content", "message"),
    [
        *(("xlsx", *MALFORMED[name]) for name in MALFORMED),
        *(("ods", *case) for case in MALFORMED_ODS),
        *(("csv", *case) for case in MALFORMED_TEXT),
        ("xlsx", of_many_rows, r"more than 100000 rows"),
    ],
)
def test_a_refusal_costs_little_time_and_memory(tmp_path, ending, content, message):
    path = tmp_path / f"survey.{ending}"
    path.write_bytes(content() if callable(content) else content)
    seconds, mebibytes = cost(path, message)
    assert seconds < 5
    assert mebibytes < 488


@pytest.mark.acceptance
def test_a_cell_in_the_last_corner_of_the_sheet_costs_nothing(tmp_path):
    path = tmp_path / "survey.xlsx"
    path.write_bytes(with_a_cell_in_the_last_corner())
    begin = time.process_time()
    read_table(path, COLUMNS)
    assert time.process_time() - begin < 1


def test_rows_of_styled_empty_cells_shrink_more_than_a_large_part_may(tmp_path):
    path = tmp_path / "styled.xlsx"
    rows = b"".join(b'<row r="%d">%s</row>' % (i, b'<c s="12"/>' * 300) for i in range(3000))
    path.write_bytes(rebuilt(parts={SHEET: b"<worksheet>" + rows + b"</worksheet>"}))
    with package.open_package(path) as opened:
        assert max(i.file_size / i.compress_size for i in opened.infolist()) > 255
