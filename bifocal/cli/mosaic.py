"""``bifocal mosaic``."""

from __future__ import annotations

from pathlib import Path

import click

from photocore.cli import print_json, progress_bar, remark
from photocore.options import Length, Numbers

EXAMPLE = """\b
Examples:
  bifocal mosaic left.tif middle.tif right.tif --out facade.tif
  bifocal mosaic left.tif right.tif --relief left_r.tif --relief right_r.tif --out facade.tif
  bifocal mosaic left_r.tif right_r.tif --out facade_relief.tif

The last band of the result says which input every pixel comes from: 1, 2, ... in the order given.
"""

_file = click.Path(path_type=Path)


@click.command(short_help="One orthophoto from several.", epilog=EXAMPLE)
@click.argument("rasters", nargs=-1, required=True, metavar="ORTHO.tif...", type=_file)
@click.option("--out", required=True, type=_file, help="GeoTIFF to write.")
@click.option("--gsd", type=Length(), help="Pixel [m] or 5mm.  [default: that of the finest]")
@click.option(
    "--bounds", type=Numbers(4), metavar="XMIN,YMIN,XMAX,YMAX",
    help="Part of the wall [m].  [default: all of it]",
)  # fmt: skip
@click.option(
    "--relief", multiple=True, type=_file,
    help="Relief map: seams keep away from its edges; repeat it.",
)  # fmt: skip
@click.option("--priority", is_flag=True, help="Earlier files cover later ones; no seam is sought.")
@click.option("--gain/--no-gain", default=True, show_default=True, help="Make the exposure equal.")
@click.option(
    "--blend/--no-blend", default=True, show_default=True,
    help="Blend over the seams; relief maps are never mixed.",
)  # fmt: skip
@click.option(
    "--overviews/--no-overviews", default=True, show_default=True,
    help="Reduced copies in the file, for fast display.",
)  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    rasters: tuple[Path, ...], out: Path, gsd: float | None, bounds: tuple[float, ...] | None,
    relief: tuple[Path, ...], priority: bool, gain: bool, blend: bool, overviews: bool,
    overwrite: bool, as_json: bool,
) -> None:  # fmt: skip
    """Join orthophotos, or relief maps, of one wall.

    Seams run where the rasters agree, away from edges of the relief and from hidden places;
    exposure is made equal and colours fade into each other. Sizes are not limited.
    """
    from bifocal.orthophotos.mosaic_workflow import make_mosaic

    with progress_bar("mosaic", quiet=as_json) as progress:
        result = make_mosaic(
            rasters, out, gsd=gsd,
            bounds=(bounds[0], bounds[1], bounds[2], bounds[3]) if bounds else None,
            relief=relief, priority=priority, gain=gain, blend=blend, overviews=overviews,
            overwrite=overwrite, progress=progress,
        )  # fmt: skip
    for text in result.remarks:
        remark(text)
    if as_json:
        print_json(result.to_dict())
        return
    grid = result.grid
    click.echo(f"{out}: {grid.width} x {grid.height} px of {grid.gsd * 1000:g} mm")
    for name, share in result.shares.items():
        click.echo(f"  {100 * share:5.1f} %  {name}")
