"""Printing the tables of the camera commands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from photocore.cli import print_result, remark, text_table
from photocore.options import Argument

if TYPE_CHECKING:
    from multimedia.orientation import PointTable

ProjectOption = Annotated[Path, Argument()]
#: Rows printed when the table also goes into a file.
_SHOWN = 10


def show(table: PointTable, *, as_json: bool, out: Path | None, digits: Mapping[str, int]) -> None:
    """Print a table: as JSON, or as text with the given number of decimals."""
    records = table.records()
    shown = records if out is None else records[:_SHOWN]
    rows = [[_text(row[name], digits.get(name)) for name in table.columns] for row in shown]
    lines = [text_table(tuple(table.columns), rows)]
    if len(shown) < len(records):
        lines.append(f"... and {len(records) - len(shown)} more")
    data = {"points": records, "summary": list(table.summary)}
    print_result(data, [*lines, *table.summary], as_json=as_json, notes=table.remarks)
    if out is not None:
        remark(f"Table written to {out}")


def _text(value: object, digits: int | None) -> str:
    """Return a cell: numbers with their decimals, nothing for what is undefined."""
    if isinstance(value, float):
        if value != value:
            return "-"
        return f"{value:.{digits}f}" if digits is not None else f"{value:.4g}"
    return str(value)
