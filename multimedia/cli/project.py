"""``multimedia project``."""

from __future__ import annotations

from pathlib import Path

import click

EXAMPLE = """\b
Examples:
  multimedia project tank.toml
  multimedia project tank.toml --points wand.csv --out images.csv
"""


@click.command(short_help="Image coordinates of object points through the media.", epilog=EXAMPLE)
@click.argument("project", type=click.Path(path_type=Path))
@click.option(
    "--points", type=click.Path(path_type=Path),
    help="Table of object points: id, X, Y, Z.  [default: the project's own]",
)  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path), help="Also write a .csv or .xlsx table.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    project: Path, points: Path | None, out: Path | None, overwrite: bool, as_json: bool
) -> None:
    """Project object points into every camera of PROJECT, a .toml file.

    Prints image coordinates x, y [mm], x to the right and y up from the centre of the sensor, and
    column and row [px] where the sensor is described; distortion included. Points a camera cannot
    see have a status that says why.
    """
    from multimedia.cli.tables import show
    from multimedia.orientation.workflow import project_project

    table = project_project(project, points=points, out=out, overwrite=overwrite)
    show(table, as_json=as_json, out=out, digits={"x": 6, "y": 6, "col": 4, "row": 4})
