"""``multimedia resect``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from photocore.cli import print_json, remark, text_table

if TYPE_CHECKING:
    from multimedia.orientation.workflow import Resected

EXAMPLE = """\b
Examples:
  multimedia resect tank.toml --out oriented.toml
  multimedia resect tank.toml --estimate c,xh,yh,k1,p1,p2,scale --out calibrated.toml
  multimedia resect tank.toml --camera cam2 --residuals cam2_residuals.csv
"""


@click.command(
    short_help="Orientation and calibration of each camera from control points.", epilog=EXAMPLE
)
@click.argument("project", type=click.Path(path_type=Path))
@click.option(
    "--estimate", default="", metavar="NAMES",
    help="Interior parameters to determine beside the exterior orientation, with commas: c, xh, "
    "yh [mm], k1, k2, k3, p1, p2, scale, shear; or 'all'.  [default: none]",
)  # fmt: skip
@click.option("--camera", "cameras", multiple=True, help="Only this camera; repeatable.")
@click.option(
    "--out", type=click.Path(path_type=Path), help="Write the project with the new orientations."
)
@click.option(
    "--residuals", type=click.Path(path_type=Path),
    help="Write the residuals [mm] of all image points as .csv or .xlsx.",
)  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    project: Path,
    estimate: str,
    cameras: tuple[str, ...],
    out: Path | None,
    residuals: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Orient, and with --estimate calibrate, each camera of PROJECT (.toml) on its own.

    Uses the image points whose ids are among the object points. The start values of the project
    may be as poor as you like. Prints every estimated parameter with its standard deviation;
    angles in degrees, image lengths in mm, object lengths in the unit of the project.
    """
    from multimedia.orientation.workflow import resect_project, resected_as_dict

    names = tuple(name.strip() for name in estimate.split(",") if name.strip())
    if names == ("all",):
        names = ("c", "xh", "yh", "k1", "k2", "k3", "p1", "p2", "scale", "shear")
    resected = resect_project(
        project, estimate=names, cameras=cameras, out=out, residuals=residuals, overwrite=overwrite
    )
    for line in resected.remarks:
        remark(f"Note: {line}")
    if as_json:
        print_json(resected_as_dict(resected))
    else:
        _print(resected)
    if out is not None:
        remark(f"Project written to {out}")
    if residuals is not None:
        remark(f"Residuals written to {residuals}")


def _print(resected: Resected) -> None:
    """Print parameters with their standard deviations."""
    from multimedia.orientation.workflow import resected_as_dict

    for camera in resected_as_dict(resected)["cameras"]:
        sigma0 = f"{camera['sigma0_um']:.3f} um" if camera["redundancy"] else "unknown"
        click.echo(
            f"{camera['name']}: sigma0 {sigma0}, {camera['points']} points, "
            f"redundancy {camera['redundancy']}, {camera['iterations']} iterations"
        )
        rows = [
            (
                name,
                f"{camera[name]:.8g}",
                f"{camera['sigma'][name]:.2g}" if camera["redundancy"] else "unknown",
            )
            for name in camera["estimated"]
        ]
        click.echo(text_table(("parameter", "value", "sigma"), rows))
