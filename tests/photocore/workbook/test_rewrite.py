"""No workbook is written that no program opens: parts are XML, references lead somewhere."""

import re
import zipfile

import openpyxl
import pytest
from click.testing import CliRunner

from bifocal import InputError
from photocore.workbook.reading.package import Parts, rewrite_package
from photocore.workbook.reading.references import lost_references, refuse_lost
from photocore.workbook.reading.xlsx import open_xlsx
from tests.bare_workbook import with_parts
from tests.builders.commands import bifocal_command as bifocal
from tests.builders.commands import multimedia_command as multimedia

OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"
STRICT = "http://purl.oclc.org/ooxml/officeDocument/relationships"
BOOK, RELATIONS = "xl/workbook.xml", "xl/_rels/workbook.xml.rels"
TABLES = {
    "solve": (("id", "s1", "s2", "theta"), ("P1", 4.242424, 4.470588, 90), ("P2", 4, 4, 0)),
    "shift": (("id", "X [m]", "Y [m]", "Z [m]"), ("P1", 0.3, 0.4, -0.2), ("P2", 0, 0.1, -0.1)),
}
OPTIONS = {
    "solve": (bifocal, "--d1 17.5 --d2 9.5 --c1 35 --c2 19"),
    "shift": (multimedia, "--indices 1,1.5,1.34 --thicknesses 0.01 --camera 0,0,0.51"),
}


def table_book(path, rows):
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.save(path)
    return path


def as_lxml_writes(path):
    """Declare the prefix of relations in each sheet, as openpyxl does where lxml is installed."""
    with zipfile.ZipFile(path) as package:
        data = package.read(BOOK).decode()
    prefix = re.search(rf' xmlns:(\w+)="{OFFICE}"', data)
    if prefix:
        data = data.replace(prefix[0], "").replace(f"{prefix[1]}:id", "r:id")
    data = data.replace(f' xmlns:r="{OFFICE}"', "")
    data = re.sub(r"<((?:\w+:)?sheet) ", rf'<\1 xmlns:r="{OFFICE}" ', data)
    assert data.count("xmlns:r=") == data.count("r:id=") == 1
    return with_parts(path, {BOOK: data.encode()})


@pytest.mark.parametrize("command", TABLES)
def test_a_workbook_whose_sheets_declare_their_own_prefix_stays_a_workbook(tmp_path, command):
    path = as_lxml_writes(table_book(tmp_path / "m.xlsx", TABLES[command]))
    main, options = OPTIONS[command]
    line = [command, str(path), *options.split(), "--out", str(path), "--overwrite"]
    result = CliRunner().invoke(main, line)
    assert result.exit_code == 0, result.stderr
    book = openpyxl.load_workbook(path)
    assert len(book.sheetnames) == 2
    assert [cell.value for cell in book["Sheet"][2]][:4] == list(TABLES[command][1])
    assert len(open_xlsx(path, max_rows=100).titles) == 2


FAULTS = {
    "is not valid XML: unbound prefix": {BOOK: b"<a:workbook/>"},
    "is not valid XML: mismatched tag": {"xl/worksheets/sheet1.xml": b"<worksheet></sheet>"},
    "leads to xl/lost.xml, which is missing": {
        RELATIONS: f'<Relationships xmlns="{PACKAGE}"><Relationship Id="rId1" Type="t" '
        'Target="lost.xml"/></Relationships>'.encode()
    },
    "leads to xl/styles.xml, which is missing": {"xl/styles.xml": None},
    "has no relation rId9": {BOOK: f'<b xmlns:r="{OFFICE}"><s r:id="rId9"/></b>'.encode()},
    "has no relation rId8": {BOOK: f'<b xmlns:q="{STRICT}"><s q:id="rId8"/></b>'.encode()},
}


@pytest.mark.parametrize(("said", "parts"), FAULTS.items())
def test_a_workbook_that_no_program_would_open_is_not_written(tmp_path, said, parts):
    source = table_book(tmp_path / "m.xlsx", TABLES["solve"])
    with pytest.raises(InputError, match=re.escape(said)):
        rewrite_package(source, tmp_path / "out.xlsx", Parts(parts))


@pytest.mark.parametrize("name", [BOOK, RELATIONS, "xl/worksheets/sheet1.xml"])
def test_what_was_wrong_with_a_workbook_before_is_no_reason_to_refuse_it(tmp_path, name):
    lost = f'<x xmlns:r="{OFFICE}" r:id="rId99"/>'
    external = '<Relationship Id="e" Type="t" Target="http://a/b" TargetMode="External"/>'
    links = f'<Relationships xmlns="{PACKAGE}">{external}<Relationship Id="g" Target="no.xml"/>'
    data = (f"{links}</Relationships>" if name == RELATIONS else lost).encode()
    source = with_parts(table_book(tmp_path / "m.xlsx", TABLES["solve"]), {name: data})
    rewrite_package(source, tmp_path / "out.xlsx", Parts({name: data + b"<!-- changed -->"}))
    with zipfile.ZipFile(tmp_path / "out.xlsx") as package:
        assert package.read(name).endswith(b"<!-- changed -->")


LOST = {
    "=SUM(Gone!A1:A3)": 'with the sheet "Gone"',
    "='My wall'!A1+'My wall 2'!B1": 'with the sheet "My wall 2"',
    "=SUM(tbl[r])+SUM(tbl[s])": "with tbl[s]",
    "=tbl[[#This Row],[t]]*2": "with tbl[t]",
    "=d_1+d_3": 'with the name "d_3"',
    '=IF(A1="d_9",R1C1,TRUE)&"Gone!A1"&1E-3+A$1+$B2': "",
    "=IF(ISNA(A1),#N/A,#REF!+[1]Other!A1)": "",
    "=ROW()-ROW(tbl[[#Headers],[r]])": "",
}


@pytest.mark.parametrize("formula", LOST)
def test_formulas_that_name_what_is_not_there_are_found(tmp_path, formula):
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "My wall"
    sheet["A1"], sheet["A2"], sheet["D1"] = "r", 1.5, formula
    sheet.add_table(openpyxl.worksheet.table.Table(displayName="tbl", ref="A1:A2"))
    book.defined_names["d_1"] = openpyxl.workbook.defined_name.DefinedName(
        "d_1", attr_text="'My wall'!$A$2"
    )
    book.save(tmp_path / "own.xlsx")
    found = lost_references(tmp_path / "own.xlsx")
    assert len(found) == bool(LOST[formula])
    assert all(LOST[formula] in fault for fault in found)
    # What the user's own formulas lack does not keep anybody from changing the workbook.
    refuse_lost(tmp_path / "own.xlsx", tmp_path / "own.xlsx")
    if found:
        with pytest.raises(InputError, match="nothing was written"):
            refuse_lost(tmp_path / "own.xlsx")
