"""``multimedia project``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from multimedia.cli.tables import ProjectOption
from photocore.option_types import NEW_TABLE
from photocore.options import Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class ProjectCommand:
    """The options of ``multimedia project``, and examples.

    multimedia project tank.toml
    multimedia project tank.toml --points wand.csv --out images.csv
    """

    project: ProjectOption
    points: Path | None = None
    """Table of object points: id, X, Y, Z.  [default: the project's own]"""
    out: Annotated[Path | None, Typed(NEW_TABLE)] = None
    """Also write a .csv or .xlsx table; - is stdout."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(ProjectCommand)
def command(options: ProjectCommand) -> None:
    """Project object points into every camera of PROJECT, a .toml file.

    Prints image coordinates x, y [mm], x to the right and y up from the centre of the sensor, and
    column and row [px] where the sensor is described; distortion included. Points a camera cannot
    see have a status that says why.
    """
    from multimedia.cli.tables import show
    from multimedia.orientation import project_project

    table = project_project(
        options.project, out=options.out, points=options.points, overwrite=options.overwrite
    )
    show(
        table, as_json=options.as_json, out=options.out, digits={"x": 6, "y": 6, "col": 4, "row": 4}
    )
