"""``multimedia openptv``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import click

from photocore.cli import print_json, print_result, remark, text_table
from photocore.option_types import POSITIVE
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class OpenptvCommand:
    """The options of ``multimedia openptv``, and examples.

    multimedia openptv test_cavity --out cavity.toml
    multimedia openptv test_cavity --swap-indices --out cavity.toml
    multimedia openptv cavity.toml --export folder_for_openptv
    """

    source: Annotated[Path, Argument(unit="DIR")]
    out: Path | None = None
    """Project file to write (.toml), tables beside it.  [default: name of the folder + .toml,
    here]"""
    swap_indices: bool = False
    """Exchange the indices of glass and water."""
    least_pixels: Annotated[int, Typed(click.IntRange(min=1), flag="--min-pixels")] = 15
    """Smaller targets are no dots of the calibration body [px]."""
    radius: Annotated[float, Typed(POSITIVE, "PX")] = 25.0
    """Farthest a target may lie from where the stored orientation expects it [px]."""
    export: Path | None = None
    """The other way: DIR is a project file; write it as an OpenPTV folder."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(OpenptvCommand)
def command(options: OpenptvCommand) -> None:
    """Read an OpenPTV experiment folder DIR into a project file.

    Reads ptv.par or pyptv's parameters_Run1.yaml (DIR may be that file), .ori, .addpar, _targets,
    the calibration body and the first rt_is frame; finds the control points among the targets of
    the calibration images, starting from the stored orientation; and says what looks wrong, such as
    interchanged indices of glass and water.

    Where multi_planes.par lists positions of the body, the .crd and .fix files of each position and
    camera are found by name and content, whatever folder they lie in; what was taken is said, and
    lists that no camera can have seen, alone or together with the others, are refused.
    """
    from multimedia.openptv import export_openptv, import_openptv

    if options.export is not None:
        written, inexact = export_openptv(
            options.source, options.export, overwrite=options.overwrite
        )
        for line in inexact:
            remark(f"Note: {line}")
        remark(f"OpenPTV folder written to {options.export}")
        if options.as_json:
            names = list(written.camera_names)
            print_json({"folder": options.export, "cameras": names, "remarks": list(inexact)})
        return
    target = (
        options.out if options.out is not None else Path(f"{options.source.resolve().name}.toml")
    )
    imported = import_openptv(
        options.source,
        out=target,
        swap_indices=options.swap_indices,
        least_pixels=options.least_pixels,
        radius=options.radius,
        overwrite=options.overwrite,
    )
    project = imported.project
    total = len(project.object_points.ids)
    cameras = list(zip(project.cameras, imported.matched, project.media_of, strict=True))
    data = {
        "project": target, "files": list(imported.files), "unit": project.unit,
        "cameras": [
            {"name": camera.name, "control_points": count, "media": media}
            for camera, count, media in cameras
        ],
        "object_points": total, "particles": imported.particles, "remarks": list(project.remarks),
    }  # fmt: skip
    rows = [(camera.name, media or "none", f"{n} of {total}") for camera, n, media in cameras]
    lines = [text_table(("camera", "looks through", "control points"), rows)]
    if imported.particles:
        lines.append(f"{imported.particles} particles of the stored frame")
    lines += [f"Written: {file}" for file in imported.files]
    print_result(data, lines, as_json=options.as_json, notes=project.remarks)
