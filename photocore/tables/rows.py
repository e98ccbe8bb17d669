"""Which rows of a sheet are data: blocks, repeated headings, notes below, hidden rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from photocore.remarks import remark
from photocore.tables.heading_words import bare
from photocore.tables.headings import Match, is_summary
from photocore.tables.model import Column
from photocore.workbook import CellGrid, Value

#: What a row begins with that is switched off.
COMMENTS = ("#", "//")


@dataclass(slots=True)
class DataRows:
    """The rows of a table.

    Parameters
    ----------
    rows : list of int
        Row numbers.
    blocks : list of str
        Label of the block each row belongs to, empty where there is none.
    remarks : list of str
        What was left out or used with doubt.
    """

    rows: list[int] = field(default_factory=list)
    blocks: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


class RowSorter:
    """Tells data from headings, block labels and notes, one row after the other.

    Parameters
    ----------
    match : Match
        Where the columns are.
    columns : sequence of Column
        What they are.
    headings : mapping
        The cells of the heading row, by column.
    whole : bool
        Whether a row that stands apart with less than half the numbers of the one before is a note.
    """

    def __init__(
        self,
        match: Match,
        columns: Sequence[Column],
        headings: Mapping[int, Value],
        *,
        whole: bool = False,
    ) -> None:
        self.whole, self.count = whole, 0
        kinds = {column.key: column.kind for column in columns}
        self.columns = match.columns
        self.text = {n for key, n in match.columns.items() if kinds[key] == "text"}
        self.numeric = {
            n for key, n in match.columns.items() if kinds[key] in ("number", "integer")
        }
        # A prepared row whose only content is a preset flag holds no data.
        self.filling = {n for key, n in match.columns.items() if kinds[key] != "flag"}
        used = set(match.columns.values())
        self.headings = {n: bare(str(v)) for n, v in headings.items() if n in used}
        self.block = ""
        self.previous = match.first - 1
        self.left_out: list[int] = []

    def is_data(self, row: int, cells: Mapping[int, Value]) -> bool:
        """Whether a row holds data; block labels and rows left out are remembered."""
        if len(cells) == 1:
            number, value = next(iter(cells.items()))
            if number not in self.text and len(self.numeric) > 1:
                self.block = label(value)
                self.previous = row
                return False
        if not self.filling & cells.keys():
            return False
        has_text = self.headings and any(isinstance(cells.get(n), str) for n in self.headings)
        if has_text and all(bare(str(cells.get(n, ""))) == h for n, h in self.headings.items()):
            self.previous = row
            return False
        count = len(self.numeric & cells.keys())
        lacks = not count or (self.whole and 2 * count < self.count)
        if row != self.previous + 1 and self.numeric and lacks:
            self.left_out.append(row)
            return False
        self.previous, self.count = row, count
        return True

    def remarks(self) -> list[str]:
        """Return what the user should know of the rows left out."""
        if not self.left_out:
            return []
        rows = ", ".join(map(str, self.left_out[:5])) + (", ..." if len(self.left_out) > 5 else "")
        return [remark("table.notes_left_out", rows=rows)]


def label(value: Value) -> str:
    """Return the label of a block as text, 27.0 as ``"27"``."""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value).strip()


def data_rows(
    grid: CellGrid,
    match: Match,
    columns: Sequence[Column],
    *,
    visible_only: bool,
    whole: bool = False,
) -> DataRows:
    """Return the rows of a table that hold data.

    Parameters
    ----------
    grid : CellGrid
        The sheet.
    match : Match
        Where the table's columns and headings are.
    columns : sequence of Column
        What was asked for.
    visible_only : bool
        Leave hidden rows out.
    whole : bool
        As of `RowSorter`.
    """
    data = DataRows()
    sorter = RowSorter(match, columns, grid.rows.get(match.header, {}), whole=whole)
    sorter.block = block_above(grid, match)
    hidden = 0
    for row in sorted(grid.rows):
        if not match.first <= row <= match.last or not sorter.is_data(row, grid.rows[row]):
            continue
        if row in grid.hidden:
            hidden += 1
            if visible_only:
                continue
        data.rows.append(row)
        data.blocks.append(sorter.block)
    data.remarks += sorter.remarks()
    named = match.columns.get("id", min(match.columns.values()))
    after = 0
    gaps = [k for k, row in enumerate(data.rows) if k and row != data.rows[k - 1] + 1]
    last = data.rows[gaps[-1] :] if gaps else []
    # Below the last gap several notes may stand, one under the other.
    notes = {row for row in last if is_summary(grid.rows[row], named, apart=True)}
    apart = {data.rows[k] for k in gaps} | (notes if len(notes) == len(last) else set())
    for index in reversed(range(len(data.rows))):
        row = data.rows[index]
        is_point = after == row + 1 or len(data.rows) == 1
        if is_point or not is_summary(grid.rows[row], named, apart=row in apart):
            after = row
            continue
        del data.rows[index], data.blocks[index]
        data.remarks.append(remark("table.summary_left_out", row=row))
    _drop_commented(grid, data)
    if hidden:
        key = f"table.hidden_{'left_out' if visible_only else 'used'}"
        data.remarks.append(remark(key, count=hidden))
    return data


def _drop_commented(grid: CellGrid, data: DataRows) -> None:
    """Leave out rows that begin with # or //, unless all do: then it is part of the names."""
    first = [str(grid.rows[row][min(grid.rows[row])]) for row in data.rows]
    off = [text.lstrip().startswith(COMMENTS) for text in first]
    if not any(off) or all(off):
        return
    rows = [str(row) for row, out in zip(data.rows, off, strict=True) if out]
    listed = ", ".join(rows[:5]) + (", ..." if len(rows) > 5 else "")
    data.remarks.append(remark("table.commented", rows=listed))
    for index in reversed([k for k, out in enumerate(off) if out]):
        del data.rows[index], data.blocks[index]


def block_above(grid: CellGrid, match: Match) -> str:
    """Return the label of the first block, which stands alone above the headings or the data.

    Of two rows above data without headings the nearer one counts; above headings only the next row
    is looked at, and a text there is a title.
    """
    top = min(match.header or match.first, match.first)
    nearest_first = sorted((row for row in grid.rows if row < top), reverse=True)
    for row in nearest_first[: 1 if match.header else 2]:
        value = next(iter(grid.rows[row].values()))
        if len(grid.rows[row]) == 1 and not (match.header and isinstance(value, str)):
            return label(value)
    return ""
