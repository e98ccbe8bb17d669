"""``multimedia epipolar``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from multimedia.cli.tables import ProjectOption
from photocore.cli import print_result, tell_written, text_table
from photocore.option_types import NEW_TABLE, Number, Numbers, thousandth
from photocore.options import Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption

if TYPE_CHECKING:
    from multimedia.orientation import EpipolarResult


@dataclass(frozen=True, kw_only=True)
class EpipolarCommand:
    """The options of ``multimedia epipolar``, and examples.

    multimedia epipolar tank.toml --camera cam1 --to cam2 --point 12
    multimedia epipolar tank.toml --camera cam1 --to cam3 --at 640.5,371.2 --z-range -20,20
    multimedia epipolar tank.toml --camera cam1 --to cam2 --picture curves.png --photo cam2.tif
    """

    project: ProjectOption
    camera: str
    """Camera of the image points."""
    other: Annotated[str, Typed(flag="--to")]
    """Camera in whose image the curves run."""
    ids: Annotated[tuple[str, ...], Typed(unit="ID", flag="--point")] = ()
    """Image point of --camera; repeatable.  [default: all of them]"""
    at: Annotated[tuple[float, float] | None, Typed(Numbers(2), "A,B")] = None
    """Column, row of a point instead [px]."""
    z_range: Annotated[tuple[float, float] | None, Typed(Numbers(2), "A,B")] = None
    """Depth range of the object, Z from and to [unit of the project].  [default: that of the object
    points and a quarter more]"""
    chord_error: Annotated[
        float, Typed(Number(above=0, to=thousandth, least=0.001), "UM", flag="--chord", default=0.5)
    ] = 0.0005
    """Largest distance between curve and polygon [um]."""
    vertices: int | None = None
    """Fixed number of vertices instead of --chord.  [default: as needed]"""
    tolerance: Annotated[float, Typed(Number(above=0, to=thousandth), "UM", default=10.0)] = 0.01
    """Half width of the band in which candidates are looked for [um]."""
    out: Annotated[Path | None, Typed(NEW_TABLE)] = None
    """Vertices as .csv or .xlsx; - is stdout."""
    picture: Path | None = None
    """Picture of the curves: .png, .svg or .pdf."""
    photo: Path | None = None
    """Image of --to, under the picture."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(EpipolarCommand)
def command(options: EpipolarCommand) -> None:
    """Draw where the ray of an image point of one camera runs in the image of another.

    Through refracting media that is a curve; it is given as a polygon whose vertices are exact and
    whose chords stay within --chord. The image points of the other camera near it are listed with
    the object point each of them would give.
    """
    if options.photo is not None and options.picture is None:
        raise click.UsageError("--photo goes under a picture; give --picture as well.")
    from multimedia.orientation import epipolar_project

    result = epipolar_project(
        options.project,
        out=options.out,
        picture=options.picture,
        camera=options.camera,
        other=options.other,
        ids=options.ids,
        at=options.at,
        z_range=options.z_range,
        chord_error=options.chord_error,
        vertices=options.vertices,
        tolerance=options.tolerance,
        photo=options.photo,
        overwrite=options.overwrite,
    )
    data = {name: getattr(result, name) for name in ("unit", "z_range", "curves", "candidates")}
    print_result(data, _lines(result), as_json=options.as_json, notes=result.remarks)
    tell_written(options.out, options.picture)


def _lines(result: EpipolarResult) -> Iterator[str]:
    """Yield the curves if they are few, and the candidates."""
    axes = [f"{axis} {result.unit}" for axis in "XYZ"]
    if len(result.curves) <= 3:
        rows = [
            (c["id"], *(f"{v:.5f}" for v in xy), *(f"{v:.4f}" for v in xyz))
            for c in result.curves
            for xy, xyz in zip(c["image"], c["points"], strict=True)
        ]
        yield text_table(("point", "x mm", "y mm", *axes), rows)
    else:
        yield f"{len(result.curves)} curves; --out writes their vertices."
    rows = [
        (
            c["id"],
            c["target"],
            f"{c['distance'] * 1000:.2f}",
            *(f"{v:.4f}" for v in (c["X"], c["Y"], c["Z"])),
        )
        for c in result.candidates
    ]
    yield f"\n{len(rows)} candidates"
    if rows:
        yield text_table(("point", "candidate", "off um", *axes), rows[:40])
    if len(rows) > 40:
        yield f"... and {len(rows) - 40} more; --json lists them all."
