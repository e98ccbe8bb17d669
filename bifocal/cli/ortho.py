"""``bifocal ortho``."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import click

from bifocal.options import (
    DRAWING,
    OF_PAIR,
    DrawingOptions,
    FacesOption,
    GsdOption,
    LanguageOption,
    PictureOptions,
)
from photocore.cli import print_result, progress_bar, remark
from photocore.option_types import Length
from photocore.options import Argument, Typed, declared
from photocore.shared_options import (
    ChangedPhotosOption,
    JsonOption,
    OverwriteOption,
    RasterCogOption,
)

if TYPE_CHECKING:
    from bifocal.model import Points


@dataclass(frozen=True, kw_only=True)
class OrthoCommand:
    """The options of ``bifocal ortho``, and examples.

    bifocal ortho wall.pair.json --relief relief.tif --out ortho.tif
    bifocal ortho porch.photos.json --relief relief.tif --out ortho.tif
    bifocal ortho wall.pair.json --points result.xlsx --breakline P7,P8,P9 --out ortho.tif
    bifocal ortho result.xlsx --out ortho.tif
    bifocal ortho wall.pair.json --plane --gsd 5mm --bounds -4,0,4,7.5 --out flat.tif
    bifocal ortho wall.pair.json --relief relief.tif --faces doors.dxf --out ortho.tif
    bifocal ortho wall.pair.json --relief relief.tif --measured-only --out measured.tif
    bifocal ortho wall.pair.json --relief relief.tif --deliver drawing --scale 1:50 --dpi 254
                  --control control.csv --mark result.xlsx --section x=1.5
                  --section y=2 --contours 0.05
    """

    pair: Annotated[Path, Argument()]
    out: Path | None = None
    """GeoTIFF to write."""
    relief: Path | None = None
    """Relief map of `bifocal relief`."""
    points: Path | None = None
    """Result of `bifocal solve`: relief between its points."""
    breaklines: Annotated[tuple[str, ...], Typed(unit="ID,ID,...", flag="--breakline")] = ()
    """Points along an edge that no triangle may cross; repeat it. With --points."""
    plane: Annotated[float | None, Typed(Length(), "[M]", flag_value="0", is_flag=False)] = None
    """No relief: the reference plane, or one so many metres before it."""
    faces: FacesOption = None
    gsd: GsdOption = None
    picture: PictureOptions = field(default_factory=PictureOptions)
    folder: Annotated[Path | None, Typed(unit="DIR", flag="--deliver")] = None
    """Write GeoTIFF, PNG, DXF and PDF, of the relief too, and their hashes for `bifocal verify`,
    into a folder. Needs --scale."""
    drawing: DrawingOptions = field(default_factory=DrawingOptions)
    control: Path | None = None
    """Table of control points to draw."""
    language: LanguageOption = "en"
    """Of sheets and sections."""
    title: str = ""
    """Title of the drawing.  [default: the pair's name]"""
    tfw: bool = False
    """Also write the world file beside it."""
    cog: RasterCogOption = False
    changed_photos: ChangedPhotosOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(OrthoCommand)
def command(
    pair: Path, out: Path | None, relief: Path | None, points: Path | None, plane: float | None,
    folder: Path | None, title: str, tfw: bool, overwrite: bool, as_json: bool, **given: Any,
) -> None:  # fmt: skip
    """Make the orthophoto of a wall from the photos of a PAIR file, set or survey workbook.

    Every pixel is taken from the original photo, moved by its own relief. Relief comes from a
    map, from measured points, or is none (--plane); by default from the points of the workbook,
    if PAIR is one: its set-up is then taken as typed. What the camera cannot see stays empty; the
    last band says where each pixel comes from (0 nothing, 1 and 2 the photos, 3 both, 4 filled,
    5 a photo on interpolated relief, 6 a photo on the plane, 7 seen by no photo). Of a set each
    pixel is taken from the photo that sees it best: 11 is its first photo, 12 the second, 3 a
    transition.
    """
    from bifocal.faces import faces_path, keep_faces
    from bifocal.files import default_title
    from bifocal.orthophotos import DeliverTask, OrthoTask, basis_in_words, deliver, make_ortho
    from bifocal.reports import wall_in_words
    from bifocal.workbook import is_workbook, points_of, read_photos

    if out is None and folder is None:
        raise click.UsageError("Give --out FILE, --deliver DIR or both.")
    drawing = {name: given.pop(name) for name in (*DRAWING, "control", "language")}
    scale = drawing["scale"]
    if folder is not None and scale is None:
        raise click.UsageError("--deliver needs the scale of the drawing, e.g. --scale 1:50.")
    if sum(choice is not None for choice in (relief, points, plane)) > 1:
        raise click.UsageError("Give one of --relief, --points and --plane.")
    source = read_photos(pair)
    drawn = given["faces"]
    given["faces"] = faces_path(drawn, pair)
    points_used: Path | Points | None = points
    if relief is None and points is None and plane is None and is_workbook(pair):
        points_used = points_of(pair)
    breaklines = [line.split(",") for line in given.pop("breaklines")]
    if breaklines and points_used is None:
        raise click.UsageError("--breakline joins measured points; give their table by --points.")
    for name in (*DRAWING[4:], "control"):
        by_default = drawing[name] == OF_PAIR[name].attributes.get("default")
        if drawing[name] and not by_default and folder is None:
            flag = OF_PAIR[name].flag
            raise click.UsageError(f"{flag} is drawn into a folder; give --deliver DIR.")
    if relief is None and points_used is None and plane is None:
        remark("No relief given: the wall is taken as flat (as with --plane).")
    task = OrthoTask.from_given(
        given,
        relief=relief,
        points=points_used,
        breaklines=breaklines,
        plane=plane or 0.0,
        scale=scale,
    )
    files: dict[str, object] = {}
    with progress_bar("orthophoto", quiet=as_json) as progress:
        if folder is not None and scale is not None:
            title = title or default_title(source, pair)
            wish = DeliverTask(
                title=title, hashes=True, **drawing,
                expected=partial(wall_in_words, language=drawing["language"]),
            )  # fmt: skip
            done = deliver(
                source, folder, task, wish, out=out, world_file=tfw, overwrite=overwrite,
                progress=progress,
            )  # fmt: skip
            result = done.ortho
            files = {"folder": str(folder), "files": list(done.files), "sheet": done.sheet}
        else:
            result = make_ortho(
                source, out or Path("ortho.tif"), task, overwrite=overwrite, world_file=tfw,
                progress=progress,
            )  # fmt: skip
    grid, shares = result.grid, result.shares
    remarks = (*result.remarks, *keep_faces(drawn, pair))
    lines = [
        f"{result.path}: {grid.width} x {grid.height} px of {grid.gsd * 1000:g} mm; "
        f"{100 * (1 - shares['none']):.1f} % covered, {100 * shares['hidden']:.1f} % hidden"
    ]
    if basis := basis_in_words(result.basis):
        lines.append(f"Of the picture {basis}")
    if files:
        lines.append(f"{folder}: {', '.join(done.files)} (sheet {done.sheet})")
    print_result(result.to_dict() | files, lines, as_json=as_json, remarks=remarks)
