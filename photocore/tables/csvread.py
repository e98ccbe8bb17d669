"""Reading text tables: encoding, delimiter and decimal separator are found out per file."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from io import BytesIO, StringIO
from itertools import islice
from pathlib import Path

import numpy as np

from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError
from photocore.remarks import remark
from photocore.tables.advice import advice
from photocore.tables.encodings import decoded
from photocore.tables.fill import describe, near_headings
from photocore.tables.headings import Match, find_columns, is_summary
from photocore.tables.lists import as_table
from photocore.tables.model import Column
from photocore.tables.numbers import ArrowTexts, Decimal, is_clear, plain_numbers, take_apart
from photocore.textfile import readable
from photocore.workbook import CellGrid, SheetFile, Value, cell_name

_DELIMITERS = (";", "\t", ",", "|", " ")
_COMMENTED = re.compile(r"^[ \t]*(?:#|//)", re.M)
#: The apostrophes of `photocore.tables.csvwrite.guarded`.
_GUARDED = re.compile(r"(?:^|(?<=[;\r\n]))'(?='*[=+\-@\t\r])")
_SAMPLE = 200
_SAMPLE_TEXT = 2**18
#: Few enough records to stay in the processor's cache.
_CHUNK = 4000
#: Characters of a usual record.
_RECORD = 40
#: Characters from which Arrow, where it is installed, pays its import (60 ms), and its blocks.
_LARGE, _ARROW_BLOCK = 2**21, 2**22


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
        lines = StringIO(text, newline="")
        if self.delimiter:
            lines.readline()
            # The line that names the delimiter keeps its number, as spreadsheets count it.
            yield []
        try:
            yield from csv.reader(lines, delimiter=delimiter, skipinitialspace=delimiter == " ")
        except csv.Error as error:
            raise InputError(remark("table.no_fields", of=self.label, error=error)) from None

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
    """Read a text file of any usual encoding, also the lists of instruments and programs.

    Raises
    ------
    InputError
        If it is missing, empty or not text.
    """
    with readable(path, "table file"):
        content = path.read_bytes()
    if not content or content.isspace():
        raise InputError(f"{path}: the file is empty; save or copy it again.")
    if content.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise InputError(f"{path}: is a workbook, not a text table; give it the ending .xlsx.")
    try:
        text, remarks = decoded(content)
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not a text table (broken UTF-16).") from None
    if "\0" in text[:10_000]:
        raise InputError(f"{path}: is not a text table.")
    text, notes = as_table(text, str(path))
    remarks += notes
    first = text[: text.find("\n")].strip().strip('"') if "\n" in text else text
    delimiter = first[4:] if first.lower().startswith("sep=") and len(first) == 5 else ""
    return CsvFile(label=path.name, text=text, remarks=remarks, delimiter=delimiter)


def find_in_text(
    file: CsvFile, columns: Sequence[Column], column_map: Mapping[str, str] | None
) -> tuple[CellGrid, Match, str]:
    """Return the first records, where the headings are, and the delimiter that shows most of them.

    Raises
    ------
    InputError
        If a required column is missing.
    """
    best: tuple[tuple[float, ...], CellGrid, Match | None, str] | None = None
    sample = file.text[:_SAMPLE_TEXT]
    # Those that do not occur all show the same: one field.
    absent = [mark for mark in _DELIMITERS if mark not in sample][1:]
    likely = [mark for mark in _DELIMITERS if mark not in absent]
    for rank, delimiter in enumerate(file.delimiter or likely):
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
        needed = missing or [c.key for c in columns if c.required] or [c.key for c in columns]
        shown = describe(grid, match)
        about = {"missing": ", ".join(needed), "headings": shown or "absent"}
        first = next((record for record in file.records(delimiter, sample=True) if record), [])
        if sum(take_apart(field) is not None for field in first) > 2:
            text = remark("table.no_headings", of=file.label, row=" ".join(first[:6]))
            keys = ", ".join(column.key for column in columns[:8])
            raise InputError(f"{text} {advice('order', '--columns', '--control-order', keys=keys)}")
        near = near_headings(grid, match, columns)
        raise InputError(f"{remark('table.no_column', of=file.label, **about)} {near}")
    return grid, match, delimiter


def _consistency(file: CsvFile, delimiter: str) -> float:
    """Return the share of sample records with the commonest number of fields, 0 for one field."""
    records = islice(file.records(delimiter, sample=True), _SAMPLE)
    counts = [len(record) for record in records if any(record)]
    # Of two numbers equally common the larger: block labels stand alone in their lines.
    commonest = max(set(counts), key=lambda fields: (counts.count(fields), fields), default=1)
    return counts.count(commonest) / len(counts) if commonest > 1 else 0.0


@dataclass(frozen=True, slots=True)
class PlainRows:
    """Rows that are data without exception, by columns.

    Parameters
    ----------
    rows : range
        Their numbers.
    numbers : dict
        Key to the numbers (NaN where blank) of columns that have one clear meaning.
    texts : dict
        Key to the fields of all other columns.
    proven : dict
        Key to the decimal separators that columns of numbers prove.
    """

    rows: range
    numbers: dict[str, FloatArray]
    texts: dict[str, list[str]]
    proven: dict[str, set[Decimal]]


def plain_rows(
    file: CsvFile,
    delimiter: str,
    width: int,
    match: Match,
    columns: Sequence[Column],
    decimal: Decimal | None,
    *,
    careful: frozenset[str] = frozenset(),
) -> PlainRows | None:
    """Read a table on the quick road, None if any of its rows asks for a closer look.

    Every record must be full, hold a number and at least one thing more, and be no headings again.

    Parameters
    ----------
    file, delimiter, match, columns, decimal
        The table.
    width : int
        Number of fields of each record.
    careful : frozenset
        Columns of numbers known to need a closer look; their fields stay texts.
    """
    kinds = {column.key: column.kind for column in columns}
    numeric = {key for key in match.columns if kinds[key] in ("number", "integer")}
    quick = sorted(numeric - careful)
    if all(plain_numbers([match.headings.get(key) or "x"]) for key in quick):
        return None
    if _COMMENTED.search(file.text):
        return None
    others = sorted(match.columns.keys() - quick)
    chunks: dict[str, list[FloatArray]] = {key: [] for key in quick}
    proven: dict[str, set[str]] = {key: set() for key in quick}
    texts: dict[str, list[str]] = {key: [] for key in others}
    last = match.first - 1
    for chunk in _full_chunks(file, delimiter, last, width):
        if chunk is None:
            return None
        fields = {key: chunk[number - 1] for key, number in match.columns.items()}
        for key in quick:
            plain = plain_numbers(fields[key])
            if plain is None or (kinds[key] == "integer" and np.any(plain[0] % 1 > 0)):
                return plain_rows(
                    file, delimiter, width, match, columns, decimal, careful=careful | {key}
                )
            chunks[key].append(plain[0])
            proven[key] |= plain[1]
        filled = np.sum([~np.isnan(chunks[key][-1]) for key in quick], axis=0)
        for index in np.flatnonzero(filled < min(2, len(numeric))).tolist():
            if not filled[index] or not any(fields[key][index].strip() for key in others):
                return None
        for key in others:
            texts[key] += fields[key][:]
        last += len(filled)
    if last < match.first or is_summary({1: texts.get("id", [""])[-1]}, 1):
        return None
    for key in quick:
        elsewhere = set[str]().union(*(proven[rival] for rival in quick if rival != key))
        if not is_clear(proven[key], elsewhere, decimal):
            careful |= {key}
    if not careful.isdisjoint(quick):
        return plain_rows(file, delimiter, width, match, columns, decimal, careful=careful)
    marks: tuple[Decimal, ...] = ("point", "comma")
    return PlainRows(
        range(match.first, last + 1),
        {key: np.concatenate(arrays) for key, arrays in chunks.items()},
        texts,
        {key: {mark for mark in marks if mark in proven[key]} for key in quick},
    )


def _full_chunks(
    file: CsvFile, delimiter: str, skipped: int, width: int
) -> Iterator[list[Sequence[str]] | None]:
    """Yield many records at a time, turned into columns; None where one is not full."""
    if delimiter == " " or '"' in file.text:
        records = islice(file.records(delimiter), skipped, None)
        while chunk := list(islice(records, _CHUNK)):
            if {*map(len, chunk)} != {width}:
                yield None
            yield list(zip(*chunk, strict=True))
        return
    # Without quotation marks a record is a line, and many lines are taken apart at once.
    text = file.text.rstrip("\r\n").replace("\r\n", "\n").replace("\r", "\n")
    start = 0
    for _ in range(skipped):
        start = text.find("\n", start) + 1 or len(text)
    if len(text) > _LARGE and find_spec("pyarrow") is not None:
        yield from _arrow_chunks(text[start:], delimiter, width)
        return
    while start < len(text):
        end = text.find("\n", start + _RECORD * _CHUNK)
        part = text[start : end if end > 0 else None]
        if {line.count(delimiter) for line in part.split("\n")} != {width - 1}:
            yield None
        fields = part.replace("\n", delimiter).split(delimiter)
        yield [fields[number::width] for number in range(width)]
        start += len(part) + 1


def _arrow_chunks(text: str, delimiter: str, width: int) -> Iterator[list[Sequence[str]] | None]:
    """Yield lines of a large text as columns of a few megabytes; None where one is not full."""
    from pyarrow import ArrowInvalid, string
    from pyarrow import csv as arrow

    if text.startswith("\ufeff"):  # Arrow would take it off
        yield None
    names = [str(number) for number in range(width)]
    read = arrow.ReadOptions(column_names=names, block_size=_ARROW_BLOCK, use_threads=False)
    parse = arrow.ParseOptions(delimiter=delimiter, quote_char=False, ignore_empty_lines=False)
    kinds = arrow.ConvertOptions(column_types=dict.fromkeys(names, string()))
    try:
        with arrow.open_csv(BytesIO(text.encode()), read, parse, kinds) as batches:
            for batch in batches:
                yield [ArrowTexts(column) for column in batch.columns]
    except ArrowInvalid:
        yield None


def too_wide(file: CsvFile, grid: CellGrid, width: int, rows: Iterable[int]) -> Iterator[CellError]:
    """Yield a complaint for each record that reaches beyond the headings."""
    for row in rows:
        if max(grid.rows[row]) > width:
            message = remark("table.too_many_fields", fields=max(grid.rows[row]), width=width)
            yield CellError(message, file=file.label, cell=cell_name(row, width + 1))


def unguarded(text: str | None) -> str | None:
    """Take off the apostrophes that keep spreadsheets from running a text as a formula."""
    return _GUARDED.sub("", text) if text and "'" in text else text
