"""Changing an existing workbook: only the cells asked for, all else byte for byte as it was."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import count as counted
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from photocore.errors import InputError
from photocore.output import atomic_path, check_writable, kept_copy
from photocore.remarks import remark
from photocore.workbook.changing import formulas
from photocore.workbook.changing.cells import (
    CellValue,
    NewCell,
    NewColumn,
    NewRows,
    RowFormula,
    escape,
)
from photocore.workbook.changing.changes import SheetChanges, Spliced, replaced_outside_cells
from photocore.workbook.changing.graft import Graft
from photocore.workbook.changing.splice import splice_sheet
from photocore.workbook.changing.styles import StyleSheet
from photocore.workbook.making.newbook import check_new_workbook, new_workbook
from photocore.workbook.reading.grid import CellGrid, SheetFile, TableArea, Value, cell_name
from photocore.workbook.reading.package import (
    Parts,
    check_header,
    open_package,
    read_part,
    rewrite_package,
)
from photocore.workbook.reading.references import refuse_lost
from photocore.workbook.reading.xlsx import (
    SheetPart,
    Workbook,
    open_xlsx,
    part_of_kind,
    read_directory,
    read_shared_strings,
    read_tables,
)


@dataclass(slots=True)
class WorkbookEditor:
    """Gathers changes to a workbook and writes them in one go.

    Sheets, styles, drawings, charts, macros, comments: whatever the changes do not touch is copied
    byte for byte. Formulas are never overwritten by `set_value`. Where a typed value changes, the
    stored results of all formulas that may depend on it are taken out unless a new one is given, so
    that no program shows a stale number.

    Parameters
    ----------
    path : path
        The workbook, .xlsx or .xlsm.
    file : SheetFile, optional
        The same workbook, read already.

    Raises
    ------
    InputError
        If it is not a workbook, is damaged, unsafe, or digitally signed.
    """

    path: Path
    file: SheetFile | None = None
    book: Workbook = field(init=False)
    tables: list[TableArea] = field(init=False)
    changes: dict[str, SheetChanges] = field(init=False, default_factory=dict)
    grown: dict[str, tuple[TableArea, int]] = field(init=False, default_factory=dict)
    names: dict[str, str] = field(init=False, default_factory=dict)
    home: str | None = field(init=False, default=None)
    grafts: list[tuple[Mapping[str, bytes], Mapping[str, str]]] = field(
        init=False, default_factory=list
    )
    texts: list[tuple[str, bytes, bytes]] = field(init=False, default_factory=list)
    _styles: StyleSheet | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.path = Path(self.path)
        if self.path.suffix.lower() not in (".xlsx", ".xlsm"):
            check_header(self.path)
            raise InputError(remark("book.in_place", of=self.path))
        with open_package(self.path) as package:
            if any(name.startswith("_xmlsignatures/") for name in package.namelist()):
                raise InputError(remark("book.signed", of=self.path))
            self.book = read_directory(self.path, package)
            self.tables = [t for s in self.book.sheets for t in read_tables(self.path, package, s)]

    @property
    def titles(self) -> list[str]:
        """Names of the sheets, in the order of the workbook."""
        return [sheet.title for sheet in self.book.sheets]

    def table(self, name: str) -> TableArea | None:
        """Return a named table, None where there is none; upper and lower case are alike."""
        return next((t for t in self.tables if t.name.casefold() == name.casefold()), None)

    def grid(self, title: str) -> CellGrid:
        """Return a sheet's cells as they stand in the file."""
        self._sheet(title)
        if self.file is None:
            self.file = open_xlsx(self.path, max_rows=2**20)
        return self.file.grid(title)

    def value_at(self, title: str, row: int, column: int) -> Value | None:
        """Return what stands in a cell of the file, None where it is blank."""
        return self.grid(title).rows.get(row, {}).get(column)

    def set_value(self, title: str, row: int, column: int, value: CellValue) -> None:
        """Type a value into a cell; its format stays. None clears the cell."""
        if isinstance(value, float) and not math.isfinite(value):
            where = f"{self.path.name} › {title}!{cell_name(row, column)}"
            raise InputError(remark("book.no_number", of=where, value=value))
        self._changes(title).inputs.setdefault(row, {})[column] = value

    def set_result(self, title: str, row: int, column: int, value: CellValue) -> None:
        """Store the result of a cell's formula; a cell without formula is left alone.

        NaN is stored as the error value #N/A, None as an empty text.
        """
        self._changes(title).cached.setdefault(row, {})[column] = "" if value is None else value

    def put(
        self,
        title: str,
        row: int,
        column: int,
        value: CellValue,
        *,
        formula: str = "",
        style: str = "",
    ) -> None:
        """Put a value, or a formula with its result, into a cell, whatever stands there.

        Parameters
        ----------
        title : str
            Sheet.
        row, column : int
            Where.
        value : float, int, str, bool or None
            The value, or the result of the formula: an empty text for None.
        formula : str
            English names, comma as separator, without the equals sign.
        style : str
            Index of the format for a cell that has none; an own format stays.
        """
        shown = "" if formula and value is None else value
        cell = NewCell(shown, escape(formula), style, "over")
        self._changes(title).placed.setdefault(row, {})[column] = cell

    def fill_rows(self, title: str, first: int, columns: Sequence[NewColumn]) -> None:
        """Fill rows of columns: what stands in a cell stays, a formula there takes the result.

        Parameters
        ----------
        title : str
            Sheet.
        first : int
            First row.
        columns : sequence of NewColumn
            Values, or formulas with results, for the cells that are empty, from left to right.
        """
        size = max((len(column.values) for column in columns), default=0)
        if size:
            self._changes(title).added.append(NewRows(first, size, columns, "filled"))

    def extend(self, table: str, bottom: int) -> None:
        """Let a named table reach down to a row, over what stands there; as `append_columns`."""
        area, last = self._growing(table)
        if bottom > last:
            self.grown[area.name] = (area, bottom)

    def styles_of(self, title: str, row: int) -> dict[int, str]:
        """Return the formats of a row's cells by column."""
        return {column: cell.style for column, cell in self.models(title, row).items()}

    def models(self, title: str, row: int) -> dict[int, formulas.ModelCell]:
        """Return formats and formulas of a row's cells by column."""
        with open_package(self.path) as package:
            return formulas.model_cells(self.path, package, self._sheet(title), row)

    def style_like(self, style: str, number_format: str) -> str:
        """Return a format like another one, that shows numbers in another way."""
        return self._style_sheet().like(style, number_format)

    @property
    def named(self) -> Mapping[str, str]:
        """The names that count: in a workbook of somebody else's those of the sheet `home`."""
        if self.home is None:
            return self.book.names
        return self.book.names_on(self.home) if self.home else {}

    def define(self, name: str, reference: str) -> None:
        """Let a defined name lead to a place, e.g. ``'Sheet 1'!$B$3``."""
        self.names[name] = reference

    def add_sheets(self, content: Mapping[str, bytes], titles: Mapping[str, str]) -> None:
        """Add sheets of a package made for it behind all others.

        Parameters
        ----------
        content : mapping
            Its parts, from `photocore.workbook.making.newbook.finished_parts`.
        titles : mapping
            Which sheets, and their titles in this workbook.
        """
        self.grafts.append((content, titles))

    def replace_text(self, title: str, old: str, new: str) -> None:
        """Replace a text outside the cells of a sheet: in its rules, footer and charts."""
        with open_package(self.path) as package:
            sheet = self._sheet(title)
            for part in [sheet.part, *formulas.charts_of(self.path, package, sheet)]:
                self.texts.append((part, escape(old).encode(), escape(new).encode()))

    def free_title(self, title: str) -> str:
        """Return a title, or one with a number if a sheet has it already."""
        titles = {name.casefold() for name in self.titles}
        names = (f"{title}{f' {number}' if number > 1 else ''}" for number in counted(1))
        return next(name for name in names if name.casefold() not in titles)

    def append_columns(
        self,
        table: str,
        inputs: Mapping[str, ArrayLike | Sequence[CellValue]],
        results: Mapping[str, ArrayLike | Sequence[CellValue]] | None = None,
        *,
        count: int | None = None,
    ) -> list[int]:
        """Add rows to a named table, given by columns; formulas and formats are of its last row.

        The table, its filter, the conditional formats and validations of its last row, and charts
        and names that reach to its last row grow with it.

        Parameters
        ----------
        table : str
            Name of the table.
        inputs, results : mapping
            Heading to typed values, and to cached results of the formulas, one per row.
        count : int, optional
            Number of rows; the length of the columns when None.

        Returns
        -------
        list of int
            The new rows' numbers.

        Raises
        ------
        InputError
            If there is no such table or heading, the table ends in a row of totals, or the cells
            below it are not empty.
        """
        area, bottom = self._growing(table)
        where = f"{self.path.name} › {area.sheet}"
        results = results or {}
        headings = area.headings()
        unknown = [name for name in (*inputs, *results) if name not in headings]
        if unknown:
            raise InputError(f'{where}: the table {area.name} has no column "{unknown[0]}".')
        cells = {name: _plain(values) for name, values in (*inputs.items(), *results.items())}
        size = count or max((len(values) for values in cells.values()), default=0)
        new_rows = list(range(bottom + 1, bottom + 1 + size))
        if not new_rows:
            return []
        last = area.area[2]
        with open_package(self.path) as package:
            model = formulas.model_cells(self.path, package, self._sheet(area.sheet), last)
        self._refuse_occupied(area, new_rows)
        columns = []
        for name, column in headings.items():
            like = model.get(column, formulas.ModelCell())
            formula = RowFormula(escape(like.formula), last).at if like.formula else None
            fits = name in (results if formula else inputs)
            values = [*cells[name]] if fits else []
            values += [None] * (size - len(values))
            columns.append(NewColumn(column, values, like.style, formula))
        self._changes(area.sheet).added.append(NewRows(bottom + 1, size, columns))
        self.grown[area.name] = (area, new_rows[-1])
        return new_rows

    def _growing(self, table: str) -> tuple[TableArea, int]:
        """Return a table that may grow, and its last row so far."""
        area = self.table(table)
        if area is None:
            names = ", ".join(t.name for t in self.tables) or "none"
            raise InputError(f'{self.path.name}: has no table "{table}"; it has {names}.')
        if area.totals_rows:
            raise InputError(
                remark("book.totals_row", of=f"{self.path.name} › {area.sheet}", table=area.name)
            )
        return self.grown.get(area.name, (area, area.area[2]))

    def save(
        self,
        target: Path | str | None = None,
        *,
        overwrite: bool = False,
        settle: Callable[[Path, Parts], Parts] | None = None,
    ) -> Path | None:
        """Write the changed workbook.

        Parameters
        ----------
        target : path, optional
            Where to; the workbook itself when None. Then the old file is kept beside it with
            ``.bak`` added to its name, or ``.bak2``, ``.bak3`` ... where that is taken: no
            backup is ever replaced, and none is made of a state that one holds already.
        overwrite : bool
            Whether to replace another existing file.
        settle : callable, optional
            Takes the workbook and its changed parts, and returns these with other results.

        Returns
        -------
        Path or None
            The file that holds the old state; None where it was not changed in place.

        Raises
        ------
        InputError
            If the target is open in another program, has another ending, exists, or is another
            workbook that holds anybody else's work.
        """
        target = self.path if target is None else Path(target)
        in_place = target.exists() and target.samefile(self.path)
        if target.suffix.lower() != self.path.suffix.lower():
            raise InputError(
                remark("book.other_ending", of=target, ending=self.path.suffix, name=self.path.name)
            )
        if in_place:
            check_writable(target, overwrite=True)
        else:
            check_new_workbook(target, overwrite=overwrite)
        parts, place = self.changed_parts(), atomic_path if in_place else new_workbook
        parts = settle(self.path, parts) if settle else parts
        with place(target, overwrite=in_place or overwrite) as temporary:
            rewrite_package(self.path, temporary, parts)
            refuse_lost(temporary, self.path)
            return kept_copy(self.path) if in_place else None

    def changed_parts(self) -> Parts:
        """Return the parts of the package that change or are new, with their new content."""
        if self.file is not None:
            self.file.forget()
        with open_package(self.path) as package:
            spliced = self._splice(package)
            tainted = set[str]()
            if any(sheet.inputs_changed for sheet in spliced.values()):
                # New results of other sheets follow from what was typed.
                tainted = {t for t, sheet in spliced.items() if sheet.edits or sheet.differs}
            references = formulas.References(self.path, package, self.book, self.tables)
            settled = [title for title, sheet in spliced.items() if not sheet.strips]
            stale = references.dependents(tainted, settled)
            parts = Parts()
            stripped = any(spliced[title].strips for title in stale & spliced.keys())
            formula_lost = any(sheet.formula_lost for sheet in spliced.values())
            for sheet in self.book.sheets:
                changed = spliced.get(sheet.title)
                if changed is None and sheet.title in stale:
                    data = read_part(self.path, package, sheet.part)
                    changed = splice_sheet(self.path, sheet.part, data, SheetChanges())
                    stripped |= bool(changed.strips)
                if changed is not None:
                    file = changed.written(strip=sheet.title in stale)
                    if changed.differs:
                        parts[sheet.part] = file
            differ = {*parts}
            for area, bottom in self.grown.values():
                references.grow(area, bottom, parts)
            for name, old, new in self.texts:
                data = parts.now(self.path, package, name)
                parts[name] = replaced_outside_cells(data, old, new)
            if stripped:
                formulas.recalculate_on_load(self.path, package, self.book, parts)
            if formula_lost:
                formulas.drop_order(self.path, package, self.book, parts)
            self._graft(package, parts)
            for name in {*package.namelist()} & parts.keys() - differ:
                if parts[name] == read_part(self.path, package, name):
                    del parts[name]
        return parts

    def _graft(self, package: zipfile.ZipFile, parts: Parts) -> None:
        """Add new sheets, names and formats."""
        if self.grafts or self.names:
            graft = Graft(self.path, package, self.book, parts, self._style_sheet())
            for content, titles in self.grafts:
                graft.add_sheets(content, titles, local=self.home is not None)
            for name, reference in self.names.items():
                graft.define(name, reference, anew=True)
        if self._styles is not None and self._styles.added:
            parts[part_of_kind(package, self.book, "styles")] = self._styles.written()

    def _style_sheet(self) -> StyleSheet:
        if self._styles is None:
            with open_package(self.path) as package:
                part = part_of_kind(package, self.book, "styles")
                if not part:
                    raise InputError(remark("book.no_formats", of=self.path))
                self._styles = StyleSheet(read_part(self.path, package, part))
        return self._styles

    def _splice(self, package: zipfile.ZipFile) -> dict[str, Spliced]:
        """Return the changed sheets."""
        shared = cache(partial(read_shared_strings, self.path, package, self.book))
        spliced = {}
        for sheet in self.book.sheets:
            changes = self.changes.get(sheet.title)
            if changes:
                read = partial(read_part, self.path, package, sheet.part)
                pieces = splice_sheet(self.path, sheet.part, read(), changes, shared)
                if not pieces.strips:
                    pieces.written(strip=False)
                spliced[sheet.title] = pieces
        return spliced

    def _changes(self, title: str) -> SheetChanges:
        if title not in self.changes:
            self.changes[self._sheet(title).title] = SheetChanges()
        return self.changes[title]

    def _sheet(self, title: str) -> SheetPart:
        for sheet in self.book.sheets:
            if sheet.title == title:
                return sheet
        names = ", ".join(f'"{name}"' for name in self.titles)
        raise InputError(f'{self.path.name}: has no sheet "{title}"; it has {names}.')

    def _refuse_occupied(self, area: TableArea, rows: Iterable[int]) -> None:
        cells = self.grid(area.sheet).rows
        _, left, _, right = area.area
        for row in rows:
            for column in cells.get(row, {}):
                if left <= column <= right:
                    where = f"{self.path.name} › {area.sheet}!{cell_name(row, column)}"
                    raise InputError(remark("book.table_blocked", of=where, table=area.name))


def _plain(values: ArrayLike | Sequence[CellValue]) -> Sequence[CellValue]:
    """Return values as Python objects."""
    return values.tolist() if isinstance(values, np.ndarray) else list(values)  # type: ignore[arg-type]
