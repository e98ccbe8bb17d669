"""``multimedia project``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from photocore.options import FILE, NEW_TABLE, as_json, overwrite

EXAMPLE = """\b
Examples:
  multimedia project tank.toml
  multimedia project tank.toml --points wand.csv --out images.csv
"""


@click.command(epilog=EXAMPLE)
@click.argument("project", type=FILE)
@click.option(
    "--points", type=FILE,
    help="Table of object points: id, X, Y, Z.  [default: the project's own]",
)  # fmt: skip
@click.option("--out", type=NEW_TABLE, help="Also write a .csv or .xlsx table; - is stdout.")
@overwrite
@as_json
def command(project: Path, out: Path | None, as_json: bool, **options: Any) -> None:
    """Project object points into every camera of PROJECT, a .toml file.

    Prints image coordinates x, y [mm], x to the right and y up from the centre of the sensor, and
    column and row [px] where the sensor is described; distortion included. Points a camera cannot
    see have a status that says why.
    """
    from multimedia.cli.tables import show
    from multimedia.orientation.workflow import project_project

    table = project_project(project, out=out, **options)
    show(table, as_json=as_json, out=out, digits={"x": 6, "y": 6, "col": 4, "row": 4})
