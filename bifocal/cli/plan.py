"""``bifocal plan``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import click

from bifocal.options import LanguageOption, MediaOptions
from photocore.cli import print_result, remark, text_table
from photocore.option_types import POSITIVE, Number, Scale, Size, thousandth
from photocore.options import Typed, declared, options_of
from photocore.shared_options import JsonOption, OverwriteOption

if TYPE_CHECKING:
    from bifocal.planning import Plan


@dataclass(frozen=True, kw_only=True)
class PlanCommand:
    """The options of ``bifocal plan``, and examples.

    bifocal plan --focal 35 --focal 28 --focal 19 --sensor 22.7x15.1 --pixels 3072x2048 --scale
                 1:500
    bifocal plan --focal 35 --focal 18 --sensor 23.5x15.6 --pixels 6000x4000 --object 12x8
                 --free-space 20 --out plan.xlsx
    bifocal plan --focal 35 --focal 19 --sensor 22.7x15.1 --pixels 3072x2048 --scale 1:100
                 --indices 1,1.49,1.337 --thicknesses 0.01 --depth 0.9
    bifocal plan --equivalent 77 --equivalent 24 --pixels 4000x3000 --object 6x4
    """

    focal_lengths: Annotated[tuple[float, ...], Typed(POSITIVE, "MM", flag="--focal")] = ()
    """A focal length at hand [mm]; repeat it for every lens or zoom mark."""
    equivalents: Annotated[tuple[float, ...], Typed(POSITIVE, "MM", flag="--equivalent")] = ()
    """A 35 mm equivalent, as phones state it, in place of --focal and --sensor [mm]; repeat it for
    every camera of the phone."""
    sensor: Annotated[tuple[float, float] | None, Typed(Size(above=0))] = None
    """Width x height of the sensor [mm]."""
    pixels: Annotated[tuple[int, int], Typed(Size(least=1, whole=True))]
    """Columns x rows of the photo [px]."""
    object_size: Annotated[tuple[float, float] | None, Typed(Size(above=0), flag="--object")] = None
    """Width x height of the wall [m]."""
    scale_number: Annotated[float | None, Typed(Scale(), flag="--scale")] = None
    """Wanted scale of the photo, 1:N."""
    gsd: Annotated[float | None, Typed(Number(above=0, to=thousandth), "MM")] = None
    """Wanted pixel on the wall [mm]."""
    sigma_r: Annotated[float | None, Typed(Number(above=0, to=thousandth), "MM")] = None
    """Wanted sigma of the relief at the RMS radius of the photo [mm]."""
    sigma_px: Annotated[float, Typed(POSITIVE, "PX")] = 0.5
    """Precision of a pick [px]."""
    sigma_r_max: Annotated[float | None, Typed(Number(above=0, to=thousandth), "MM")] = None
    """Area of uncertainty: sigma of the relief above this [mm].  [default: 3 x that of the best
    pair]"""
    free_space: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """Room in front of the wall [m]."""
    media: MediaOptions = field(default_factory=MediaOptions)
    out: Path | None = None
    """Also write the plan as .xlsx, live: change distances or lenses in it, the rest follows."""
    language: LanguageOption = "en"
    """Of the workbook."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(PlanCommand)
def command(
    focal_lengths: tuple[float, ...], equivalents: tuple[float, ...], pixels: tuple[int, int],
    out: Path | None, as_json: bool, **wishes: Any,
) -> None:  # fmt: skip
    """Compare pairs of lenses: where to stand, what a photo covers, how precise it gets.

    Give the lenses and the camera, and one wish: the size of the wall, a scale, a pixel size on
    the wall, or a sigma of the relief.
    """
    from bifocal.model import PairMedia
    from bifocal.planning import CameraSensor, make_plan, plan_as_dict

    sensor = wishes.pop("sensor")
    media = {name: wishes.pop(name) for name in options_of(MediaOptions)}
    if equivalents and (focal_lengths or sensor):
        raise click.UsageError("Give --equivalent, or --focal with --sensor, not both.")
    if equivalents:
        camera = CameraSensor.of_film(*pixels)
    elif sensor is None or not focal_lengths:
        raise click.UsageError("Give --focal with --sensor, or --equivalent for a phone.")
    else:
        camera = CameraSensor(width=sensor[0], height=sensor[1], columns=pixels[0], rows=pixels[1])
    if media["indices"] is not None:
        media |= {"thicknesses": media["thicknesses"] or (), "ports": (media.pop("port"), None)}
        wishes["media"] = PairMedia.stated(**media)
    elif any(value not in (None, ()) for value in media.values()):
        raise click.UsageError("--thicknesses, --port and --depth go with --indices.")
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
    third = plan.third_photo(best)
    yield (
        f"A third photo, {third.c:g} mm from {third.d:.2f} m and {third.step:.2f} m aside: sigma "
        f"of r {third.at_nadir * 1000:.1f} mm at the nadir, where the pair tells nothing; at the "
        f"RMS radius {third.at_rms * 1000:.1f} mm instead of {best.sigma_r_rms * 1000:.1f}."
    )
    x, y, sigma = plan.sigma_grid(best, columns=7, rows=5)
    yield f"\nsigma of r [mm] over its photo, picks of {plan.sigma_px:g} px:"
    grid = [
        (f"{v:.1f}", *("nadir" if s != s else f"{s * 1000:.0f}" for s in row))
        for v, row in zip(y, sigma, strict=True)
    ]
    yield text_table(("Y \\ X [m]", *(f"{v:.1f}" for v in x)), grid)
