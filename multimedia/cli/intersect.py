"""``multimedia intersect``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from photocore.options import FILE, NEW_TABLE, as_json, choice, overwrite

EXAMPLE = """\b
Examples:
  multimedia intersect tank.toml
  multimedia intersect tank.toml --points frame.csv --out particles.xlsx
  multimedia intersect tank.toml --method pairs
"""


@click.command(epilog=EXAMPLE)
@click.argument("project", type=FILE)
@click.option(
    "--points", type=FILE,
    help="Table of image points: camera, id, and col, row [px] or x, y [mm]; or one row per point "
    "with columns such as 'cam1 col', 'cam1 row'.  [default: the project's own]",
)  # fmt: skip
@choice(
    "--method", "rigorous|rays|pairs",
    "Least squares of the image residuals; of the distances to the rays; or the mean of the "
    "midpoints of all pairs of rays, as OpenPTV does.", default="rigorous",
)  # fmt: skip
@click.option("--out", type=NEW_TABLE, help="Also write a .csv or .xlsx table; - is stdout.")
@overwrite
@as_json
def command(project: Path, out: Path | None, as_json: bool, **options: Any) -> None:
    """Intersect the rays of every point that two or more cameras of PROJECT (.toml) saw.

    Gives X, Y, Z with standard deviations [unit of the project], the number of rays, the largest
    angle between them [deg], sigma0 (about 1 if the image coordinates are as good as the project's
    sigma_image says), the camera to suspect where rays do not meet, and a status.
    """
    from multimedia.cli.tables import show
    from multimedia.orientation.workflow import intersect_project

    table = intersect_project(project, out=out, **options)
    places = dict.fromkeys(("X", "Y", "Z"), 4) | {"angle": 1, "sigma0": 2}
    show(table, as_json=as_json, out=out, digits=places)
