"""Forty workbooks full of what people use: results go in, all else comes back byte for byte."""

from __future__ import annotations

import io
import itertools
import re
import zipfile

import openpyxl
import pytest
from openpyxl.chart import BarChart, LineChart, PieChart, Reference
from openpyxl.comments import Comment
from openpyxl.drawing.image import Image
from openpyxl.formatting.rule import ColorScaleRule, FormulaRule
from openpyxl.styles import Font, PatternFill
from openpyxl.workbook.defined_name import DefinedName
from openpyxl.worksheet.datavalidation import DataValidation
from openpyxl.worksheet.table import Table
from PIL import Image as Picture

from bifocal import Taking, solve
from bifocal.workbook.output import write_result
from tests.bifocal.workbook.filled_forms import POINTS, rows
from tests.bifocal.workbook.test_survey_workbook import parts

MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
X14 = "http://schemas.microsoft.com/office/spreadsheetml/2009/9/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
#: Parts that no library writes for us, with their kinds; their content is never looked at.
RAW = {
    "vba": (
        "xl/vbaProject.bin",
        "http://schemas.microsoft.com/office/2006/relationships/vbaProject",
    ),
    "pivot": ("xl/pivotCache/pivotCacheDefinition1.xml", f"{OFFICE}/pivotCacheDefinition"),
    "slicer": ("xl/slicerCaches/slicerCache1.xml", f"{OFFICE}/slicerCache"),
    "timeline": ("xl/timelineCaches/timelineCache1.xml", f"{OFFICE}/timelineCache"),
    "connections": ("xl/connections.xml", f"{OFFICE}/connections"),
    "custom": ("customXml/item1.xml", f"{OFFICE}/customXml"),
    "persons": ("xl/persons/person.xml", f"{OFFICE}/person"),
    "metadata": ("xl/metadata.xml", f"{OFFICE}/sheetMetadata"),
    "chain": ("xl/calcChain.xml", f"{OFFICE}/calcChain"),
    "richdata": ("xl/richData/rdrichvalue.xml", f"{OFFICE}/rdRichValue"),
}
#: Parts of the sheet with the table, and what its XML gains behind the cells.
SHEET_RAW = {
    "header picture": ("xl/drawings/vmlDrawing9.vml", "vmlDrawing", ""),
    "query table": ("xl/queryTables/queryTable1.xml", "queryTable", ""),
    "threads": ("xl/threadedComments/threadedComment1.xml", "threadedComment", ""),
    "controls": ("xl/ctrlProps/ctrlProp1.xml", "ctrlProp", ""),
    "printer": ("xl/printerSettings/printerSettings1.bin", "printerSettings", ""),
    "pivot table": ("xl/pivotTables/pivotTable1.xml", "pivotTable", ""),
    "slicer list": ("xl/slicers/slicer1.xml", "slicer", ""),
    "x14": (
        "xl/embeddings/oleObject1.bin",
        "oleObject",
        f'<extLst><ext uri="{{CCE6A557-97BC-4b89-ADB6-D9C93CAAB3DF}}" xmlns:x14="{X14}">'
        '<x14:dataValidations count="1"><x14:dataValidation type="list"><x14:formula1><xm:f '
        'xmlns:xm="http://schemas.microsoft.com/office/excel/2006/main">Note!$A$1:$A$3</xm:f>'
        "</x14:formula1></x14:dataValidation></x14:dataValidations></ext></extLst>",
    ),
}


def charts(_, sheet):
    for kind, place in ((BarChart, "M2"), (LineChart, "M20"), (PieChart, "M40")):
        chart = kind()
        chart.add_data(Reference(sheet, min_col=2, max_col=4, min_row=3))
        sheet.add_chart(chart, place)


def images(book, sheet):
    data = io.BytesIO()
    Picture.new("RGB", (30, 20), "red").save(data, "png")
    sheet.add_image(Image(data), "N5")
    book["Note"].add_image(Image(io.BytesIO(data.getvalue())), "B2")


def comments(book, sheet):
    sheet["B4"].comment = Comment("gemessen bei Regen", "Ada")
    book["Note"]["A1"].comment = Comment("siehe Plan", "Ada")


def rules(_, sheet):
    sheet.conditional_formatting.add("B4:E9", ColorScaleRule("min", None, "FF0000", "max"))
    fill = PatternFill("solid", start_color="FFFF00")
    sheet.conditional_formatting.add("A4:A9", FormulaRule(formula=['$A4="P2"'], fill=fill))
    choice = DataValidation(type="list", formula1='"a,b"', showInputMessage=True)
    choice.add("H4:H9")
    sheet.add_data_validation(choice)


def listed(book, sheet):
    book["Note"].append(["a", "b"])
    book["Note"].append([1, 2])
    book["Note"].add_table(Table(displayName="Liste", ref="A4:B5"))
    sheet.auto_filter.ref = "A3:E7"


def named(book, sheet):
    book.defined_names["Punkte"] = DefinedName("Punkte", attr_text="'Feld'!$A$4:$A$7")
    book.defined_names["fern"] = DefinedName("fern", attr_text="[1]Blatt!$A$1")
    sheet.print_title_rows, sheet.print_area = "1:3", "A1:H40"


def layout(book, sheet):
    sheet.merge_cells("A1:E1")
    sheet.row_dimensions[5].hidden = True
    sheet.row_dimensions[6].height = 30
    sheet.column_dimensions["G"].outlineLevel = 1
    sheet.freeze_panes, sheet.sheet_view.zoomScale = "B4", 85
    sheet.oddHeader.center.text = "&G Rilievo"
    sheet.protection.sheet = True
    sheet.protection.password = "geheim"
    book["Note"].sheet_state = "hidden"


def formulas(book, sheet):
    sheet["G4"], sheet["G5"] = "=B4*2", "=SUM(B4:B7)"
    book["Note"]["C1"] = "=Feld!B4"
    sheet["B4"].font = Font(name="Arial", size=8, bold=True)
    sheet["H1"].hyperlink = "https://example.org/"


MADE = {f.__name__: f for f in (charts, images, comments, rules, listed, named, layout, formulas)}
#: Each alone, and pairs of them.
CORPUS = [
    *((name,) for name in (*MADE, *RAW, *SHEET_RAW, "strict", "prefixed", "crlf")),
    *itertools.islice(itertools.combinations([*MADE], 2), 0, 28, 2),
    (*MADE, *RAW, *SHEET_RAW),
]


def related(data, number, part, kind):
    entry = f'<Relationship Id="rIdX{number}" Type="{kind}" Target="/{part}"/></Relationships>'
    return data.replace(b"</Relationships>", entry.encode())


def made(path, features):
    """Write a workbook with the features, its table in the second sheet below a title."""
    book = openpyxl.Workbook()
    book.active.title = "Note"
    for text in ("Müller", "Fassade & Turm", "<3"):
        book["Note"].append([text])
    sheet = book.create_sheet("Feld")
    sheet["A1"] = "Aufmaß"
    for row, values in enumerate([("id", "x1", "y1", "x2", "y2"), *rows(POINTS)], start=3):
        for column, value in enumerate(values, start=1):
            sheet.cell(row, column, value)
    for feature in features:
        if feature in MADE:
            MADE[feature](book, sheet)
    buffer = io.BytesIO()
    book.save(buffer)
    content = parts(buffer)
    book_rels = "xl/_rels/workbook.xml.rels"
    rels, field = "xl/worksheets/_rels/sheet2.xml.rels", "xl/worksheets/sheet2.xml"
    empty = b'<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    types = b""
    for number, feature in enumerate(features):
        if feature in RAW:
            part, kind = RAW[feature]
            content[part] = f"<{feature}/>".encode() * 3
            content[book_rels] = related(content[book_rels], number, part, kind)
        elif feature in SHEET_RAW:
            part, kind, more = SHEET_RAW[feature]
            content[part] = f"<{kind}/>".encode() * 3
            content.setdefault(rels, empty + b"</Relationships>")
            content[rels] = related(content[rels], number, part, f"{OFFICE}/{kind}")
            content[field] = content[field].replace(
                b"</worksheet>", more.encode() + b"</worksheet>"
            )
        else:
            continue
        types += f'<Override PartName="/{part}" ContentType="application/x-{number}"/>'.encode()
    name = "[Content_Types].xml"
    content[name] = content[name].replace(b"</Types>", types + b"</Types>")
    if "strict" in features:
        for key, data in content.items():
            data = data.replace(MAIN.encode(), b"http://purl.oclc.org/ooxml/spreadsheetml/main")
            content[key] = data.replace(
                OFFICE.encode(), b"http://purl.oclc.org/ooxml/officeDocument/relationships"
            )
    if "prefixed" in features:
        for key in (field, "xl/workbook.xml", "xl/styles.xml"):
            data = re.sub(rb"<(/?)(?=[A-Za-z])", rb"<\1x:", content[key])
            content[key] = data.replace(b'xmlns="', b'xmlns:x="')
    if "crlf" in features:
        content[field] = content[field].replace(b"<row ", b"\r\n<row ")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        for key, data in content.items():
            package.writestr(key, data)
    return path


def outside_cells(data):
    """Return a sheet without its cells, what states their extent, and which columns are folded."""
    data = re.sub(rb' outlineLevelCol="\d+"', b"", data)
    data = re.sub(rb"<(\w+:)?cols>.*?</(\w+:)?cols>", b"", data, flags=re.DOTALL)
    data = re.sub(rb"<(\w+:)?sheetData\b.*</(\w+:)?sheetData\s*>", b"", data, flags=re.DOTALL)
    return re.sub(rb"<(\w+:)?dimension [^>]*>", b"", data)


def columns_of(data):
    """Return what is stated of each column of a sheet, by its number: width, style and the like."""
    stated = {}
    for col in re.findall(rb"<(?:\w+:)?col ([^>]*?)/?>", data):
        said = dict(re.findall(rb'(\w+)="([^"]*)"', col))
        first, last = int(said.pop(b"min")), int(said.pop(b"max"))
        stated |= dict.fromkeys(range(first, min(last, first + 500) + 1), said)
    return stated


def cells_of(path, title):
    from photocore.workbook.changing.editor import WorkbookEditor

    return WorkbookEditor(path).grid(title).rows


def put_in(path):
    solution = solve(path, taking=Taking(d1=17.5, d2=9.5, c1=35, c2=19))
    write_result(path, solution, overwrite=True)
    return solution


REST = pytest.mark.acceptance
#: By default: all at once, forms of the XML, and what stands where the results go.
ALONE = (CORPUS[-1], *((name,) for name in ("strict", "prefixed", "crlf", "formulas", "layout")))


@pytest.mark.parametrize(
    "features", [pytest.param(f, marks=() if f in ALONE else REST) for f in CORPUS], ids=" ".join
)
def test_results_go_in_and_all_else_stays(tmp_path, features):
    path = made(tmp_path / "own.xlsx", features)
    before, rows_before = parts(path), cells_of(path, "Feld")
    solution = put_in(path)
    after, rows_after = parts(path), cells_of(path, "Feld")
    mine = {"xl/worksheets/sheet2.xml", "xl/workbook.xml", "xl/styles.xml", "[Content_Types].xml"}
    mine |= {"xl/_rels/workbook.xml.rels"}
    if "formulas" in features:
        mine.add("xl/worksheets/sheet1.xml")  # a stored result that may be stale is taken out
    assert {name for name in before if before[name] != after.get(name)} <= mine
    assert list(after)[: len(before)] == list(before)
    field = "xl/worksheets/sheet2.xml"
    assert outside_cells(after[field]) == outside_cells(before[field])
    for row, cells in rows_before.items():
        kept = {column: rows_after[row].get(column) for column in cells}
        if "formulas" not in features:
            assert kept == cells
    last = max(max(cells) for cells in rows_before.values())
    stated, kept = columns_of(before[field]), columns_of(after[field])
    for column in range(1, last + 1):
        assert kept.get(column) == stated.get(column)
    heads = {rows_after[3][column]: column for column in rows_after[3] if column > last}
    for i, r in enumerate(solution.table["r"].tolist()):
        assert rows_after[4 + i][heads["r [m]"]] == r
    for name in ("xl/workbook.xml", "xl/styles.xml"):
        assert len(re.findall(rb"<(?:\w+:)?(?:definedNames|cellXfs)\b", after[name])) == 1
    # Solved again from the workbook alone: the same numbers, and a backup of both states.
    again = solve(path)
    assert again.table["r"].tolist() == solution.table["r"].tolist()


def test_a_survey_workbook_with_large_shared_strings_is_changed_in_place(tmp_path):
    path = made(tmp_path / "own.xlsx", ("charts",))
    content = parts(path)
    text = "".join(f"<si><t>{i} {'x' * 400}</t></si>" for i in range(20_000))
    content["xl/sharedStrings.xml"] = f'<sst xmlns="{MAIN}">{text}</sst>'.encode()
    content["xl/_rels/workbook.xml.rels"] = related(
        content["xl/_rels/workbook.xml.rels"], 9, "xl/sharedStrings.xml", f"{OFFICE}/sharedStrings"
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as package:
        for key, data in content.items():
            package.writestr(key, data)
    put_in(path)
    assert parts(path)["xl/sharedStrings.xml"] == content["xl/sharedStrings.xml"]


@pytest.mark.office
@pytest.mark.acceptance
def test_the_corpus_opens_in_libreoffice_with_the_same_results(tmp_path):
    from tests.office import recalculated

    for number, features in enumerate(CORPUS):
        if len(features) == 1:
            continue  # each is in pairs too
        path = made(tmp_path / f"own{number}.xlsx", features)
        if {*RAW, *SHEET_RAW} & set(features):
            continue  # made-up parts: LibreOffice reads them and finds nothing in them
        solution = put_in(path)
        values = set(recalculated(path, tmp_path)["Feld"].values())
        for r in solution.table["r"].tolist():
            assert any(
                v == pytest.approx(r, rel=1e-12) for v in values if isinstance(v, int | float)
            )
