"""``multimedia epipolar``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from photocore.cli import print_json, remark, text_table
from photocore.options import Numbers

if TYPE_CHECKING:
    from multimedia.orientation.epipolar_workflow import EpipolarResult

EXAMPLE = """\b
Examples:
  multimedia epipolar tank.toml --camera cam1 --to cam2 --point 12
  multimedia epipolar tank.toml --camera cam1 --to cam3 --at 640.5,371.2 --z-range -20,20
  multimedia epipolar tank.toml --camera cam1 --to cam2 --picture curves.png --photo cam2.tif
"""


@click.command(short_help="Epipolar curves and the candidates along them.", epilog=EXAMPLE)
@click.argument("project", type=click.Path(path_type=Path))
@click.option("--camera", required=True, help="Camera of the image points.")
@click.option("--to", "other", required=True, help="Camera in whose image the curves run.")
@click.option(
    "--point", "ids", multiple=True, metavar="ID",
    help="Image point of --camera; repeatable.  [default: all of them]",
)  # fmt: skip
@click.option("--at", type=Numbers(2), metavar="A,B", help="Column, row of a point instead [px].")
@click.option(
    "--z-range", type=Numbers(2), metavar="A,B",
    help="Depth range of the object, Z from and to [unit of the project].  [default: that of the "
    "object points and a quarter more]",
)  # fmt: skip
@click.option(
    "--chord", type=click.FloatRange(min=0, min_open=True), default=0.5, show_default=True,
    metavar="UM", help="Largest distance between curve and polygon [um].",
)  # fmt: skip
@click.option(
    "--vertices",
    type=int,
    help="Fixed number of vertices instead of --chord.  [default: as needed]",
)
@click.option(
    "--tolerance", type=click.FloatRange(min=0, min_open=True), default=10.0, show_default=True,
    metavar="UM", help="Half width of the band in which candidates are looked for [um].",
)  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path), help="Vertices as .csv or .xlsx.")
@click.option(
    "--picture", type=click.Path(path_type=Path), help="Picture of the curves: .png, .svg or .pdf."
)
@click.option("--photo", type=click.Path(path_type=Path), help="Image of --to, under the picture.")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    project: Path,
    camera: str,
    other: str,
    ids: tuple[str, ...],
    at: tuple[float, float] | None,
    z_range: tuple[float, float] | None,
    chord: float,
    vertices: int | None,
    tolerance: float,
    out: Path | None,
    picture: Path | None,
    photo: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Draw where the ray of an image point of one camera runs in the image of another.

    Through refracting media that is a curve; it is given as a polygon whose vertices are exact and
    whose chords stay within --chord. The image points of the other camera near it are listed with
    the object point each of them would give.
    """
    from multimedia.orientation.epipolar_workflow import epipolar_project

    result = epipolar_project(
        project, camera=camera, other=other, ids=ids, at=at, z_range=z_range,
        chord_error=chord / 1000.0, vertices=vertices, tolerance=tolerance / 1000.0, out=out,
        picture=picture, photo=photo, overwrite=overwrite,
    )  # fmt: skip
    for line in result.remarks:
        remark(f"Note: {line}")
    if as_json:
        print_json(
            {"z_range": result.z_range, "curves": result.curves, "candidates": result.candidates}
        )
    else:
        _print(result)
    for file in (out, picture):
        if file is not None:
            remark(f"Written: {file}")


def _print(result: EpipolarResult) -> None:
    """Print the curves if they are few, and the candidates."""
    if len(result.curves) <= 3:
        rows = [
            (c["id"], *(f"{v:.5f}" for v in xy), *(f"{v:.4f}" for v in xyz))
            for c in result.curves
            for xy, xyz in zip(c["image"], c["points"], strict=True)
        ]
        click.echo(text_table(("point", "x mm", "y mm", "X", "Y", "Z"), rows))
    else:
        click.echo(f"{len(result.curves)} curves; --out writes their vertices.")
    rows = [
        (c["id"], c["target"], f"{c['distance'] * 1000:.2f}", *(f"{c[k]:.4f}" for k in "XYZ"))
        for c in result.candidates
    ]
    click.echo(f"\n{len(rows)} candidates")
    if rows:
        click.echo(text_table(("point", "candidate", "off um", "X", "Y", "Z"), rows[:40]))
    if len(rows) > 40:
        click.echo(f"... and {len(rows) - 40} more; --json lists them all.")
