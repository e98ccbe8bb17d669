"""``multimedia resect``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from multimedia.cli.tables import ProjectOption
from photocore.cli import print_result, remark, text_table
from photocore.option_types import Names
from photocore.options import Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class ResectCommand:
    """The options of ``multimedia resect``, and examples.

    multimedia resect tank.toml --out oriented.toml
    multimedia resect tank.toml --estimate c,xh,yh,k1,p1,p2,scale --out calibrated.toml
    multimedia resect tank.toml --camera cam2 --residuals cam2_residuals.csv
    """

    project: ProjectOption
    estimate: Annotated[tuple[str, ...], Typed(Names(), "NAMES")] = ()
    """Interior parameters to determine beside the exterior orientation, with commas: c, xh, yh
    [mm], k1, k2, k3, p1, p2, scale, shear (fisheye: k1 to k4, scale); or 'all'.  [default: none]"""
    cameras: Annotated[tuple[str, ...], Typed(flag="--camera")] = ()
    """Only this camera; repeatable."""
    out: Path | None = None
    """Write the project with the new orientations."""
    residuals: Path | None = None
    """Write the residuals [mm] of all image points as .csv or .xlsx."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(ResectCommand)
def command(project: Path, as_json: bool, **options: Any) -> None:
    """Orient, and with --estimate calibrate, each camera of PROJECT (.toml) on its own.

    Uses the image points whose ids are among the object points. The start values of the project
    may be as poor as you like. Prints every estimated parameter with its standard deviation;
    angles in degrees, image lengths in mm, object lengths in the unit of the project.
    """
    from multimedia.orientation import resect_project, resected_as_dict

    resected = resect_project(project, **options)
    data = resected_as_dict(resected)
    print_result(data, _lines(data["cameras"]), as_json=as_json, notes=resected.remarks)
    for what, key in (("Project", "out"), ("Residuals", "residuals")):
        if options[key] is not None:
            remark(f"{what} written to {options[key]}")


def _lines(cameras: list[dict[str, Any]]) -> Iterator[str]:
    """Yield parameters with their standard deviations."""
    for camera in cameras:
        is_determined = bool(camera["redundancy"])
        sigma0 = f"{camera['sigma0_um']:.3f} um" if is_determined else "unknown"
        yield (
            f"{camera['name']}: sigma0 {sigma0}, {camera['points']} points, "
            f"redundancy {camera['redundancy']}, {camera['iterations']} iterations"
        )
        rows = [
            (
                name,
                f"{camera[name]:.8g}",
                f"{camera['sigma'][name]:.2g}" if is_determined else "unknown",
            )
            for name in camera["estimated"]
        ]
        yield text_table(("parameter", "value", "sigma"), rows)
