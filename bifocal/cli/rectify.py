"""``bifocal rectify``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from bifocal.options.commands import RectifyCommand
from photocore.cli import print_result, progress_bar, remark
from photocore.options import declared


@declared(RectifyCommand)
def command(
    photo: Path, out: Path | None, folder: Path | None, lines: bool, tfw: bool, overwrite: bool,
    as_json: bool, **given: Any,
) -> None:  # fmt: skip
    """Bring one PHOTO of a flat wall to scale.

    The plane comes from four control points or more, from a rectangle of known sides, or from the
    upright and level lines of a façade and one length. What does not lie on the plane is displaced;
    the first line tells by how much at most, and only a second photo removes it.
    """
    from bifocal.campaigns import rectify_photo

    by_points, corners, rectangle, length = (
        given[name] is not None for name in ("control", "corners", "rectangle", "length")
    )
    faults = {
        "Give --out FILE, --deliver DIR or both.": out is None and folder is None,
        "--deliver needs the scale of the drawing, e.g. --scale 1:50.":
            folder is not None and given["scale"] is None,
        "Give one of --control, --rectangle and --lines.":
            rectangle + lines + (by_points and not rectangle) != 1,
        "--rectangle needs its four corners: --corners, or by --control.":
            rectangle and corners == by_points,
        "--corners are those of a rectangle; give --rectangle W,H.": corners and not rectangle,
        "--lines and --length belong together.": lines != length,
    }  # fmt: skip
    if fault := next((words for words, wrong in faults.items() if wrong), ""):
        raise click.UsageError(fault)
    with progress_bar("rectification", quiet=as_json) as progress:
        done = rectify_photo(
            photo, out, given, folder=folder, overwrite=overwrite, world_file=tfw, progress=progress
        )
    grid, data = done.ortho.grid, done.to_dict()
    size = f"{grid.width} x {grid.height} px of {grid.gsd * 1000:g} mm"
    sentences = [*done.words, f"{out or folder}: {size}"]
    if done.delivery is not None:
        delivery = done.delivery
        data |= {"folder": str(folder), "files": list(delivery.files), "sheet": delivery.sheet}
        sentences.append(f"{folder}: {', '.join(delivery.files)} (sheet {delivery.sheet})")
    print_result(data, sentences, as_json=as_json)
    for note in done.remarks:  # what relief does comes before all else
        remark(note)
