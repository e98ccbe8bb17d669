"""``bifocal photos``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from photocore.cli import print_result, remark
from photocore.options import declared

if TYPE_CHECKING:
    from bifocal.projects.photos_workflow import ProjectPhotos


@declared
def command(
    project: Path, out: Path, to: str | None, overwrite: bool, as_json: bool, **given: Any
) -> None:
    """Take over the cameras of another program's finished project as a set of photos of a wall.

    PROJECT is a folder or file of COLMAP (text or binary), Metashape (cameras exported as XML),
    OpenDroneMap or OpenSfM (reconstruction.json), AliceVision or Meshroom (.sfm), OpenMVG
    (sfm_data.json) or Bundler (bundle.out). The wall is the largest façade among its points, or
    goes through points that are named (--wall), or is that of control points (--control). With --to
    PROJECT is a set of photos or a pair, and OUT a folder for the other program.
    """
    from bifocal.projects.colmap_workflow import export_photos
    from bifocal.projects.photos_workflow import ProjectOptions, photos_from_project

    options = ProjectOptions(**{key: said for key, said in given.items() if said is not None})
    if to is not None:
        if options != ProjectOptions():
            raise click.UsageError("--to: takes a set of photos as it is; leave out other options.")
        export_photos(project, out, overwrite=overwrite)
        remark(f"COLMAP model written to {out}")
        return
    made = photos_from_project(project, out, options, overwrite=overwrite)
    data = {
        "program": made.program,
        "scale": made.scale,
        "photos": [
            {
                "name": photo.name,
                "file": photo.file,
                "distance": photo.distance,
                "nadir": photo.nadir,
            }
            for photo in made.photos.photos
        ],
    }
    print_result(data, _lines(made), as_json=as_json, remarks=made.remarks)
    if not as_json:
        remark(f"Set of photos written to {out}")


def _lines(made: ProjectPhotos) -> Iterator[str]:
    """Yield what was made for people."""
    yield f"{made.program}: {len(made.photos)} photos of the wall; scale: {made.scale}."
    for photo in made.photos.photos:
        yield f"  {photo.name:>16}  {photo.distance:8.3f} m from the wall"
