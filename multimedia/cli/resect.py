"""``multimedia resect``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from photocore.cli import print_result, remark, text_table
from photocore.options import declared


@declared
def command(project: Path, as_json: bool, **options: Any) -> None:
    """Orient, and with --estimate calibrate, each camera of PROJECT (.toml) on its own.

    Uses the image points whose ids are among the object points. The start values of the project
    may be as poor as you like. Prints every estimated parameter with its standard deviation;
    angles in degrees, image lengths in mm, object lengths in the unit of the project.
    """
    from multimedia.orientation.workflow import resect_project, resected_as_dict

    resected = resect_project(project, **options)
    data = resected_as_dict(resected)
    print_result(data, _lines(data["cameras"]), as_json=as_json, notes=resected.remarks)
    for what, key in (("Project", "out"), ("Residuals", "residuals")):
        if options[key] is not None:
            remark(f"{what} written to {options[key]}")


def _lines(cameras: list[dict[str, Any]]) -> Iterator[str]:
    """Yield parameters with their standard deviations."""
    for camera in cameras:
        known = bool(camera["redundancy"])
        sigma0 = f"{camera['sigma0_um']:.3f} um" if known else "unknown"
        yield (
            f"{camera['name']}: sigma0 {sigma0}, {camera['points']} points, "
            f"redundancy {camera['redundancy']}, {camera['iterations']} iterations"
        )
        rows = [
            (name, f"{camera[name]:.8g}", f"{camera['sigma'][name]:.2g}" if known else "unknown")
            for name in camera["estimated"]
        ]
        yield text_table(("parameter", "value", "sigma"), rows)
