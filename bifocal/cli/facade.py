"""``bifocal facade``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bifocal.cli.media_options import media_of_pair
from photocore.cli import print_result, progress_bar
from photocore.options import (
    FILE,
    Length,
    Names,
    Numbers,
    Scale,
    as_json,
    bounds,
    choice,
    number,
    overwrite,
)  # fmt: skip

if TYPE_CHECKING:
    from bifocal.campaigns.pair_job import PairJob, PairOutcome

EXAMPLE = """\b
Examples:
  bifocal facade far.jpg near.jpg --control points.csv --scale 1:50 --out DIR
  bifocal facade far.jpg near.jpg --control points.csv --check check.csv --scale 1:20 --out wall
  bifocal facade far.jpg near.jpg --auto --distance1 17.5 --scale 1:100 --language de --out wall
  bifocal facade reef_far.jpg reef_near.jpg --control reef.csv --indices 1,1.49,1.337
                 --thicknesses 0.01 --port 0.05 --prior index3=0.003 --out reef
"""

#: What to look at first.
_TO_OPEN = ("report/*.html", "drawing/*.pdf", "points/*.xlsx", "relief/*.png", "ortho/*.tif")


@click.command(epilog=EXAMPLE)
@click.argument("far", type=FILE)
@click.argument("near", type=FILE)
@click.option("--out", type=FILE, required=True, metavar="DIR", help="Folder of the results.")
@click.option("--control", type=FILE, help="Table of control points: id, X, Y, r [m] and pixels.")
@click.option(
    "--check", type=FILE,
    help="Table of independent check points, like --control: the accuracy is judged by them.",
)  # fmt: skip
@click.option("--scale", type=Scale(), default="1:50", show_default=True, help="Of the drawing.")
@click.option("--name", default="", help="Title.  [default: the folder's name]")
@choice("--language", "en|it|de", "Of report and workbook.", default="en")
@click.option("--lens", type=FILE, help="Lens file of both photos.")
@click.option("--lens1", type=FILE, help="Lens file of the far photo.")
@click.option("--lens2", type=FILE, help="Lens file of the near photo.")
@click.option("--lengths", type=FILE, help="Table of taped lengths: from, to, length [m].")
@click.option("--auto", is_flag=True, help="Without control points: from the photos alone.")
@click.option(
    "--as-set-up",
    is_flag=True,
    help="Take the set-up exactly as typed, square to the wall; nothing is registered anew.",
)
@number("--distance1", "M", "Far camera to the wall [m].")
@number("--distance2", "M", "Near camera to the wall [m].")
@number("--focal1", "MM", "Focal length, far photo [mm].  [default: EXIF]")
@number("--focal2", "MM", "Focal length, near photo [mm].  [default: EXIF]")
@number("--sensor-width", "MM", "Longer side of the sensor, both photos [mm].")
@number("--delta-d", "M", "Difference of the two distances [m].")
@number("--pixel-size", "MM", "Instead of the sensor width: one pixel, both photos [mm].")
@click.option(
    "--length", type=Numbers(5), metavar="COL,ROW,COL,ROW,M",
    help="A length on the wall: two points of the far photo [px] and metres.",
)  # fmt: skip
@click.option(
    "--wall", type=Numbers(2), metavar="COL,ROW",
    help="A spot of the wall in the far photo, where several planes compete [px].",
)  # fmt: skip
@media_of_pair
@choice("--unit", "m|cm|mm", "Unit of the coordinates.  [default: the headings', else m]")
@choice("--quality", "fast|standard|best", "Of the relief map.  [default: standard]")
@bounds("Part of the wall [m].  [default: all that is known]")
@click.option("--relief-gsd", type=Length(above=0), help="Pixel of the relief map [m].")
@click.option("--gsd", type=Length(above=0), help="Pixel of the product ortho [m].")
@click.option("--any-size", is_flag=True, help="Make an orthophoto of an unusual size.")
@choice("--image", "1|2|both", "Photo that gives the colours.  [default: 1]")
@click.option("--fill", is_flag=True, help="Close holes with the colours around them.")
@click.option("--complete", is_flag=True, help="A whole picture; what is not measured is marked.")
@choice("--paper", "A4|A3|A2|A1|A0", "Sheet of paper.  [default: the smallest that fits]")
@click.option(
    "--products", type=Names(), metavar="NAME,NAME,...",
    help="Of relief, points, ortho, drawing, view, report.  [default: all but ortho, which the "
    "drawing has]",
)  # fmt: skip
@click.option("--cog", is_flag=True, help="Write rasters as cloud-optimised GeoTIFF.")
@overwrite
@as_json
def command(
    far: Path, near: Path, out: Path, name: str, products: tuple[str, ...] | None, overwrite: bool,
    as_json: bool, **given: Any,
) -> None:  # fmt: skip
    """Make everything a façade needs from two photos and one table of control points.

    The pair is set up, the relief measured, the points solved, orthophoto and drawings made to
    scale, the relief shown in three dimensions, and a report written; each step into a folder of
    its own within DIR. Run it again, and only what changed is made anew; stopped, it goes on where
    it was.
    """
    from bifocal.campaigns.workflow import facade, facade_job

    job = facade_job(far, near, out, name=name, given=given, products=products, overwrite=overwrite)
    with progress_bar("facade", quiet=as_json) as progress:
        outcome = facade(job, progress=progress)
    print_result(outcome.to_dict(), _lines(job, outcome), as_json=as_json, remarks=outcome.remarks)


def _lines(job: PairJob, outcome: PairOutcome) -> list[str]:
    """Return what was made where, for people."""
    lines = []
    for step in (*outcome.kept, *outcome.done):
        names = sorted(path.name for path in (job.folder / step).iterdir() if path.name[0] != ".")
        kept = " (kept)" if step in outcome.kept else ""
        lines.append(f"{job.folder / step}{kept}: {', '.join(names)}")
    ready = [path for kind in _TO_OPEN for path in sorted(job.folder.glob(kind))]
    opened = f"; open {' and '.join(map(str, ready[:2]))} first" if ready else ""
    return [*lines, f"All of it is in {job.folder.resolve()}{opened}."]
