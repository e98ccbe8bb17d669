"""New workbooks as outputs: none takes the place of one that holds anybody else's work.

Own sheets, charts and typed cells go with a file that is replaced. So every new workbook carries a
seal, the digest of its parts, in the comment of its zip package, and only a workbook whose seal is
whole may be replaced by a new one. Whatever program saves it again breaks the seal.

openpyxl builds the sheets, tables, names and charts, but leaves formula cells without values, so
that viewers show blanks, and needs a Python object per cell. `finish_book` copies the package it
wrote once more: prototype rows are multiplied, and every formula cell gets its value.
"""

from __future__ import annotations

import hashlib
import io
import math
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from photocore.errors import InputError
from photocore.output import atomic_path, check_writable, free_path
from photocore.provenance import provenance
from photocore.remarks import remark
from photocore.workbook.changing.cells import (
    CellValue,
    NewColumn,
    NewRows,
    RowText,
    escape,
    name_cell,
)
from photocore.workbook.changing.changes import SheetChanges
from photocore.workbook.changing.formulas import ModelCell, model_cells
from photocore.workbook.changing.splice import splice_sheet
from photocore.workbook.reading.grid import split_cell
from photocore.workbook.reading.package import Parts, read_part, rewrite_package
from photocore.workbook.reading.references import refuse_lost
from photocore.workbook.reading.xlsx import read_directory

if TYPE_CHECKING:
    from openpyxl import Workbook

#: Date of every part, so that equal input makes equal files; ZIP knows nothing before 1980.
PART_TIME = (1980, 1, 1, 0, 0, 0)
_TYPES = "[Content_Types].xml"
_RELATIONS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"
_DRAWING = "application/vnd.openxmlformats-officedocument.drawing+xml"
#: The part with the properties of a workbook.
_CORE = "docProps/core.xml"
_DUBLIN_CORE = "http://purl.org/dc/elements/1.1/"
_ILLEGAL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RowBlock:
    """Rows that repeat a prototype row, formats and formulas included.

    Attributes
    ----------
    row : int
        Number of the prototype row, the first of the block.
    columns : sequence of (sequence of CellValue)
        Values of columns A, B, ... ; in a formula column these are the results.
    formulas : mapping of int to RowText
        Column (0 = A) to its formula, the prototype's own in its row; where absent the prototype's
        formula is repeated as it stands.
    """

    row: int
    columns: Sequence[Sequence[CellValue]]
    formulas: Mapping[int, RowText] = field(default_factory=dict)

    def changes(self, prototype: Mapping[int, ModelCell]) -> SheetChanges:
        """Return what makes the rows of a sheet with this prototype row."""
        changes = SheetChanges(restates=True)
        count = max((len(column) for column in self.columns), default=0)
        columns = []
        for column, values in enumerate(self.columns, start=1):
            like = prototype.get(column, ModelCell())
            shown = [*map(_result if like.formula else _typed, values)]
            shown += [_result(None) if like.formula else None] * (count - len(values))
            changes_of_kind = changes.cached if like.formula else changes.inputs
            changes_of_kind.setdefault(self.row, {})[column] = shown[0] if shown else None
            formula = self._formula(column - 1, like.formula) if like.formula else None
            columns.append(NewColumn(column, shown[1:], like.style, formula))
        changes.added.append(NewRows(self.row + 1, count - 1, columns))
        return changes

    def _formula(self, index: int, text: str) -> str | RowText:
        formula = self.formulas.get(index)
        if formula is None:
            return escape(text)
        return formula.escaped(shared=not re.search(r"[!\[]", formula.text))


def finish_book(
    source: BinaryIO,
    target: Path,
    *,
    results: Mapping[str, Mapping[str, CellValue]],
    blocks: Mapping[str, RowBlock] | None = None,
    drawings: Mapping[str, bytes] | None = None,
) -> None:
    """Copy a package written by openpyxl, multiplying rows and filling in results.

    Parameters
    ----------
    source : file
        The package.
    target : path
        Where the finished one goes; overwritten.
    results : mapping
        Sheet name to cell (``"C7"``) to the value of the formula there (None is an empty text, NaN
        is #N/A), or to the number there in full precision.
    blocks : mapping, optional
        Sheet name to the rows that repeat its prototype row.
    drawings : mapping, optional
        Sheet name to the drawing on it, of a sheet that has neither tables nor charts.
    """
    parts = _finished(source, results, blocks or {})
    _add_drawings(source, target, parts, drawings or {})
    rewrite_package(source, target, parts, date=PART_TIME)
    refuse_lost(target)


def finished_parts(
    source: BinaryIO,
    *,
    results: Mapping[str, Mapping[str, CellValue]],
    blocks: Mapping[str, RowBlock] | None = None,
) -> dict[str, bytes]:
    """Return all parts of a finished package, to take sheets from; as `finish_book` otherwise."""
    return {name: part or b"" for name, part in _finished(source, results, blocks or {}).items()}


def _finished(
    source: BinaryIO,
    results: Mapping[str, Mapping[str, CellValue]],
    blocks: Mapping[str, RowBlock],
) -> Parts:
    """Return all parts of a finished package."""
    named, parts = Path("new sheets"), Parts()
    with zipfile.ZipFile(source) as package:
        for sheet in read_directory(named, package).sheets:
            changes, block = SheetChanges(restates=True), blocks.get(sheet.title)
            if block is not None:
                prototype = model_cells(named, package, sheet, block.row)
                if not prototype:
                    raise InputError(f"row {block.row}: no prototype row to repeat.")
                changes = block.changes(prototype)
            for cell, value in results.get(sheet.title, {}).items():
                row, column = split_cell(cell)
                if block is None or row != block.row:
                    # openpyxl writes 16 digits; doubles need up to 17.
                    changes.cached.setdefault(row, {})[column] = _result(value)
            data = read_part(named, package, sheet.part)
            spliced = splice_sheet(named, sheet.part, data, changes)
            parts[sheet.part] = spliced.written(strip=False)
        parts[_CORE] = _stated_properties(read_part(named, package, _CORE))
        for name in package.namelist():
            if name not in parts:
                parts[name] = package.read(name)
    return parts


def _add_drawings(
    source: BinaryIO, target: Path, parts: Parts, drawings: Mapping[str, bytes]
) -> None:
    """Add drawings to sheets that openpyxl cannot draw on."""
    with zipfile.ZipFile(source) as package:
        sheets = {sheet.title: sheet.part for sheet in read_directory(target, package).sheets}
    types = parts[_TYPES] or b""
    for title, drawing in drawings.items():
        folder, _, file = sheets[title].rpartition("/")
        name = f"xl/drawings/sketch-{file}"
        parts[name] = drawing
        link = f'<drawing xmlns:r="{_RELATIONS}" r:id="rId1"/></worksheet>'
        sheet = parts[sheets[title]] or b""
        parts[sheets[title]] = sheet.replace(b"</worksheet>", link.encode())
        entry = f'<Relationship Id="rId1" Type="{_RELATIONS}/drawing" Target="/{name}"/>'
        whole = f'<Relationships xmlns="{_PACKAGE}">{entry}</Relationships>'
        parts[f"{folder}/_rels/{file}.rels"] = whole.encode()
        kind = f'<Override PartName="/{name}" ContentType="{_DRAWING}"/></Types>'
        types = types.replace(b"</Types>", kind.encode())
    parts[_TYPES] = types


def _stated_properties(core: bytes) -> bytes:
    """Return a workbook's properties with its provenance as description, and no time of day."""
    moment = rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ"
    core = re.sub(moment, b"1980-01-01T00:00:00Z", core)
    core = re.sub(
        rb"<dc:description[^>]*/>|<dc:description\b.*?</dc:description>", b"", core, flags=re.S
    )
    origin = provenance()
    if not origin.command:
        # An empty form written from Python says the same whatever the day.
        return core
    text = escape(without_control("\n".join(origin.lines())))
    # Without lxml openpyxl declares the prefix for the whole part, with it in each element. The
    # order of the elements is free; the last one closes the part.
    element = f'<dc:description xmlns:dc="{_DUBLIN_CORE}">{text}</dc:description>'.encode()
    return core.replace(b"</cp:coreProperties>", element + b"</cp:coreProperties>")


def _typed(value: CellValue) -> CellValue:
    """Return what is typed into a cell: nothing for NaN, no characters that XML cannot hold."""
    if isinstance(value, str):
        return without_control(value) or None
    return None if value is None or math.isnan(value) else value


def _result(value: CellValue) -> CellValue:
    """Return what a formula shows: an empty text for None, #N/A for what is not finite."""
    if isinstance(value, float):
        return value if math.isfinite(value) else math.nan
    return "" if value is None else without_control(value) if isinstance(value, str) else value


def without_control(text: str) -> str:
    """Return a text without the characters that XML cannot hold."""
    return _ILLEGAL.sub("", text)


@contextmanager
def new_workbook(path: Path | str, *, overwrite: bool) -> Iterator[Path]:
    """Yield a temporary path for a new workbook, as `photocore.output.atomic_path`.

    Raises
    ------
    InputError
        As `photocore.output.atomic_path`, and if the path holds a workbook that is not exactly as
        this function left it.
    """
    path = check_new_workbook(path, overwrite=overwrite)
    with atomic_path(path, overwrite=overwrite) as temporary:
        yield temporary
        with zipfile.ZipFile(temporary, "a") as package:
            package.comment = _seal(package)


def save_book(book: Workbook, path: Path) -> None:
    """Write a workbook of openpyxl, whose own writer tells of a full disk a second time."""
    package = io.BytesIO()
    book.properties.creator = "bifocal"
    book.save(package)
    with zipfile.ZipFile(package) as written:
        parts = Parts({_CORE: _stated_properties(written.read(_CORE))})
    rewrite_package(package, path, parts, date=PART_TIME)


def plain_cell(sheet: Any, value: object) -> object:
    """Return what openpyxl appends to a sheet: blank for NaN, a name as `name_cell` has it."""
    from openpyxl.cell import WriteOnlyCell

    if isinstance(value, str):
        value = name_cell(without_control(value))
    if isinstance(value, str):
        cell = WriteOnlyCell(sheet, value)
        cell.data_type = "s"  # a name that begins with "=" stays a name
        return cell
    return None if isinstance(value, float | np.floating) and not np.isfinite(value) else value


def check_new_workbook(
    path: Path | str,
    *,
    overwrite: bool,
    source: Path | str | None = None,
    suffix: str = "-result",
) -> Path:
    """Return path if a workbook or another file may be written there; call it before long work.

    Parameters
    ----------
    path : path
        The output; only workbooks are looked into.
    overwrite : bool
        Replace an existing file.
    source : path, optional
        A workbook that may be changed in place.
    suffix : str
        What the name of another file, which is proposed, ends in.

    Raises
    ------
    InputError
        As `photocore.output.check_writable`, and if a workbook stands there that is neither
        ``source`` nor as this program left it: no option would help, so none is named.
    """
    path = Path(path)
    in_place = source is not None and path.exists() and Path(source).exists()
    in_place = in_place and path.samefile(source or path)
    is_book = path.suffix.lower() in (".xlsx", ".xlsm") and path.is_file()
    if is_book and not in_place and not is_untouched(path):
        stem = path.stem if suffix and path.stem.endswith(suffix) else f"{path.stem}{suffix}"
        raise InputError(
            remark("book.not_ours", of=path, name=free_path(path.parent, stem, path.suffix).name)
        )
    return check_writable(path, overwrite=overwrite)


def is_untouched(path: Path) -> bool:
    """Tell whether a path is free, holds no workbook, or a new one exactly as it was written."""
    if not path.exists():
        return True
    with path.open("rb") as file:
        if not file.read(8).startswith(_BOOK_STARTS):
            return True
    try:
        with zipfile.ZipFile(path) as package:
            return package.comment == _seal(package)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return False


#: How workbooks begin: zip packages, and the compound files of old or encrypted ones.
_BOOK_STARTS = (b"PK", bytes.fromhex("D0CF11E0"))


def _seal(package: zipfile.ZipFile) -> bytes:
    """Return the digest of names, sizes and checksums of all parts."""
    parts = sorted((part.filename, part.file_size, part.CRC) for part in package.infolist())
    return b"new workbook, parts " + hashlib.sha256(repr(parts).encode()).hexdigest().encode()
