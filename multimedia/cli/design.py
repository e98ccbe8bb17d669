"""``multimedia design``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from photocore.cli import print_json, remark, text_table
from photocore.options import Size

if TYPE_CHECKING:
    from multimedia.design.studies import Design

EXAMPLE = """\b
Examples:
  multimedia design --cameras 4 --distance 0.6 --half-angle 30 --c 25 --extent 0.3x0.3
             --depths 0.02x0.2 --indices 1,1.5,1.337 --thicknesses 0.01 --sigma 0.0012
  multimedia design tank.toml --out design.xlsx --plot design.png
"""


def _numbers(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, ...]:
    """Split a list of numbers at commas."""
    try:
        return tuple(float(part) for part in (value or "").split(",") if part.strip())
    except ValueError:
        raise click.BadParameter(f"{value!r} is not a list of numbers", ctx, param) from None


@click.command(short_help="Accuracy studies before anyone gets wet.", epilog=EXAMPLE)
@click.argument("project", required=False, type=click.Path(path_type=Path))
@click.option("--cameras", type=int, default=4, show_default=True, help="Cameras on the cone.")
@click.option("--distance", type=float, help="From the last face to each camera [m].")
@click.option(
    "--half-angle", type=float, default=30.0, show_default=True,
    help="Half opening of the cone of cameras, in air [deg].",
)  # fmt: skip
@click.option("--c", "principal_distance", type=float, help="Principal distance [mm].")
@click.option(
    "--indices", callback=_numbers, default="1,1.337", show_default=True,
    help="Refractive indices from camera to object.",
)  # fmt: skip
@click.option(
    "--thicknesses",
    callback=_numbers,
    default="",
    help="Of media between [m].  [default: none]",
)
@click.option("--extent", type=Size(), help="Width x height of the object space [m].")
@click.option(
    "--depths", type=Size(), metavar="LEASTxLARGEST", help="Depths of the object space [m]."
)
@click.option(
    "--sigma", "sigma_image", type=float, default=0.001, show_default=True,
    help="Precision of an image coordinate [mm].",
)  # fmt: skip
@click.option("--seed", type=int, default=1, show_default=True, help="Of the simulated noise.")
@click.option("--out", type=click.Path(path_type=Path), help="Write the tables (.xlsx).")
@click.option("--plot", type=click.Path(path_type=Path), help="Draw them (.png, .svg, .pdf).")
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    project: Path | None, cameras: int, distance: float | None, half_angle: float,
    principal_distance: float | None, indices: tuple[float, ...], thicknesses: tuple[float, ...],
    extent: tuple[float, float] | None, depths: tuple[float, float] | None, sigma_image: float,
    seed: int, out: Path | None, plot: Path | None, overwrite: bool, as_json: bool,
) -> None:  # fmt: skip
    """Predict precision, ray angles, sensitivities and calibration costs of a set-up.

    Of a PROJECT file with cameras, media and the object points to be measured; or of cameras on a
    cone above the water, described by options.
    """
    from math import radians

    from multimedia.design import workflow as design

    if project is not None:
        result = design.design_project(project, seed=seed)
    else:
        needed = {"--distance": distance, "--c": principal_distance, "--extent": extent,
                  "--depths": depths}  # fmt: skip
        missing = [name for name, value in needed.items() if value is None]
        if distance is None or principal_distance is None or extent is None or depths is None:
            raise click.UsageError(f"give a PROJECT file, or {', '.join(missing)} as well.")
        result = design.design_ring(
            count=cameras, distance=distance, half_angle=radians(half_angle),
            principal_distance=principal_distance, indices=indices, thicknesses=thicknesses,
            extent=extent, depths=depths, sigma_image=sigma_image, seed=seed,
        )  # fmt: skip
    design.write_design(result, out=out, plot=plot, overwrite=overwrite)
    for note in result.remarks:
        remark(note)
    if as_json:
        print_json(design.as_dict(result))
    else:
        _print(result)
    for path in (out, plot):
        if path is not None:
            remark(f"Written: {path}")


def _print(result: Design) -> None:
    """Print the tables."""
    from math import degrees

    unit = result.unit
    rows = [
        (f"{d:.4g}", f"{x:.3g}", f"{y:.3g}", f"{z:.3g}", f"{a:.1f}", f"{b:.1f}")
        for d, x, y, z, a, b in result.by_depth.tolist()
    ]
    click.echo(f"Expected precision [{unit}] and intersection angle [deg]")
    click.echo(text_table(("depth", "sigma X", "sigma Y", "sigma Z", "angle", "in air"), rows))
    click.echo(f"\nWhat unknown media do to coordinates, RMS [{unit}]")
    click.echo(
        text_table(
            ("unknown", "wrong by", "dX", "dY", "dZ"),
            [(n, s, *(f"{v:.3g}" for v in moved)) for n, s, moved in result.sensitivities],
        )
    )
    if result.placements:
        click.echo("\nPlacement of the cameras")
        places = [
            (f"{degrees(p.half_angle):.0f}", *(f"{v:.3g}" for v in p.sigma),
             f"{degrees(p.angle):.1f}")
            for p in result.placements
        ]  # fmt: skip
        click.echo(text_table(("half angle", "sigma X", "sigma Y", "sigma Z", "rays"), places))
        best = min(result.placements, key=lambda p: sum(v * v for v in p.sigma))
        click.echo(f"Best: half angle {degrees(best.half_angle):.0f} deg.")
    if result.costs is not None:
        costs = result.costs
        cases = (
            ("I   air", costs.air, costs.sigma0[0]),
            ("II  water, calibrated in air", costs.air_calibration_in_water, costs.sigma0[1]),
            ("III water, calibrated in water", costs.water, costs.sigma0[2]),
        )
        click.echo(f"\nCheck points when calibrating in air or in water, RMS [{unit}] (simulated)")
        click.echo(
            text_table(
                ("case", "X", "Y", "Z", "sigma0 um"),
                [(n, *(f"{v:.3g}" for v in e), f"{s * 1000:.2f}") for n, e, s in cases],
            )
        )
    if result.models:
        click.echo(
            f"\nSimplified models in place of the rigorous one, error across the ray [{unit}]"
        )
        click.echo(
            text_table(
                ("model", "RMS", "largest"),
                [(name, f"{rms:.3g}", f"{largest:.3g}") for name, rms, largest in result.models],
            )
        )
        click.echo(
            f"Colour seam, red (650 nm) to blue (450 nm): up to {result.seam * 1000:.1f} um in the "
            "image (camera square to the media)."
        )
