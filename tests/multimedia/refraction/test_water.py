"""Refractive index of water: published values, derivatives, inverses, ranges."""

from __future__ import annotations

import numpy as np
import pytest

from multimedia import (
    HOEHLE,
    PARRISH,
    QUAN_FRY,
    InputError,
    WaterFormula,
    salinity_from_index,
    temperature_from_index,
    water_index_derivatives,
    water_index_sigma,
    water_refractive_index,
)
from multimedia.refraction.water import WATER_FORMULAS

ALL = pytest.mark.parametrize("formula", WATER_FORMULAS.values(), ids=lambda f: f.name)
SEA = {"wavelength_nm": 550.0, "temperature_c": 18.0, "salinity_percent": 3.5, "depth": 4.0}


def index(formula: WaterFormula, nm: float, celsius: float, percent: float) -> float:
    return float(
        water_refractive_index(
            wavelength_nm=nm,
            temperature_c=celsius,
            salinity_percent=percent,
            depth=0,
            formula=formula,
        )
    )


def test_hoehle_by_hand() -> None:
    # 1.338 + 4e-5 (486 - 600 + 0.03 + 175 - 10) = 1.338 + 4e-5 * 51.03 = 1.3400412
    value = water_refractive_index(
        wavelength_nm=600, temperature_c=10, salinity_percent=3.5, depth=10
    )
    assert value == pytest.approx(1.3400412, abs=1e-12)


def test_quan_fry_equals_the_sodium_line_of_pure_water() -> None:
    # Handbooks: 1.33299 at 20 °C and 589.3 nm, relative to air.
    assert index(QUAN_FRY, 589.3, 20, 0) == pytest.approx(1.33299, abs=5e-5)


def test_quan_fry_by_hand() -> None:
    # T = 20, S = 35 per mille, 500 nm; the terms in the order of the paper:
    terms = [1.31405, 0.0057155, -0.000808, 0.03237530, -0.017528, 0.009164]
    assert index(QUAN_FRY, 500, 20, 3.5) == pytest.approx(sum(terms), abs=1e-7)


@pytest.mark.parametrize(
    ("nm", "celsius", "printed"),
    [
        # The table in the documentation of the R package photobiologyFilters, which rounds
        # the coefficients.
        (400, 20, 1.342809),
        (540, 20, 1.334717),
        (700, 20, 1.330423),
        (540, 0, 1.335679),
        (540, 30, 1.333642),
    ],
)
def test_parrish_equals_published_values(nm: float, celsius: float, printed: float) -> None:
    assert index(PARRISH, nm, celsius, 0) == pytest.approx(printed, abs=5e-6)


@pytest.mark.parametrize("celsius", [0, 10, 20, 30])
@pytest.mark.parametrize("percent", [0, 3.5])
@pytest.mark.parametrize("nm", [420, 550, 680])
def test_the_formulas_agree_as_well_as_their_data(
    nm: float, celsius: float, percent: float
) -> None:
    best = index(QUAN_FRY, nm, celsius, percent)
    assert index(PARRISH, nm, celsius, percent) == pytest.approx(best, abs=6e-4)
    assert index(HOEHLE, nm, celsius, percent) == pytest.approx(best, abs=2.5e-3)


@ALL
def test_derivatives_equal_differences(formula: WaterFormula) -> None:
    found = water_index_derivatives(**SEA, formula=formula)
    assert found.refractive_index == water_refractive_index(**SEA, formula=formula)
    for name, slope in zip(SEA, found[1:], strict=True):
        step = 0.01
        up = water_refractive_index(**{**SEA, name: SEA[name] + step}, formula=formula)
        down = water_refractive_index(**{**SEA, name: SEA[name] - step}, formula=formula)
        assert slope == pytest.approx(float(up - down) / (2 * step), rel=1e-6, abs=1e-12)


@ALL
@pytest.mark.parametrize("celsius", [3.0, 15.0, 28.0])
def test_salinity_and_temperature_come_back(formula: WaterFormula, celsius: float) -> None:
    n_w = index(formula, 532, celsius, 2.5)
    salinity = salinity_from_index(
        n_w, wavelength_nm=532, temperature_c=celsius, depth=0, formula=formula
    )
    temperature = temperature_from_index(
        n_w, wavelength_nm=532, salinity_percent=2.5, depth=0, formula=formula
    )
    assert salinity == pytest.approx(2.5, abs=1e-10)
    assert temperature == pytest.approx(celsius, abs=1e-8)


def test_an_index_no_temperature_gives_is_nan() -> None:
    value = temperature_from_index(
        1.36, wavelength_nm=532, salinity_percent=0, depth=0, formula=QUAN_FRY
    )
    assert np.isnan(value)


@ALL
def test_uncertainty_agrees_with_a_simulation(formula: WaterFormula) -> None:
    rng = np.random.default_rng(7)
    sigmas = {"sigma_temperature_c": 0.5, "sigma_salinity_percent": 0.05}
    n = 200_000
    spread = np.std(
        water_refractive_index(
            wavelength_nm=550,
            temperature_c=18 + 0.5 * rng.normal(size=n),
            salinity_percent=3.5 + 0.05 * rng.normal(size=n),
            depth=4,
            formula=formula,
        )
    )
    assert water_index_sigma(**SEA, **sigmas, formula=formula) == pytest.approx(spread, rel=0.01)


def test_everything_broadcasts() -> None:
    value = water_refractive_index(
        wavelength_nm=np.array([450.0, 550.0, 650.0])[:, None],
        temperature_c=[10.0, 20.0],
        salinity_percent=0,
        depth=0,
        formula=QUAN_FRY,
    )
    assert value.shape == (3, 2)
    assert value[1, 1] == index(QUAN_FRY, 550, 20, 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wavelength_nm": 0.52}, "0.52 µm is 520 nm"),
        ({"temperature_c": 295}, "295 K is 22 °C"),
        ({"salinity_percent": 35}, "sea water is 3.5, not 35"),
        ({"depth": -3}, "positive downwards"),
    ],
)
def test_wrong_units_are_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        water_refractive_index(**{**SEA, **change})


def test_a_negative_standard_deviation_is_refused() -> None:
    with pytest.raises(InputError, match="sigma_depth: a standard deviation"):
        water_index_sigma(**SEA, sigma_depth=-1)


def test_values_out_of_range_are_remarked_upon() -> None:
    assert HOEHLE.remarks(**SEA) == ()
    found = QUAN_FRY.remarks(wavelength_nm=380, temperature_c=40, salinity_percent=3.5, depth=100)
    assert [text.split()[0] for text in found] == ["wavelength", "temperature", "quan-fry"]
    assert "0.0001 too low" in found[2]
