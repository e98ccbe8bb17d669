"""What is not known (NaN) on the way in is not known on the way out, whoever computes."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

import multimedia as mm
from multimedia import GeometryError, InputError, best_over_compensation, iterated_radius
from multimedia.refraction.shift import axis_ratio, shift_derivatives, shift_ratio, shifted_radius
from multimedia.refraction.unrolled import unrolled_shift
from tests.tables import each

NAN = np.nan
TANK = mm.Layers(indices=(1.0, 1.5, 1.34), thicknesses=(0.01,))
DIVER = mm.Layers(indices=(1.34, 1.5, 1.0), thicknesses=(0.01,))
#: Index of the camera's medium lowest, in the middle, and last.
MEDIA = ((1.0, 1.5, 1.34), (1.5, 1.0, 1.34), (1.34, 1.5, 1.0))
KNOWN = (0.1, 0.5, 0.01, 0.2)  # radius, z0, thickness, zp


def every_derivative(radius, heights, indices):
    found = shift_derivatives(radius, heights, indices)
    parts = (found.radius_bar, found.d_radius, *np.moveaxis(found.d_heights, -1, 0))
    values = np.stack([*parts, *np.moveaxis(found.d_indices, -1, 0)])
    assert (np.isnan(values) == np.isnan(values[0])).all()
    return values[0]


SHIFTS = [
    shifted_radius,
    shift_ratio,
    every_derivative,
    lambda *a: iterated_radius(*a).radius_bar,
    lambda *a: iterated_radius(*a, over_compensation=None).radius_bar,
    best_over_compensation,
    lambda *a: unrolled_shift(*a).radius_bar,
]
IDS = ["shift", "ratio", "derivatives", "iteration", "iteration with its own factor",
       "factor", "workbook"]  # fmt: skip


@pytest.mark.parametrize("indices", MEDIA)
@pytest.mark.parametrize("shift", SHIFTS, ids=IDS)
def test_any_unknown_radius_or_height_makes_the_shift_unknown(
    shift: Callable[..., np.ndarray], indices: tuple[float, ...]
) -> None:
    for unknown in product((False, True), repeat=4):
        for known in (KNOWN, (0.0, 0.5, 0.01, 0.2), (0.1, 0.5, 0.0, 0.0)):
            radius, *heights = np.where(unknown, NAN, known)
            scalar = shift(float(radius), [float(h) for h in heights], indices)
            assert np.isnan(scalar) == any(unknown), (unknown, known)
            one = shift(np.array([radius]), [np.array([h]) for h in heights], indices)
            assert np.isnan(one).tolist() == [any(unknown)], (unknown, known)


@pytest.mark.parametrize("indices", MEDIA)
@pytest.mark.parametrize("shift", SHIFTS, ids=IDS)
def test_an_unknown_element_leaves_its_neighbours_as_they_are(
    shift: Callable[..., np.ndarray], indices: tuple[float, ...]
) -> None:
    unknown = np.array(list(product((False, True), repeat=4)))
    radius, *heights = np.where(unknown, NAN, KNOWN).T
    found = shift(radius, heights, indices)
    assert np.isnan(found).tolist() == unknown.any(axis=1).tolist()
    np.testing.assert_allclose(found[0], shift(KNOWN[0], KNOWN[1:], indices), rtol=1e-15)


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("shift", SHIFTS, ids=IDS)
def test_an_unknown_index_makes_the_shift_unknown(
    shift: Callable[..., np.ndarray], place: int
) -> None:
    indices = [1.0, 1.5, 1.34]
    indices[place] = NAN
    assert np.isnan(shift(0.1, [0.5, 0.01, 0.2], indices))


def test_an_unknown_neighbour_does_not_cost_digits() -> None:
    # A thin layer beyond the others' critical angle: the root is finished with twice the digits.
    heights, indices = [300.0, 1e-3, 200.0], (1.337, 1.0, 1.337)
    radius = np.linspace(400.0, 2000.0, 50)
    alone = shifted_radius(radius, heights, indices)
    among = shifted_radius(np.append(radius, NAN), heights, indices)
    np.testing.assert_array_equal(among[:-1], alone)


def test_a_negative_distance_is_refused_among_unknown_ones() -> None:
    with pytest.raises(InputError, match="cannot be negative, found -1"):
        shifted_radius([NAN, -1.0], [0.5, 0.2], (1.0, 1.34))
    with pytest.raises(InputError, match=r"heights\[1\]"):
        shifted_radius(1.0, [0.5, [-1.0, NAN]], (1.0, 1.34))


def test_only_a_set_up_without_height_has_the_ratio_one() -> None:
    assert axis_ratio([0.0, 0.0], (1.0, 1.34)) == 1.0
    assert np.isnan(axis_ratio([0.0, NAN], (1.0, 1.34)))


@each("layers", [TANK, DIVER])
@pytest.mark.parametrize("as_argument", [float, np.array, lambda v: np.array([v])])
@pytest.mark.parametrize("unknown", list(product((False, True), repeat=3)))
def test_every_public_shift_says_unknown(
    unknown: tuple[bool, ...], as_argument: Callable[[float], object], layers: mm.Layers
) -> None:
    radius, z0, zp = (
        as_argument(NAN if u else v) for u, v in zip(unknown, (0.1, 0.5, 0.2), strict=True)
    )
    table = mm.ShiftTable(z0=0.5, layers=layers, max_radius=0.15, depths=(0.0, 0.3))
    derivatives = mm.radial_shift_derivatives(radius, z0=z0, zp=zp, layers=layers)
    found = [
        mm.radial_shift(radius, z0=z0, zp=zp, layers=layers),
        mm.radial_shift_ratio(radius, z0=z0, zp=zp, layers=layers),
        table(radius, z0=z0, zp=zp, layers=layers),
        mm.shift_per_colour(radius, z0=z0, zp=zp, colours=[layers]),
        *derivatives,
    ]
    for values in found:
        assert (np.isnan(values) == any(unknown)).all()


@pytest.mark.acceptance
def test_a_lazy_shift_says_unknown() -> None:
    array = pytest.importorskip("dask.array")
    radius = array.from_array(np.array([0.1, 0.2]), chunks=1)
    for z0, zp in ((NAN, 1.0), (1.0, NAN)):
        assert np.isnan(mm.radial_shift(radius, z0=z0, zp=zp, layers=TANK).compute()).all()


def test_a_table_broadcasts_its_camera_and_is_built_for_a_known_one() -> None:
    table = mm.ShiftTable(z0=0.5, layers=TANK, max_radius=0.15, depths=(0.0, 0.3))
    assert np.isnan(table(0.1, z0=[0.5, NAN], zp=0.2)).tolist() == [False, True]
    with pytest.raises(GeometryError, match="its own table"):
        table(0.1, z0=[NAN, 0.6], zp=0.2)
    with pytest.raises(InputError, match="z0: must be a finite number"):
        mm.ShiftTable(z0=NAN, layers=TANK, max_radius=0.15, depths=(0.0, 0.3))


DOME = mm.Interfaces(
    surfaces=(
        mm.Sphere(centre=(0, 0, 0.5), radius=0.1),
        mm.Sphere(centre=(0, 0, 0.5), radius=0.11),
    ),
    indices=(1.0, 1.5, 1.34),
)


@pytest.mark.parametrize("media", [None, TANK, DOME], ids=["none", "layers", "dome"])
def test_a_point_with_an_unknown_coordinate_has_no_image(media: object) -> None:
    camera = mm.Camera.from_angles((0, 0, 0.5), 0.0, 0.0, 0.0, principal_distance=25.0)
    points = np.array([0.1, 0.05, -0.2]) + np.zeros((8, 3))
    unknown = np.array(list(product((False, True), repeat=3)))
    points[unknown] = NAN
    image = mm.project(camera, points, media)
    status = mm.projection_status(camera, points, media)
    assert not np.isnan(image[0]).any()
    assert np.isnan(image[1:]).all()
    assert status == ["ok", *["not a number"] * 7]


@pytest.mark.parametrize("media", [None, TANK, DOME], ids=["none", "layers", "dome"])
def test_an_unknown_image_point_has_no_ray(media: object) -> None:
    camera = mm.Camera.from_angles((0, 0, 0.5), 0.0, 0.0, 0.0, principal_distance=25.0)
    image = np.array([[1.0, 1.0], [NAN, 1.0], [1.0, NAN], [NAN, NAN]])
    _, directions = mm.image_rays(camera, image, media)
    assert np.isfinite(directions[0]).all()
    assert np.isnan(directions[1:]).all()


@pytest.mark.parametrize("place", [0, 1, 2])
def test_snell_says_unknown(place: int) -> None:
    beta, n1, n2 = (NAN if i == place else v for i, v in enumerate((0.5, 1.0, 1.34)))
    assert np.isnan(mm.refracted_angle(beta, n_from=n1, n_to=n2))
    assert np.isnan(mm.refracted_direction([0.6, 0.0, -0.8 + 0 * beta], [0, 0, 1],
                                           n_from=n1, n_to=n2)).all()  # fmt: skip
    if place:
        assert np.isnan(mm.critical_angle(n_from=n1, n_to=n2))


def test_the_inverses_of_the_index_of_water_say_unknown() -> None:
    for unknown in list(product((False, True), repeat=4))[1:]:
        index, nm, other, depth = np.where(unknown, NAN, (1.335, 520.0, 3.0, 1.0))
        assert np.isnan(
            mm.salinity_from_index(index, wavelength_nm=nm, temperature_c=other, depth=depth)
        )
        assert np.isnan(
            mm.temperature_from_index(index, wavelength_nm=nm, salinity_percent=other, depth=depth)
        )
