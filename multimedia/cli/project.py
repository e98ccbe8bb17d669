"""``multimedia project``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.options import declared


@declared
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
