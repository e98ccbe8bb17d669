"""``bifocal relief``."""

from __future__ import annotations

from pathlib import Path

import click

from photocore.cli import print_json, progress_bar, remark
from photocore.options import Numbers

EXAMPLE = """\b
Examples:
  bifocal relief wall.pair.json --out relief.tif --preview relief.png
  bifocal relief wall.pair.json --out relief.tif --gsd 0.005 --bounds -5,-3,5,3 --cloud wall.laz
  bifocal relief wall.pair.json --out quick.tif --quality fast --json

Bands of the GeoTIFF: relief [m], NaN where unknown; its sigma [m]; quality (1 measured in both
photos, 2 interpolated, 3 hidden from a camera, 0 unknown).
"""


@click.command(short_help="Dense relief map of the wall.", epilog=EXAMPLE)
@click.argument("pair_file", metavar="PAIR.pair.json", type=click.Path(path_type=Path))
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), help="Relief map to write (.tif)."
)
@click.option(
    "--gsd", type=float, metavar="M",
    help="Side of a pixel of the map on the plane [m], 0.2 at most; a coarse one is also matched "
    "more coarsely.  [default: that of the far photo]",
)  # fmt: skip
@click.option(
    "--bounds", type=Numbers(4), metavar="XMIN,YMIN,XMAX,YMAX",
    help="Part of the plane [m].  [default: all that both photos see]",
)  # fmt: skip
@click.option(
    "--quality", type=click.Choice(["fast", "standard", "best"]), default="standard",
    show_default=True,
    help="fast: half the resolution; best: full resolution also above 9 megapixels.",
)  # fmt: skip
@click.option(
    "--relief-range", type=Numbers(2), metavar="LOW,HIGH",
    help="Least and greatest relief to expect [m].  [default: -36 % and +22 % of d2]",
)  # fmt: skip
@click.option("--preview", type=click.Path(path_type=Path), help="Also a shaded picture (.png).")
@click.option(
    "--cloud", type=click.Path(path_type=Path),
    help="Also a coloured point cloud (.ply, .las, .laz).",
)  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    pair_file: Path, out: Path, gsd: float | None, bounds: tuple[float, ...] | None, quality: str,
    relief_range: tuple[float, ...] | None, preview: Path | None, cloud: Path | None,
    overwrite: bool, as_json: bool,
) -> None:  # fmt: skip
    """Measure the relief of the whole wall from the two photos of a pair file.

    Every pixel of the map gets its relief and the standard deviation of it, which comes from the
    photos themselves: points can only move along the radius, so what moves across it is error.
    """
    from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair

    job = ReliefJob(
        out=out, preview=preview, cloud=cloud, gsd=gsd, quality=quality, overwrite=overwrite,
        bounds=None if bounds is None else (bounds[0], bounds[1], bounds[2], bounds[3]),
        relief_range=None if relief_range is None else (relief_range[0], relief_range[1]),
    )  # fmt: skip
    with progress_bar("Relief", quiet=as_json) as progress:
        summary, remarks = relief_of_pair(pair_file, job, progress=progress)
    for line in remarks:
        remark(line)
    if as_json:
        print_json(summary | {"remarks": list(remarks)})
        return
    width, height = summary["size"]
    shares, relief = summary["shares"], summary["relief"]
    click.echo(f"Map       {width} x {height} px of {1000 * summary['gsd']:.2f} mm")
    click.echo(
        f"Relief    {relief['min']:.3f} to {relief['max']:.3f} m, median {relief['median']:.3f} m"
    )
    click.echo(
        f"Pixels    {shares['measured']:.0%} measured, {shares['interpolated']:.0%} interpolated, "
        f"{shares['hidden']:.0%} hidden, {shares['unknown']:.0%} unknown"
    )
    if summary["sigma_median"] is not None:
        click.echo(f"Sigma     {1000 * summary['sigma_median']:.1f} mm (median of the measured)")
    for path in summary["written"]:
        click.echo(f"Written   {path}")
