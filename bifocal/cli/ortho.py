"""``bifocal ortho``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bifocal.options import CONTROL, DRAWING, GSD, LANGUAGE, PICTURE
from photocore.cli import print_result, progress_bar, remark
from photocore.options import FILE, Length, as_json, cog, overwrite, takes

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

_CONTROL = CONTROL.but(help="Table of control points to draw.")
_LANGUAGE = LANGUAGE.but(help="Of sheets and sections.")


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
@takes(GSD, *PICTURE)
@click.option(
    "--deliver", "folder", type=FILE, metavar="DIR",
    help="Write GeoTIFF, PNG, DXF and PDF, of the relief too, into a folder. Needs --scale.",
)  # fmt: skip
@takes(*DRAWING, _CONTROL, _LANGUAGE)
@click.option("--title", default="", help="Title of the drawing.  [default: the pair's name]")
@click.option("--tfw", is_flag=True, help="Also write the world file beside it.")
@cog
@overwrite
@as_json
def command(
    pair: Path, out: Path | None, relief: Path | None, points: Path | None,
    breaklines: tuple[str, ...], plane: float | None, folder: Path | None, title: str,
    tfw: bool, overwrite: bool, as_json: bool,
    **given: Any,
) -> None:  # fmt: skip
    """Make the orthophoto of a wall from the photos of a PAIR file or survey workbook.

    Every pixel is taken from the original photo, moved by its own relief. Relief comes from a
    map, from measured points, or is none (--plane); by default from the points of the workbook,
    if PAIR is one: its set-up is then taken as typed. What the camera cannot see stays empty; the
    last band says where each pixel comes from (0 nothing, 1 and 2 the photos, 3 both, 4 filled,
    5 a photo on interpolated relief, 6 a photo on the plane).
    """
    from bifocal.orthophotos.deliver_workflow import DeliverTask, default_title, deliver
    from bifocal.orthophotos.ortho_workflow import OrthoTask, make_ortho, not_measured
    from bifocal.workbook.pair_workflow import is_workbook, points_of, read_pair

    if out is None and folder is None:
        raise click.UsageError("Give --out FILE, --deliver DIR or both.")
    drawing = {option.name: given.pop(option.name) for option in (*DRAWING, _CONTROL, _LANGUAGE)}
    scale = drawing["scale"]
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
    for option in (*DRAWING[3:], _CONTROL):
        if drawing[option.name] and folder is None:
            raise click.UsageError(f"{option.flag} is drawn into a folder; give --deliver DIR.")
    if relief is None and own is None and plane is None:
        remark("No relief given: the wall is taken as flat (as with --plane).")
    task = OrthoTask.from_given(
        given, relief=relief, points=own, breaklines=[line.split(",") for line in breaklines],
        plane=plane or 0.0, scale=scale,
    )  # fmt: skip
    files: dict[str, object] = {}
    with progress_bar("orthophoto", quiet=as_json) as progress:
        if folder is not None and scale is not None:
            wish = DeliverTask(title=title or default_title(source, pair), **drawing)
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
