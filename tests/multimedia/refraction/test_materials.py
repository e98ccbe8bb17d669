"""Air and glasses: catalogue values."""

from __future__ import annotations

import pytest

from multimedia import (
    ACRYLIC,
    FLOAT_GLASS,
    FUSED_SILICA,
    N_BK7,
    POLYCARBONATE,
    SAPPHIRE,
    InputError,
    Material,
    air_refractive_index,
)
from multimedia.refraction.materials import MATERIALS


@pytest.mark.parametrize(
    ("material", "nm", "catalogue", "digit"),
    [
        (N_BK7, 587.56, 1.51680, 1e-5),
        (N_BK7, 486.13, 1.52238, 1e-5),
        (FUSED_SILICA, 587.56, 1.45846, 1e-5),
        (SAPPHIRE, 589.3, 1.7681, 1e-4),
        (ACRYLIC, 587.6, 1.491, 5e-4),
        (POLYCARBONATE, 587.6, 1.5849, 3e-4),
        (FLOAT_GLASS, 589.3, 1.5233, 1e-4),
    ],
)
def test_index_equals_the_catalogue(
    material: Material, nm: float, catalogue: float, digit: float
) -> None:
    assert float(material.index(nm)) == pytest.approx(catalogue, abs=digit)


@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: m.name)
def test_blue_bends_more_than_red(material: Material) -> None:
    assert material.index(450) > material.index(650)


def test_air_at_the_sodium_line() -> None:
    assert air_refractive_index(589.3) == pytest.approx(1.0002772, abs=1e-7)


def test_warm_thin_air_bends_less() -> None:
    assert air_refractive_index(550, temperature_c=30, pressure_hpa=900) < air_refractive_index(550)


def test_wavelengths_outside_the_data_are_refused() -> None:
    with pytest.raises(InputError, match=r"acrylic \(PMMA\) is known from 436"):
        ACRYLIC.index(400)
    with pytest.raises(InputError, match="air is known from 230"):
        air_refractive_index(0.55)
