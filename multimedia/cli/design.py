"""``multimedia design``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import click

from photocore.cli import print_result, tell_written, text_table
from photocore.option_types import FOCAL, POSITIVE, Number, Numbers, Size
from photocore.options import Argument, Typed, declared, options_of
from photocore.shared_options import JsonOption, OverwriteOption

if TYPE_CHECKING:
    from multimedia.bathymetry import WaveCase
    from multimedia.design import Design


@dataclass(frozen=True, kw_only=True)
class DesignCommand:
    """The options of ``multimedia design``, and examples.

    multimedia design --cameras 4 --distance 0.6 --half-angle 30 --c 25 --extent 0.3x0.3
               --depths 0.02x0.2 --indices 1,1.5,1.337 --thicknesses 0.01 --sigma 0.0012
    multimedia design tank.toml --out design.xlsx --plot design.png --flatness
    multimedia design --cameras 2 --distance 20 --half-angle 14 --c 25 --extent 6x4
               --depths 1x3 --waves 0.01,1,4
    """

    project: Annotated[Path | None, Argument()] = None
    count: Annotated[int, Typed(click.IntRange(min=1, max=100), flag="--cameras")] = 4
    """Cameras on the cone."""
    distance: Annotated[float | None, Typed(POSITIVE, "M")] = None
    """From the last face to each camera [m]."""
    half_angle: Annotated[
        float, Typed(Number(to=math.radians, above=0, below=90), default=30.0)
    ] = math.radians(30.0)
    """Half opening of the cone of cameras, in air [deg]."""
    principal_distance: Annotated[float | None, Typed(FOCAL, flag="--c")] = None
    """Principal distance [mm]."""
    indices: Annotated[tuple[float, ...], Typed(Numbers(above=0))] = (1.0, 1.337)
    """Refractive indices from camera to object."""
    thicknesses: Annotated[tuple[float, ...], Typed(Numbers(least=0))] = ()
    """Of media between [m].  [default: none]"""
    extent: Annotated[tuple[float, float] | None, Typed(Size(above=0))] = None
    """Width x height of the object space [m]."""
    depths: Annotated[tuple[float, float] | None, Typed(Size(), "LEASTxLARGEST")] = None
    """Depths of the object space [m]."""
    sigma_image: Annotated[float, Typed(Number(above=0, most=1), flag="--sigma")] = 0.001
    """Precision of an image coordinate [mm]."""
    seed: Annotated[int, Typed(click.IntRange(min=0))] = 1
    """Of the simulated noise."""
    flatness: bool = False
    """Also study how plane and parallel the faces must be (bent, wedged, wavy ones)."""
    waves: Annotated[tuple[float, ...] | None, Typed(Numbers(above=0), "AMPLITUDE,LENGTH,...")] = (
        None
    )
    """Also say what waves of an amplitude and some lengths cost [m], and how many frames take it
    away; for cameras above open water."""
    out: Path | None = None
    """Write the tables (.xlsx)."""
    plot: Path | None = None
    """Draw them (.png, .svg, .pdf)."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(DesignCommand)
def command(
    project: Path | None, out: Path | None, plot: Path | None, as_json: bool, **ring: Any
) -> None:
    """Predict precision, ray angles, sensitivities and calibration costs of a set-up.

    Of a PROJECT file with cameras, media and the object points to be measured; or of cameras on a
    cone above the water, described by options.
    """
    from multimedia.design import workflow as design

    overwrite = ring.pop("overwrite")
    study = {name: ring.pop(name) for name in ("seed", "flatness")}
    waves = ring.pop("waves")
    design.check_outputs(out, plot, overwrite=overwrite)
    if project is not None:
        context = click.get_current_context()
        for name in ring:
            if context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
                raise click.UsageError(
                    "cameras come from the PROJECT file or from options; give one of them."
                )
        result = design.design_project(project, **study)
    else:
        options = options_of(DesignCommand)
        missing = [options[name].flag for name, value in ring.items() if value is None]
        if missing:
            raise click.UsageError(f"give a PROJECT file, or {', '.join(missing)} as well.")
        result = design.design_ring(**study, **ring)
    design.write_design(result, out=out, plot=plot, overwrite=overwrite)
    data, lines = design.as_dict(result), list(_lines(result))
    if waves is not None:
        from multimedia.bathymetry import waves_over

        cases = waves_over(result.media, result.centres, result.study, waves, unit=result.unit)
        data["waves"] = [
            {"wavelength": c.wavelength, "period_s": c.period, "from_base_deg": c.from_base,
             "rms": c.rms.tolist(), "mean": c.mean.tolist(),
             "frames": c.frames if c.frames < float("inf") else None}
            for c in cases
        ]  # fmt: skip
        lines += _wave_lines(result, cases)
    print_result(data, lines, as_json=as_json, remarks=result.remarks)
    tell_written(out, plot)


def _wave_lines(result: Design, cases: tuple[WaveCase, ...]) -> Iterator[str]:
    """Yield what waves cost, and the frames whose mean is as good as the set-up itself."""
    unit, goal = result.unit, sum(v * v for v in result.study.rms_sigma) ** 0.5
    within = f"{goal:.2g} {unit}"
    yield f"\nWaves taken for flat water, RMS [{unit}], and frames whose mean is within {within}"
    rows = [
        (f"{c.wavelength:g}", f"{c.period:.1f}", f"{c.from_base:.0f}",
         *(f"{v:.2g}" for v in c.rms), f"{float(c.mean @ c.mean) ** 0.5:.2g}",
         f"{c.frames:.0f}" if c.frames < float("inf") else "no number")
        for c in cases
    ]  # fmt: skip
    yield text_table(
        (f"length {unit}", "period s", "from base deg", "dX", "dY", "dZ", "stays", "frames"), rows
    )
    yield "Spread the frames over several periods, not in step with the wave."


def _lines(result: Design) -> Iterator[str]:
    """Yield the tables."""
    from multimedia.design import best_placement

    unit = result.unit
    rows = [
        (f"{d:.4g}", f"{x:.3g}", f"{y:.3g}", f"{z:.3g}", f"{a:.1f}", f"{b:.1f}")
        for d, x, y, z, a, b in result.by_depth.tolist()
    ]
    yield f"Expected precision, to first order [{unit}], and intersection angle [deg]"
    yield text_table(("depth", "sigma X", "sigma Y", "sigma Z", "angle", "in air"), rows)
    yield f"\nWhat unknown media do to coordinates, to first order, RMS [{unit}]"
    yield text_table(
        ("unknown", "wrong by", "dX", "dY", "dZ"),
        [(n, s, *(f"{v:.3g}" for v in moved)) for n, s, moved in result.sensitivities],
    )
    if result.placements:
        yield f"\nPlacement of the cameras, sigma [{unit}] and angles [deg]"
        places = [
            (
                f"{degrees(p.half_angle):.0f}",
                *(f"{v:.3g}" for v in p.sigma),
                f"{degrees(p.angle):.1f}",
            )
            for p in result.placements
        ]
        yield text_table(("half angle", "sigma X", "sigma Y", "sigma Z", "rays"), places)
        best, open_end = best_placement(result.placements)
        angle = f"half angle {degrees(best.half_angle):.0f} deg"
        yield (
            f"Best: {angle}, the last that works of those tried; there is no optimum before it."
            if open_end
            else f"Best: {angle}."
        )
    if result.planarity:
        yield from _planarity(result)
    if result.costs is not None:
        costs = result.costs
        cases = (
            ("I   air", costs.air, costs.sigma0[0]),
            ("II  water, calibrated in air", costs.air_calibration_in_water, costs.sigma0[1]),
            ("III water, calibrated in water", costs.water, costs.sigma0[2]),
        )
        yield f"\nCheck points when calibrating in air or in water, RMS [{unit}] (simulated)"
        yield text_table(
            ("case", "X", "Y", "Z", "sigma0 um"),
            [(n, *(f"{v:.3g}" for v in e), f"{s * 1000:.2f}") for n, e, s in cases],
        )
    if result.models:
        yield f"\nSimplified models, not the rigorous: error at the points, to first order [{unit}]"
        yield text_table(
            ("model", "RMS", "largest"),
            [(name, f"{rms:.3g}", f"{largest:.3g}") for name, rms, largest in result.models],
        )
        yield (
            f"Colour seam, red (650 nm) to blue (450 nm): up to {result.seam * 1000:.1f} um in the "
            "image (camera square to the media)."
        )


def _planarity(result: Design) -> Iterator[str]:
    """Yield what faces cost that are not plane or not parallel, and what is allowed."""
    unit = result.unit
    yield f"\nFaces that are not plane or not parallel, RMS error of the points [{unit}]"
    rows = []
    for one in result.planarity:
        bent = one.kind == "bend"
        size, allowed = (
            f"{v:.3g} {unit} sag" if bent else f"{v * 1000:.3g} mrad"
            for v in (one.size, one.allowed)
        )
        name = one.kind if one.kind != "waves" else f"waves {one.wavelength:.3g} {unit} long"
        rows.append((name, size, *(f"{v:.3g}" for v in one.shift), f"{one.largest:.3g}", allowed))
    yield text_table(("deviation", "of", "dX", "dY", "dZ", "largest", "as much as noise"), rows)
