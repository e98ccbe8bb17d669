"""``multimedia adjust``."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click

from multimedia.cli.tables import ProjectOption
from photocore.cli import print_result, tell_written, text_table
from photocore.option_types import POSITIVE, Names
from photocore.options import Typed, declared
from photocore.shared_options import JsonOption, LanguageOption, OverwriteOption

if TYPE_CHECKING:
    from multimedia.adjustment import Adjustment, Extension


@dataclass(frozen=True, kw_only=True)
class BundleCommand:
    """The options of ``multimedia adjust``, and examples.

    multimedia adjust tank.toml --interior c,xh,yh,k1 --media index3 --out tank2.toml
               --report tank.html
    multimedia adjust tank.toml --interior auto --media index3 --prior index3=0.0005
               --report rapporto.pdf --language it
    multimedia adjust boards.toml --plate all --fix-camera cam1 --interior c,xh,yh,k1 --media index3
               --out housing.toml
    multimedia adjust reef.toml --control free --scale-bar A,B,0.5,0.0001 --out reef2.toml
    multimedia adjust wand.toml --control free --scale-bar @a,@b,80,0.02 --out tank2.toml
    multimedia adjust tank.toml --media index3 --wavelength 520 --temperature 20 --depth 0.1

    Cameras whose poses the project leaves out start from nothing but a wand, or boards.

    Unknowns of the media: offset, tilt1, tilt2, thickness1..., index1... counted from the camera;
    radius, centreX, centreY, centreZ of a dome; radius, shift1, shift2, tilt1, tilt2 of a tube;
    gradient of the index with depth; NAME:index3 for one media of several. Labels for --prior are
    those of the result; c alone means that of every camera.
    """

    project: ProjectOption
    interior: Annotated[tuple[str, ...], Typed(Names(), "LIST")] = ()
    """Interior parameters to estimate, of c,xh,yh,k1,k2,k3,p1,p2,scale,shear, of a fisheye
    c,xh,yh,k1,k2,k3,k4,scale; or auto: those that the data carry.  [default: none]"""
    shared_interior: bool = False
    """One set of interior parameters for all cameras."""
    media: Annotated[tuple[str, ...], Typed(Names(), "LIST")] = ()
    """Unknowns of the media, e.g. index3,offset,tilt1,tilt2.  [default: none]"""
    fixed_cameras: Annotated[tuple[str, ...], Typed(unit="NAME", flag="--fix-camera")] = ()
    """Keep this camera's orientation; repeat it."""
    control: Literal["fixed", "weighted", "free"] = "fixed"
    """Control points: error-free unless they have a sigma, all weighted, or a free network."""
    plates: Annotated[tuple[str, ...], Typed(unit="GROUP", flag="--plate")] = ()
    """Group of object points that is a rigid plate of unknown pose; repeat it, or say all."""
    scale_bars: Annotated[tuple[str, ...], Typed(unit="A,B,LENGTH,SIGMA", flag="--scale-bar")] = ()
    """Known distance between two points [object unit]; repeat it. @a,@b: a wand in many places, its
    ends named 1a, 1b, 2a, 2b..."""
    priors: Annotated[tuple[str, ...], Typed(unit="LABEL=SIGMA", flag="--prior")] = ()
    """Standard deviation of an unknown's start value [its unit]; inf: not known at all; repeat
    it.  [default: indices 0.005, thicknesses and radii a tenth, centres a tenth of the radius,
    gradients 0.005 over the depth of the points, others inf]"""
    robust: Annotated[float | None, Typed(POSITIVE, "K")] = None
    """Huber weights beyond K standard deviations; image points that contradict the others by far
    are left out and named.  [default: plain least squares]"""
    diagnose: bool = False
    """Also try every extension of the model by one step and rank what would lower sigma0 most."""
    wavelength: Annotated[float | None, Typed(POSITIVE, "NM")] = None
    """For the salinity: light [nm]."""
    temperature: Annotated[float | None, Typed(unit="C")] = None
    """For the salinity: water temperature [deg C]."""
    depth: Annotated[float, Typed(unit="M")] = 0.0
    """Its depth [m]."""
    out: Path | None = None
    """Write the adjusted project (.toml)."""
    report: Path | None = None
    """Write a report (.html, .pdf)."""
    language: LanguageOption = "en"
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(BundleCommand)
def command(
    project: Path, wavelength: float | None, temperature: float | None, depth: float,
    out: Path | None, report: Path | None, diagnose: bool, as_json: bool, **choices: Any,
) -> None:  # fmt: skip
    """Adjust cameras, object points and the media of a project together."""
    from multimedia.adjustment import Unknowns, is_angle
    from multimedia.adjustment import workflow as adjust
    from photocore.adjustment.priors import parse_prior

    if (wavelength is None) != (temperature is None):
        raise click.UsageError("the salinity needs both --wavelength and --temperature.")
    writing = {name: choices.pop(name) for name in ("language", "overwrite")}
    choices["scale_bars"] = tuple(map(adjust.parse_scale_bar, choices["scale_bars"]))
    priors = dict(map(parse_prior, choices["priors"]))
    choices["priors"] = {k: math.radians(v) if is_angle(k) else v for k, v in priors.items()}
    unknowns = Unknowns(**choices, typical_priors=True)
    result, notes = adjust.adjust_project(project, unknowns, out=out, report=report, **writing)
    salinity = None
    if wavelength is not None and temperature is not None:
        salinity = adjust.salinity_of(
            result, wavelength_nm=wavelength, temperature_c=temperature, depth=depth
        )
    data, lines = adjust.as_dict(result), _lines(result)
    if salinity:
        data["salinity_percent"] = {"value": salinity[0], "sigma": salinity[1]}
        lines.append(f"Salinity {salinity[0]:.3f} % (sigma {salinity[1]:.3f} %)")
    if diagnose:
        _, extensions = adjust.diagnose_project(project, unknowns)
        data["extensions"] = [asdict(extension) for extension in extensions]
        lines += ["\nWhat one step more would bring, each alone (score test):", _ranked(extensions)]
    print_result(data, lines, as_json=as_json, remarks=notes)
    tell_written(out, report)


def _ranked(extensions: list[Extension]) -> str:
    """Return the extensions as a table, those that chance does not explain first of all."""
    rows = [
        (e.what, e.unknowns, f"{e.sigma0 * 1000:.3f}",
         "-" if e.chance < 1e-3 else f"{e.chance:.2g}", e.option)
        for e in extensions
    ]  # fmt: skip
    return text_table(("extension", "unknowns", "sigma0 [um]", "by chance", "option"), rows)


def _lines(result: Adjustment) -> list[str]:
    """Return sigma0, the unknowns and the suspects."""
    from multimedia.adjustment import decimals

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
