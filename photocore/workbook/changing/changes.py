"""What is to change in a sheet, and the places of its XML that do."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from operator import itemgetter
from tempfile import SpooledTemporaryFile
from typing import IO

from photocore.workbook.changing.cells import CellValue, NewCell, NewRows
from photocore.workbook.reading.grid import cell_name, split_area
from photocore.workbook.reading.package import SMALL

_ROWS_END = re.compile(rb"</(?:\w+:)?sheetData\s*>")


@dataclass(slots=True)
class SheetChanges:
    """What is to change in one sheet; rows and columns are counted from 1.

    Parameters
    ----------
    inputs : dict
        Row to (column to value): typed cells, made where they are missing. The cell's format
        stays. A cell that holds a formula is never overwritten.
    placed : dict
        Row to (column to cell): cells with formulas, or that may take the place of one.
    cached : dict
        Row to (column to result): results of formulas that are there. Cells that hold no formula
        (any more) are left as they are.
    added : list of NewRows
        Rows to be added, with formulas, formats and results.
    columns : dict
        Column to its width and whether it is folded away; columns side by side, new to the sheet.
    restates : bool
        Whether a number may be given among the results for a cell that holds one, to replace it.
    """

    inputs: dict[int, dict[int, CellValue]] = field(default_factory=dict)
    cached: dict[int, dict[int, CellValue]] = field(default_factory=dict)
    added: list[NewRows] = field(default_factory=list)
    placed: dict[int, dict[int, NewCell]] = field(default_factory=dict)
    columns: dict[int, tuple[float, bool]] = field(default_factory=dict)
    restates: bool = False

    def __bool__(self) -> bool:
        return bool(self.inputs or self.cached or self.added or self.placed or self.columns)

    def rows(self) -> list[int]:
        """Return the numbers of the rows with cells to be typed or added, in order."""
        added = (range(block.first, block.first + block.size) for block in self.added)
        return sorted(set(self.inputs).union(self.placed, *added))

    def cells(self, row: int) -> dict[int, NewCell]:
        """Return the cells to be typed or added in one row, in order."""
        typed = self.inputs.get(row, {}).items()
        cells = {column: NewCell(None if value == "" else value) for column, value in typed}
        for block in self.added:
            cells = block.cells(row) | cells
        return dict(sorted((cells | self.placed.get(row, {})).items()))

    def grown(self, reference: str) -> str:
        """Return the stated extent of a sheet with the cells that are made."""
        cells = [(row, column) for row, columns in self.inputs.items() for column in _ends(columns)]
        cells += [
            (row, column) for row, columns in self.placed.items() for column in _ends(columns)
        ]
        for block in self.added:
            numbers = [column.column for column in block.columns]
            cells += [(block.first, min(numbers)), (block.first + block.size - 1, max(numbers))]
        if not cells or not re.fullmatch(r"[A-Z]{1,3}\d+(:[A-Z]{1,3}\d+)?", reference):
            return reference
        area = top, left, bottom, right = split_area(reference)
        top, left = min(top, *(r for r, _ in cells)), min(left, *(c for _, c in cells))
        bottom, right = max(bottom, *(r for r, _ in cells)), max(right, *(c for _, c in cells))
        if (top, left, bottom, right) == area:
            return reference
        return f"{cell_name(top, left)}:{cell_name(bottom, right)}"

    def only_filled(self, row: int) -> NewRows | None:
        """Return the block that fills a row to which nothing is added, None for other rows."""
        if row in self.placed or row in self.cached:
            return None
        blocks = [block for block in self.added if 0 <= row - block.first < block.size]
        return blocks[0] if len(blocks) == 1 and blocks[0].rule == "filled" else None


class _Written(SpooledTemporaryFile[bytes]):
    """A part on its way, on the disk where it is large."""

    def __del__(self) -> None:
        self.close()  # left to itself it would warn


@dataclass(slots=True)
class Spliced:
    """A sheet with its changes, ready to be joined with or without stale results.

    Parameters
    ----------
    data : bytes
        The sheet as it was.
    edits, strips : list of (start, end, replacement)
        The changes asked for; the results of all other formulas, to be taken out.
    inputs_changed : bool
        Whether any typed value differs from what was there.
    formula_lost : bool
        Whether a value took the place of a formula.
    file : file, optional
        The changed sheet up to a position of the old one; a large one lies on the disk.
    differs : bool
        Whether what is written there is not what stood there.
    """

    data: bytes
    edits: list[tuple[int, int, bytes]] = field(default_factory=list)
    strips: list[tuple[int, int, bytes]] = field(default_factory=list)
    inputs_changed: bool = False
    formula_lost: bool = False
    file: IO[bytes] | None = None
    position: int = 0
    differs: bool = False

    def write(self) -> None:
        """Write the sheet up to its last change so far; the changes are let go."""
        if self.file is None:
            self.file = _Written(SMALL)
            if len(self.data) > SMALL:
                self.file.rollover()  # it would only look after it has taken a write whole
        view = memoryview(self.data)
        for start, end, replacement in sorted(self.edits, key=itemgetter(0, 1)):
            self.file.write(view[self.position : start])
            self.file.write(replacement)
            self.differs = self.differs or self.data[start:end] != replacement
            self.position = end
        self.edits.clear()  # not only let go: what made them holds the same list

    def written(self, *, strip: bool) -> IO[bytes]:
        """Return the changed sheet, without results of other formulas if ``strip``."""
        if self.data or self.file is None:
            self.edits += self.strips if strip else ()
            self.write()
            assert self.file is not None
            self.file.write(memoryview(self.data)[self.position :])
            self.data = b""  # of a large sheet each copy is 80 MB
        return self.file

    def joined(self, *, strip: bool) -> bytes:
        """Return the bytes of the changed sheet, as `written`."""
        file = self.written(strip=strip)
        file.seek(0)
        return file.read()


def column_edits(
    head: bytes, prefix: str, columns: Mapping[int, tuple[float, bool]]
) -> Iterator[tuple[int, int, bytes]]:
    """Yield the edits of a sheet, up to its rows, that give columns their widths and fold them.

    Parameters
    ----------
    head : bytes
        The sheet in front of its rows.
    prefix : str
        Of its tags.
    columns : mapping
        As in `SheetChanges`.
    """
    form = re.search(rb"<(?:\w+:)?sheetFormatPr\b", head)
    if form and b"outlineLevelCol" not in head and any(folded for _, folded in columns.values()):
        yield form.end(), form.end(), b' outlineLevelCol="1"'
    match = re.search(rb"<(?:\w+:)?cols\b.*</(?:\w+:)?cols\s*>", head, re.DOTALL)
    widths = {}
    for tag in re.findall(rb"<(?:\w+:)?col\s[^>]*>", match[0] if match else b""):
        low, high = (int(*re.findall(rb"\s%s=.(\d+)" % key, tag)) for key in (b"min", b"max"))
        for first, last in ((low, min(high, min(columns) - 1)), (max(low, max(columns) + 1), high)):
            if first <= last:
                changed = re.sub(rb"(\smin=.)\d+", rb"\g<1>%d" % first, tag)
                changed = re.sub(rb"(\smax=.)\d+", rb"\g<1>%d" % last, changed)
                widths[first] = changed.rstrip(b"/>") + b"/>"
    for column, (width, folded) in columns.items():
        fold = ' outlineLevel="1" hidden="1"' if folded else ""
        text = f'min="{column}" max="{column}" width="{width:g}" customWidth="1"{fold}'
        widths[column] = f"<{prefix}col {text}/>".encode()
    whole = b"".join(tag for _, tag in sorted(widths.items()))
    tags = b"<%scols>%s</%scols>" % (prefix.encode(), whole, prefix.encode())
    yield (*(match.span() if match else (len(head), len(head))), tags)


def _ends(columns: Collection[int]) -> tuple[int, ...]:
    """Return the first and the last of some columns."""
    return (min(columns), max(columns)) if columns else ()


def replaced_outside_cells(data: bytes, old: bytes, new: bytes) -> bytes:
    """Return a part with a text replaced; of a sheet only behind its rows."""
    end = max((match.end() for match in _ROWS_END.finditer(data)), default=0)
    return data[:end] + data[end:].replace(old, new)
