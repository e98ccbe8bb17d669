"""``multimedia adjust``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from photocore.cli import print_result, tell_written, text_table
from photocore.options import FILE, NUMBER, Names, as_json, choice, number, overwrite

if TYPE_CHECKING:
    from multimedia.adjustment.unknowns import Adjustment

EXAMPLE = """\b
Examples:
  multimedia adjust tank.toml --interior c,xh,yh,k1 --media index3 --out tank2.toml
             --report tank.html
  multimedia adjust tank.toml --interior auto --media index3 --prior index3=0.0005
             --report rapporto.pdf --language it
  multimedia adjust boards.toml --plate all --fix-camera cam1 --interior c,xh,yh,k1 --media index3
             --out housing.toml
  multimedia adjust reef.toml --control free --scale-bar A,B,0.5,0.0001 --out reef2.toml
  multimedia adjust tank.toml --media index3 --wavelength 520 --temperature 20 --depth 0.1

Unknowns of the media: offset, tilt1, tilt2, thickness1..., index1... counted from the camera;
radius, centreX, centreY, centreZ of a dome; radius, shift1, shift2, tilt1, tilt2 of a tube;
gradient of the index with depth; NAME:index3 for one media of several. Labels for --prior are those
of the result; c alone means that of every camera.
"""


@click.command(epilog=EXAMPLE)
@click.argument("project", type=FILE)
@click.option(
    "--interior", default="", type=Names(), metavar="LIST",
    help="Interior parameters to estimate, of c,xh,yh,k1,k2,k3,p1,p2,scale,shear, "
    "of a fisheye c,xh,yh,k1,k2,k3,k4,scale; or auto: those "
    "that the data carry.  [default: none]",
)  # fmt: skip
@click.option(
    "--shared-interior", is_flag=True, help="One set of interior parameters for all cameras."
)
@click.option(
    "--media", default="", type=Names(), metavar="LIST",
    help="Unknowns of the media, e.g. index3,offset,tilt1,tilt2.  [default: none]",
)  # fmt: skip
@click.option(
    "--fix-camera", multiple=True, metavar="NAME", help="Keep this camera's orientation; repeat it."
)
@choice(
    "--control", "fixed|weighted|free",
    "Control points: error-free unless they have a sigma, all weighted, or a free network.",
    default="fixed",
)  # fmt: skip
@click.option(
    "--plate", multiple=True, metavar="GROUP",
    help="Group of object points that is a rigid plate of unknown pose; repeat it, or say all.",
)  # fmt: skip
@click.option(
    "--scale-bar", multiple=True, metavar="A,B,LENGTH,SIGMA",
    help="Known distance between two points [object unit]; repeat it.",
)  # fmt: skip
@click.option(
    "--prior", multiple=True, metavar="LABEL=SIGMA",
    help="Standard deviation of an unknown's start value [its unit]; inf: not known at all; repeat "
    "it.  [default: indices 0.005, thicknesses and radii a tenth, centres a tenth of the radius, "
    "gradients 0.005 over the depth of the points, others inf]",
)  # fmt: skip
@number(
    "--robust", "K", "Huber weights beyond K standard deviations.  [default: plain least squares]"
)
@number("--wavelength", "NM", "For the salinity: light [nm].")
@number("--temperature", "C", "For the salinity: water temperature [deg C].", type=NUMBER)
@number("--depth", "M", "Its depth [m].", type=NUMBER, default=0.0)
@click.option("--out", type=FILE, help="Write the adjusted project (.toml).")
@click.option("--report", type=FILE, help="Write a report (.html, .pdf).")
@choice("--language", "en|it|de", "Of the report.", default="en")
@overwrite
@as_json
def command(
    project: Path, fix_camera: tuple[str, ...], plate: tuple[str, ...], scale_bar: tuple[str, ...],
    prior: tuple[str, ...], wavelength: float | None, temperature: float | None, depth: float,
    out: Path | None, report: Path | None, language: str, overwrite: bool, as_json: bool,
    **choices: Any,
) -> None:  # fmt: skip
    """Adjust cameras, object points and the media of a project together."""
    from multimedia.adjustment import workflow as adjust
    from multimedia.adjustment.unknowns import Unknowns
    from photocore.adjustment.priors import parse_prior

    if (wavelength is None) != (temperature is None):
        raise click.UsageError("the salinity needs both --wavelength and --temperature.")
    unknowns = Unknowns(
        fixed_cameras=fix_camera, plates=plate, **choices,
        scale_bars=tuple(adjust.parse_scale_bar(text) for text in scale_bar),
        priors=dict(parse_prior(text) for text in prior), typical_priors=True,
    )  # fmt: skip
    result, notes = adjust.adjust_project(
        project, unknowns, out=out, report=report, language=language, overwrite=overwrite
    )
    salinity = None
    if wavelength is not None and temperature is not None:
        salinity = adjust.salinity_of(
            result, wavelength_nm=wavelength, temperature_c=temperature, depth=depth
        )
    data, lines = adjust.as_dict(result), _lines(result)
    if salinity:
        data["salinity_percent"] = {"value": salinity[0], "sigma": salinity[1]}
        lines.append(f"Salinity {salinity[0]:.3f} % (sigma {salinity[1]:.3f} %)")
    print_result(data, lines, as_json=as_json, remarks=notes)
    tell_written(out, report)


def _lines(result: Adjustment) -> list[str]:
    """Return sigma0, the unknowns and the suspects."""
    from multimedia.adjustment.unknowns import decimals

    rows = [
        (name, f"{value:.{max(6, decimals(s))}f}", f"{s:.2g}", unit)
        for name, value, s, unit in result.rows()
    ]
    suspects = result.suspects()
    return [
        text_table(("unknown", "value", "sigma", ""), rows),
        f"\nsigma0 {result.sigma0 * 1000:.3f} um, redundancy {result.redundancy}, "
        f"{result.iterations} iterations",
        *(f"  camera {name}: sigma0 {s * 1000:.3f} um" for name, s in result.sigma0_of.items()),
        *(f"Suspected: {sentence}" for sentence in suspects[:20]),
        *([f"... and {len(suspects) - 20} more"] if len(suspects) > 20 else []),
    ]
