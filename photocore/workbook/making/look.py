"""How new workbooks look: one face, one scale of sizes, colours, tables, pages to print."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from openpyxl import Workbook
from openpyxl.formatting.rule import FormulaRule
from openpyxl.styles import Border, Font, PatternFill, Side
from openpyxl.utils import get_column_letter
from openpyxl.utils.indexed_list import IndexedList
from openpyxl.worksheet.pagebreak import Break, ColBreak
from openpyxl.worksheet.table import Table, TableFormula, TableStyleInfo
from openpyxl.worksheet.worksheet import Worksheet

#: A face that Windows, macOS and (as Liberation Sans, of the same widths) Linux have.
FACE = "Arial"
#: The scale of sizes. [pt]
TITLE, HEAD, BODY, LABEL = 14, 10, 10, 9
ROW_HEIGHT = 13.5
BLUE, GREY = "1F3FA8", "595959"
TITLE_FONT = Font(name=FACE, size=TITLE, bold=True)
HEAD_FONT = Font(name=FACE, size=HEAD, bold=True)
BODY_FONT, LABEL_FONT = Font(name=FACE, size=BODY), Font(name=FACE, size=LABEL)
FORMULA_FONT = Font(name=FACE, size=BODY, color=BLUE)
NOTE_FONT = Font(name=FACE, size=BODY, italic=True, color=GREY)
WARN_FONT = Font(name=FACE, size=BODY, bold=True, color="8B0000")
INPUT_FILL = PatternFill("solid", start_color="FFF9DB", end_color="FFF9DB")
HEAD_FILL = PatternFill("solid", start_color="DCE6F1", end_color="DCE6F1")
INPUT_EDGE = Border(*(Side(style="hair", color="BFBFBF"),) * 4)
#: Fill and ink of what is good, doubtful, wrong; the word itself always stands in the cell too.
GOOD, DOUBT, WRONG = ("E2F0D9", "1E5B12"), ("E4DFEC", "3F2A63"), ("F8CBCB", "8B0000")

#: Margins left and right, and the sides of A4. [inch]
_MARGIN, _SHORT, _LONG = 0.4, 8.27, 11.69
#: What one unit of a column's width is on paper: LibreOffice's, Excel's is 5.25. [pt]
_DIGIT = 5.56


def new_book() -> Workbook:
    """Return an empty workbook whose ordinary cells have the face and size of all."""
    book = Workbook()
    book._fonts = IndexedList([BODY_FONT])
    book._named_styles["Normal"].font = BODY_FONT
    return book


def add_table(sheet: Worksheet, name: str, area: str, columns: Iterable[tuple[str, str]]) -> None:
    """Make a table of an area; of each column its key and its formula, empty for typed cells."""
    table = Table(displayName=name, name=name, ref=area)
    table._initialise_columns()
    for described, (key, formula) in zip(table.tableColumns, columns, strict=True):
        described.name = key
        if formula:
            described.calculatedColumnFormula = TableFormula(attr_text=formula)
    table.tableStyleInfo = TableStyleInfo(name="TableStyleLight1", showRowStripes=False)
    sheet.add_table(table)


def colour_words(
    sheet: Worksheet,
    area: str,
    colours: Mapping[str, tuple[str, str]],
    *,
    bold: Collection[str] = (),
    stop: bool | None = None,
) -> None:
    """Colour the cells of a column, fill and ink, by the word they hold, which tells the same."""
    first = area.partition(":")[0]
    for text, colour in colours.items():
        weight = (text in bold) if bold else None
        colour_where(sheet, area, f'${first}="{text}"', colour, bold=weight, stop=stop)


def colour_where(
    sheet: Worksheet,
    area: str,
    formula: str,
    colour: tuple[str, str],
    *,
    bold: bool | None = None,
    stop: bool | None = None,
) -> None:
    """Colour the cells of an area, fill and ink, where a formula holds."""
    fill, ink = colour
    rule = FormulaRule(
        formula=[formula],
        fill=PatternFill("solid", start_color=fill, end_color=fill),
        font=Font(color=ink) if bold is None else Font(color=ink, bold=bold),
        stopIfTrue=stop,
    )
    sheet.conditional_formatting.add(area, rule)


def strike_out(sheet: Worksheet, area: str, formula: str) -> None:
    """Strike out the cells of an area, grey and without any other colour, where a formula holds.

    To be called before other rules of these cells, since the first that holds counts.
    """
    blank = PatternFill("solid", start_color="FFFFFF", end_color="FFFFFF")
    font = Font(color="7F7F7F", strike=True, bold=False)
    rule = FormulaRule(formula=[formula], fill=blank, font=font, stopIfTrue=True)
    sheet.conditional_formatting.add(area, rule)


def prepare_page(
    sheet: Worksheet,
    *,
    landscape: bool,
    page: str,
    repeat: str = "",
    scale: int = 0,
) -> None:
    """Set A4, one page wide, repeated headings, a footer with file, sheet, date and page number.

    Parameters
    ----------
    sheet : Worksheet
    landscape : bool
    page : str
        The word before the page number.
    repeat : str
        Rows printed on every page: ``"3:4"``.
    scale : int
        Fixed scale with breaks between the columns where a page is full, its first column
        repeated, instead of one page's width. [%]
    """
    sheet.page_setup.paperSize = sheet.PAPERSIZE_A4
    sheet.page_setup.orientation = "landscape" if landscape else "portrait"
    sheet.sheet_properties.pageSetUpPr.fitToPage = not scale
    if scale:
        sheet.page_setup.scale = scale
        sheet.print_title_cols = "A:A"
    else:
        sheet.page_setup.fitToWidth, sheet.page_setup.fitToHeight = 1, 0
    if repeat:
        sheet.print_title_rows = repeat
    sheet.oddFooter.left.text = "&F · &A"
    sheet.oddFooter.center.text = "&D"
    sheet.oddFooter.right.text = f"{page} &P / &N"
    sheet.HeaderFooter.scaleWithDoc = False
    margins = sheet.page_margins
    margins.left = margins.right = _MARGIN
    margins.top, margins.header = 0.6, 0.3
    # The footer stands within the bottom margin: text and what printers cannot reach.
    margins.bottom, margins.footer = 0.75, 0.3


def break_columns(sheet: Worksheet, last: int, *, scale: int, before: Sequence[int] = ()) -> None:
    """Break a landscape page where it is full, the first column standing on each.

    Parameters
    ----------
    last : int
        The last column printed.
    scale : int
        Of the print. [%]
    before : sequence of int
        Columns that begin a page in any case.
    """
    space = 72 * (_LONG - 2 * _MARGIN) / (scale / 100)
    sheet.col_breaks = ColBreak()
    first = used = width_of(sheet, 1)
    is_due = False
    for column in range(2, last + 1):
        width = width_of(sheet, column)
        is_due |= column in before
        if width and (used + width > space or is_due):
            sheet.col_breaks.append(Break(id=column - 1))
            used, is_due = first, False
        used += width


def width_of(sheet: Worksheet, column: int) -> float:
    """Return the width of a column on paper at full scale, zero where it is hidden. [pt]"""
    dimension = sheet.column_dimensions.get(get_column_letter(column))
    if dimension is None:
        return 13 * _DIGIT
    return 0.0 if dimension.hidden else dimension.width * _DIGIT


def guard(sheet: Worksheet) -> None:
    """Protect a sheet against slips, without a password; filters and widths stay free."""
    protection = sheet.protection
    protection.sheet = True
    protection.formatCells = protection.formatColumns = protection.formatRows = False
    protection.sort = protection.autoFilter = False
