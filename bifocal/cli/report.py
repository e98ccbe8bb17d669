"""``bifocal report``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.cli import progress_bar, remark, tell_written
from photocore.options import declared


@declared
def command(source: Path, out: Path, overwrite: bool, **options: Any) -> None:
    """Report what was measured, with which geometry, and how good it is.

    SOURCE is a solved workbook, a PAIR file, or the folder of `bifocal facade` or `bifocal
    survey`. The report is one file that needs nothing else: accuracy and verdict per drawing
    scale first, then geometry, photos, relief, residuals, and the method with one point worked
    through for a pocket calculator.
    """
    from bifocal.options import PROJECT
    from bifocal.reports.workflow import ReportTask, report_of

    project = {name: value for name in PROJECT if (value := options.pop(name)) is not None}
    given: dict[str, Any] = {
        "unit": options.pop("unit") or "",
        "language": options.pop("language") or "",
    }
    task = ReportTask(**options, **given, project=project)
    with progress_bar("report") as progress:
        for text in report_of(source, out, task, overwrite=overwrite, progress=progress):
            remark(text)
    tell_written(out)
