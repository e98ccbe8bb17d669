"""``bifocal compare``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from bifocal.options import LanguageOption
from photocore.cli import print_result, progress_bar
from photocore.option_types import POSITIVE
from photocore.options import Argument, Typed, declared
from photocore.shared_options import ChangedPhotosOption, JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class CompareCommand:
    """The options of ``bifocal compare``, and examples.

    bifocal compare relief2019.tif relief2024.tif --out changed
    bifocal compare relief2019.tif relief2024.tif --fit --language de --out moved
    bifocal compare relief2019.tif relief2024.tif --stable still.geojson --out bulge

    Positive: the wall came forward. A region is only told where chance alone would make any on the
    whole wall with a probability below 1 %.
    """

    before: Annotated[Path, Argument()]
    after: Annotated[Path, Argument()]
    out: Annotated[Path, Typed(unit="DIR")]
    """Folder to write."""
    stable: Path | None = None
    """GeoJSON polygons (X, Y) of parts that did not move: offset and tilt are found there."""
    fit: bool = False
    """Find offset and tilt on the whole wall, robustly: most of it did not move."""
    smallest: Annotated[float, Typed(POSITIVE, "M2")] = 0.02
    """Area of the smallest patch that is tested [m2]."""
    language: LanguageOption = "en"
    changed_photos: ChangedPhotosOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(CompareCommand)
def command(options: CompareCommand) -> None:
    """Find what has changed on a wall between two dates.

    BEFORE and AFTER are relief maps of one wall, oriented on the same control, or files of pairs
    and sets with their relief.tif beside them. Where the photos that a map is of are there too,
    every change is held against them. The folder gets the difference as GeoTIFF, changed
    regions as DXF, CSV and XLSX, and a report.
    """
    from bifocal.comparison import compare_files

    with progress_bar("comparison", quiet=options.as_json) as progress:
        done = compare_files(
            options.before,
            options.after,
            options.out,
            progress=progress,
            stable=options.stable,
            fit=options.fit,
            smallest=options.smallest,
            language=options.language,
            overwrite=options.overwrite,
        )
    print_result(done.to_dict(), done.lines(), as_json=options.as_json, remarks=done.remarks)
