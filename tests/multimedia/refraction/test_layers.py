"""Layers: what is refused, what is remarked upon."""

from __future__ import annotations

import numpy as np
import pytest

from multimedia import GeometryError, InputError, Interfaces, Layers, correct_bathymetry


def test_two_media_need_no_thickness() -> None:
    assert Layers(indices=(1.0, 1.337)).thicknesses == ()


def test_a_single_number_counts_as_a_list_of_one() -> None:
    layers = Layers(indices=[1, 1.5, 1.337], thicknesses=0.01)  # type: ignore[arg-type]
    assert layers.thicknesses == (0.01,)


@pytest.mark.parametrize("index", [0.99, 0.0, -1.337, np.nan, np.inf])
def test_an_index_below_one_is_refused(index: float) -> None:
    with pytest.raises(InputError, match="medium 3 has refractive index"):
        Layers(indices=(1.0, 1.5, index), thicknesses=(0.01,))


@pytest.mark.parametrize("index", [0.99, 1.0, 3.0, 4.0, 4.1, 4.2, 13.37, np.nan])
def test_one_limit_holds_for_layers_surfaces_and_bathymetry(index: float) -> None:
    possible = 1 <= index <= 4.1
    for make in (
        lambda: Layers(indices=(1.0, index)),
        lambda: Interfaces.flat_water(0.0, refractive_index=index),
        lambda: correct_bathymetry([0.0, 0.0, -1.0], water_level=0.0, refractive_index=index),
    ):
        if possible:
            make()
        else:
            with pytest.raises(InputError, match=r"possible are 1 .* to 4\.1 .*decimal point"):
                make()


def test_a_negative_thickness_is_refused() -> None:
    with pytest.raises(InputError, match=r"layer 1 has thickness -0\.01"):
        Layers(indices=(1.0, 1.5, 1.337), thicknesses=(-0.01,))


def test_a_missing_thickness_is_refused() -> None:
    with pytest.raises(InputError, match="3 media have 1 layers between"):
        Layers(indices=(1.0, 1.5, 1.337))


def test_one_medium_is_refused() -> None:
    with pytest.raises(InputError, match="at least two media"):
        Layers(indices=(1.0,))


def test_words_are_refused() -> None:
    with pytest.raises(InputError, match="indices: expected numbers"):
        Layers(indices=("air", "water"))  # type: ignore[arg-type]


def test_glass_thinner_than_water_is_remarked_upon() -> None:
    # The index order of a well-known OpenPTV data set: glass and water interchanged.
    layers = Layers(indices=(1.0, 1.33, 1.46), thicknesses=(6.0,))
    assert "swapped" in layers.remarks[0]
    assert Layers(indices=(1.0, 1.46, 1.33), thicknesses=(6.0,)).remarks == ()


@pytest.mark.parametrize(
    ("indices", "thicknesses"),
    [((1.0, 1.337, 1.5, 1.0), (0.1, 0.01)), ((1.0, 1.337, 1.49, 1.337), (0.2, 0.01))],
)
def test_water_before_glass_is_not_remarked_upon(indices, thicknesses) -> None:
    """Looked at through water, then the wall of the tank: nothing is swapped."""
    assert Layers(indices=indices, thicknesses=thicknesses).remarks == ()


def test_an_air_gap_is_not_remarked_upon() -> None:
    assert Layers(indices=(1.33, 1.5, 1.0003, 1.5, 1.33), thicknesses=(5, 1, 5)).remarks == ()


@pytest.mark.parametrize(
    ("thickness", "z0", "zp"),
    [(10.0, 0.5, 0.2), (0.00001, 500.0, 200.0)],
)
def test_millimetres_among_metres_are_remarked_upon(thickness: float, z0: float, zp: float) -> None:
    layers = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(thickness,))
    assert "mm" in layers.remarks_about(z0=z0, zp=zp)[-1]


@pytest.mark.parametrize(("thickness", "z0", "zp"), [(10, 500, 200), (0.01, 0.5, 3), (0.3, 0, 1)])
def test_ordinary_set_ups_are_not_remarked_upon(thickness: float, z0: float, zp: float) -> None:
    layers = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(thickness,))
    assert layers.remarks_about(z0=z0, zp=zp) == ()


def test_a_camera_below_the_interface_is_refused() -> None:
    with pytest.raises(GeometryError, match="z0: the camera is on the object's side"):
        Layers(indices=(1.0, 1.337)).heights(z0=-0.1, zp=1.0)


def test_points_on_the_wrong_side_are_counted_and_the_first_is_named() -> None:
    with pytest.raises(GeometryError, match=r"zp: 2 of 3 values \(first: number 2\).*-0\.2"):
        Layers(indices=(1.0, 1.337)).heights(z0=1.0, zp=[1.0, -0.2, -0.3])


def test_layers_survive_json() -> None:
    layers = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,))
    assert Layers.from_dict(layers.as_dict()) == layers


def test_a_bad_json_object_is_named() -> None:
    with pytest.raises(InputError, match=r"wall\.pair\.json, layers: indices: medium 2"):
        Layers.from_dict({"indices": [1.0, 0.5]}, where="wall.pair.json, layers")


def test_an_index_without_its_decimal_point_is_refused():
    with pytest.raises(InputError, match="decimal point"):
        Layers(indices=(1.0, 13.37))
