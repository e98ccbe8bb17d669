"""``bifocal undistort``."""

from __future__ import annotations

from pathlib import Path

import click

from photocore.cli import print_json, progress_bar, remark

EXAMPLE = """\b
Examples:
  bifocal undistort far.jpg --lens lens35.json --out-dir corrected
  bifocal undistort far.jpg near.jpg --lens exif

All other commands take the original photos together with a lens file and resample once; correct
photos beforehand only for other programs.
"""


@click.command(short_help="Photos freed of lens distortion.", epilog=EXAMPLE)
@click.argument(
    "images", nargs=-1, required=True, metavar="IMAGE...", type=click.Path(path_type=Path)
)
@click.option(
    "--lens", required=True, metavar="FILE|exif",
    help="Lens file (lens.json, COLMAP cameras.txt, Metashape .xml, OpenCV .yml), or exif for the "
    "lens database.",
)  # fmt: skip
@click.option(
    "--out-dir", type=click.Path(path_type=Path), help="Folder to write to.  [default: the photo's]"
)
@click.option("--camera-name", default="", help="With exif: camera, if EXIF lacks it.")
@click.option("--lens-name", default="", help="With exif: lens, if EXIF lacks it.")
@click.option("--focal", type=float, help="With exif: focal length [mm], if EXIF lacks it.")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    images: tuple[Path, ...], lens: str, out_dir: Path | None, camera_name: str, lens_name: str,
    focal: float | None, overwrite: bool, as_json: bool,
) -> None:  # fmt: skip
    """Write each photo without lens distortion as NAME_undistorted, same size and scale."""
    from bifocal.calibration.workflow import undistort_images

    if out_dir is not None and not out_dir.is_dir():
        raise click.UsageError(f"--out-dir: the folder {out_dir} does not exist.")
    with progress_bar("Undistorting", quiet=as_json) as progress:
        written, notes = undistort_images(
            images, lens, folder=out_dir, overwrite=overwrite, progress=progress,
            camera_name=camera_name, lens_name=lens_name, focal_length=focal,
        )  # fmt: skip
    for note in notes:
        remark(note)
    if as_json:
        print_json({"written": written, "remarks": notes})
    else:
        for path in written:
            click.echo(path)
