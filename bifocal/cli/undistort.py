"""``bifocal undistort``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from bifocal.options import OF_DATABASE
from photocore.cli import print_result, progress_bar
from photocore.options import FILE, as_json, overwrite, takes

EXAMPLE = """\b
Examples:
  bifocal undistort far.jpg --lens lens35.json --out-dir corrected
  bifocal undistort far.jpg near.jpg --lens exif

All other commands take the original photos together with a lens file and resample once; correct
photos beforehand only for other programs.
"""


@click.command(epilog=EXAMPLE)
@click.argument("images", nargs=-1, required=True, metavar="IMAGE...", type=FILE)
@click.option(
    "--lens", required=True, metavar="FILE|exif",
    help="Lens file (lens.json, COLMAP cameras.txt, Metashape .xml, OpenCV .yml), or exif for the "
    "lens database.",
)  # fmt: skip
@click.option("--out-dir", type=FILE, help="Existing folder to write to.  [default: the photo's]")
@takes(*OF_DATABASE)
@overwrite
@as_json
def command(
    images: tuple[Path, ...], lens: str, out_dir: Path | None, as_json: bool, **options: Any
) -> None:
    """Write each photo without lens distortion as NAME_undistorted, same size and scale."""
    from bifocal.calibration.workflow import undistort_images

    if out_dir is not None and not out_dir.is_dir():
        raise click.UsageError(f"--out-dir: the folder {out_dir} does not exist.")
    with progress_bar("Undistorting", quiet=as_json) as progress:
        written, notes = undistort_images(
            images, lens, folder=out_dir, progress=progress, **options
        )
    data = {"written": written, "remarks": notes}
    print_result(data, map(str, written), as_json=as_json, remarks=notes)
