"""``multimedia convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.cli import print_result, text_table
from photocore.options import declared


@declared
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
    print_result(data, lines, as_json=as_json, notes=done.remarks)
