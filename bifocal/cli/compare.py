"""``bifocal compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.cli import print_result, progress_bar
from photocore.options import declared


@declared
def command(before: Path, after: Path, out: Path, as_json: bool, **options: Any) -> None:
    """Find what has changed on a wall between two dates.

    BEFORE and AFTER are relief maps of one wall, oriented on the same control, or files of pairs
    and sets with their relief.tif beside them. The folder gets the difference as GeoTIFF, changed
    regions as DXF, CSV and XLSX, and a report.
    """
    from bifocal.comparison.workflow import compare_files

    with progress_bar("comparison", quiet=as_json) as progress:
        done = compare_files(before, after, out, progress=progress, **options)
    print_result(done.to_dict(), done.lines(), as_json=as_json, remarks=done.remarks)
