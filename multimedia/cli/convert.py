"""``multimedia convert``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from photocore.cli import print_result, text_table
from photocore.option_types import POSITIVE
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class ConvertCommand:
    """The options of ``multimedia convert``, and examples.

    multimedia convert sparse/0 tank.toml --unit mm --pitch 0.00345
    multimedia convert tank.toml model --to colmap
    multimedia convert tank.toml cameras.xml
    multimedia convert calibration.json rig.toml
    multimedia convert rig.toml calibration.json --to aquacal
    """

    source: Annotated[Path, Argument()]
    target: Annotated[Path, Argument()]
    form: Annotated[
        Literal["colmap", "metashape", "opencv", "aquacal"] | None, Typed(flag="--to")
    ] = None
    """Format of TARGET.  [default: by its ending: .toml a project, .xml metashape, .yml opencv,
    none colmap]"""
    pixel_size: Annotated[float, Typed(POSITIVE, "MM", flag="--pitch")] = 0.005
    """Width of a pixel, which the other programs do not know [mm]."""
    unit: Literal["m", "cm", "mm", "um", "km"] = "m"
    """Unit of their lengths, which all but AquaCal leave open."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(ConvertCommand)
def command(options: ConvertCommand) -> None:
    """Convert SOURCE, a project or the cameras of another program, into TARGET.

    Known are project files (.toml), COLMAP text models with their refractive cameras (a folder),
    Metashape's cameras (.xml), calibrations of OpenCV (.yml, .json, .xml, or a folder of them) and
    of AquaCal (.json), and, read only, folders with the cameras and control points of MyPTV, proPTV
    and OpenLPT. Poses, lenses and, where both hold them, ports, water surfaces and points go
    over exactly; what the other program cannot hold is said, or refused.
    """
    from multimedia.exchange import convert

    done = convert(
        options.source,
        options.target,
        form=options.form,
        pixel_size=options.pixel_size,
        unit=options.unit,
        overwrite=options.overwrite,
    )
    project = done.project
    data = {
        "source": options.source, "from": done.source, "target": options.target, "to": done.target,
        "cameras": list(project.camera_names), "object_points": len(project.object_points.ids),
        "image_points": len(project.image_points.ids), "remarks": list(done.remarks),
    }  # fmt: skip
    pairs = zip(project.cameras, project.media_of, strict=True)
    rows = [
        (camera.name, media or "none", len(project.image_points.of_camera(camera.name)))
        for camera, media in pairs
    ]
    lines = [text_table(("camera", "looks through", "image points"), rows)]
    lines.append(f"Written: {options.target} ({done.target})")
    print_result(data, lines, as_json=options.as_json, notes=done.remarks)
