"""``multimedia adjust``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from photocore.cli import print_json, remark, text_table

if TYPE_CHECKING:
    from multimedia.adjustment.unknowns import Adjustment

EXAMPLE = """\b
Examples:
  multimedia adjust tank.toml --interior c,xh,yh,k1 --media index3 --out tank2.toml
             --report tank.html
  multimedia adjust reef.toml --control free --scale-bar A,B,0.5,0.0001 --out reef2.toml
  multimedia adjust tank.toml --media index3 --wavelength 520 --temperature 20 --depth 0.1

Unknowns of the media: offset, tilt1, tilt2, thickness1..., index1... counted from the camera;
NAME:index3 for one media of several. Labels for --prior are those of the result.
"""


def _names(
    ctx: click.Context, param: click.Parameter, value: str  # noqa: ARG001
) -> tuple[str, ...]:  # fmt: skip
    """Split a list at commas."""
    return tuple(part.strip() for part in value.split(",") if part.strip())


@click.command(short_help="Bundle adjustment: cameras, points, media.", epilog=EXAMPLE)
@click.argument("project", type=click.Path(path_type=Path))
@click.option(
    "--interior", default="", callback=_names, metavar="LIST",
    help="Interior parameters to estimate, of c,xh,yh,k1,k2,k3,p1,p2,scale,shear.  [default: none]",
)  # fmt: skip
@click.option(
    "--shared-interior", is_flag=True, help="One set of interior parameters for all cameras."
)
@click.option(
    "--media", default="", callback=_names, metavar="LIST",
    help="Unknowns of the media, e.g. index3,offset,tilt1,tilt2.  [default: none]",
)  # fmt: skip
@click.option(
    "--fix-camera", multiple=True, metavar="NAME", help="Keep this camera's orientation; repeat it."
)
@click.option(
    "--control", type=click.Choice(["fixed", "weighted", "free"]), default="fixed",
    show_default=True,
    help="Control points: error-free unless they have a sigma, all weighted, or a free network.",
)  # fmt: skip
@click.option(
    "--plate", multiple=True, metavar="GROUP",
    help="Group of object points that is a rigid plate of unknown pose; repeat it.",
)  # fmt: skip
@click.option(
    "--scale-bar", multiple=True, metavar="A,B,LENGTH,SIGMA",
    help="Known distance between two points [object unit]; repeat it.",
)  # fmt: skip
@click.option(
    "--prior", multiple=True, metavar="LABEL=SIGMA",
    help="Standard deviation of an unknown's start value [its unit]; repeat it.",
)  # fmt: skip
@click.option(
    "--robust", type=float, metavar="K",
    help="Huber weights beyond K standard deviations.  [default: plain least squares]",
)  # fmt: skip
@click.option("--wavelength", type=float, default=None, help="For the salinity: light [nm].")
@click.option("--temperature", type=float, help="For the salinity: water temperature [deg C].")
@click.option("--depth", type=float, default=0.0, show_default=True, help="Its depth [m].")
@click.option("--out", type=click.Path(path_type=Path), help="Write the adjusted project (.toml).")
@click.option("--report", type=click.Path(path_type=Path), help="Write a report (.html).")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    project: Path, interior: tuple[str, ...], shared_interior: bool, media: tuple[str, ...],
    fix_camera: tuple[str, ...], control: str, plate: tuple[str, ...], scale_bar: tuple[str, ...],
    prior: tuple[str, ...], robust: float | None, wavelength: float | None,
    temperature: float | None, depth: float, out: Path | None, report: Path | None,
    overwrite: bool, as_json: bool,
) -> None:  # fmt: skip
    """Adjust cameras, object points and the media of a project together."""
    from multimedia.adjustment import workflow as adjust
    from multimedia.adjustment.unknowns import Unknowns

    unknowns = Unknowns(
        fixed_cameras=fix_camera, interior=interior, shared_interior=shared_interior, media=media,
        control=control, plates=plate, robust=robust,
        scale_bars=tuple(adjust.parse_scale_bar(text) for text in scale_bar),
        priors=dict(adjust.parse_prior(text) for text in prior),
    )  # fmt: skip
    result, notes = adjust.adjust_project(
        project, unknowns, out=out, report=report, overwrite=overwrite
    )
    salinity = None
    if wavelength is not None and temperature is not None:
        salinity = adjust.salinity_of(
            result, wavelength_nm=wavelength, temperature_c=temperature, depth=depth
        )
    for note in notes:
        remark(note)
    if as_json:
        data = adjust.as_dict(result)
        if salinity:
            data["salinity_percent"] = {"value": salinity[0], "sigma": salinity[1]}
        print_json(data)
    else:
        _print(result)
        if salinity:
            click.echo(f"Salinity {salinity[0]:.3f} % (sigma {salinity[1]:.3f} %)")
    for path in (out, report):
        if path is not None:
            remark(f"Written: {path}")


def _print(result: Adjustment) -> None:
    """Print sigma0, the unknowns and the suspects."""
    rows = [(name, f"{value:.6f}", f"{s:.2g}", unit) for name, value, s, unit in result.rows()]
    click.echo(text_table(("unknown", "value", "sigma", ""), rows))
    click.echo(
        f"\nsigma0 {result.sigma0 * 1000:.3f} um, redundancy {result.redundancy}, "
        f"{result.iterations} iterations"
    )
    for camera, sigma0 in result.sigma0_of.items():
        click.echo(f"  camera {camera}: sigma0 {sigma0 * 1000:.3f} um")
    suspects = result.suspects()
    for sentence in suspects[:20]:
        click.echo(f"Suspected: {sentence}")
    if len(suspects) > 20:
        click.echo(f"... and {len(suspects) - 20} more")
