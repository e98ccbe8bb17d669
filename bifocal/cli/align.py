"""``bifocal align``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from photocore.cli import print_json, remark

if TYPE_CHECKING:
    from bifocal.orientation.alignment import Alignment

EXAMPLE = """\b
Examples:
  bifocal align far.jpg near.jpg --control points.csv --out wall.pair.json
  bifocal align far.jpg near.jpg --distance1 17.5 --distance2 9.5 --focal1 35 --focal2 19
               --sensor-width 22.7 --out wall.pair.json
  bifocal align far.jpg near.jpg --auto --distance1 17.5 --out wall.pair.json
\b
points.csv, one line per control point; r blank = on the wall; pixels in both photos:
  id,X [m],Y [m],r [m],col1 [px],row1 [px],col2 [px],row2 [px]
  P1,0.000,0.000,,512.3,1700.8,498.1,1741.0
"""


class NumberList(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """Numbers separated by commas."""

    name = "numbers"

    def __init__(self, count: int) -> None:
        self.count = count

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Return a tuple of floats."""
        if isinstance(value, tuple):
            return value
        try:
            found = tuple(float(part) for part in value.split(","))
        except ValueError:
            found = ()
        if len(found) != self.count:
            self.fail(
                f"expected {self.count} numbers separated by commas, got {value!r}", param, ctx
            )
        return found


FILE = click.Path(path_type=Path)


@click.command(
    short_help="A pair file from two photos: control points, site distances or automatic.",
    epilog=EXAMPLE,
)
@click.argument("far", type=FILE)
@click.argument("near", type=FILE)
@click.option("--out", type=FILE, required=True, help="Pair file to write (*.pair.json).")
@click.option("--control", type=FILE, help="Table of control points: id, X, Y, r [m] and pixels.")
@click.option("--auto", is_flag=True, help="From the photos alone; needs one distance or length.")
@click.option("--distance1", type=float, metavar="M", help="Far camera to the wall [m].")
@click.option("--distance2", type=float, metavar="M", help="Near camera to the wall [m].")
@click.option("--delta-d", type=float, metavar="M", help="Difference of the two distances [m].")
@click.option(
    "--focal1", type=float, metavar="MM", help="Focal length, far photo [mm].  [default: EXIF]"
)
@click.option(
    "--focal2", type=float, metavar="MM", help="Focal length, near photo [mm].  [default: EXIF]"
)
@click.option(
    "--sensor-width", type=float, metavar="MM", help="Longer side of the sensor, both photos [mm]."
)
@click.option("--sensor-width1", type=float, metavar="MM", help="The same, far photo only [mm].")
@click.option("--sensor-width2", type=float, metavar="MM", help="The same, near photo only [mm].")
@click.option(
    "--pixel-size",
    type=float,
    metavar="MM",
    help="Instead of the sensor width: one pixel, both photos [mm].",
)
@click.option("--pixel-size1", type=float, metavar="MM", help="The same, far photo only [mm].")
@click.option("--pixel-size2", type=float, metavar="MM", help="The same, near photo only [mm].")
@click.option("--lens", type=FILE, help="Lens file of both photos.")
@click.option("--lens1", type=FILE, help="Lens file of the far photo.")
@click.option("--lens2", type=FILE, help="Lens file of the near photo.")
@click.option(
    "--lengths", type=FILE, help="Table of lengths between control points: from, to, length [m]."
)
@click.option(
    "--length",
    type=NumberList(5),
    metavar="COL,ROW,COL,ROW,M",
    help="A length on the wall: two points of the far photo [px] and metres.",
)
@click.option(
    "--wall",
    type=NumberList(2),
    metavar="COL,ROW",
    help="A spot of the wall in the far photo, where several planes compete [px].",
)
@click.option(
    "--horizontal",
    type=NumberList(4),
    metavar="COL,ROW,COL,ROW",
    help="Two points of the far photo on a level line of the wall [px].",
)
@click.option(
    "--vertical",
    type=NumberList(4),
    metavar="COL,ROW,COL,ROW",
    help="Two points of the far photo on an upright line of the wall [px].",
)
@click.option(
    "--unit",
    type=click.Choice(["m", "cm", "mm"]),
    help="Unit of the control coordinates.  [default: the headings', else m]",
)
@click.option(
    "--sigma-pick", type=float, default=0.5, show_default=True, help="Precision of a pick [px]."
)
@click.option(
    "--sigma-control",
    type=float,
    default=0.003,
    show_default=True,
    help="Precision of a control coordinate [m].",
)
@click.option(
    "--sigma-distance",
    type=float,
    default=0.02,
    show_default=True,
    help="Precision of the measured distances [m].",
)
@click.option("--picture", type=FILE, help="Picture of the set-up.  [default: beside OUT, .png]")
@click.option("--no-picture", is_flag=True, help="Do not draw the picture.")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    far: Path, near: Path, out: Path, picture: Path | None, no_picture: bool, overwrite: bool,
    as_json: bool, **given: Any,
) -> None:  # fmt: skip
    """Set up a pair: where both cameras stood, how they looked, at which scale.

    FAR is the photo taken from afar with the long lens, NEAR the other one. Three ways: control
    points measured on the wall (--control), distances measured on site with the cameras square to
    the wall (--distance1, --distance2), or the photos alone (--auto) and one distance or length.
    """
    from bifocal.orientation.align_workflow import align_photos, alignment_as_dict

    if picture is None and not no_picture:
        picture = out.with_name(out.name.removesuffix(".json").removesuffix(".pair") + ".pair.png")
    alignment = align_photos(
        far, near, out, _options(given),
        picture=None if no_picture else picture, overwrite=overwrite,
    )  # fmt: skip
    for text in (*alignment.remarks, *alignment.pair.remarks):
        remark(text)
    if as_json:
        print_json(alignment_as_dict(alignment))
        return
    _print(alignment)
    remark(f"Pair written to {out}" + (f", picture to {picture}" if not no_picture else ""))


def _options(given: dict[str, Any]) -> Any:
    """Return the workflow's options from the command line's."""
    from bifocal.orientation.align_workflow import AlignOptions, KnownLens
    from bifocal.orientation.control_points import SiteMeasures
    from photocore.arrays import positive

    for name, value in given.items():
        if isinstance(value, float):
            positive(value, f"--{name.replace('_', '-')}")
    lenses = tuple(
        KnownLens(
            lens=given[f"lens{n}"] or given["lens"],
            focal=given[f"focal{n}"],
            pixel_size=given[f"pixel_size{n}"] or given["pixel_size"],
            sensor_width=given[f"sensor_width{n}"] or given["sensor_width"],
        )
        for n in (1, 2)
    )
    line = given["horizontal"] or given["vertical"]
    length = given["length"]
    return AlignOptions(
        lenses=(lenses[0], lenses[1]),
        site=SiteMeasures(
            distance1=given["distance1"],
            distance2=given["distance2"],
            delta_d=given["delta_d"],
            sigma=given["sigma_distance"],
            sigma_control=given["sigma_control"],
            sigma_pick=given["sigma_pick"],
            wall=given["wall"],
        ),
        auto=given["auto"],
        control=given["control"],
        lengths=given["lengths"],
        length=(length[:4], length[4]) if length else None,
        line=(line, given["horizontal"] is None) if line else None,
        unit=given["unit"] or "",
    )


def _print(alignment: Alignment) -> None:
    """Print the set-up for people."""
    for text in alignment.words:
        click.echo(text)
    ties = alignment.setup["common_points"]
    if ties["count"]:
        click.echo(
            f"{ties['count']} common points, {ties['on_wall']} of them on the wall, precise to "
            f"{ties['sigma_px']:.2f} px."
        )
    if alignment.control_ids:
        click.echo("Control point residuals [px]: far column, row; near column, row; test")
        for index, name in enumerate(alignment.control_ids):
            values = "  ".join(f"{value:7.2f}" for value in alignment.control_residuals[index])
            mark = "" if alignment.control_used[index] else "   LEFT OUT"
            click.echo(f"  {name:>12}  {values}  {alignment.control_test[index]:6.1f}{mark}")
    for text in alignment.setup["assumed"]:
        click.echo(f"Assumed: {text}.")
