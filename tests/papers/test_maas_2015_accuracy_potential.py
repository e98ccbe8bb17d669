"""Maas, "On the accuracy potential in underwater/multimedia photogrammetry" (2015): media."""

from __future__ import annotations

import numpy as np
import pytest

from multimedia import (
    HOEHLE,
    QUAN_FRY,
    Layers,
    air_refractive_index,
    lavest,
    layers_per_colour,
    radial_shift,
    refracted_angle,
    salinity_from_index,
    seam_width,
    shift_per_colour,
    telem,
    water_index_derivatives,
    water_refractive_index,
)

TAP = {"temperature_c": 20.0, "salinity_percent": 0.0, "depth": 0.0}


def test_typical_indices_follow_from_equation_4() -> None:
    value = water_refractive_index(wavelength_nm=500, temperature_c=15, salinity_percent=2, depth=5)
    assert value == pytest.approx(1.34, abs=0.005)


def test_index_changes_with_salt_and_temperature_as_in_section_5() -> None:
    slopes = water_index_derivatives(wavelength_nm=520, **TAP)
    assert slopes.d_salinity == pytest.approx(0.002, abs=5e-4)
    assert slopes.d_temperature == pytest.approx(-0.00004, abs=5e-6)


def test_an_index_good_to_0_00015_gives_salinity_to_a_tenth_of_a_per_cent() -> None:
    low, high = salinity_from_index([1.3400, 1.34015], wavelength_nm=520, temperature_c=20, depth=0)
    assert 0 < high - low < 0.1


@pytest.mark.parametrize("formula", [HOEHLE, QUAN_FRY], ids=lambda f: f.name)
def test_dispersion_of_water_is_one_per_cent(formula: object) -> None:
    # Sect. 6 says 1.4 %; 0.9 % is found from 400 to 700 nm and 1.25 % from 380 to 780 nm
    # (docs/errata.md).
    blue, red = water_refractive_index(
        wavelength_nm=[380, 780],
        formula=formula,
        **TAP,  # type: ignore[arg-type]
    )
    assert 100 * (blue / red - 1) == pytest.approx(1.23, abs=0.04)


def test_dispersion_of_air_is_a_thousandth_of_that() -> None:
    # Sect. 6 says 0.008 %; Ciddor gives 0.0009 % from 380 to 780 nm (docs/errata.md).
    blue, red = air_refractive_index([380, 780])
    assert 100 * (blue / red - 1) == pytest.approx(0.0009, abs=0.00005)


def test_seams_are_red_towards_the_nadir_and_blue_outwards() -> None:
    red, _, blue = shift_per_colour(0.2, z0=0.5, zp=0.3, colours=layers_per_colour())
    assert red < blue


def test_seams_are_visible() -> None:
    # Half a metre of air and 300 mm of water, 20 degrees off, 24 mm lens, 4 um pixels.
    width = seam_width(
        0.25, z0=0.5, zp=0.3, colours=layers_per_colour(), principal_distance=24, pixel_size=0.004
    )
    assert 1 < float(width) < 10


def test_refraction_reduces_the_opening_angle() -> None:
    half = np.radians(30.0)
    assert np.degrees(refracted_angle(half, n_from=1.0, n_to=1.34)) == pytest.approx(21.9, abs=0.05)


def test_refraction_narrows_the_intersection_of_two_rays() -> None:
    # Fig. 4: two cameras 0.5 m apart look at a point midway under 0.4 m of water, 0.8 m below them.
    layers = Layers(indices=(1.0, 1.34))
    bar = radial_shift(0.25, z0=0.4, zp=0.4, layers=layers)
    in_air = np.arctan(bar / 0.8)
    in_water = refracted_angle(in_air, n_from=1.0, n_to=1.34)
    straight = np.arctan(0.25 / 0.8)
    assert in_water < straight < in_air


def test_lavest_focal_length_is_only_approximately_right() -> None:
    port = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(0.008,))
    near, far = (
        lavest(r, z0=0.02, zp=2.0, layers=port, principal_distance=20.0).image_error
        for r in (0.05, 1.0)
    )
    assert abs(near) < 0.002
    assert abs(far) > 1.0


def test_refraction_at_right_angles_is_radially_symmetric_so_distortion_absorbs_it() -> None:
    port = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(0.008,))
    model = telem(
        np.linspace(0, 1, 50), z0=0.02, zp=2.0, layers=port, principal_distance=20.0, terms=4
    )
    assert model.rms < 1e-4
