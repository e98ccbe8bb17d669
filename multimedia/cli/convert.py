"""``multimedia convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from photocore.cli import print_result, text_table
from photocore.options import FILE, as_json, number, overwrite

EXAMPLE = """\b
Examples:
  multimedia convert sparse/0 tank.toml --unit mm --pitch 0.00345
  multimedia convert tank.toml model --to colmap
  multimedia convert tank.toml cameras.xml
  multimedia convert calibration.json rig.toml
  multimedia convert rig.toml calibration.json --to aquacal
"""
FORMATS = ("colmap", "metashape", "opencv", "aquacal")


@click.command(epilog=EXAMPLE)
@click.argument("source", type=FILE)
@click.argument("target", type=FILE)
@click.option(
    "--to", "form", type=click.Choice(FORMATS),
    help="Format of TARGET.  [default: by its ending: .toml a project, .xml metashape, "
    ".yml opencv, none colmap]",
)  # fmt: skip
@number(
    "--pitch", "MM", "Width of a pixel, which the other programs do not know [mm].", default=0.005,
)  # fmt: skip
@click.option(
    "--unit", type=click.Choice(("m", "cm", "mm", "um", "km")), default="m", show_default=True,
    help="Unit of their lengths, which all but AquaCal leave open.",
)  # fmt: skip
@overwrite
@as_json
def command(source: Path, target: Path, as_json: bool, **options: Any) -> None:
    """Convert SOURCE, a project or the cameras of another program, into TARGET.

    Known are project files (.toml), COLMAP text models with their refractive cameras (a folder),
    Metashape's cameras (.xml), calibrations of OpenCV (.yml, .json, .xml, or a folder of them) and
    of AquaCal (.json). Poses, lenses and, where both hold them, ports, water surfaces and points go
    over exactly; what the other program cannot hold is said, or refused.
    """
    from multimedia.exchange.workflow import convert

    done = convert(source, target, **options)
    project = done.project
    data = {
        "source": source, "from": done.source, "target": target, "to": done.target,
        "cameras": list(project.camera_names), "object_points": len(project.object_points.ids),
        "image_points": len(project.image_points.ids), "remarks": list(done.remarks),
    }  # fmt: skip
    pairs = zip(project.cameras, project.media_of, strict=True)
    rows = [
        (camera.name, media or "none", len(project.image_points.of_camera(camera.name)))
        for camera, media in pairs
    ]
    lines = [text_table(("camera", "looks through", "image points"), rows)]
    lines.append(f"Written: {target} ({done.target})")
    notes = (f"Note: {line}" for line in done.remarks)
    print_result(data, lines, as_json=as_json, remarks=notes)
