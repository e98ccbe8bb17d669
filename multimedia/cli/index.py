"""``multimedia index``."""

from __future__ import annotations

import click

from photocore.cli import print_result, remark
from photocore.options import NOT_NEGATIVE, NUMBER, POSITIVE, as_json

EXAMPLE = """\b
Examples:
  multimedia index --wavelength 520 --temperature 22.2 --salinity 0 --depth 0.15
  multimedia index --wavelength 532 --temperature 18 --salinity 3.5 --formula quan-fry
  multimedia index --temperature 20 --sigma-temperature 0.5 --salinity 3.5 --sigma-salinity 0.1
  multimedia index --from-index 1.3412 --sigma-index 0.00015 --find salinity --temperature 20
"""


@click.command(epilog=EXAMPLE)
@click.option(
    "--wavelength", type=POSITIVE, default=550.0, show_default=True, metavar="NM",
    help="Wavelength of the light [nm]; blue 460, green 550, red 620.",
)  # fmt: skip
@click.option(
    "--temperature", type=NUMBER, default=20.0, show_default=True, metavar="C",
    help="Water temperature [°C].",
)  # fmt: skip
@click.option(
    "--salinity", type=NUMBER, default=0.0, show_default=True, metavar="PERCENT",
    help="Salinity [%]; sea water has 3.5.",
)  # fmt: skip
@click.option(
    "--depth", type=NUMBER, default=0.0, show_default=True, metavar="M", help="Water depth [m]."
)
@click.option(
    "--formula", type=click.Choice(["hoehle", "quan-fry", "parrish"]), default="hoehle",
    show_default=True, help="Published formula; hoehle is that of the multimedia papers.",
)  # fmt: skip
@click.option(
    "--sigma-wavelength", type=NOT_NEGATIVE, default=0.0, show_default=True, metavar="NM",
    help="Standard deviation of the wavelength [nm].",
)  # fmt: skip
@click.option(
    "--sigma-temperature", type=NOT_NEGATIVE, default=0.0, show_default=True, metavar="C",
    help="Standard deviation of the temperature [°C].",
)  # fmt: skip
@click.option(
    "--sigma-salinity", type=NOT_NEGATIVE, default=0.0, show_default=True, metavar="PERCENT",
    help="Standard deviation of the salinity [%].",
)  # fmt: skip
@click.option(
    "--from-index", type=POSITIVE, metavar="N",
    help="A measured refractive index: the inverse; needs --find.",
)  # fmt: skip
@click.option(
    "--sigma-index", type=NOT_NEGATIVE, default=0.0, show_default=True, metavar="N",
    help="Standard deviation of the measured index.",
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
