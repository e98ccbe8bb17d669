"""``multimedia adjust``."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from photocore.cli import print_result, tell_written, text_table
from photocore.options import declared

if TYPE_CHECKING:
    from multimedia.adjustment.extensions import Extension
    from multimedia.adjustment.unknowns import Adjustment


@declared
def command(
    project: Path, wavelength: float | None, temperature: float | None, depth: float,
    out: Path | None, report: Path | None, diagnose: bool, as_json: bool, **choices: Any,
) -> None:  # fmt: skip
    """Adjust cameras, object points and the media of a project together."""
    from multimedia.adjustment import workflow as adjust
    from multimedia.adjustment.unknowns import Unknowns, is_angle
    from photocore.adjustment.priors import parse_prior

    if (wavelength is None) != (temperature is None):
        raise click.UsageError("the salinity needs both --wavelength and --temperature.")
    told = {name: choices.pop(name) for name in ("language", "overwrite")}
    choices["scale_bars"] = tuple(map(adjust.parse_scale_bar, choices["scale_bars"]))
    given = dict(map(parse_prior, choices["priors"]))
    choices["priors"] = {k: math.radians(v) if is_angle(k) else v for k, v in given.items()}
    unknowns = Unknowns(**choices, typical_priors=True)
    result, notes = adjust.adjust_project(project, unknowns, out=out, report=report, **told)
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
