"""``multimedia shift``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from photocore.cli import print_json, remark
from photocore.options import declared


@declared
def command(source: Path, out: Path | None, as_json: bool, **options: Any) -> None:
    """Shift points so that straight rays see them where they are seen through the media.

    IN is a table (.xlsx, .xlsm, .ods, .csv; - for stdin) with X, Y, Z (points in water have Z
    below 0) or R, ZP (distance from the camera's nadir, depth). All lengths in one unit. A workbook
    comes back with the results put in and everything else as it was; a text table becomes .csv, or
    a workbook with live formulas.
    """
    if out is None and not as_json:
        raise click.UsageError("give --out FILE, --json, or both.")
    if None not in (options["camera"], options["z0"]):
        raise click.UsageError("give --camera or --z0, not both.")
    from multimedia.workbook.workflow import shift_file

    report = shift_file(source, out, **options)
    for text in report.remarks:
        remark(f"Note: {text}")
    if as_json:
        print_json(report.as_dict())
    if out is not None:
        remark(f"{len(report.points.ids)} points written to {out}")
