"""``multimedia epipolar``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from photocore.cli import print_result, tell_written, text_table
from photocore.options import declared

if TYPE_CHECKING:
    from multimedia.orientation.epipolar_workflow import EpipolarResult


@declared
def command(
    project: Path, out: Path | None, picture: Path | None, as_json: bool, **options: Any
) -> None:
    """Draw where the ray of an image point of one camera runs in the image of another.

    Through refracting media that is a curve; it is given as a polygon whose vertices are exact and
    whose chords stay within --chord. The image points of the other camera near it are listed with
    the object point each of them would give.
    """
    if options["photo"] is not None and picture is None:
        raise click.UsageError("--photo goes under a picture; give --picture as well.")
    from multimedia.orientation.epipolar_workflow import epipolar_project

    result = epipolar_project(project, out=out, picture=picture, **options)
    data = {name: getattr(result, name) for name in ("unit", "z_range", "curves", "candidates")}
    print_result(data, _lines(result), as_json=as_json, notes=result.remarks)
    tell_written(out, picture)


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
        (c["id"], c["target"], f"{c['distance'] * 1000:.2f}", *(f"{c[k]:.4f}" for k in "XYZ"))
        for c in result.candidates
    ]
    yield f"\n{len(rows)} candidates"
    if rows:
        yield text_table(("point", "candidate", "off um", *axes), rows[:40])
    if len(rows) > 40:
        yield f"... and {len(rows) - 40} more; --json lists them all."
