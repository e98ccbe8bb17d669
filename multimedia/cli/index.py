"""``multimedia index``."""

from __future__ import annotations

import click

from photocore.cli import print_result, remark
from photocore.options import NOT_NEGATIVE, NUMBER, as_json, number

EXAMPLE = """\b
Examples:
  multimedia index --wavelength 520 --temperature 22.2 --salinity 0 --depth 0.15
  multimedia index --wavelength 532 --temperature 18 --salinity 3.5 --formula quan-fry
  multimedia index --temperature 20 --sigma-temperature 0.5 --salinity 3.5 --sigma-salinity 0.1
  multimedia index --from-index 1.3412 --sigma-index 0.00015 --find salinity --temperature 20
"""


@click.command(epilog=EXAMPLE)
@number(
    "--wavelength", "NM", "Wavelength of the light [nm]; blue 460, green 550, red 620.",
    default=550.0,
)  # fmt: skip
@number("--temperature", "C", "Water temperature [°C].", type=NUMBER, default=20.0)
@number("--salinity", "PERCENT", "Salinity [%]; sea water has 3.5.", type=NUMBER, default=0.0)
@number("--depth", "M", "Water depth [m].", type=NUMBER, default=0.0)
@click.option(
    "--formula", type=click.Choice(["hoehle", "quan-fry", "parrish"]), default="hoehle",
    show_default=True, help="Published formula; hoehle is that of the multimedia papers.",
)  # fmt: skip
@number(
    "--sigma-wavelength", "NM", "Standard deviation of the wavelength [nm].",
    type=NOT_NEGATIVE, default=0.0,
)  # fmt: skip
@number(
    "--sigma-temperature", "C", "Standard deviation of the temperature [°C].",
    type=NOT_NEGATIVE, default=0.0,
)  # fmt: skip
@number(
    "--sigma-salinity", "PERCENT", "Standard deviation of the salinity [%].",
    type=NOT_NEGATIVE, default=0.0,
)  # fmt: skip
@number("--from-index", "N", "A measured refractive index: the inverse; needs --find.")
@number(
    "--sigma-index", "N", "Standard deviation of the measured index.",
    type=NOT_NEGATIVE, default=0.0,
)  # fmt: skip
@click.option(
    "--find", type=click.Choice(["salinity", "temperature"]),
    help="What to find from --from-index; the others are given.",
)  # fmt: skip
@as_json
def command(
    wavelength: float, temperature: float, salinity: float, depth: float, formula: str,
    sigma_wavelength: float, sigma_temperature: float, sigma_salinity: float,
    from_index: float | None, sigma_index: float, find: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Print the refractive index of water; or, the other way round, salinity or temperature.

    The number on stdout is the result; formula, standard deviation and doubts go to stderr.
    """
    if (from_index is None) != (find is None):
        raise click.UsageError("--from-index and --find belong together.")
    from multimedia.workbook.index_workflow import find_from_index, find_index

    water = (wavelength, temperature, salinity, depth, formula)
    sigmas = (sigma_wavelength, sigma_temperature, sigma_salinity)
    if find is None or from_index is None:
        result = find_index(*water, sigmas=sigmas)
    else:
        result = find_from_index(find, from_index, sigma_index, *water, sigmas=sigmas)
    print_result(result.as_dict(), [result.text], as_json=as_json)
    if not as_json:
        remark(f"{result.label}, formula {result.formula.name}: {result.formula.citation}")
        if result.sigma:
            remark(f"standard deviation {result.sigma:.2g}{result.unit}")
    for text in result.remarks:
        remark(f"Note: {text}")
