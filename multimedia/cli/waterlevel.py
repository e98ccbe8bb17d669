"""``multimedia waterlevel``."""

from __future__ import annotations

from pathlib import Path

import click

EPILOG = """\b
Examples:
  multimedia waterlevel tiepoints.csv
  multimedia waterlevel tiepoints.ply --tilted --out water.json
  multimedia bathymetry dem.tif --water-level water.json --index 1.337 --out bed.tif
"""


@click.command(
    "waterlevel", short_help="Mean water height from tie points on the surface.", epilog=EPILOG
)
@click.argument("source", metavar="POINTS", type=click.Path(path_type=Path))
@click.option("--tilted", is_flag=True, help="Fit a tilted plane instead of a height. [off]")
@click.option(
    "--spread",
    type=click.FloatRange(0, min_open=True),
    metavar="M",
    help="Expected standard deviation of a surface point, waves included [m]. "
    "[default: from the data]",
)
@click.option(
    "--out",
    "target",
    type=click.Path(path_type=Path),
    help="Write the level as .json, for `multimedia bathymetry`. [default: none]",
)
@click.option("--overwrite", is_flag=True, help="Replace an existing file. [off]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object. [off]")
def command(
    source: Path,
    tilted: bool,
    spread: float | None,
    target: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Estimate the mean water height from tie points, some of them on the water surface.

    POINTS is a table or point cloud (.csv .txt .xyz .ply .las .laz). The surface is the highest
    group of points of about one height; points on the bottom and blunders are rejected.
    """
    from multimedia.bathymetry.waterlevel_workflow import fit_water_level
    from photocore.cli import print_json, remark

    fitted = fit_water_level(
        source, tilted=tilted, spread=spread, target=target, overwrite=overwrite
    )
    for text in fitted.remarks:
        remark(text)
    if as_json:
        print_json(fitted.as_dict())
        return
    water = fitted.water
    click.echo(f"water level   {water.level:.5f} m, standard deviation {water.sigma:.2g} m")
    click.echo(f"single point  {water.spread:.2g} m (measurement and waves)")
    click.echo(
        f"points        {int(water.used.sum())} on the surface, {water.below} below and "
        f"{water.above} above rejected"
    )
    if tilted:
        click.echo(
            f"slope         {1000 * water.slope[0]:+.4g} mm/m in X, {1000 * water.slope[1]:+.4g} "
            f"mm/m in Y (sd {1000 * water.slope_sigma[0]:.2g}, {1000 * water.slope_sigma[1]:.2g})"
        )
