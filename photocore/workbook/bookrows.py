"""Finishing a new workbook: thousands of rows from one prototype row, results in formula cells.

openpyxl builds the sheets, tables, names and charts, but leaves formula cells without values, so
that viewers show blanks, and needs a Python object per cell. Here the package it wrote is copied
once more: prototype rows are multiplied with their styles and formulas, and every formula cell gets
its value. Times in the package are fixed, so equal input makes equal files.
"""

from __future__ import annotations

import math
import re
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO
from xml.sax.saxutils import escape

from photocore.errors import InputError

#: Value of a cell: None is blank (an empty text in a formula cell), NaN is #N/A.
CellValue = float | int | str | None
#: Date of every part; ZIP knows nothing before 1980.
PART_TIME = (1980, 1, 1, 0, 0, 0)
_CHUNK = 2000
_ILLEGAL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RowBlock:
    """Rows that repeat a prototype row.

    Attributes
    ----------
    row : int
        Number of the prototype row, the first of the block.
    columns : sequence of (sequence of CellValue)
        Values of columns A, B, ... ; in a formula column these are the results.
    formulas : mapping of int to callable
        Column (0 = A) to a function of the row number that returns the formula; where absent the
        prototype's own formula is repeated as it stands.
    """

    row: int
    columns: Sequence[Sequence[CellValue]]
    formulas: Mapping[int, Callable[[int], str]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of rows."""
        return max((len(column) for column in self.columns), default=0)


def finish_book(
    source: BinaryIO,
    target: Path,
    *,
    blocks: Mapping[str, RowBlock],
    results: Mapping[str, Mapping[str, CellValue]],
) -> None:
    """Copy a package written by openpyxl, multiplying rows and filling in results.

    Parameters
    ----------
    source : file
        The package.
    target : path
        Where the finished one goes; overwritten.
    blocks : mapping
        Sheet name to the rows that repeat its prototype row.
    results : mapping
        Sheet name to cell (``"C7"``) to the value of the formula there, or to the number there in
        full precision.
    """
    with (
        zipfile.ZipFile(source) as package,
        zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=4) as finished,
    ):
        parts = _sheet_parts(package)
        by_part = {parts[name]: name for name in parts}
        for info in package.infolist():
            part = zipfile.ZipInfo(info.filename, PART_TIME)
            part.compress_type = zipfile.ZIP_DEFLATED
            data = package.read(info.filename)
            if info.filename == "docProps/core.xml":
                data = re.sub(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", b"1980-01-01T00:00:00Z", data)
            name = by_part.get(info.filename)
            with finished.open(part, "w", force_zip64=True) as stream:
                if name is None:
                    stream.write(data)
                    continue
                for piece in _sheet(data.decode(), blocks.get(name), results.get(name, {})):
                    stream.write(piece.encode())


def _sheet_parts(package: zipfile.ZipFile) -> dict[str, str]:
    """Return sheet name -> part of a package that openpyxl wrote."""
    relations = dict(
        re.findall(
            r'Target="/?([^"]+)" Id="([^"]+)"', package.read("xl/_rels/workbook.xml.rels").decode()
        )
    )
    targets = {key: target for target, key in relations.items()}
    book = package.read("xl/workbook.xml").decode()
    sheets = re.findall(r'<sheet [^>]*?name="([^"]+)"[^>]*?r:id="([^"]+)"', book)
    return {name: targets[key] for name, key in sheets}


def _sheet(text: str, block: RowBlock | None, results: Mapping[str, CellValue]) -> Iterator[str]:
    """Yield the text of a sheet, finished."""
    if block is None:
        yield _with_results(text, results)
        return
    match = re.search(rf'<row r="{block.row}"([^>]*)>(.*?)</row>', text, re.DOTALL)
    if match is None:
        raise InputError(f"row {block.row}: no prototype row to repeat.")
    yield _with_results(text[: match.start()], results)
    yield from _rows(match[1], match[2], block)
    yield _with_results(text[match.end() :], results)


def _with_results(text: str, results: Mapping[str, CellValue]) -> str:
    """Return sheet text with values put into formula cells."""
    if not results:
        return text

    def fill(match: re.Match[str]) -> str:
        value = results.get(match[1])
        kind, content = _result(value)
        return f'<c r="{match[1]}"{match[2]}{kind}><f>{match[3]}</f>{content}</c>'

    def restate(match: re.Match[str]) -> str:
        value = results.get(match[2])
        return f"{match[1]}{value!r}{match[4]}" if isinstance(value, float) else match[0]

    # openpyxl writes 16 digits; doubles need up to 17.
    text = re.sub(r'(<c r="([A-Z]+\d+)"(?: s="\d+")?(?: t="n")?><v>)([^<]*)(</v>)', restate, text)
    pattern = (
        r'<c r="([A-Z]+\d+)"((?: s="\d+")?)(?: t="\w+")?>'
        r"<f>(.*?)</f><v ?/?>(?:</v>)?</c>"
    )
    return re.sub(pattern, fill, text)


def _rows(attributes: str, prototype: str, block: RowBlock) -> Iterator[str]:
    """Yield the repeated rows, some at a time."""
    cells = re.findall(r'<c r="([A-Z]+)\d+"([^>]*?)(?:/>|>(.*?)</c>)', prototype, re.DOTALL)
    styles = {letters: re.search(r' s="\d+"', more) for letters, more, _ in cells}
    formulas = {
        letters: re.search(r"<f>(.*?)</f>", inner, re.DOTALL) for letters, _, inner in cells
    }
    writers: list[tuple[Sequence[CellValue], Callable[[int, CellValue], str]]] = []
    for index, values in enumerate(block.columns):
        letters = column_letters(index)
        found = styles.get(letters)
        style = found[0] if found else ""
        formula = formulas.get(letters)
        own = block.formulas.get(index)
        if own is not None:
            writers.append((values, _changing_writer(letters, style, own)))
        elif formula:
            writers.append((values, _formula_writer(letters, style, formula[1])))
        else:
            writers.append((values, _input_writer(letters, style)))
    count = block.count
    for start in range(0, count, _CHUNK):
        rows = range(start, min(start + _CHUNK, count))
        yield "".join(
            f'<row r="{block.row + i}"{attributes}>'
            + "".join(
                [
                    write(block.row + i, values[i] if i < len(values) else None)
                    for values, write in writers
                ]
            )
            + "</row>"
            for i in rows
        )


def _formula_writer(letters: str, style: str, formula: str) -> Callable[[int, CellValue], str]:
    def write(row: int, value: CellValue) -> str:
        kind, content = _result(value)
        return f'<c r="{letters}{row}"{style}{kind}><f>{formula}</f>{content}</c>'

    return write


def _changing_writer(
    letters: str, style: str, formula: Callable[[int], str]
) -> Callable[[int, CellValue], str]:
    def write(row: int, value: CellValue) -> str:
        kind, content = _result(value)
        return f'<c r="{letters}{row}"{style}{kind}><f>{escape(formula(row))}</f>{content}</c>'

    return write


def _input_writer(letters: str, style: str) -> Callable[[int, CellValue], str]:
    def write(row: int, value: CellValue) -> str:
        if value is None or value != value or value == "":
            return f'<c r="{letters}{row}"{style}/>'
        if isinstance(value, str):
            text = escape(_ILLEGAL.sub("", value)).replace("\r", "_x000D_")
            return (
                f'<c r="{letters}{row}"{style} t="inlineStr"><is>'
                f'<t xml:space="preserve">{text}</t></is></c>'
            )
        return f'<c r="{letters}{row}"{style}><v>{value!r}</v></c>'

    return write


def _result(value: CellValue) -> tuple[str, str]:
    """Return the type attribute and the value element of a formula's result."""
    if value is None or value == "":
        return ' t="str"', "<v></v>"
    if isinstance(value, str):
        text = escape(_ILLEGAL.sub("", value)).replace("\r", "_x000D_")
        return ' t="str"', f"<v>{text}</v>"
    if isinstance(value, float) and not math.isfinite(value):
        return ' t="e"', "<v>#N/A</v>"
    return "", f"<v>{value!r}</v>"


def column_letters(index: int) -> str:
    """Return the letters of a column, 0 = A.

    Examples
    --------
    >>> column_letters(0), column_letters(25), column_letters(26)
    ('A', 'Z', 'AA')
    """
    letters = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        letters = chr(ord("A") + rest) + letters
    return letters
