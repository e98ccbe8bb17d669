"""``bifocal photos``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click

from bifocal.options import SigmaControlOption, UnitOption
from photocore.cli import print_result, remark
from photocore.option_types import POSITIVE, TABLE, Names
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption

if TYPE_CHECKING:
    from bifocal.projects import ProjectPhotos


@dataclass(frozen=True, kw_only=True)
class PhotosCommand:
    """The options of ``bifocal photos``, and examples.

    bifocal photos colmap --out wall.photos.json
    bifocal photos reconstruction.json --points picks.csv --length A,B,4.20
                 --out wall.photos.json
    bifocal photos cameras.xml --points picks.csv --control control.csv --out wall.pair.json
    bifocal photos wall.photos.json --to colmap --out model

    picks.csv, a row for each photo that shows the point, in two photos or more:
      id,photo,col [px],row [px]
      A,DSC_0101.jpg,512.3,1700.8
    """

    project: Annotated[Path, Argument(unit="PROJECT")]
    out: Path
    """File of the set to write (*.photos.json), or of its best two photos (*.pair.json); with --to
    a folder."""
    images: Path | None = None
    """Folder of the photos.  [default: searched about the project]"""
    cloud: Path | None = None
    """Point cloud in the project's frame, where its file holds no points (.ply, .las, .xyz)."""
    points: Annotated[Path | None, Typed(TABLE)] = None
    """Named points: id, photo, col, row in two photos or more; or id, x, y, z of the project."""
    wall: Annotated[tuple[str, ...] | None, Typed(Names(), "N or A,B,C,...")] = None
    """Three points of the wall or more, or its number in the list.  [default: 1, the largest]"""
    horizontal: Annotated[tuple[str, ...] | None, Typed(Names(), "A,B")] = None
    """Two points on a level line.  [default: up as the project or its photos say]"""
    control: Annotated[Path | None, Typed(TABLE)] = None
    """Control points: id, X, Y, r [m], named as in --points; they give frame and scale."""
    length: Annotated[tuple[str, ...] | None, Typed(Names(), "A,B,M")] = None
    """A length measured on site: two points and metres."""
    sigma_length: Annotated[float, Typed(POSITIVE, "M")] = 0.003
    """Precision of that length [m]."""
    sigma_control: SigmaControlOption = 0.003
    unit: UnitOption = None
    """Unit of the project's lengths, where it has been scaled.  [default: as it says]"""
    part: Annotated[str | None, Typed(unit="NAME")] = None
    """Which of the project's models, chunks or components.  [default: the largest]"""
    to: Literal["colmap"] | None = None
    """Write a set of photos for another program, as a text model of COLMAP."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(PhotosCommand)
def command(
    project: Path, out: Path, to: str | None, overwrite: bool, as_json: bool, **given: Any
) -> None:
    """Take over the cameras of another program's finished project as a set of photos of a wall.

    PROJECT is a folder or file of COLMAP (text or binary), Metashape (cameras exported as XML),
    OpenDroneMap or OpenSfM (reconstruction.json), AliceVision or Meshroom (.sfm, or its cache),
    OpenMVG (sfm_data.json), Bundler (bundle.out), RealityCapture or RealityScan (XMP, CSV),
    VisualSFM (.nvm) or NeRF (transforms.json). The wall is the largest façade among its points, or
    another of those listed (--wall 2), whose X, Y run on about the corner; or goes through points
    that are named, or is that of control points (--control). With --to
    PROJECT is a set of photos or a pair, and OUT a folder for the other program.
    """
    from bifocal.projects import ProjectOptions, export_photos, photos_from_project

    options = ProjectOptions(**{key: value for key, value in given.items() if value is not None})
    if to is not None:
        if options != ProjectOptions():
            raise click.UsageError("--to: takes a set of photos as it is; leave out other options.")
        export_photos(project, out, overwrite=overwrite)
        remark(f"COLMAP model written to {out}")
        return
    result = photos_from_project(project, out, options, overwrite=overwrite)
    data = {
        "program": result.program,
        "scale": result.scale,
        "walls": result.walls,
        "photos": [
            {
                "name": photo.name,
                "file": photo.file,
                "distance": photo.distance,
                "nadir": photo.nadir,
            }
            for photo in result.photos.photos
        ],
    }
    print_result(data, _lines(result), as_json=as_json, remarks=result.remarks)
    if not as_json:
        remark(f"Set of photos written to {out}")


def _lines(photos: ProjectPhotos) -> Iterator[str]:
    """Yield what was made for people."""
    yield f"{photos.program}: {len(photos.photos)} photos of the wall; scale: {photos.scale}."
    yield from (f"  {wall}" for wall in photos.walls)
    for photo in photos.photos.photos:
        yield f"  {photo.name:>16}  {photo.distance:8.3f} m from the wall"
