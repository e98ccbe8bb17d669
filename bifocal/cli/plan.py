"""``bifocal plan``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bifocal.options import MEDIA
from photocore.cli import print_result, remark, text_table
from photocore.options import (
    FILE,
    POSITIVE,
    THOUSANDTHS,
    Scale,
    Size,
    as_json,
    number,
    overwrite,
    takes,
)

if TYPE_CHECKING:
    from bifocal.planning.camera_plan import Plan

EXAMPLE = """\b
Examples:
  bifocal plan --focal 35 --focal 28 --focal 19 --sensor 22.7x15.1 --pixels 3072x2048 --scale 1:500
  bifocal plan --focal 35 --focal 18 --sensor 23.5x15.6 --pixels 6000x4000 --object 12x8
               --free-space 20 --out plan.xlsx
  bifocal plan --focal 35 --focal 19 --sensor 22.7x15.1 --pixels 3072x2048 --scale 1:100
               --indices 1,1.49,1.337 --thicknesses 0.01 --depth 0.9
  bifocal plan --equivalent 77 --equivalent 24 --pixels 4000x3000 --object 6x4
"""


@click.command(epilog=EXAMPLE)
@click.option(
    "--focal", "focal_lengths", type=POSITIVE, multiple=True, metavar="MM",
    help="A focal length at hand [mm]; repeat it for every lens or zoom mark.",
)  # fmt: skip
@click.option(
    "--equivalent", "equivalents", type=POSITIVE, multiple=True, metavar="MM",
    help="A 35 mm equivalent, as phones state it, in place of --focal and --sensor [mm]; repeat "
    "it for every camera of the phone.",
)  # fmt: skip
@click.option("--sensor", type=Size(above=0), help="Width x height of the sensor [mm].")
@click.option(
    "--pixels", type=Size(least=1, whole=True), required=True,
    help="Columns x rows of the photo [px].",
)  # fmt: skip
@click.option("--object", "object_size", type=Size(above=0), help="Width x height of the wall [m].")
@click.option("--scale", "scale_number", type=Scale(), help="Wanted scale of the photo, 1:N.")
@number("--gsd", "MM", "Wanted pixel on the wall [mm].", type=THOUSANDTHS)
@number(
    "--sigma-r", "MM", "Wanted sigma of the relief at the RMS radius of the photo [mm].",
    type=THOUSANDTHS,
)  # fmt: skip
@number("--sigma-px", "PX", "Precision of a pick [px].", default=0.5)
@number(
    "--sigma-r-max", "MM", "Area of uncertainty: sigma of the relief above this [mm].  "
    "[default: 3 x that of the best pair]", type=THOUSANDTHS,
)  # fmt: skip
@number("--free-space", "M", "Room in front of the wall [m].")
@takes(*MEDIA)
@click.option("--out", type=FILE, help="Also write the plan as .xlsx.")
@overwrite
@as_json
def command(
    focal_lengths: tuple[float, ...], equivalents: tuple[float, ...],
    sensor: tuple[float, float] | None, pixels: tuple[int, int],
    indices: tuple[float, ...] | None, thicknesses: tuple[float, ...] | None,
    port: float | None, depth: float | None,
    out: Path | None, as_json: bool, **wishes: Any,
) -> None:  # fmt: skip
    """Compare pairs of lenses: where to stand, what a photo covers, how precise it gets.

    Give the lenses and the camera, and one wish: the size of the wall, a scale, a pixel size on
    the wall, or a sigma of the relief.
    """
    from bifocal.model.pair_media import PairMedia
    from bifocal.planning.camera_plan import CameraSensor
    from bifocal.planning.workflow import make_plan, plan_as_dict

    if equivalents and (focal_lengths or sensor):
        raise click.UsageError("Give --equivalent, or --focal with --sensor, not both.")
    if equivalents:
        camera = CameraSensor.of_film(*pixels)
    elif sensor is None or not focal_lengths:
        raise click.UsageError("Give --focal with --sensor, or --equivalent for a phone.")
    else:
        camera = CameraSensor(width=sensor[0], height=sensor[1], columns=pixels[0], rows=pixels[1])
    if indices is None and (thicknesses or port is not None or depth is not None):
        raise click.UsageError("--thicknesses, --port and --depth go with --indices.")
    if indices is not None:
        wishes["media"] = PairMedia.stated(
            indices, thicknesses or (), ports=(port, None), depth=depth
        )
    plan = make_plan(equivalents or focal_lengths, camera, out=out, **wishes)
    print_result(plan_as_dict(plan), _lines(plan), as_json=as_json)
    if out is not None:
        remark(f"Plan written to {out}")


def _lines(plan: Plan) -> Iterator[str]:
    """Yield the stations and the precision over the frame of the best pair."""
    rows = [
        (
            f"{s.c1:g}/{s.c2:g}", f"{s.d1:.2f}", f"{s.d2:.2f}", f"{s.delta_d:.2f}",
            f"1:{s.scale_number:.0f}", f"{s.gsd * 1000:.2f}",
            f"{s.footprint[0]:.1f} x {s.footprint[1]:.1f}", f"{s.photos[0]} x {s.photos[1]}",
            f"{s.sigma_r_rms * 1000:.1f}", f"{s.sigma_r_corner * 1000:.1f}",
            f"{s.sigma_ortho * 1000:.1f}", f"{s.uncertain_radius:.2f}",
            "yes" if s.feasible else "NO",
        )
        for s in plan.stations
    ]  # fmt: skip
    headings = (
        "lenses mm", "d1 m", "d2 m", "delta_d m", "scale", "pixel mm", "covers m", "photos",
        "sigma r mm", "in corner", "ortho mm", "uncertain m", "fits",
    )  # fmt: skip
    yield text_table(headings, rows)
    for station in plan.stations:
        if station.z0_1 is not None:
            yield (
                f"{station.c1:g}/{station.c2:g} mm: first interface {station.z0_1:.3f} and "
                f"{station.z0_2:.3f} m before the cameras."
            )
        if station.note:
            yield f"{station.c1:g}/{station.c2:g} mm: {station.note}"
    yield plan.basis
    best = plan.best
    yield f"\nBest: {best.c1:g} mm from {best.d1:.2f} m and {best.c2:g} mm from {best.d2:.2f} m."
    x, y, sigma = plan.sigma_grid(best, columns=7, rows=5)
    yield f"\nsigma of r [mm] over its photo, picks of {plan.sigma_px:g} px:"
    grid = [
        (f"{v:.1f}", *("nadir" if s != s else f"{s * 1000:.0f}" for s in row))
        for v, row in zip(y, sigma, strict=True)
    ]
    yield text_table(("Y \\ X [m]", *(f"{v:.1f}" for v in x)), grid)
