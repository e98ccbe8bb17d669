"""``multimedia intersect``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from multimedia.cli.tables import ProjectOption
from photocore.option_types import NEW_TABLE
from photocore.options import Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class IntersectCommand:
    """The options of ``multimedia intersect``, and examples.

    multimedia intersect tank.toml
    multimedia intersect tank.toml --points frame.csv --out particles.xlsx
    multimedia intersect tank.toml --method pairs
    """

    project: ProjectOption
    points: Path | None = None
    """Table of image points: camera, id, and col, row [px] or x, y [mm]; or one row per point with
    columns such as 'cam1 col', 'cam1 row'.  [default: the project's own]"""
    method: Literal["rigorous", "rays", "pairs"] = "rigorous"
    """Least squares of the image residuals; of the distances to the rays; or the mean of the
    midpoints of all pairs of rays, as OpenPTV does."""
    out: Annotated[Path | None, Typed(NEW_TABLE)] = None
    """Also write a .csv or .xlsx table; - is stdout."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(IntersectCommand)
def command(options: IntersectCommand) -> None:
    """Intersect the rays of every point that two or more cameras of PROJECT (.toml) saw.

    Gives X, Y, Z with standard deviations [unit of the project], the number of rays, the largest
    angle between them [deg], sigma0 (about 1 if the image coordinates are as good as the project's
    sigma_image says), the camera to suspect where rays do not meet, and a status.
    """
    from multimedia.cli.tables import show
    from multimedia.orientation import intersect_project

    table = intersect_project(
        options.project,
        out=options.out,
        points=options.points,
        method=options.method,
        overwrite=options.overwrite,
    )
    places = dict.fromkeys(("X", "Y", "Z"), 4) | {"angle": 1, "sigma0": 2}
    show(table, as_json=options.as_json, out=options.out, digits=places)
