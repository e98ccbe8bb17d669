"""``bifocal ortho``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from photocore.cli import print_result, progress_bar, remark
from photocore.options import (
    FILE,
    NOT_NEGATIVE,
    Length,
    Scale,
    as_json,
    bounds,
    choice,
    cog,
    number,
    overwrite,
    switch,
)

if TYPE_CHECKING:
    from bifocal.model.points import SurveyPoints

EXAMPLE = """\b
Examples:
  bifocal ortho wall.pair.json --relief relief.tif --out ortho.tif
  bifocal ortho wall.pair.json --points result.xlsx --breakline P7,P8,P9 --out ortho.tif
  bifocal ortho result.xlsx --out ortho.tif
  bifocal ortho wall.pair.json --plane --gsd 5mm --bounds -4,0,4,7.5 --out flat.tif
  bifocal ortho wall.pair.json --relief relief.tif --image both --fill --out ortho.tif
  bifocal ortho wall.pair.json --relief relief.tif --image both --complete --out picture.tif
  bifocal ortho wall.pair.json --relief relief.tif --deliver drawing --scale 1:50 --dpi 254
                --control control.csv --mark result.xlsx --section x=1.5
                --section y=2 --contours 0.05
"""


@click.command(epilog=EXAMPLE)
@click.argument("pair", type=FILE)
@click.option("--out", type=FILE, help="GeoTIFF to write.")
@click.option("--relief", type=FILE, help="Relief map of `bifocal relief`.")
@click.option("--points", type=FILE, help="Result of `bifocal solve`: relief between its points.")
@click.option(
    "--breakline", "breaklines", multiple=True, metavar="ID,ID,...",
    help="Points along an edge that no triangle may cross; repeat it. With --points.",
)  # fmt: skip
@click.option(
    "--plane", is_flag=False, flag_value="0", type=Length(), metavar="[M]",
    help="No relief: the reference plane, or one so many metres before it.",
)  # fmt: skip
@choice(
    "--image", "1|2|both",
    "Photo that gives the colours: 1 far, 2 near, both: 1 where it sees the wall, else 2.",
    default="1",
)  # fmt: skip
@click.option(
    "--gsd", type=Length(above=0),
    help="Pixel of the orthophoto [m], or with its unit: 5mm.  [default: that of the relief map "
    "or the photo]",
)  # fmt: skip
@bounds("Part of the wall [m].  [default: all that is known]")
@choice(
    "--interpolation", "cubic|linear|nearest|lanczos", "Between the pixels of the photo.",
    default="cubic",
)  # fmt: skip
@switch("mask", "Leave empty what relief hides from the camera, or show what hides it.")
@click.option("--fill", is_flag=True, help="Close holes with the colours around them.")
@click.option(
    "--complete", is_flag=True,
    help="A whole picture: unknown relief is interpolated, far from all else the plane; what is "
    "not measured says so in the last band. Closes holes, too.",
)  # fmt: skip
@switch("match", "With --image both: bring photo 2 to the colours of photo 1.")
@click.option(
    "--vignetting", default="", metavar="cos4|K1,K2,K3",
    help="Undo the fall-off of light to the corners.  [default: off]",
)  # fmt: skip
@click.option("--chromatic", is_flag=True, help="Measure and undo red and blue fringes.")
@number(
    "--feather", "PX", "Width of the transition between the photos [px].",
    type=NOT_NEGATIVE, default=8.0,
)  # fmt: skip
@click.option(
    "--deliver", "folder", type=FILE, metavar="DIR",
    help="Write GeoTIFF, PNG, DXF and PDF, of the relief too, into a folder. Needs --scale.",
)  # fmt: skip
@click.option("--scale", type=Scale(), help="Scale of the drawing 1:N, e.g. 1:50.")
@number(
    "--dpi", "N",
    "Pixels per inch of paper; at 1:50 and 254 dpi a pixel is 5.00 mm. With --deliver.",
    default=254.0,
)  # fmt: skip
@click.option("--title", default="", help="Title of the drawing.  [default: the pair's name]")
@choice(
    "--paper", "A4|A3|A2|A1|A0", "Sheet of paper.  [default: the smallest that fits]",
    case_sensitive=False,
)  # fmt: skip
@click.option("--mark", type=FILE, help="Table of points to draw.  [default: --points]")
@click.option("--control", type=FILE, help="Table of control points to draw.")
@click.option(
    "--section", "sections", multiple=True, metavar="x=M|y=M|'X,Y X,Y ...'",
    help="Section of the relief as DXF and SVG [m]; repeat it. With --deliver.",
)  # fmt: skip
@click.option(
    "--contours", type=Length(above=0), help="Between contour lines [m].  [default: by relief]"
)
@click.option(
    "--overviews/--no-overviews", default=None,
    help="Reduced copies in the file.  [default: above 50 megapixels]",
)  # fmt: skip
@click.option("--tfw", is_flag=True, help="Also write the world file beside it.")
@click.option("--any-size", is_flag=True, help="Do not ask back about an unusual size.")
@cog
@overwrite
@as_json
def command(
    pair: Path, out: Path | None, relief: Path | None, points: Path | None,
    breaklines: tuple[str, ...], plane: float | None, interpolation: str, mask: bool, fill: bool,
    complete: bool, feather: float, folder: Path | None, scale: float | None, dpi: float,
    title: str,
    paper: str | None, mark: Path | None, control: Path | None, sections: tuple[str, ...],
    contours: float | None, tfw: bool, overwrite: bool, as_json: bool, **choices: Any,
) -> None:  # fmt: skip
    """Make the orthophoto of a wall from the photos of a PAIR file or survey workbook.

    Every pixel is taken from the original photo, moved by its own relief. Relief comes from a
    map, from measured points, or is none (--plane); by default from the points of the workbook,
    if PAIR is one: its set-up is then taken as typed. What the camera cannot see stays empty; the
    last band says where each pixel comes from (0 nothing, 1 and 2 the photos, 3 both, 4 filled,
    5 a photo on interpolated relief, 6 a photo on the plane).
    """
    from bifocal.orthophotos.deliver_workflow import DeliverTask, default_title, deliver
    from bifocal.orthophotos.ortho_image import OrthoOptions
    from bifocal.orthophotos.ortho_workflow import OrthoTask, make_ortho, not_measured
    from bifocal.workbook.pair_workflow import is_workbook, points_of, read_pair

    if out is None and folder is None:
        raise click.UsageError("Give --out FILE, --deliver DIR or both.")
    if folder is not None and scale is None:
        raise click.UsageError("--deliver needs the scale of the drawing, e.g. --scale 1:50.")
    if sum(choice is not None for choice in (relief, points, plane)) > 1:
        raise click.UsageError("Give one of --relief, --points and --plane.")
    source = read_pair(pair)
    own: Path | SurveyPoints | None = points
    if relief is None and points is None and plane is None and is_workbook(pair):
        own = points_of(pair)
    if breaklines and own is None:
        raise click.UsageError("--breakline joins measured points; give their table by --points.")
    drawn = {"--section": sections, "--contours": contours, "--mark": mark, "--control": control}
    for name, given in drawn.items():
        if given and folder is None:
            raise click.UsageError(f"{name} is drawn into a folder; give --deliver DIR.")
    if relief is None and own is None and plane is None:
        remark("No relief given: the wall is taken as flat (as with --plane).")
    task = OrthoTask(
        relief=relief, points=own, breaklines=[line.split(",") for line in breaklines],
        plane=plane or 0.0, scale=scale, **choices,
        options=OrthoOptions(
            interpolation=interpolation,  # type: ignore[arg-type]
            mask_hidden=mask, fill=fill, complete=complete, feather=feather,
        ),
    )  # fmt: skip
    files: dict[str, object] = {}
    with progress_bar("orthophoto", quiet=as_json) as progress:
        if folder is not None and scale is not None:
            wish = DeliverTask(
                scale=scale, dpi=dpi, title=title or default_title(source, pair), paper=paper,
                marked=mark, control=control, sections=sections, interval=contours,
            )  # fmt: skip
            done = deliver(
                source, folder, task, wish, out=out, overwrite=overwrite, progress=progress
            )
            result = done.ortho
            files = {"folder": str(folder), "files": list(done.files), "sheet": done.sheet}
        else:
            result = make_ortho(
                source, out or Path("ortho.tif"), task, overwrite=overwrite, world_file=tfw,
                progress=progress,
            )  # fmt: skip
    grid, shares = result.grid, result.shares
    lines = [
        f"{result.path}: {grid.width} x {grid.height} px of {grid.gsd * 1000:g} mm; "
        f"{100 * (1 - shares['none']):.1f} % covered, {100 * shares['hidden']:.1f} % hidden"
    ]
    if told := not_measured(shares):
        lines.append(f"Not measured: {told}")
    if files:
        lines.append(f"{folder}: {', '.join(done.files)} (sheet {done.sheet})")
    print_result(result.to_dict() | files, lines, as_json=as_json, remarks=result.remarks)
