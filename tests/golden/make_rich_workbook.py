"""Write a macro workbook with everything that openpyxl would drop on saving.

The parts are the smallest that still are what Excel writes: text box, picture, chart, slicer,
sparkline, threaded comment, form control, custom view, macros, header picture, x14 format.
Run it to look at the file: ``python tests/golden/make_rich_workbook.py rich.xlsm``.
"""

from __future__ import annotations

import base64
import sys
import zipfile
from pathlib import Path

MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
X14 = "http://schemas.microsoft.com/office/spreadsheetml/2009/9/main"
EXCEL_MAIN = "http://schemas.microsoft.com/office/excel/2006/main"
DRAWING = "http://schemas.openxmlformats.org/drawingml/2006"
HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\r\n'
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5E"
    "rkJggg=="
)

TYPES = {
    "xl/workbook.xml": "application/vnd.ms-excel.sheet.macroEnabled.main+xml",
    "xl/worksheets/sheet1.xml": "{o}spreadsheetml.worksheet+xml",
    "xl/worksheets/sheet2.xml": "{o}spreadsheetml.worksheet+xml",
    "xl/worksheets/sheet3.xml": "{o}spreadsheetml.worksheet+xml",
    "xl/styles.xml": "{o}spreadsheetml.styles+xml",
    "xl/sharedStrings.xml": "{o}spreadsheetml.sharedStrings+xml",
    "xl/calcChain.xml": "{o}spreadsheetml.calcChain+xml",
    "xl/tables/table1.xml": "{o}spreadsheetml.table+xml",
    "xl/drawings/drawing1.xml": "{o}drawing+xml",
    "xl/charts/chart1.xml": "{o}drawingml.chart+xml",
    "xl/ctrlProps/ctrlProp1.xml": "application/vnd.ms-excel.controlproperties+xml",
    "xl/slicers/slicer1.xml": "application/vnd.ms-excel.slicer+xml",
    "xl/slicerCaches/slicerCache1.xml": "application/vnd.ms-excel.slicerCache+xml",
    "xl/threadedComments/threadedComment1.xml": "application/vnd.ms-excel.threadedcomments+xml",
    "xl/persons/person.xml": "application/vnd.ms-excel.person+xml",
    "xl/comments1.xml": "{o}spreadsheetml.comments+xml",
    "xl/vbaProject.bin": "application/vnd.ms-office.vbaProject",
}


def relations(*items: tuple[str, str, str]) -> str:
    """Return a relations part of (id, type, target)."""
    inside = "".join(
        f'<Relationship Id="{key}" Type="{kind}" Target="{target}"/>' for key, kind, target in items
    )
    space = "http://schemas.openxmlformats.org/package/2006/relationships"
    return f'<Relationships xmlns="{space}">{inside}</Relationships>'


def points_sheet(prefix: str) -> str:
    """Return the sheet with the table: typed cells, shared formulas, styles, extensions."""
    rows = []
    for row, (name, s1, s2) in enumerate([(1, 12.5, 13.25), (2, 14.75, 15.5)], start=3):
        formula = (
            '<f t="shared" ref="D3:D4" si="0">C3-B3</f>' if row == 3 else '<f t="shared" si="0"/>'
        )
        rows.append(
            f'<row r="{row}" spans="1:6" ht="15" customHeight="1"><c r="A{row}" t="s">'
            f'<v>{name + 3}</v></c><c r="B{row}" s="1"><v>{s1}</v></c><c r="C{row}" s="1">'
            f'<v>{s2}</v></c><c r="D{row}">{formula}<v>0.75</v></c>'
            f'<c r="E{row}"><f>tblPoints[[#This Row],[ds]]*2</f><v>1.5</v></c></row>'
        )
    body = (
        f'<worksheet xmlns="{MAIN}" xmlns:r="{OFFICE}" '
        'xmlns:mc="http://schemas.openxmlformats.org/markup-compatibility/2006" '
        'mc:Ignorable="x14ac xr" xmlns:x14ac="urn:a" xmlns:xr="urn:b">'
        '<dimension ref="A1:E4"/><sheetViews><sheetView workbookViewId="0"><pane ySplit="2" '
        'topLeftCell="A3" state="frozen"/></sheetView></sheetViews><sheetData>'
        '<row r="2"><c r="A2" t="s"><v>0</v></c><c r="B2" t="s"><v>1</v></c><c r="C2" t="s">'
        '<v>2</v></c><c r="D2" t="s"><v>3</v></c><c r="E2" t="inlineStr"><is><t>twice</t></is></c>'
        f"</row>{''.join(rows)}</sheetData>"
        '<customSheetViews><customSheetView guid="{00000000-0000-0000-0000-000000000001}"/>'
        '</customSheetViews><conditionalFormatting sqref="B3:C4"><cfRule type="cellIs" dxfId="0" '
        'priority="1" operator="lessThan"><formula>0</formula></cfRule></conditionalFormatting>'
        '<dataValidations count="1"><dataValidation type="decimal" sqref="B3:C4"><formula1>0'
        "</formula1></dataValidation></dataValidations>"
        '<pageMargins left="1" right="1" top="1" bottom="1" header="1" footer="1"/>'
        '<drawing r:id="rId1"/><legacyDrawing r:id="rId2"/><mc:AlternateContent><mc:Choice '
        'Requires="x14"><controls><control shapeId="1025" r:id="rId3" name="Button 1"><controlPr>'
        '<anchor><from><xdr:row xmlns:xdr="urn:x">3</xdr:row></from></anchor></controlPr></control>'
        '</controls></mc:Choice></mc:AlternateContent><tableParts count="1">'
        '<tablePart r:id="rId4"/></tableParts><extLst>'
        '<ext uri="{05C60535-1F16-4fd2-B633-F4F36F0B64E0}" '
        f'xmlns:x14="{X14}" xmlns:xm="{EXCEL_MAIN}"><x14:sparklineGroups><x14:sparklineGroup>'
        "<x14:sparklines><x14:sparkline><xm:f>Points!B3:C3</xm:f><xm:sqref>F3</xm:sqref>"
        "</x14:sparkline></x14:sparklines></x14:sparklineGroup></x14:sparklineGroups>"
        "<x14:conditionalFormattings><x14:conditionalFormatting><xm:sqref>D3:D4</xm:sqref>"
        "</x14:conditionalFormatting></x14:conditionalFormattings></ext>"
        '<ext uri="{A8765BA9-456A-4dab-B4F3-ACF838C121DE}"><x14:slicerList xmlns:x14="urn:s">'
        '<x14:slicer r:id="rId7"/></x14:slicerList></ext></extLst></worksheet>'
    )
    return HEAD + prefixed(body, prefix)


def prefixed(xml: str, prefix: str) -> str:
    """Give the elements of the main namespace a prefix, as the OpenXML SDK writes them."""
    import re

    if not prefix:
        return xml
    xml = re.sub(r"<(/?)(?=[a-zA-Z0-9]+[\s/>])", rf"<\1{prefix}:", xml)
    return xml.replace(f'xmlns="{MAIN}"', f'xmlns:{prefix}="{MAIN}"')


def parts(prefix: str = "") -> dict[str, bytes]:
    """Return the parts of the package; ``prefix`` is put before the elements of the sheets."""
    office = "application/vnd.openxmlformats-officedocument."
    microsoft = "http://schemas.microsoft.com/office"
    types = "".join(
        f'<Override PartName="/{name}" ContentType="{kind.format(o=office)}"/>'
        for name, kind in TYPES.items()
    )
    space = "http://schemas.openxmlformats.org/package/2006/content-types"
    strings = ["id", "s1", "s2", "ds", "P1", "P2 é <&>", "  user's own  "]
    shared = "".join(
        f'<si><t xml:space="preserve">{t.replace("&", "&amp;").replace("<", "&lt;")}</t></si>'
        for t in strings
    )
    texts = {
        "[Content_Types].xml": f'<Types xmlns="{space}"><Default Extension="rels" ContentType="'
        'application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="xml" '
        'ContentType="application/xml"/><Default Extension="png" ContentType="image/png"/><Default '
        'Extension="vml" ContentType="application/vnd.openxmlformats-officedocument.vmlDrawing"/>'
        f"{types}</Types>",
        "_rels/.rels": relations(("rId1", f"{OFFICE}/officeDocument", "xl/workbook.xml")),
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><workbookPr '
        'codeName="ThisWorkbook"/><sheets><sheet name="Points" sheetId="1" r:id="rId1"/><sheet '
        'name="My notes" sheetId="2" r:id="rId2"/><sheet name="Far away" sheetId="3" r:id="rId3"/>'
        '</sheets><definedNames><definedName name="all_s1">Points!$B$3:$B$4</definedName>'
        "<definedName name=\"own_value\">'Far away'!$A$1</definedName></definedNames>"
        '<calcPr calcId="191029"/><customWorkbookViews><customWorkbookView name="mine" guid="'
        '{00000000-0000-0000-0000-000000000001}" windowWidth="1" windowHeight="1" '
        'activeSheetId="1"/></customWorkbookViews></workbook>',
        "xl/_rels/workbook.xml.rels": relations(
            *((f"rId{i}", f"{OFFICE}/worksheet", f"worksheets/sheet{i}.xml") for i in (1, 2, 3)),
            ("rId4", f"{OFFICE}/styles", "styles.xml"),
            ("rId5", f"{OFFICE}/sharedStrings", "sharedStrings.xml"),
            ("rId6", f"{OFFICE}/calcChain", "calcChain.xml"),
            ("rId7", f"{microsoft}/2006/relationships/vbaProject", "vbaProject.bin"),
            (
                "rId8",
                f"{microsoft}/2007/relationships/slicerCache",
                "slicerCaches/slicerCache1.xml",
            ),
            ("rId9", f"{microsoft}/2017/10/relationships/person", "persons/person.xml"),
        ),
        "xl/styles.xml": f'<styleSheet xmlns="{MAIN}"><numFmts count="1"><numFmt numFmtId="164" '
        'formatCode="0.000"/></numFmts><fonts count="1"><font><sz val="11"/><name val="Calibri"/>'
        '</font></fonts><fills count="2"><fill><patternFill patternType="none"/></fill><fill>'
        '<patternFill patternType="gray125"/></fill></fills><borders count="1"><border/></borders>'
        '<cellStyleXfs count="1"><xf/></cellStyleXfs><cellXfs count="2"><xf xfId="0"/><xf '
        'numFmtId="164" xfId="0" applyNumberFormat="1"/></cellXfs><dxfs count="1"><dxf/></dxfs>'
        "</styleSheet>",
        "xl/sharedStrings.xml": f'<sst xmlns="{MAIN}" count="7" uniqueCount="7">{shared}</sst>',
        "xl/calcChain.xml": f'<calcChain xmlns="{MAIN}"><c r="D3" i="1"/><c r="D4"/></calcChain>',
        "xl/worksheets/_rels/sheet1.xml.rels": relations(
            ("rId1", f"{OFFICE}/drawing", "../drawings/drawing1.xml"),
            ("rId2", f"{OFFICE}/vmlDrawing", "../drawings/vmlDrawing1.vml"),
            ("rId3", f"{OFFICE}/ctrlProp", "../ctrlProps/ctrlProp1.xml"),
            ("rId4", f"{OFFICE}/table", "../tables/table1.xml"),
            ("rId5", f"{OFFICE}/comments", "../comments1.xml"),
            (
                "rId6",
                f"{microsoft}/2017/10/relationships/threadedComment",
                "../threadedComments/threadedComment1.xml",
            ),
            ("rId7", f"{microsoft}/2007/relationships/slicer", "../slicers/slicer1.xml"),
        ),
        "xl/tables/table1.xml": f'<table xmlns="{MAIN}" id="1" name="tblPoints" '
        'displayName="tblPoints" ref="A2:E4" totalsRowShown="0"><autoFilter ref="A2:E4"/>'
        '<tableColumns count="5"><tableColumn id="1" name="id"/><tableColumn id="2" name="s1"/>'
        '<tableColumn id="3" name="s2"/><tableColumn id="4" name="ds"><calculatedColumnFormula>'
        'C3-B3</calculatedColumnFormula></tableColumn><tableColumn id="5" name="twice"/>'
        '</tableColumns><tableStyleInfo name="TableStyleMedium2" showRowStripes="1"/></table>',
        "xl/drawings/drawing1.xml": f'<xdr:wsDr xmlns:xdr="{DRAWING}/spreadsheetDrawing" '
        f'xmlns:a="{DRAWING}/main"><xdr:absoluteAnchor><xdr:pos x="0" y="0"/><xdr:ext cx="900000" '
        'cy="300000"/><xdr:sp macro="" textlink=""><xdr:nvSpPr><xdr:cNvPr id="2" name="TextBox 1"/>'
        '<xdr:cNvSpPr txBox="1"/></xdr:nvSpPr><xdr:spPr><a:prstGeom prst="rect"/></xdr:spPr>'
        "<xdr:txBody><a:bodyPr/><a:p><a:r><a:t>do not lose me</a:t></a:r></a:p></xdr:txBody>"
        '</xdr:sp><xdr:clientData/></xdr:absoluteAnchor><xdr:absoluteAnchor><xdr:pos x="0" '
        f'y="400000"/><xdr:ext cx="90000" cy="90000"/><xdr:pic xmlns:r="{OFFICE}"><xdr:nvPicPr>'
        '<xdr:cNvPr id="3" name="Picture 1"/><xdr:cNvPicPr/></xdr:nvPicPr><xdr:blipFill><a:blip '
        'r:embed="rId1"/><a:stretch><a:fillRect/></a:stretch></xdr:blipFill><xdr:spPr><a:prstGeom '
        'prst="rect"/></xdr:spPr></xdr:pic><xdr:clientData/></xdr:absoluteAnchor></xdr:wsDr>',
        "xl/drawings/_rels/drawing1.xml.rels": relations(
            ("rId1", f"{OFFICE}/image", "../media/image1.png"),
            ("rId2", f"{OFFICE}/chart", "../charts/chart1.xml"),
        ),
        "xl/drawings/vmlDrawing1.vml": '<xml xmlns:v="urn:v"><v:shape id="_x0000_s1025"/></xml>',
        "xl/charts/chart1.xml": f'<c:chartSpace xmlns:c="{DRAWING}/chart"><c:chart><c:plotArea>'
        '<c:scatterChart><c:scatterStyle/><c:ser><c:idx val="0"/><c:order val="0"/>'
        "<c:xVal><c:numRef><c:f>Points!$B$3:$B$4</c:f></c:numRef></c:xVal>"
        '</c:ser><c:axId val="1"/><c:axId val="2"/></c:scatterChart></c:plotArea></c:chart>'
        "</c:chartSpace>",
        "xl/ctrlProps/ctrlProp1.xml": f'<formControlPr xmlns="{X14}" objectType="Button"/>',
        "xl/slicers/slicer1.xml": f'<slicers xmlns="{X14}"><slicer name="id" cache="Slicer_id"/>'
        "</slicers>",
        "xl/slicerCaches/slicerCache1.xml": f'<slicerCacheDefinition xmlns="{X14}" '
        'name="Slicer_id" sourceName="id"/>',
        "xl/threadedComments/threadedComment1.xml": "<ThreadedComments xmlns="
        f'"{microsoft}/spreadsheetml/2018/threadedcomments"><threadedComment ref="B3" id="{{1}}">'
        "<text>look again</text></threadedComment></ThreadedComments>",
        "xl/persons/person.xml": "<personList xmlns="
        f'"{microsoft}/spreadsheetml/2018/threadedcomments"/>',
        "xl/comments1.xml": f'<comments xmlns="{MAIN}"><authors><author>me</author></authors>'
        '<commentList><comment ref="B3" authorId="0"><text><t>look again</t></text></comment>'
        "</commentList></comments>",
    }
    notes = (
        f'<worksheet xmlns="{MAIN}"><sheetData><row><c t="s"><v>6</v></c><c><f>SUM(all_s1)</f>'
        "<v>27.25</v></c></row></sheetData></worksheet>"
    )
    far = (
        f'<worksheet xmlns="{MAIN}"><sheetData><row r="1"><c r="A1"><f>1+1</f><v>2</v></c></row>'
        "</sheetData></worksheet>"
    )
    texts = {name: HEAD + text for name, text in texts.items()}
    texts["xl/worksheets/sheet1.xml"] = points_sheet(prefix)
    texts["xl/worksheets/sheet2.xml"] = HEAD + prefixed(notes, prefix)
    texts["xl/worksheets/sheet3.xml"] = HEAD + prefixed(far, prefix)
    binary = {
        "xl/vbaProject.bin": b"\xd0\xcf\x11\xe0 macros \x00\x01",
        "xl/media/image1.png": PIXEL,
    }
    return {name: text.encode() for name, text in texts.items()} | binary


def write(path: Path, prefix: str = "") -> Path:
    """Write the workbook."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        for name, data in parts(prefix).items():
            info = zipfile.ZipInfo(name, (2024, 5, 1, 12, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            package.writestr(info, data)
    return path


if __name__ == "__main__":
    write(Path(sys.argv[1]))
