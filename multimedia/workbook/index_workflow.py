"""Refractive index of water on demand: result, its precision, and what to doubt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot

from multimedia.refraction import (
    WATER_FORMULAS,
    WaterFormula,
    salinity_from_index,
    temperature_from_index,
    water_index_derivatives,
    water_index_sigma,
    water_refractive_index,
)
from multimedia.remarks import remark
from photocore.arrays import FloatArray
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

    def as_dict(self) -> dict[str, object]:
        """Return everything as plain data for ``--json``."""
        return {
            self.key: self.value,
            "sigma": self.sigma,
            **self.conditions,
            "formula": self.formula.name,
            "citation": self.formula.citation,
            "remarks": list(self.remarks),
        }


def find_index(water: dict[str, float], formula: str, *, sigmas: dict[str, float]) -> WaterAnswer:
    """Return the refractive index of water.

    Parameters
    ----------
    water : dict of str to float
        wavelength_nm, temperature_c, salinity_percent, depth. [nm, °C, %, m]
    formula : str
        Name of one of `WATER_FORMULAS`.
    sigmas : dict of str to float
        Standard deviations, named as in `water_index_sigma`.

    Raises
    ------
    InputError
        If a value cannot be meant in its unit.
    """
    chosen = WATER_FORMULAS[formula]
    return WaterAnswer(
        key="refractive_index",
        label="refractive index of water",
        unit="",
        value=float(water_refractive_index(**water, formula=chosen)),
        sigma=float(water_index_sigma(**water, **sigmas, formula=chosen)),
        conditions=water,
        formula=chosen,
        remarks=chosen.remarks(**water),
    )


def find_from_index(
    what: str,
    index: float,
    sigma_index: float,
    water: dict[str, float],
    formula: str,
    *,
    sigmas: dict[str, float],
) -> WaterAnswer:
    """Return the salinity or temperature of water of a known index.

    Parameters
    ----------
    what : {"salinity", "temperature"}
        What is unknown; its own value and standard deviation below are ignored.
    index, sigma_index : float
        Refractive index and its standard deviation.
    water, formula, sigmas
        As in `find_index`.

    Raises
    ------
    InputError
        If a value cannot be meant in its unit.
    GeometryError
        If no temperature, or no possible salinity, gives the index.
    """
    key, unit, solve, low, high = _UNKNOWNS[what]
    rest = {name: value for name, value in water.items() if name != key}
    chosen = WATER_FORMULAS[formula]
    value = float(solve(index, **rest, formula=chosen))
    if not low <= value <= high:
        raise GeometryError(
            remark(
                "shift.no_salinity", temperature=water["temperature_c"], index=index, value=value
            )
            if what == "salinity"
            else remark("shift.no_temperature", salinity=water["salinity_percent"], index=index)
        )
    everything = water | {key: max(value, 0.0) if what == "salinity" else value}
    sigmas_of_rest = {name: sigma for name, sigma in sigmas.items() if name != f"sigma_{key}"}
    sigma_others = float(water_index_sigma(**everything, **sigmas_of_rest, formula=chosen))
    slope = getattr(water_index_derivatives(**everything, formula=chosen), f"d_{what}")
    return WaterAnswer(
        key=key,
        label=f"{what} of the water",
        unit=unit,
        value=value,
        sigma=hypot(sigma_index, sigma_others) / abs(float(slope)),
        conditions={"refractive_index": index, **rest},
        formula=chosen,
        remarks=chosen.remarks(**everything),
    )


#: Key, unit, inverse formula and possible values. Within the error of the index fresh water may
#: come out slightly below zero.
_UNKNOWNS: dict[str, tuple[str, str, Callable[..., FloatArray], float, float]] = {
    "salinity": ("salinity_percent", " %", salinity_from_index, -0.5, 30.0),
    "temperature": ("temperature_c", " °C", temperature_from_index, -5.0, 100.0),
}
