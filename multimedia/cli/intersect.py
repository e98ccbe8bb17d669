"""``multimedia intersect``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.options import declared


@declared
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
