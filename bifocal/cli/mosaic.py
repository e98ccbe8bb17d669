"""``bifocal mosaic``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from bifocal.options import BOUNDS
from photocore.cli import print_result, progress_bar
from photocore.options import FILE, Length, as_json, cog, overwrite, switch

EXAMPLE = """\b
Examples:
  bifocal mosaic left.tif middle.tif right.tif --out facade.tif
  bifocal mosaic left.tif right.tif --relief left_r.tif --relief right_r.tif --out facade.tif
  bifocal mosaic left_r.tif right_r.tif --out facade_relief.tif

The last band of the result says which input every pixel comes from: 1, 2, ... in the order given.
"""


@click.command(epilog=EXAMPLE)
@click.argument("rasters", nargs=-1, required=True, metavar="ORTHO.tif...", type=FILE)
@click.option("--out", required=True, type=FILE, help="GeoTIFF to write.")
@click.option(
    "--gsd", type=Length(above=0), help="Pixel [m] or 5mm.  [default: that of the finest]"
)
@BOUNDS.but(help="Part of the wall [m].  [default: all of it]")
@click.option(
    "--relief", multiple=True, type=FILE,
    help="Relief map: seams keep away from its edges; repeat it.",
)  # fmt: skip
@click.option("--priority", is_flag=True, help="Earlier files cover later ones; no seam is sought.")
@switch("gain", "Make the exposure equal to the first file's.")
@switch("blend", "Blend over the seams; relief maps are never mixed.")
@switch("overviews", "Reduced copies in the file, for fast display.")
@cog
@overwrite
@as_json
def command(rasters: tuple[Path, ...], out: Path, as_json: bool, **options: Any) -> None:
    """Join orthophotos, or relief maps, of one wall.

    Seams run where the rasters agree, away from edges of the relief and from hidden places;
    exposure becomes that of the first file and colours fade into each other. Sizes are not limited.
    """
    from bifocal.orthophotos.mosaic_workflow import make_mosaic

    with progress_bar("mosaic", quiet=as_json) as progress:
        result = make_mosaic(rasters, out, progress=progress, **options)
    grid = result.grid
    lines = [f"{out}: {grid.width} x {grid.height} px of {grid.gsd * 1000:g} mm"]
    lines += [f"  {100 * share:5.1f} %  {name}" for name, share in result.shares.items()]
    print_result(result.to_dict(), lines, as_json=as_json, remarks=result.remarks)
