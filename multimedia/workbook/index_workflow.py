"""Refractive index of water on demand: result, its precision, and what to doubt."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import Any

from multimedia.refraction.water import (
    WATER_FORMULAS,
    WaterFormula,
    salinity_from_index,
    temperature_from_index,
    water_index_derivatives,
    water_index_sigma,
    water_refractive_index,
)
from photocore.errors import GeometryError


@dataclass(frozen=True, slots=True, kw_only=True)
class WaterAnswer:
    """A number about water.

    Attributes
    ----------
    key, label, unit : str
        What it is: as a JSON key, in words, its unit with a leading blank.
    value, sigma : float
        The number and its standard deviation.
    conditions : dict
        What was given.
    formula : WaterFormula
        What it was computed with.
    remarks : tuple of str
        What lies outside the formula's range.
    """

    key: str
    label: str
    unit: str
    value: float
    sigma: float
    conditions: dict[str, float]
    formula: WaterFormula
    remarks: tuple[str, ...]

    @property
    def text(self) -> str:
        """The number as text: 8 decimals of an index, 4 of a salinity or temperature."""
        return f"{self.value:.8f}" if self.key == "refractive_index" else f"{self.value:.4f}"

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain data for ``--json``."""
        return {
            self.key: self.value,
            "sigma": self.sigma,
            **self.conditions,
            "formula": self.formula.name,
            "citation": self.formula.citation,
            "remarks": list(self.remarks),
        }


def find_index(
    wavelength_nm: float,
    temperature_c: float,
    salinity_percent: float,
    depth: float,
    formula: str,
    *,
    sigmas: tuple[float, float, float],
) -> WaterAnswer:
    """Return the refractive index of water.

    Parameters
    ----------
    wavelength_nm, temperature_c, salinity_percent, depth : float
        [nm, °C, %, m]
    formula : str
        Name of one of `WATER_FORMULAS`.
    sigmas : (float, float, float)
        Standard deviations of the first three.

    Raises
    ------
    InputError
        If a value cannot be meant in its unit.
    """
    chosen = WATER_FORMULAS[formula]
    given = {
        "wavelength_nm": wavelength_nm,
        "temperature_c": temperature_c,
        "salinity_percent": salinity_percent,
        "depth": depth,
    }
    sigma = water_index_sigma(
        **given,
        sigma_wavelength_nm=sigmas[0],
        sigma_temperature_c=sigmas[1],
        sigma_salinity_percent=sigmas[2],
        formula=chosen,
    )
    return WaterAnswer(
        key="refractive_index",
        label="refractive index of water",
        unit="",
        value=float(water_refractive_index(**given, formula=chosen)),
        sigma=float(sigma),
        conditions=given,
        formula=chosen,
        remarks=chosen.remarks(**given),
    )


def find_from_index(
    what: str,
    index: float,
    sigma_index: float,
    wavelength_nm: float,
    temperature_c: float,
    salinity_percent: float,
    depth: float,
    formula: str,
    *,
    sigmas: tuple[float, float, float],
) -> WaterAnswer:
    """Return the salinity or temperature of water of a known index.

    Parameters
    ----------
    what : {"salinity", "temperature"}
        What is unknown; its own argument below is ignored.
    index, sigma_index : float
        Refractive index and its standard deviation.
    wavelength_nm, temperature_c, salinity_percent, depth, formula, sigmas
        As in `find_index`.

    Raises
    ------
    InputError
        If a value cannot be meant in its unit.
    GeometryError
        If no temperature, or no possible salinity, gives the index.
    """
    chosen = WATER_FORMULAS[formula]
    given = {"wavelength_nm": wavelength_nm, "depth": depth}
    if what == "salinity":
        key, label, unit = "salinity_percent", "salinity of the water", " %"
        given["temperature_c"] = temperature_c
        value = float(salinity_from_index(index, **given, formula=chosen))
        others = (sigmas[0], sigmas[1], 0.0)
        # Within the error of the index fresh water may come out slightly below zero.
        if not -0.5 <= value <= 30:
            raise GeometryError(
                f"no salinity between 0 and 30 % gives water of {temperature_c:g} °C the index "
                f"{index:g} (it would take {value:.2f} %): check index and wavelength."
            )
    else:
        key, label, unit = "temperature_c", "temperature of the water", " °C"
        given["salinity_percent"] = salinity_percent
        value = float(temperature_from_index(index, **given, formula=chosen))
        others = (sigmas[0], 0.0, sigmas[2])
        if not -5 <= value <= 100:
            raise GeometryError(
                f"no temperature of liquid water with {salinity_percent:g} % salt gives the index "
                f"{index:g}: check index, salinity and wavelength."
            )
    everything = {**given, key: max(value, 0.0) if what == "salinity" else value}
    slopes = water_index_derivatives(**everything, formula=chosen)
    slope = slopes.d_salinity if what == "salinity" else slopes.d_temperature
    from_conditions = water_index_sigma(
        **everything,
        sigma_wavelength_nm=others[0],
        sigma_temperature_c=others[1],
        sigma_salinity_percent=others[2],
        formula=chosen,
    )
    return WaterAnswer(
        key=key,
        label=label,
        unit=unit,
        value=value,
        sigma=hypot(sigma_index, float(from_conditions)) / abs(float(slope)),
        conditions={"refractive_index": index, **given},
        formula=chosen,
        remarks=chosen.remarks(**everything),
    )
