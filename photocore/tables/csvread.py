"""Reading text tables: encoding, delimiter and decimal separator are found out per file."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError
from photocore.tables.convert import decimal_evidence
from photocore.tables.fill import fill, refuse_doubles, take_unit_row
from photocore.tables.headings import Match, describe, find_columns
from photocore.tables.model import Column, Table
from photocore.tables.numbers import Decimal
from photocore.tables.rows import RowSorter, label
from photocore.workbook.grid import CellGrid, SheetFile, Value, cell_name

_DELIMITERS = (";", "\t", ",", "|", " ")
_GUARDED = re.compile(r"'+[=+\-@\t\r]")
#: A text that may be a number with three decimals or one with thousands.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
_SAMPLE = 200
_SAMPLE_TEXT = 2**18
_CHUNK = 50_000
_STARTS = frozenset("0123456789-+.,")


@dataclass(slots=True)
class CsvFile:
    """A text table in memory, not yet split into fields.

    Parameters
    ----------
    label : str
        File name for messages.
    text : str
        Its content.
    remarks : list of str
        What the user should know about the file.
    delimiter : str
        Delimiter that the file itself names in a first line ``sep=;``; empty if it does not.
    """

    label: str
    text: str
    remarks: list[str] = field(default_factory=list)
    delimiter: str = ""

    def records(self, delimiter: str, *, sample: bool = False) -> Iterator[list[str]]:
        """Yield the records, as many fields as each has; only the first ones for a sample."""
        text = self.text
        if sample and len(text) > _SAMPLE_TEXT:
            text = text[: text.rfind("\n", 0, _SAMPLE_TEXT) + 1] or text
        lines = io.StringIO(text, newline="")
        if self.delimiter:
            lines.readline()
            # The line that names the delimiter keeps its number, as spreadsheets count it.
            yield []
        if delimiter != " " and '"' not in text:
            # Without quotation marks a record is a line, which is quicker to take apart.
            plain = io.StringIO(text[lines.tell() :], newline=None)
            yield from (line.rstrip("\n").split(delimiter) for line in plain)
            return
        try:
            yield from csv.reader(lines, delimiter=delimiter, skipinitialspace=delimiter == " ")
        except csv.Error as error:
            raise InputError(
                f"{self.label}: cannot be split into fields ({error}); look for a quotation mark "
                "that is opened but not closed."
            ) from None

    def grid(self, delimiter: str, *, most: int | None = _SAMPLE) -> CellGrid:
        """Return the first records as a grid of texts."""
        grid = CellGrid("")
        records = self.records(delimiter, sample=most == _SAMPLE)
        for row, record in enumerate(islice(records, most), start=1):
            cells: dict[int, Value] = {
                column: text for column, text in enumerate(record, start=1) if text.strip()
            }
            if cells:
                grid.rows[row] = cells
        return grid

    def as_sheets(self) -> SheetFile:
        """Return the whole table as a workbook of one sheet, for small files."""
        delimiter = self.delimiter or max(_DELIMITERS, key=lambda mark: _consistency(self, mark))
        grid = self.grid(delimiter, most=100_000)
        return SheetFile(label=self.label, titles=[""], load=lambda _: grid)


def open_csv(path: Path) -> CsvFile:
    """Read a text file of any usual encoding.

    Raises
    ------
    InputError
        If it is missing, empty or not text.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file.") from None
    except OSError as error:
        if path.is_dir():
            raise InputError(f"{path}: is a folder, expected a table file.") from None
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from None
    if not content.strip():
        raise InputError(f"{path}: the file is empty.")
    if content.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise InputError(f"{path}: is a workbook, not a text table; give it the ending .xlsx.")
    remarks = []
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            text = content.decode("utf-16")
        except UnicodeDecodeError:
            raise InputError(f"{path}: is not a text table (broken UTF-16).") from None
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("cp1252", errors="replace")
            remarks.append("The file is not UTF-8; its letters were read as Windows-1252.")
    if "\0" in text[:10_000]:
        raise InputError(f"{path}: is not a text table.")
    first = text[: text.find("\n")].strip().strip('"') if "\n" in text else text
    delimiter = first[4:] if first.lower().startswith("sep=") and len(first) == 5 else ""
    return CsvFile(label=path.name, text=text, remarks=remarks, delimiter=delimiter)


def read_csv_table(
    file: CsvFile,
    columns: Sequence[Column],
    *,
    decimal: Decimal | None,
    column_map: Mapping[str, str] | None,
    errors: list[CellError],
) -> Table:
    """Read a text table; see `photocore.tables.read_table`."""
    grid, match, delimiter = _find(file, columns, column_map)
    refuse_doubles(file.label, "", match)
    take_unit_row(grid, match)
    table = Table(
        file=file.label,
        sheet="",
        values={},
        present=frozenset(match.columns),
        rows=[],
        columns=dict(match.columns),
        units=dict(match.units),
        headings=dict(match.headings),
        remarks=[*file.remarks, *match.remarks],
    )
    gathered = _Gathered(match, columns)
    _gather(file, delimiter, grid, table, gathered, errors)
    quick = gathered.quick(decimal)
    slow = gathered.careful(quick, decimal)
    fill(
        table,
        [c for c in columns if c.key not in quick],
        slow,
        decimal,
        errors,
        proven=gathered.proven(quick),
    )
    table.values |= quick
    for column in columns:
        if column.kind == "integer" and column.key in quick:
            bad = np.flatnonzero(quick[column.key] % 1 > 0)
            message = "expected a whole number."
            errors += [table.error(int(index), column.key, message) for index in bad]
    return table


def _find(
    file: CsvFile, columns: Sequence[Column], column_map: Mapping[str, str] | None
) -> tuple[CellGrid, Match, str]:
    """Return the delimiter with which the most headings are found, and where they are."""
    best: tuple[tuple[float, ...], CellGrid, Match | None, str] | None = None
    for rank, delimiter in enumerate(file.delimiter or _DELIMITERS):
        grid = file.grid(delimiter)
        match = find_columns(grid, columns, column_map=column_map)
        score = match.score[0] if match else 0
        merit = (score, _consistency(file, delimiter), -rank)
        if best is None or merit > best[0]:
            best = (merit, grid, match, delimiter)
    assert best is not None
    _, grid, match, delimiter = best
    missing = match.missing(columns) if match else []
    if match is None or missing:
        wanted = missing or [c.key for c in columns if c.required] or [c.key for c in columns]
        shown = describe(grid, match)
        raise InputError(
            f"{file.label}: no column {', '.join(wanted)}; the headings are {shown or 'absent'}. "
            f'Rename a heading, or, where it exists, use --columns "{wanted[0]}=HEADING" (or a '
            "column letter)."
        )
    return grid, match, delimiter


def _consistency(file: CsvFile, delimiter: str) -> float:
    """Return the share of sample records with the commonest number of fields, 0 for one field."""
    records = islice(file.records(delimiter, sample=True), _SAMPLE)
    counts = [len(record) for record in records if any(record)]
    commonest = max(set(counts), key=counts.count, default=1)
    return counts.count(commonest) / len(counts) if commonest > 1 else 0.0


@dataclass(slots=True)
class _Chunk:
    """Fields of one column of numbers: read already, or still as texts.

    ``marks`` holds what the numbers read prove: a decimal ``"point"`` or ``"comma"``, or only
    ``"grouped point"`` / ``"grouped comma"`` where each may also separate thousands.
    """

    numbers: FloatArray | None = None
    texts: list[str] = field(default_factory=list)
    marks: frozenset[str] = frozenset()

    def cells(self) -> list[Value | None]:
        """Return the fields as texts again, for the careful road that names bad ones."""
        if self.numbers is None:
            return [text or None for text in self.texts]
        grouped = self.marks in ({"grouped point"}, {"grouped comma"})
        shown = [
            None if np.isnan(x) else f"{x:.3f}" if grouped and x % 1 else repr(x).removesuffix(".0")
            for x in self.numbers.tolist()
        ]
        if self.marks & {"comma", "grouped comma"}:
            return [text and text.replace(".", ",") for text in shown]
        return list(shown)


@dataclass(slots=True)
class _Gathered:
    """The fields of the columns asked for, in chunks; plain numbers are read at once."""

    match: Match
    columns: Sequence[Column]
    numbers: dict[str, list[_Chunk]] = field(default_factory=dict)
    texts: dict[str, list[Value | None]] = field(default_factory=dict)

    def add(self, records: list[list[str]], width: int) -> None:
        """Take the columns out of padded records."""
        turned = list(zip(*records, strict=True)) if records else [()] * width
        kinds = {column.key: column.kind for column in self.columns}
        for key, number in self.match.columns.items():
            fields = list(turned[number - 1]) if number <= width else [""] * len(records)
            if kinds[key] in ("number", "integer"):
                self.numbers.setdefault(key, []).append(_read_chunk(fields))
            else:
                self.texts.setdefault(key, []).extend(map(_unguarded, fields))

    def proven(self, keys: Iterable[str]) -> dict[str, set[Decimal]]:
        """Return the decimal separators that columns prove."""
        known: tuple[Decimal, ...] = ("point", "comma")
        return {
            key: {mark for mark in known for chunk in self.numbers[key] if mark in chunk.marks}
            for key in keys
        }

    def quick(self, decimal: Decimal | None) -> dict[str, FloatArray]:
        """Return the columns that hold nothing but numbers of one clear meaning."""
        marks = {
            key: frozenset[str]().union(*(chunk.marks for chunk in chunks))
            for key, chunks in self.numbers.items()
        }
        found = {}
        for key, chunks in self.numbers.items():
            others = frozenset[str]().union(*(m for k, m in marks.items() if k != key))
            clear = _clear(marks[key], others, decimal)
            arrays = [chunk.numbers for chunk in chunks if chunk.numbers is not None]
            if clear and len(arrays) == len(chunks):
                found[key] = np.concatenate(arrays)
        return found

    def careful(
        self, quick: Mapping[str, FloatArray], decimal: Decimal | None
    ) -> dict[str, list[Value | None]]:
        """Return the cells of all other columns."""
        cells = {
            key: self.cells(chunks, decimal)
            for key, chunks in self.numbers.items()
            if key not in quick
        }
        return self.texts | cells

    def cells(self, chunks: Sequence[_Chunk], decimal: Decimal | None) -> list[Value | None]:
        """Return the cells of a column: numbers where they are clear, texts elsewhere."""
        marks: set[str] = set()
        for chunk in chunks:
            marks |= chunk.marks if chunk.numbers is not None else decimal_evidence(chunk.texts)
        clear = bool(decimal or marks & {"point", "comma"}) and _clear(marks, set(), decimal)
        found: list[Value | None] = []
        for chunk in chunks:
            if chunk.numbers is not None and (clear or not chunk.marks):
                found += [None if np.isnan(x) else x for x in chunk.numbers.tolist()]
            else:
                found += chunk.cells()
        return found


def _clear(marks: Set[str], others: Set[str], decimal: Decimal | None) -> bool:
    """Whether numbers with these marks have one meaning."""
    if not marks:
        return True
    if decimal is not None:
        return marks <= {decimal, f"grouped {decimal}"}
    if "point" in marks:
        return marks <= {"point", "grouped point"}
    if "comma" in marks:
        return marks <= {"comma", "grouped comma"}
    return marks == {"grouped point"} and "comma" not in others


def _read_chunk(texts: list[str]) -> _Chunk:
    """Read plain numbers (NaN where blank); leave the texts alone if any is not plain."""
    numbers = _floats(texts)
    if numbers is not None:
        return _Chunk(numbers, marks=_marks(texts, numbers, "point"))
    if any("." in text for text in texts):
        return _Chunk(texts=texts)
    numbers = _floats([text.replace(",", ".") for text in texts])
    if numbers is None:
        return _Chunk(texts=texts)
    return _Chunk(numbers, marks=_marks(texts, numbers, "comma"))


def _marks(texts: list[str], numbers: FloatArray, decimal: Decimal) -> frozenset[str]:
    """Return what plain numbers prove about the separator they were read with."""
    # Only numbers of three decimals can be mistaken for thousands; look at their texts alone.
    with np.errstate(over="ignore"):
        thousandths = (np.rint(numbers * 1000) / 1000 == numbers) | ~np.isfinite(numbers)
    marks = set() if thousandths.all() else {str(decimal)}
    mark = "." if decimal == "point" else ","
    for index in np.flatnonzero(thousandths):
        if mark in texts[index]:
            grouped = _GROUPED.fullmatch(texts[index].strip())
            marks.add(f"grouped {decimal}" if grouped else decimal)
            if decimal == "point" and "point" in marks:
                break
            if len(marks) == 2:
                break
    return frozenset(marks)


def _floats(texts: list[str]) -> FloatArray | None:
    """Return numbers with a decimal point (NaN where blank); None if any is not plain."""
    blanks = 0
    try:
        array = np.fromiter(map(float, texts), dtype=np.float64, count=len(texts))
    except ValueError:
        filled = [text.strip() or "nan" for text in texts]
        try:
            array = np.fromiter(map(float, filled), dtype=np.float64, count=len(texts))
        except ValueError:
            return None
        blanks = sum(not text.strip() for text in texts)
    # Python also reads "nan", "inf" and "1_000", which no surveyor means as numbers.
    if np.count_nonzero(~np.isfinite(array)) != blanks or any("_" in text for text in texts):
        return None
    return array


def _unguarded(text: str) -> str | None:
    """Take off the apostrophe that keeps spreadsheets from running a text as a formula."""
    return (text[1:] if text[:1] == "'" and _GUARDED.match(text) else text) or None


def _gather(
    file: CsvFile,
    delimiter: str,
    grid: CellGrid,
    table: Table,
    gathered: _Gathered,
    errors: list[CellError],
) -> None:
    """Sort the records into data and the rest, and take their columns."""
    match = gathered.match
    headings = grid.rows.get(match.header, {})
    sorter = RowSorter(match, gathered.columns, headings)
    above = [row for row in grid.rows if row < match.first and len(grid.rows[row]) == 1]
    if above and match.first - above[-1] <= 2:
        sorter.block = label(grid.rows[above[-1]][next(iter(grid.rows[above[-1]]))])
    width = max([*match.columns.values(), *headings], default=1)
    plain = _PlainChunks(sorter, width, headings)
    source = file.records(delimiter)
    first = 1 + sum(1 for _ in islice(source, match.first - 1))
    while chunk := list(islice(source, _CHUNK)):
        if plain.holds(first, chunk):
            rows: Sequence[int] = range(first, first + len(chunk))
            records = chunk
            table.blocks += [sorter.block] * len(chunk)
            sorter.previous = rows[-1]
        else:
            rows, records = _sorted_out(file, first, chunk, width, sorter, table, errors)
        table.rows += rows
        gathered.add(records, width)
        first += len(chunk)
    if not gathered.numbers and not gathered.texts:
        gathered.add([], width)
    table.remarks += sorter.remarks()


@dataclass(slots=True)
class _PlainChunks:
    """Tells at a glance whether many records are all data, as most are."""

    sorter: RowSorter
    width: int
    headings: Mapping[int, Value]

    def holds(self, first: int, chunk: list[list[str]]) -> bool:
        """Whether all records are full and numbers stand in two columns (or the only one)."""
        numeric = sorted(self.sorter.numeric)
        if first != self.sorter.previous + 1 or not numeric:
            return False
        if {*map(len, chunk)} != {self.width}:
            return False
        for number in numeric[:2]:
            starts = {record[number - 1][:1] for record in chunk}
            heading = str(self.headings.get(number, "x"))
            if not starts <= _STARTS or heading[:1] in _STARTS:
                return False
        return True


def _sorted_out(
    file: CsvFile,
    first: int,
    chunk: list[list[str]],
    width: int,
    sorter: RowSorter,
    table: Table,
    errors: list[CellError],
) -> tuple[list[int], list[list[str]]]:
    """Return the rows and records of a chunk that are data, all of the same width."""
    padding = [""] * width
    rows, records = [], []
    for row, record in enumerate(chunk, start=first):
        cells: dict[int, Value] = {
            column: text for column, text in enumerate(record, start=1) if text.strip()
        }
        if not cells or not sorter.is_data(row, cells):
            continue
        if sorter.headings and max(cells) > width:
            message = (
                f"the record has {max(cells)} fields, the headings {width}. If numbers have a "
                "decimal comma, separate the fields by semicolons."
            )
            place = cell_name(row, width + 1)
            errors.append(CellError(message, file=file.label, cell=place))
        rows.append(row)
        records.append((record + padding)[:width])
        table.blocks.append(sorter.block)
    return rows, records
