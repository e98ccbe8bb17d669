"""``bifocal undistort``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import click

from bifocal.options import LensDatabaseOptions
from photocore.cli import print_result, progress_bar
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class UndistortCommand:
    """The options of ``bifocal undistort``, and examples.

    bifocal undistort far.jpg --lens lens35.json --out-dir corrected
    bifocal undistort far.jpg near.jpg --lens exif

    All other commands take the original photos together with a lens file and resample once; correct
    photos beforehand only for other programs.
    """

    images: Annotated[tuple[Path, ...], Argument(unit="IMAGE...")]
    lens: Annotated[str, Typed(unit="FILE|exif")]
    """Lens file (lens.json, COLMAP cameras.txt, Metashape .xml, OpenCV .yml), or exif for the lens
    database."""
    out_dir: Path | None = None
    """Existing folder to write to.  [default: the photo's]"""
    lens_database: LensDatabaseOptions = field(default_factory=LensDatabaseOptions)
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(UndistortCommand)
def command(
    images: tuple[Path, ...], lens: str, out_dir: Path | None, as_json: bool, **options: Any
) -> None:
    """Write each photo without lens distortion as NAME_undistorted, same size and scale."""
    from bifocal.calibration import undistort_images

    if out_dir is not None and not out_dir.is_dir():
        raise click.UsageError(f"--out-dir: the folder {out_dir} does not exist.")
    with progress_bar("Undistorting", quiet=as_json) as progress:
        written, notes = undistort_images(
            images, lens, folder=out_dir, progress=progress, **options
        )
    data = {"written": written, "remarks": notes}
    print_result(data, map(str, written), as_json=as_json, remarks=notes)
