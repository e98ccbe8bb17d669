"""Simplified models: what they assume, and that the errors they report are true."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from multimedia import InputError, Layers, agrafiotis, lavest, radial_shift, telem

PORT = Layers(indices=(1.0, 1.49, 1.34), thicknesses=(0.008,))
SEA = Layers(indices=(1.0, 1.34))
R = np.linspace(0.0, 1.0, 40)
HOUSING: dict[str, Any] = {"z0": 0.02, "zp": 2.0, "layers": PORT, "principal_distance": 20.0}


def true_image(zp: Any = 2.0) -> np.ndarray:
    return 20.0 * radial_shift(R, z0=0.02, zp=zp, layers=PORT) / (0.028 + zp)


def test_lavest_multiplies_by_the_index_of_water() -> None:
    model = lavest(R, **HOUSING)
    assert model.principal_distance == pytest.approx(26.8)
    np.testing.assert_allclose(
        model.image_error, 26.8 * R / 2.028 - true_image(), rtol=0, atol=1e-13
    )


def test_lavest_is_exact_near_the_axis_of_a_camera_in_the_water() -> None:
    model = lavest([1e-6], z0=0.0, zp=1.0, layers=SEA, principal_distance=20.0)
    assert abs(float(model.image_error[0])) < 1e-12


def test_agrafiotis_by_hand() -> None:
    # 1 m of air and 3 m of water: 0.25 * 1 + 0.75 * 1.34 = 1.255
    model = agrafiotis(R, z0=1.0, zp=3.0, layers=SEA, principal_distance=20.0)
    assert model.principal_distance == pytest.approx(25.1)


def test_agrafiotis_is_wrong_on_the_axis_between_air_and_water() -> None:
    # Paraxial optics: 4 / (1 + 3 / 1.34) = 1.2350, not 1.255: 1.6 % of the image distance.
    model = agrafiotis([0.01], z0=1.0, zp=3.0, layers=SEA, principal_distance=20.0)
    share = model.image_error[0] / (20 * 0.01 / 4 * 1.2350)
    assert share == pytest.approx(1.255 / 1.2350 - 1, abs=5e-4)


def test_no_water_no_error() -> None:
    dry = Layers(indices=(1.0, 1.0))
    for model in (lavest, agrafiotis):
        found = model(R, z0=1.0, zp=1.0, layers=dry, principal_distance=20.0)
        assert found.rms < 1e-14


def test_telem_absorbs_refraction_at_one_depth() -> None:
    rms = [telem(R, **HOUSING, terms=terms).rms for terms in range(5)]
    assert all(after < before / 4 for before, after in pairwise(rms))
    assert rms[3] < 1e-4


def test_telem_coefficients_are_those_of_the_brown_model() -> None:
    model = telem(R, **HOUSING)
    plain = model.principal_distance * R / 2.028
    k1, k2, k3 = model.distortion
    predicted = plain * (1 + k1 * plain**2 + k2 * plain**4 + k3 * plain**6)
    np.testing.assert_allclose(predicted - true_image(), model.image_error, rtol=0, atol=1e-12)
    assert k1 > 0  # pincushion, as every flat port


def test_no_distortion_absorbs_refraction_over_a_range_of_depths() -> None:
    air = {"z0": 1.0, "layers": SEA, "principal_distance": 20.0}
    one = telem(R, zp=2.0, **air)
    several = telem(R, zp=np.linspace(1.0, 3.0, 30)[:, None], **air)
    assert several.rms > 100 * one.rms
    assert several.rms > 0.05


def test_error_at_the_object_is_the_image_error_at_its_scale() -> None:
    model = lavest(R, **HOUSING)
    np.testing.assert_allclose(
        model.object_error, model.image_error * 2.028 / 26.8, rtol=1e-12, atol=0
    )


def test_too_few_points_are_refused() -> None:
    with pytest.raises(InputError, match="2 points off the axis cannot determine"):
        telem([0.0, 0.1, 0.2], **HOUSING)


def test_impossible_orders_are_refused() -> None:
    with pytest.raises(InputError, match="terms: 0 to 5"):
        telem(R, **HOUSING, terms=6)


def test_a_camera_constant_of_zero_is_refused() -> None:
    with pytest.raises(InputError, match="principal_distance: must be above zero"):
        lavest(R, **(HOUSING | {"principal_distance": 0.0}))
