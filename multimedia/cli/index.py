"""``multimedia index``."""

from __future__ import annotations

import click

from photocore.cli import print_result, remark
from photocore.options import NUMBER, as_json, choice, number, sigma

EXAMPLE = """\b
Examples:
  multimedia index --wavelength 520 --temperature 22.2 --salinity 0 --depth 0.15
  multimedia index --wavelength 532 --temperature 18 --salinity 3.5 --formula quan-fry
  multimedia index --temperature 20 --sigma-temperature 0.5 --salinity 3.5 --sigma-salinity 0.1
  multimedia index --from-index 1.3412 --sigma-index 0.00015 --find salinity --temperature 20
"""

#: Arguments of the formulas that the options set.
_KEYS = {
    "wavelength": "wavelength_nm",
    "temperature": "temperature_c",
    "salinity": "salinity_percent",
}


@click.command(epilog=EXAMPLE)
@number(
    "--wavelength", "NM", "Wavelength of the light [nm]; blue 460, green 550, red 620.",
    default=550.0,
)  # fmt: skip
@number("--temperature", "C", "Water temperature [°C].", type=NUMBER, default=20.0)
@number("--salinity", "PERCENT", "Salinity [%]; sea water has 3.5.", type=NUMBER, default=0.0)
@number("--depth", "M", "Water depth [m].", type=NUMBER, default=0.0)
@choice(
    "--formula", "hoehle|quan-fry|parrish",
    "Published formula; hoehle is that of the multimedia papers.", default="hoehle",
)  # fmt: skip
@sigma("--sigma-wavelength", "NM", "Standard deviation of the wavelength [nm].")
@sigma("--sigma-temperature", "C", "Standard deviation of the temperature [°C].")
@sigma("--sigma-salinity", "PERCENT", "Standard deviation of the salinity [%].")
@number("--from-index", "N", "A measured refractive index: the inverse; needs --find.")
@sigma("--sigma-index", "N", "Standard deviation of the measured index.")
@choice("--find", "salinity|temperature", "What to find from --from-index; the others are given.")
@as_json
def command(
    depth: float, formula: str, from_index: float | None, sigma_index: float, find: str | None,
    as_json: bool, **given: float,
) -> None:  # fmt: skip
    """Print the refractive index of water; or, the other way round, salinity or temperature.

    The number on stdout is the result; formula, standard deviation and doubts go to stderr.
    """
    if (from_index is None) != (find is None):
        raise click.UsageError("--from-index and --find belong together.")
    from multimedia.workbook.index_workflow import find_from_index, find_index

    water = {key: given[name] for name, key in _KEYS.items()} | {"depth": depth}
    sigmas = {f"sigma_{key}": given[f"sigma_{name}"] for name, key in _KEYS.items()}
    if find is None or from_index is None:
        result = find_index(water, formula, sigmas=sigmas)
    else:
        result = find_from_index(find, from_index, sigma_index, water, formula, sigmas=sigmas)
    print_result(result.as_dict(), [result.text], as_json=as_json)
    if not as_json:
        remark(f"{result.label}, formula {result.formula.name}: {result.formula.citation}")
        if result.sigma:
            remark(f"standard deviation {result.sigma:.2g}{result.unit}")
    for text in result.remarks:
        remark(f"Note: {text}")
