"""``multimedia index``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import click

from photocore.cli import print_result, remark
from photocore.option_types import NOT_NEGATIVE, POSITIVE
from photocore.options import Typed, declared
from photocore.shared_options import JsonOption


@dataclass(frozen=True, kw_only=True)
class IndexCommand:
    """The options of ``multimedia index``, and examples.

    multimedia index --wavelength 520 --temperature 22.2 --salinity 0 --depth 0.15
    multimedia index --wavelength 532 --temperature 18 --salinity 3.5 --formula quan-fry
    multimedia index --temperature 20 --sigma-temperature 0.5 --salinity 3.5 --sigma-salinity 0.1
    multimedia index --from-index 1.3412 --sigma-index 0.00015 --find salinity --temperature 20
    """

    wavelength_nm: Annotated[float, Typed(POSITIVE, "NM", flag="--wavelength")] = 550.0
    """Wavelength of the light [nm]; blue 460, green 550, red 620."""
    temperature_c: Annotated[float, Typed(unit="C", flag="--temperature")] = 20.0
    """Water temperature [°C]."""
    salinity_percent: Annotated[float, Typed(unit="PERCENT", flag="--salinity")] = 0.0
    """Salinity [%]; sea water has 3.5."""
    depth: Annotated[float, Typed(unit="M")] = 0.0
    """Water depth [m]."""
    formula: Literal["hoehle", "quan-fry", "parrish"] = "hoehle"
    """Published formula; hoehle is that of the multimedia papers."""
    sigma_wavelength_nm: Annotated[float, Typed(NOT_NEGATIVE, "NM", flag="--sigma-wavelength")] = (
        0.0
    )
    """Standard deviation of the wavelength [nm]."""
    sigma_temperature_c: Annotated[float, Typed(NOT_NEGATIVE, "C", flag="--sigma-temperature")] = (
        0.0
    )
    """Standard deviation of the temperature [°C]."""
    sigma_salinity_percent: Annotated[
        float, Typed(NOT_NEGATIVE, "PERCENT", flag="--sigma-salinity")
    ] = 0.0
    """Standard deviation of the salinity [%]."""
    from_index: Annotated[float | None, Typed(POSITIVE, "N")] = None
    """A measured refractive index: the inverse; needs --find."""
    sigma_index: Annotated[float, Typed(NOT_NEGATIVE, "N")] = 0.0
    """Standard deviation of the measured index."""
    find: Literal["salinity", "temperature"] | None = None
    """What to find from --from-index; the others are given."""
    as_json: JsonOption = False


@declared(IndexCommand)
def command(
    formula: str, from_index: float | None, find: str | None, as_json: bool, **given: float
) -> None:
    """Print the refractive index of water; or, the other way round, salinity or temperature.

    The number on stdout is the result; formula, standard deviation and doubts go to stderr.
    """
    if (from_index is None) != (find is None):
        raise click.UsageError("--from-index and --find belong together.")
    from multimedia.workbook import find_from_index, find_index

    sigma_index = given.pop("sigma_index")
    sigmas = {name: given.pop(name) for name in list(given) if name.startswith("sigma_")}
    if find is None or from_index is None:
        result = find_index(given, formula, sigmas=sigmas)
    else:
        result = find_from_index(find, from_index, sigma_index, given, formula, sigmas=sigmas)
    print_result(result.as_dict(), [result.text], as_json=as_json)
    if not as_json:
        remark(f"{result.label}, formula {result.formula.name}: {result.formula.citation}")
        if result.sigma:
            remark(f"standard deviation {result.sigma:.2g}{result.unit}")
    for text in result.remarks:
        remark(f"Note: {text}")
