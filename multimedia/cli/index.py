"""``multimedia index``."""

from __future__ import annotations

import click

from photocore.cli import print_result, remark
from photocore.options import declared


@declared
def command(
    formula: str, from_index: float | None, find: str | None, as_json: bool, **given: float
) -> None:
    """Print the refractive index of water; or, the other way round, salinity or temperature.

    The number on stdout is the result; formula, standard deviation and doubts go to stderr.
    """
    if (from_index is None) != (find is None):
        raise click.UsageError("--from-index and --find belong together.")
    from multimedia.workbook.index_workflow import find_from_index, find_index

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
