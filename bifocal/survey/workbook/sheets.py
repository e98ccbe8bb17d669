"""The sheets of a new survey workbook, built with openpyxl: see `bifocal.survey.workbook.book`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from openpyxl import Workbook
from openpyxl.styles import Alignment, Font, PatternFill, Protection
from openpyxl.utils import absolute_coordinate, get_column_letter
from openpyxl.workbook.defined_name import DefinedName
from openpyxl.worksheet.datavalidation import DataValidation
from openpyxl.worksheet.worksheet import Worksheet

from bifocal.survey.workbook.columns import TEXT_KEYS, SurveyColumn, row_formula
from bifocal.survey.workbook.words import label, word
from photocore.workbook.cells import CellValue
from photocore.workbook.look import HEAD_FILL, INPUT_EDGE, INPUT_FILL, add_table
from photocore.workbook.newbook import RowBlock

_FACE = "Calibri"
FORMULA_FONT = Font(name=_FACE, size=11, color="1F3FA8")
TITLE_FONT = Font(name=_FACE, size=14, bold=True)
HEAD_FONT, LABEL_FONT = Font(name=_FACE, size=11, bold=True), Font(name=_FACE, size=9)
NOTE_FONT = Font(name=_FACE, size=11, italic=True, color="595959")
#: Fill and text of each flag; the word itself always stands in the cell too.
FLAG_COLOURS = {
    "OK": ("E2F0D9", "1E5B12"),
    "ON-PLANE": ("DDEBF7", "1F4E79"),
    "WEAK": ("FFF2CC", "7F6000"),
    "UNCERTAIN": ("FCE4D6", "9C3D00"),
    "NADIR": ("EDEDED", "3B3B3B"),
    "OFF-RADIAL": ("F8CBCB", "8B0000"),
    "CHECK": ("E4DFEC", "3F2A63"),
}


#: The values of a table's columns, by key.
Cells = Mapping[str, Sequence[CellValue]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TableContent:
    """A table as built: its columns and their values by key."""

    columns: Sequence[SurveyColumn]
    cells: Cells


@dataclass(slots=True, eq=False)
class BookBuilder:
    """A workbook under construction with the values its formula cells will show."""

    language: str
    book: Workbook = field(default_factory=Workbook)
    results: dict[str, dict[str, CellValue]] = field(default_factory=dict)
    blocks: dict[str, RowBlock] = field(default_factory=dict)
    tables: dict[str, TableContent] = field(default_factory=dict)

    def sheet(self, name: str, note: str = "") -> SheetBuilder:
        """Add a sheet with its title and, by its key, one line of help."""
        first = len(self.book.sheetnames) == 1 and not self.results
        sheet = self.book.active if first else self.book.create_sheet()
        assert sheet is not None
        sheet.title = name
        self.results[name] = {}
        sheet["A1"], sheet["A1"].font = word(name, self.language), TITLE_FONT
        if note:
            sheet["A2"], sheet["A2"].font = word(note, self.language), NOTE_FONT
        sheet.sheet_view.showGridLines = False
        sheet.sheet_view.zoomScale = 100
        return SheetBuilder(book=self, worksheet=sheet)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SheetBuilder:
    """One sheet of a workbook under construction."""

    book: BookBuilder
    worksheet: Worksheet

    def text(self, cell: str, value: str, font: Font | None = None) -> None:
        """Write a text."""
        self.worksheet[cell].value = value
        self.worksheet[cell].data_type = "s"
        if font is not None:
            self.worksheet[cell].font = font

    def word(self, cell: str, key: str, font: Font | None = None) -> None:
        """Write a word in the language of the workbook."""
        self.text(cell, word(key, self.book.language), font)

    def formula(
        self, cell: str, text: str, value: CellValue, *, form: str = "", name: str = "",
        editable: bool = False,
    ) -> None:  # fmt: skip
        """Write a formula with its value."""
        target = self.worksheet[cell]
        target.value, target.font = "=" + text, FORMULA_FONT
        self.book.results[self.worksheet.title][cell] = value
        self._dress(cell, form, name, editable=editable)

    def input(self, cell: str, value: CellValue, *, form: str = "", name: str = "") -> None:
        """Write a cell that the user fills in."""
        target = self.worksheet[cell]
        if value is not None and value == value and value != "":
            target.value = value
            if isinstance(value, str):
                target.data_type = "s"
            else:
                self.book.results[self.worksheet.title][cell] = float(value)
        self._dress(cell, form, name, editable=True)

    def _dress(self, cell: str, form: str, name: str, *, editable: bool) -> None:
        """Give a cell its number format, its name, and the look of one that may be changed."""
        target = self.worksheet[cell]
        if editable:
            target.fill, target.border = INPUT_FILL, INPUT_EDGE
            target.protection = Protection(locked=False)
        if form:
            target.number_format = form
        if name:
            self.name_area(name, cell)

    def name_area(self, name: str, first: str, last: str = "") -> None:
        """Give a cell, or an area from its first to its last cell, a name."""
        cells = ":".join(absolute_coordinate(cell) for cell in (first, last) if cell)
        place = f"'{self.worksheet.title}'!{cells}"
        self.book.book.defined_names[name] = DefinedName(name, attr_text=place)

    def table(
        self,
        name: str,
        columns: Sequence[SurveyColumn],
        *,
        at: tuple[int, int],
        rows: int,
        cells: Cells,
        repeat: bool = False,
        short: bool = False,
    ) -> None:
        """Write a table: labels, keys, rows.

        Parameters
        ----------
        at : tuple of int
            Row of the keys (labels stand above) and first column.
        rows : int
            Rows of the table.
        cells : mapping
            Key to values; shorter than ``rows`` where the rest is blank.
        repeat : bool
            Write one prototype row and leave the rest to `finish_book`; for a table that starts in
            column A and has nothing beside it.
        short : bool
            Write formulas as A1 references.
        """
        head, left = at
        sheet, self.book.tables[name] = self.worksheet, TableContent(columns=columns, cells=cells)
        letters = {c.key: get_column_letter(left + i) for i, c in enumerate(columns)}
        for i, column in enumerate(columns):
            above, key = sheet.cell(head - 1, left + i), sheet.cell(head, left + i)
            above.value, above.font = label(column.key, self.book.language), LABEL_FONT
            above.alignment = Alignment(wrap_text=True, vertical="bottom", horizontal="center")
            key.value, key.font, key.fill = column.key, HEAD_FONT, HEAD_FILL
            key.alignment = Alignment(horizontal="center")
            width = sheet.column_dimensions[letters[column.key]]
            width.width = max(width.width if width.customWidth else 0, column.width)
            if column.folded:
                width.outlineLevel, width.hidden = 1, True
            for row in range(head + 1, head + 1 + (1 if repeat else rows)):
                cell = sheet.cell(row, left + i)
                value = None if repeat else _at(cells, column, row - head)
                self._cell(cell.coordinate, name, column, value)
        sheet.row_dimensions[head - 1].height = 38
        self._add_table(name, columns, at, rows)
        if repeat:
            block = _block(name, columns, head + 1, rows, cells, letters, short)
            self.book.blocks[sheet.title] = block
            for i, formula in block.formulas.items():
                sheet.cell(head + 1, left + i).value = f"={formula(head + 1)}"

    def _cell(self, place: str, table: str, column: SurveyColumn, value: CellValue) -> None:
        """Write one cell of a table."""
        form, cell = _number_format(column), self.worksheet[place]
        if column.kind == "formula":
            self.formula(place, row_formula(table, column.formula)[1:], value, form=form)
        else:
            self.input(place, value, form=form)
        if column.kind == "value":
            cell.fill, cell.protection = PatternFill(), Protection(locked=True)
        if column.key in ("flag", "use", "verdict"):
            cell.alignment = Alignment(horizontal="center")

    def _add_table(
        self, name: str, columns: Sequence[SurveyColumn], at: tuple[int, int], rows: int
    ) -> None:
        head, left = at
        last = get_column_letter(left + len(columns) - 1)
        reference = f"{get_column_letter(left)}{head}:{last}{head + rows}"
        texts = [row_formula(name, c.formula)[1:] if c.kind == "formula" else "" for c in columns]
        keyed = zip((column.key for column in columns), texts, strict=True)
        add_table(self.worksheet, name, reference, keyed)

    def validate(
        self, cells: str, *, choices: str = "", above_zero: bool = False, limit: float = 1e7
    ) -> None:
        """Refuse what cannot be meant."""
        if choices:
            rule = DataValidation(type="list", formula1=f'"{choices}"', allow_blank=True)
        elif above_zero:
            rule = DataValidation(type="decimal", operator="greaterThan", formula1="0")
        else:
            low, high = f"{-limit:.0f}", f"{limit:.0f}"
            rule = DataValidation(type="decimal", operator="between", formula1=low, formula2=high)
        rule.allow_blank, rule.showErrorMessage = True, True
        rule.add(cells)
        self.worksheet.add_data_validation(rule)

    def finish(
        self, *, landscape: bool = False, freeze: str = "", repeat: str = "", guarded: bool = True
    ) -> None:
        """Set A4, one page wide, repeated headings, a footer with the page number; protect.

        Protection is against slips, without a password; filters and widths stay free.
        """
        sheet = self.worksheet
        if freeze:
            sheet.freeze_panes = freeze
        sheet.page_setup.paperSize = sheet.PAPERSIZE_A4
        sheet.page_setup.orientation = "landscape" if landscape else "portrait"
        sheet.sheet_properties.pageSetUpPr.fitToPage = True
        sheet.page_setup.fitToWidth, sheet.page_setup.fitToHeight = 1, 0
        if repeat:
            sheet.print_title_rows = repeat
        sheet.oddFooter.left.text = "&F · &A"
        sheet.oddFooter.right.text = f"{word('page', self.book.language)} &P / &N"
        margins = sheet.page_margins
        margins.left = margins.right = 0.5
        margins.top = 0.6
        # The footer stands within the bottom margin: text and what printers cannot reach.
        margins.bottom, margins.footer = 0.9, 0.4
        guard = sheet.protection
        if guarded:
            guard.sheet = True
            guard.formatCells = guard.formatColumns = guard.formatRows = False
            guard.sort = guard.autoFilter = False


def _at(cells: Cells, column: SurveyColumn, row: int) -> CellValue:
    values = cells.get(column.key, ())
    return values[row - 1] if row <= len(values) else column.spare


def _number_format(column: SurveyColumn) -> str:
    if column.places is not None:
        return "0." + "0" * column.places if column.places else "0"
    # Names typed as 1-2 must not turn into dates: text, but only where text is typed.
    if column.key == "scale":
        return '"1:"0'
    return "@" if column.kind == "input" and column.key in TEXT_KEYS else "General"


def _block(
    table: str,
    columns: Sequence[SurveyColumn],
    first: int,
    rows: int,
    cells: Cells,
    letters: Mapping[str, str],
    short: bool,
) -> RowBlock:
    """Return the rows that `finish_book` makes of the prototype."""
    listed = [list(cells.get(column.key, ())) for column in columns]
    listed = [values + [None] * (rows - len(values)) for values in listed]
    formulas = {}
    if short:
        for i, column in enumerate(columns):
            if column.kind == "formula":
                formulas[i] = _short_formula(table, column.formula, letters, first - 1)
    return RowBlock(row=first, columns=listed, formulas=formulas)


def _short_formula(table: str, text: str, letters: Mapping[str, str], head: int):  # type: ignore[no-untyped-def]
    """Return a function of the row that writes the formula with A1 references."""
    text = text.replace(f"ROW()-ROW({table}[[#Headers],[id]])", "\0")
    parts = re.split(r"\[@(\w+)\]", text)
    pieces = [letters[part] if i % 2 else part for i, part in enumerate(parts)]

    def formula(row: int) -> str:
        joined = "".join(f"{part}{row}" if i % 2 else part for i, part in enumerate(pieces))
        return joined.replace("\0", str(row - head))

    return formula
