"""``bifocal report``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from bifocal.options import SurveyOptions, UnitOption
from photocore.cli import progress_bar, remark, tell_written
from photocore.option_types import Scale
from photocore.options import Argument, Typed, declared
from photocore.shared_options import ChangedPhotosOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class ReportCommand:
    """The options of ``bifocal report``, and examples.

    bifocal report result.xlsx --out report.html
    bifocal report wall.pair.json --control points.csv --check check.csv --relief relief.tif
                   --ortho ortho.tif --scale 1:50 --out report.pdf
    bifocal report wall --language it --out rapporto.html
    """

    source: Annotated[Path, Argument()]
    out: Path
    """Report to write: .html or .pdf."""
    control: Path | None = None
    """Table of the control points of a PAIR file."""
    check: Path | None = None
    """Table of independent check points of a PAIR file."""
    relief: Path | None = None
    """Relief map of `bifocal relief`."""
    ortho: Path | None = None
    """Orthophoto of `bifocal ortho`."""
    scale: Annotated[float | None, Typed(Scale())] = None
    """Scale asked for, to be judged.  [default: that of the folder's drawings]"""
    title: str = ""
    """Title.  [default: the file's name]"""
    language: Annotated[Literal["en", "it", "de"] | None, Typed(flag="--language --lang")] = None
    """Of the report.  [default: the folder's, else en]"""
    unit: UnitOption = None
    project: SurveyOptions = field(default_factory=SurveyOptions)
    changed_photos: ChangedPhotosOption = False
    overwrite: OverwriteOption = False


@declared(ReportCommand)
def command(source: Path, out: Path, overwrite: bool, **options: Any) -> None:
    """Report what was measured, with which geometry, and how good it is.

    SOURCE is a solved workbook, a PAIR file, or the folder of `bifocal facade` or `bifocal
    survey`. The report is one file that needs nothing else: accuracy and verdict per drawing
    scale first, then geometry, photos, relief, residuals, and the method with one point worked
    through for a pocket calculator.
    """
    from bifocal.options import PROJECT
    from bifocal.reports import ReportTask, report_of

    project = {name: value for name in PROJECT if (value := options.pop(name)) is not None}
    unit, language = options.pop("unit") or "", options.pop("language") or ""
    task = ReportTask(**options, unit=unit, language=language, project=project)
    with progress_bar("report") as progress:
        for text in report_of(source, out, task, overwrite=overwrite, progress=progress):
            remark(text)
    tell_written(out)
