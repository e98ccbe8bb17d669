"""New workbooks whose results are live formulas, calculated before they are written."""

from __future__ import annotations

import io
from collections.abc import Hashable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from openpyxl import Workbook
from openpyxl.cell import Cell
from openpyxl.chart.data_source import StrVal
from openpyxl.chart.title import Title
from openpyxl.styles import Alignment, Font, PatternFill, Protection
from openpyxl.styles.cell_style import StyleArray
from openpyxl.utils import absolute_coordinate, get_column_letter
from openpyxl.workbook.defined_name import DefinedName
from openpyxl.worksheet.datavalidation import DataValidation
from openpyxl.worksheet.worksheet import Worksheet

from photocore.workbook.calculating.calculation import Calculation
from photocore.workbook.changing.cells import ROW_MARK, CellValue, RowText
from photocore.workbook.changing.plain import MARK, PlainFormulas
from photocore.workbook.making.live_charts import linked_title
from photocore.workbook.making.live_columns import TEXT_KEYS, LiveColumn, row_formula
from photocore.workbook.making.look import (
    BODY_FONT,
    FORMULA_FONT,
    HEAD_FILL,
    HEAD_FONT,
    INPUT_EDGE,
    INPUT_FILL,
    LABEL_FONT,
    NOTE_FONT,
    ROW_HEIGHT,
    TITLE_FONT,
    add_table,
    break_columns,
    guard,
    new_book,
    prepare_page,
)
from photocore.workbook.making.newbook import RowBlock, finish_book, finished_parts, new_workbook
from photocore.workbook.making.repeated_rows import repeated_rows
from photocore.workbook.making.sketch import Sketch
from photocore.workbook.making.words import WordBook
from photocore.workbook.reading.grid import TableArea, cell_name, plain_title, split_area

#: The values of a table's columns, by key.
Cells = Mapping[str, Sequence[CellValue]]
#: What Excel takes: characters of a prompt and of its title.
_PROMPT, _PROMPT_TITLE = 255, 32


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TableContent:
    """A table as built: its columns and their values by key."""

    columns: Sequence[LiveColumn]
    cells: dict[str, Sequence[CellValue]]


@dataclass(slots=True, eq=False)
class BookBuilder:
    """A workbook under construction, and what its formula cells show."""

    language: str
    words: WordBook
    book: Workbook = field(default_factory=new_book)
    results: dict[str, dict[str, CellValue]] = field(default_factory=dict)
    blocks: dict[str, RowBlock] = field(default_factory=dict)
    tables: dict[str, TableContent] = field(default_factory=dict)
    drawings: dict[str, bytes] = field(default_factory=dict)
    looks: dict[Hashable, tuple[dict[str, object], StyleArray]] = field(default_factory=dict)
    _titles: list[tuple[str, str, StrVal]] = field(default_factory=list)

    def word(self, key: str) -> str:
        """Return a word in the language of the workbook."""
        return self.words.word(key, self.language)

    def sheet(self, name: str, note: str = "") -> SheetBuilder:
        """Add a sheet with its title and, by its key, one line of help."""
        first = len(self.book.sheetnames) == 1 and not self.results
        sheet = self.book.active if first else self.book.create_sheet()
        assert sheet is not None
        sheet.title = name
        self.results[name] = {}
        sheet["A1"], sheet["A1"].font = self.word(name), TITLE_FONT
        if note:
            sheet["A2"], sheet["A2"].font = self.word(note), NOTE_FONT
        sheet.sheet_view.showGridLines = False
        sheet.sheet_view.zoomScale = 100
        sheet.sheet_format.defaultRowHeight, sheet.sheet_format.customHeight = ROW_HEIGHT, True
        return SheetBuilder(book=self, worksheet=sheet)

    def define(self, name: str, place: str) -> None:
        """Give a place a name."""
        self.book.defined_names[name] = DefinedName(name, attr_text=place)

    def open_at(self, title: str) -> None:
        """Let the workbook open with one of its sheets."""
        self.book.active = self.book.sheetnames.index(title)
        for sheet in self.book.worksheets:
            sheet.sheet_view.tabSelected = sheet.title == title
        self.book.calculation.fullCalcOnLoad = True

    def calculate(self) -> None:
        """Fill in what the formulas give; a cell that has a value keeps it.

        Raises
        ------
        Unknown
            If a formula has something that is not known.
        """
        repeated = {title: (block.row, block.columns) for title, block in self.blocks.items()}
        calculation = Calculation(self.book, repeated, self.results)
        for (title, row, column), value in calculation.values().items():
            self.results[title][cell_name(row, column)] = value
        for title, cell, shown in self._titles:
            shown.v = str(self.results[title][cell])
        results = {}  # once: of a large book each copy is 50 MB
        for title, block in self.blocks.items():
            columns = results[title, block.row] = calculation.columns(title, block.row)
            listed = [columns.get(i, values) for i, values in enumerate(block.columns, start=1)]
            self.blocks[title] = replace(block, columns=listed)
        for sheet in self.book.worksheets:
            for table in sheet.tables.values():
                top, left, _, _ = split_area(table.ref)
                content = self.tables[table.name]
                at = sheet.title, top + 1
                columns = results[at] if at in results else calculation.columns(*at)
                for number, described in enumerate(content.columns, start=left):
                    if number in columns and described.kind == "formula":
                        content.cells[described.key] = columns[number]

    def linked_title(self, title: str, cell: str) -> Title:
        """Return the title of a chart that follows a cell."""
        shown = StrVal(idx=0, v="")
        self._titles.append((title, cell, shown))
        return linked_title(title, cell, shown)

    def value_of(self, name: str) -> CellValue:
        """Return what a cell with a name shows."""
        sheet, _, cell = self.book.defined_names[name].attr_text.replace("$", "").partition("!")
        return self.results[plain_title(sheet)].get(cell)

    def make_plain(self, place: str) -> None:
        """Write all formulas with A1 references only, and say so by a name that leads to a place.

        Parameters
        ----------
        place : str
            Any cell.
        """
        areas = [
            TableArea(t.name, sheet.title, split_area(t.ref), columns=tuple(t.column_names))
            for sheet in self.book.worksheets
            for t in sheet.tables.values()
        ]
        names = {name: str(cell.attr_text) for name, cell in self.book.defined_names.items()}
        plain = PlainFormulas(areas, names).plain
        for sheet in self.book.worksheets:
            block = self.blocks.get(sheet.title)
            formulas: dict[int, RowText] = {}
            for cell in (cell for row in sheet.iter_rows() for cell in row):
                if cell.data_type == "f":
                    text, row = str(cell.value)[1:], int(cell.row)
                    if block is not None and row == block.row:
                        formulas[cell.column - 1] = RowText(plain(text, ROW_MARK))
                    cell.value = "=" + plain(text, row)
            if block is not None:
                self.blocks[sheet.title] = replace(block, formulas=formulas)
            for described in (c for t in sheet.tables.values() for c in t.tableColumns):
                described.calculatedColumnFormula = None
        self.define(MARK, place)

    def readme(self, lines: Sequence[str], sketch: Sketch, *, rows: int) -> None:
        """Write the sheet `Readme`: paragraphs, "#" marks a heading, and a drawing beside them.

        Parameters
        ----------
        lines : sequence of str
            The paragraphs.
        sketch : Sketch
            The drawing.
        rows : int
            How many rows are printed.
        """
        sheet = self.sheet("Readme")
        for letter, width in zip("ABC", (80, 2, 50), strict=True):
            sheet.worksheet.column_dimensions[letter].width = width
        for row, line in enumerate(lines, start=3):
            sheet.text(f"A{row}", line.lstrip("#"), HEAD_FONT if line.startswith("#") else None)
        self.drawings["Readme"] = sketch.part("C3")
        sheet.finish(landscape=True, guarded=False)
        # Nothing stands in the cells below the sketch: without this they would not be printed.
        sheet.worksheet.print_area = f"A1:C{rows}"
        sheet.worksheet.page_setup.fitToHeight = 1

    def parts(self) -> dict[str, bytes]:
        """Return the parts of the package, with the values in its formula cells."""
        package = io.BytesIO()
        self.book.save(package)
        return finished_parts(package, blocks=self.blocks, results=self.results)

    def save(self, path: Path | str, *, overwrite: bool) -> None:
        """Write the workbook, whole or not at all, with the values in its formula cells."""
        with new_workbook(path, overwrite=overwrite) as temporary:
            package = io.BytesIO()
            self.book.save(package)
            finish_book(
                package,
                temporary,
                blocks=self.blocks,
                results=self.results,
                drawings=self.drawings,
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SheetBuilder:
    """One sheet of a workbook under construction."""

    book: BookBuilder
    worksheet: Worksheet

    def text(self, cell: str, value: str, font: Font | None = None) -> None:
        """Write a text."""
        target = self.worksheet[cell]
        target.value, target.data_type = value, "s"
        self._look(target, font=font or BODY_FONT)

    def word(self, cell: str, key: str, font: Font | None = None) -> None:
        """Write a word in the language of the workbook."""
        self.text(cell, self.book.word(key), font)

    def formula(
        self, cell: str, text: str, value: CellValue = None, *, form: str = "", name: str = "",
        editable: bool = False, font: Font = FORMULA_FONT,
    ) -> None:  # fmt: skip
        """Write a formula; ``value`` is what it shows where `BookBuilder.calculate` cannot know."""
        target = self.worksheet[cell]
        target.value = "=" + text
        self.book.results[self.worksheet.title][cell] = value
        self._look(target, font=font, form=form, editable=editable)
        self._name(cell, name)

    def input(
        self, cell: str, value: CellValue, *, form: str = "", name: str = "", editable: bool = True
    ) -> None:
        """Write a typed cell: the user's to fill in, or the program's where not editable."""
        target = self.worksheet[cell]
        if value is not None and value == value and value != "":
            target.value = value
            if isinstance(value, str):
                target.data_type = "s"
            else:
                self.book.results[self.worksheet.title][cell] = float(value)
        self._look(target, form=form, editable=editable)
        self._name(cell, name)

    def _look(
        self, cell: Cell, *, font: Font | None = None, form: str = "", editable: bool = False
    ) -> None:
        """Give a cell its font, its number format, and the look of one that may be changed."""
        parts: dict[str, object] = {"font": font} if font else {}
        if editable:
            parts |= {"fill": INPUT_FILL, "border": INPUT_EDGE, "protection": _FREE}
        if form:
            parts["number_format"] = form
        self._dress(cell, None if cell.has_style else (id(font), form, editable), **parts)

    def _dress(self, cell: Cell, key: Hashable | None, **parts: Any) -> None:
        """Give a cell parts of a style; the key, if any, stands for all that make it.

        openpyxl looks every part of a style up by all its fields: half the time of a workbook.
        """
        if key not in self.book.looks:
            for name, part in parts.items():
                setattr(cell, name, part)
            if key is not None:
                self.book.looks[key] = parts, copy(cell._style)
        else:
            cell._style = copy(self.book.looks[key][1])

    def _name(self, cell: str, name: str) -> None:
        if name:
            self.book.define(name, f"'{self.worksheet.title}'!{absolute_coordinate(cell)}")

    def describe(self, row: int, texts: Sequence[str], unit: str = "") -> None:
        """Write the name and description before a value in column C, and its unit behind it."""
        for letter, text in zip("AB", texts, strict=True):
            self.text(f"{letter}{row}", text)
        self.text(f"D{row}", unit, LABEL_FONT)
        self.worksheet[f"D{row}"].alignment = _UNIT_PLACE

    def headings(self, row: int, keys: Sequence[str], widths: Sequence[float] = ()) -> None:
        """Write a row of headings from column A, in the language of the workbook."""
        for i, key in enumerate(keys, start=1):
            letter = get_column_letter(i)
            self.word(f"{letter}{row}", key, HEAD_FONT)
            self.worksheet[f"{letter}{row}"].fill = HEAD_FILL
            place = {"value": Alignment(horizontal="right"), "unit": _UNIT_PLACE}
            self.worksheet[f"{letter}{row}"].alignment = place.get(key, Alignment())
        for i, width in enumerate(widths, start=1):
            self.worksheet.column_dimensions[get_column_letter(i)].width = width

    def table(
        self,
        name: str,
        columns: Sequence[LiveColumn],
        *,
        at: tuple[int, int],
        rows: int,
        cells: Cells,
        repeat: bool = False,
        short: bool = False,
    ) -> None:
        """Write a table: labels, keys, rows, and of typed columns what may be typed.

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
        sheet, self.book.tables[name] = (
            self.worksheet,
            TableContent(columns=columns, cells=dict(cells)),
        )
        letters = {c.key: get_column_letter(left + i) for i, c in enumerate(columns)}
        for i, column in enumerate(columns):
            self._head((head, left + i), column)
            for row in range(head + 1, head + 1 + (1 if repeat else rows)):
                cell = sheet.cell(row, left + i)
                is_live = column.kind == "formula" and column.key not in cells
                value = None if repeat or is_live else _at(cells, column, row - head)
                self._cell(cell.coordinate, name, column, value)
            if column.kind == "input":
                letter = letters[column.key]
                self._validate_column(f"{letter}{head + 1}:{letter}{head + rows}", column)
        sheet.row_dimensions[head - 1].height = 38
        self._add_table(name, columns, at, rows)
        if repeat:
            block = repeated_rows(name, columns, head + 1, rows, cells, letters, short)
            self.book.blocks[sheet.title] = block
            for i, formula in block.formulas.items():
                sheet.cell(head + 1, left + i).value = f"={formula(head + 1)}"

    def _head(self, at: tuple[int, int], column: LiveColumn) -> None:
        """Write label and key of a column, and set its width."""
        sheet, (head, number) = self.worksheet, at
        above, key = sheet.cell(head - 1, number), sheet.cell(head, number)
        label = self.book.words.label(column.label or column.key, self.book.language)
        above.value = label.replace(" [", "\n[") if "|" in label else label
        key.value = column.key
        look = None if above.has_style else "label of a column"
        self._dress(above, look, font=LABEL_FONT, alignment=_LABEL_PLACE)
        look = None if key.has_style else "key of a column"
        self._dress(key, look, font=HEAD_FONT, fill=HEAD_FILL, alignment=_MIDDLE)
        letter = get_column_letter(number)
        before = sheet.column_dimensions.get(letter)
        width = sheet.column_dimensions[letter]
        # A letter of a label is hardly ever wider than a digit: no word is broken.
        word = 0 if column.folded else max(map(len, label.split()))
        width.width = max(before.width if before else 0, column.width, word)
        if column.folded:
            width.outlineLevel, width.hidden = 1, True

    def _cell(self, place: str, table: str, column: LiveColumn, value: CellValue) -> None:
        """Write one cell of a table."""
        form, cell = column.number_format, self.worksheet[place]
        is_bare, parts = not cell.has_style, {}
        if column.kind == "formula":
            self.formula(place, row_formula(table, column.formula)[1:], value, form=form)
        else:
            self.input(place, value, form=form)
        if column.kind == "value":
            parts = {"fill": _NO_FILL, "protection": _LOCKED}
        if column.key in ("flag", "use", "verdict", "fit"):
            parts["alignment"] = _MIDDLE
        elif column.key == "id":
            parts["alignment"] = _LEFT
        if parts:
            key = (column.kind, form, *map(id, parts.values())) if is_bare else None
            self._dress(cell, key, **parts)

    def _add_table(
        self, name: str, columns: Sequence[LiveColumn], at: tuple[int, int], rows: int
    ) -> None:
        head, left = at
        last = get_column_letter(left + len(columns) - 1)
        reference = f"{get_column_letter(left)}{head}:{last}{head + rows}"
        texts = [row_formula(name, c.formula)[1:] if c.kind == "formula" else "" for c in columns]
        keyed = zip((column.key for column in columns), texts, strict=True)
        add_table(self.worksheet, name, reference, keyed)

    def _validate_column(self, area: str, column: LiveColumn) -> None:
        prompt = self.book.words.prompt(column.key, self.book.language)
        limits = None if column.key in TEXT_KEYS else column.limits
        choices = column.choices
        self.validate(area, title=column.key, prompt=prompt, choices=choices, limits=limits)

    def validate(
        self,
        cells: str,
        *,
        title: str,
        prompt: str,
        choices: str = "",
        limits: tuple[float, float] | None = None,
        above_zero: bool = False,
    ) -> None:
        """Tell what a cell is for when it is chosen, and refuse what cannot be meant.

        Parameters
        ----------
        title, prompt : str
            What the cell says.
        choices : str
            What may be typed, with commas between.
        limits : tuple of float, optional
            The least and the largest number that can be meant.
        above_zero : bool
            Whether a number must be above zero. Without any of the three all may be typed.
        """
        rule = DataValidation(allow_blank=True, showInputMessage=True)
        if choices:
            rule.type, rule.formula1 = "list", f'"{choices}"'
            error = self.book.word("error_choice").format(choices=choices.replace(",", ", "))
        elif above_zero:
            rule.type, rule.operator, rule.formula1 = "decimal", "greaterThan", "0"
            error = self.book.word("error_above_zero")
        elif limits:
            low, high = limits
            rule.type, rule.operator = "decimal", "between"
            rule.formula1, rule.formula2 = f"{low:.10g}", f"{high:.10g}"
            error = self.book.word("error_number").format(low=f"{low:g}", high=f"{high:g}")
        else:
            error = ""
        if error:
            rule.showErrorMessage, rule.errorTitle, rule.error = True, title[:_PROMPT_TITLE], error
        rule.promptTitle, rule.prompt = title[:_PROMPT_TITLE], prompt[:_PROMPT]
        rule.add(cells)
        self.worksheet.add_data_validation(rule)

    def finish(
        self,
        *,
        landscape: bool = False,
        freeze: str = "",
        repeat: str = "",
        guarded: bool = True,
        scale: int = 0,
        breaks: tuple[int, Sequence[int]] = (0, ()),
    ) -> None:
        """Prepare screen and page, and protect the sheet against slips, without a password.

        Parameters
        ----------
        landscape, repeat, scale
            As in `photocore.workbook.making.look.prepare_page`.
        freeze : str
            The first cell that scrolls.
        breaks : tuple
            With a scale: the last column printed, and columns that begin a page in any case.
        """
        sheet = self.worksheet
        if freeze:
            sheet.freeze_panes = freeze
        page = self.book.word("page")
        prepare_page(sheet, landscape=landscape, page=page, repeat=repeat, scale=scale)
        if scale:
            break_columns(sheet, breaks[0], scale=scale, before=breaks[1])
        if guarded:
            guard(sheet)


# Programs indent nothing that has no side of its own.
_MIDDLE, _LEFT = Alignment(horizontal="center"), Alignment(horizontal="left")
_NO_FILL, _LOCKED, _FREE = PatternFill(), Protection(locked=True), Protection(locked=False)
_UNIT_PLACE = Alignment(horizontal="left", indent=1)
_LABEL_PLACE = Alignment(wrap_text=True, vertical="bottom", horizontal="center")


def _at(cells: Cells, column: LiveColumn, row: int) -> CellValue:
    values = cells.get(column.key, ())
    return values[row - 1] if row <= len(values) else column.spare
