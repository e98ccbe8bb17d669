"""Pairs that look through glass and water: projection, intersection, precision, the pair file."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

import bifocal
from bifocal import GeometryError, InputError, MediaPath, Pair
from bifocal.media import interface_axes
from bifocal.model.pair_media import PairMedia
from bifocal.model.ray_field import RayField
from bifocal.rays import object_rays, plane_position, straight
from multimedia import Layers
from tests.scenes.refracted import pixels_of

AQUARIUM = {"indices": [1.0, 1.49, 1.337], "thicknesses": [0.01]}
SURFACE = {"indices": [1.0, 1.337], "thicknesses": []}
OBLIQUE = [[0.0015, 2e-5, -1.2], [-3e-5, -0.00152, 0.9], [1e-6, -2e-5, 1.0]]


def photo(distance, z0, nadir=(0.0, 0.0), **more):
    """Return a photo square to the plane, 1.5 mm a pixel on it."""
    square = [[0.0015, 0, -1.2], [0, -0.0015, 0.9], [0, 0, 1]]
    return {"plane_from_pixel": square, "nadir": list(nadir), "distance": distance, "z0": z0} | more


#: What stands in the pair file: a flat port before either camera, the glass of a tank or the
#: surface of water, cameras aside and photos oblique, a port that leans.
PAIRS = {
    "port": (AQUARIUM, photo(3.5, 0.05), photo(1.9, 0.05)),
    "tank": (AQUARIUM, photo(3.5, 2.6), photo(1.9, 1.0)),
    "surface": (SURFACE, photo(3.5, 2.9), photo(1.9, 1.3)),
    "oblique": (
        AQUARIUM,
        photo(3.5, 2.6, (0.05, -0.02), plane_from_pixel=OBLIQUE),
        photo(1.9, 1.0, (-0.03, 0.04), plane_from_pixel=OBLIQUE),
    ),
    "leaning port": (
        AQUARIUM,
        photo(3.5, 0.05, (0.05, -0.02), interface_normal=[0.1, -0.15, 1.0]),
        photo(1.9, 0.06, (-0.03, 0.04), interface_normal=[-0.07, 0.05, 1.0]),
    ),
    "diver": (
        {"indices": [1.337, 1.52, 1.0], "thicknesses": [0.006]},
        photo(3.5, 3.3),
        photo(1.9, 1.7),
    ),
}
POINTS = np.array(
    [[0.9, 0.6, 0.0], [-0.7, 0.4, 0.35], [0.3, -0.6, -0.4], [0.02, 0.01, 0.1], [-1.0, -0.5, 0.2]]
)


def content(name):
    layers, far, near = PAIRS[name]
    return {"format": "bifocal-pair/1", "image1": far, "image2": near, "layers": layers}


def points_of(name):
    # The diver looks through a window at things in the air behind it.
    return POINTS * ([0.3, 0.3, 0.2] if name == "diver" else 1.0)


@pytest.mark.parametrize("name", PAIRS)
def test_a_pair_sees_and_measures_what_shot_rays_show(name):
    pair, points = Pair.from_dict(content(name)), points_of(name)
    truth = [pixels_of(side, points, PAIRS[name][0]) for side in PAIRS[name][1:]]
    for found, true in zip(pair.project(points), truth, strict=True):
        np.testing.assert_allclose(found, true, atol=2e-10)  # px of 1.5 mm
    found = pair.intersect(*truth)
    np.testing.assert_allclose(found.xyz, points, atol=1e-9)
    np.testing.assert_allclose(found.residuals, 0, atol=1e-8)
    np.testing.assert_allclose(found.misfit, 0, atol=1e-8)


@pytest.mark.parametrize("name", PAIRS)
def test_the_jacobian_is_the_slope_of_the_projection(name):
    pair, points, step = Pair.from_dict(content(name)), points_of(name), 1e-6
    for side in (pair.image1, pair.image2):
        jacobian = side.pixels_by_point(points)
        for k, way in enumerate(np.eye(3) * step):
            slope = (side.project(points + way) - side.project(points - way)) / (2 * step)
            np.testing.assert_allclose(jacobian[..., k], slope, rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("name", PAIRS)
def test_sigmas_are_those_of_a_third_of_a_pixel_of_noise(name):
    pair, rng, draws = Pair.from_dict(content(name)), np.random.default_rng(20260722), 4000
    for point in points_of(name)[[0, 1, 2, 4]]:
        many = np.broadcast_to(point, (draws, 3))
        picks = [side + rng.normal(0, 0.3, side.shape) for side in pair.project(many)]
        found = pair.intersect(*picks, sigma_px=0.3)
        ratio = found.xyz.std(axis=0) / np.sqrt(np.median(found.sigma**2, axis=0))
        assert ((ratio > 0.95) & (ratio < 1.05)).all(), ratio
        assert np.abs(found.standardised.std() - 1) < 0.05
        error = found.xyz - point
        chi2 = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error)
        assert 2.85 < chi2.mean() < 3.15


@pytest.mark.parametrize("name", ["port", "oblique", "leaning port"])
def test_what_distances_and_nadirs_add_is_what_moving_them_does(name):
    data, point = content(name), points_of(name)[[1]]
    pair, step = Pair.from_dict(data), 1e-6
    picks = pair.project(point)

    def moved_by(change):
        other = json.loads(json.dumps(data))
        change(other)
        return (Pair.from_dict(other).intersect(*picks).xyz - pair.intersect(*picks).xyz)[0] / step

    def farther(other):
        other["image1"]["distance"] += step

    def aside(side, k):
        def change(other):
            other[side]["nadir"][k] += step

        return change

    without = pair.intersect(*picks).covariance[0]
    found = pair.intersect(*picks, sigma_d1=0.01).covariance[0] - without
    by_distance = moved_by(farther) * 0.01
    np.testing.assert_allclose(found, np.outer(by_distance, by_distance), rtol=1e-3, atol=1e-10)
    found = pair.intersect(*picks, sigma_nadir=0.01).covariance[0] - without
    ways = [moved_by(aside(side, k)) * 0.01 for side in ("image1", "image2") for k in (0, 1)]
    np.testing.assert_allclose(found, sum(np.outer(w, w) for w in ways), rtol=1e-3, atol=1e-10)


def test_media_of_one_index_are_air():
    layers = {"indices": [1.2, 1.2, 1.2], "thicknesses": [0.2]}
    data = content("oblique") | {"layers": layers}
    through, air = (
        Pair.from_dict(data),
        Pair.from_dict({k: v for k, v in data.items() if k != "layers"}),
    )
    picks = [p + np.array([0.3, -0.2]) for p in air.project(POINTS)]
    np.testing.assert_allclose(through.project(POINTS), air.project(POINTS), atol=1e-9)
    one, other = through.intersect(*picks), air.intersect(*picks)
    for field in ("xyz", "covariance", "residuals", "misfit", "standardised", "e1", "e2"):
        np.testing.assert_allclose(
            getattr(one, field), getattr(other, field), rtol=1e-9, atol=1e-12
        )
    assert one.flags == other.flags


def test_no_media_are_none_in_another_process_too():
    assert not PairMedia.none()
    assert not pickle.loads(pickle.dumps(PairMedia.none()))


def test_a_port_that_leans_by_nothing_is_parallel():
    layers = Layers(**AQUARIUM)
    plain = MediaPath(layers=layers, z0=0.05, distance=1.9)
    turned = MediaPath(
        layers=layers, z0=0.05, distance=1.9, rotation=interface_axes(np.array([0, 0, 1.0]))
    )
    away = POINTS[:, :2]
    for one, other in zip(
        plain.trace_with_jacobian(away), turned.trace_with_jacobian(away), strict=True
    ):
        np.testing.assert_allclose(one, other, atol=1e-15)


def test_what_stands_before_the_last_interface_is_not_seen():
    pair = Pair.from_dict(content("surface"))  # 0.6 m of water over the plane
    seen = pair.project([[0.3, 0.2, 0.6], [0.3, 0.2, 0.6001]])
    assert np.isfinite(seen[0][0]).all()
    assert np.isnan(seen[0][1]).all()
    assert np.isnan(seen[1][1]).all()


def test_beyond_total_reflection_nothing_is_seen():
    pair = Pair.from_dict(content("diver"))
    far_out = pair.image1.plane_from_pixels([[40000.0, 600.0]])  # 59 m aside over 3.5 m
    assert np.isnan(far_out).all()


@pytest.mark.parametrize("name", PAIRS)
def test_plane_positions_and_pixels_are_each_others_inverse(name):
    pair = Pair.from_dict(content(name))
    places = points_of(name)[:, :2]
    for side in (pair.image1, pair.image2):
        np.testing.assert_allclose(
            side.plane_from_pixels(side.pixels_from_plane(places)), places, atol=1e-12
        )
        pixels, step = side.pixels_from_plane(places), 1e-4
        metres = side.metres_per_pixel(pixels)
        for k, way in enumerate(np.eye(2) * step):
            slope = (
                side.plane_from_pixels(pixels + way) - side.plane_from_pixels(pixels - way)
            ) / (2 * step)
            np.testing.assert_allclose(metres[..., k], slope, rtol=1e-6, atol=1e-10)


def test_the_pair_file_keeps_its_media(tmp_path):
    data = content("leaning port")
    path = tmp_path / "tank.pair.json"
    Pair.from_dict(data).write(path)
    again = Pair.read(path)
    assert json.loads(path.read_text())["layers"] == AQUARIUM
    np.testing.assert_array_equal(again.project(POINTS), Pair.from_dict(data).project(POINTS))
    assert again.layers == Layers(**AQUARIUM)
    assert again.image2.z0 == 0.06


def test_a_port_square_to_the_optical_axis_follows_it():
    """A camera of 2000 px, turned by 6 degrees about X and -4 about Y, 3.5 m before the plane."""
    a, b = np.radians(6), np.radians(-4)
    about_x = [[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]
    about_y = [[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]]
    square = np.diag([1.0, -1.0, -1.0])  # columns to the right, rows down, looking at the plane
    rotation = square @ np.array(about_x) @ about_y
    interior = np.array([[2000, 0, 800], [0, 2000, 600], [0, 0, 1.0]])
    pixel_from_plane = interior @ rotation @ [[1, 0, -0.1], [0, 1, 0.2], [0, 0, -3.5]]
    turned = photo(3.5, 0.05, (0.1, -0.2), interface_normal="axis")
    for scale in (1.0, -2.0):  # a homography may have any scale
        turned["plane_from_pixel"] = (np.linalg.inv(pixel_from_plane) * scale).tolist()
        data = content("port") | {"image1": turned}
        found = Pair.from_dict(data).image1.interface_normal
        np.testing.assert_allclose(found, -rotation[2], atol=1e-12)


def test_exchanged_photos_keep_their_own_z0():
    data = content("tank")
    data["image1"], data["image2"] = data["image2"], data["image1"]
    pair = Pair.from_dict(data)
    assert (pair.image1.z0, pair.image2.z0) == (2.6, 1.0)
    assert pair.exchanged


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"layers": {"indices": [1.0], "thicknesses": []}}, '"layers".*at least two media'),
        ({"layers": {"indices": [1.0, 13.37]}}, '"layers".*decimal point missing'),
        ({"layers": [1.0, 1.337]}, '"layers".*expected'),
        ({"layers": {}}, '"layers".*expected'),
        ({"image1": photo(3.5, None)}, '"image1".*z0 is missing'),
        ({"image2": photo(1.9, -0.1)}, '"image2".*z0'),
        ({"image2": photo(1.9, 1.895)}, '"image2".*behind the reference plane'),
        ({"image2": photo(1.9, 1000.0)}, '"image2".*behind the reference plane'),
        ({"image1": photo(3.5, 0.05, interface_normal=[1, 0, 0])}, '"image1".*interface_normal'),
        ({"image1": photo(3.5, 0.05, interface_normal=[0, 1])}, '"image1".*interface_normal'),
        ({"image1": photo(3.5, "5 cm")}, '"image1".*z0'),
    ],
)
def test_media_that_cannot_be_are_refused_by_name(tmp_path, change, message):
    path = tmp_path / "bad.pair.json"
    path.write_text(json.dumps(content("port") | change))
    with pytest.raises((InputError, GeometryError), match=message):
        Pair.read(path)


def test_photos_of_a_pair_look_through_the_same_media():
    wet, dry = Pair.from_dict(content("port")), Pair.ideal(d1=3.5, d2=1.9)
    with pytest.raises(InputError, match="same media"):
        bifocal.Pair(image1=wet.image1, image2=dry.image2)


def test_a_z0_without_layers_is_told_of():
    data = content("port")
    del data["layers"]
    assert "no layers" in Pair.from_dict(data).remarks[0]


def test_a_covariance_of_cameras_in_air_moves_no_point_through_media():
    known = replace(Pair.from_dict(content("port")), orientation=np.eye(24) * 1e-6)
    assert any("in no sigma" in remark for remark in known.remarks)
    assert known.effect_of_orientation(POINTS) is None
    assert not known.covariance_of_orientation(POINTS).any()
    assert known.in_air().effect_of_orientation(POINTS).shape[:2] == (5, 3)


def test_mixed_units_are_told_of():
    data = content("port") | {"layers": {"indices": [1.0, 1.49, 1.337], "thicknesses": [1e-8]}}
    assert any("thickest layer" in remark for remark in Pair.from_dict(data).remarks)


@pytest.mark.parametrize("name", ["port", "tank", "surface", "leaning port"])
def test_tabulated_rays_are_the_bent_rays(name):
    """Where they meet the plane to 0.02 mm, against the rays shot to the points."""
    foot = Pair.from_dict(content(name)).image1.foot
    field = RayField.over(foot, (-1.2, -0.9, 1.2, 0.9), (-0.4, 0.35))
    x, y = (a.astype(np.float32) for a in np.meshgrid([-1.1, -0.3, 0.01, 1.0], [-0.8, 0.2, 0.7]))
    relief = np.linspace(-0.4, 0.35, x.size, dtype=np.float32).reshape(x.shape)
    points = np.stack([x + field.foot.nadir[0], y + field.foot.nadir[1], relief], axis=-1)
    rays = object_rays(plane_position(points.astype(float), foot), foot)
    at_x, at_y, along_x, along_y = field.through(x, y, relief)
    np.testing.assert_allclose(at_x + field.foot.nadir[0], rays.position[..., 0], atol=2e-5)
    np.testing.assert_allclose(at_y + field.foot.nadir[1], rays.position[..., 1], atol=2e-5)
    np.testing.assert_allclose(np.dstack([along_x, along_y]), rays.slope, atol=5e-5)
    # A long list of places, which OpenCV takes in no single row.
    once = field.slopes(x.ravel(), y.ravel())
    many = field.slopes(
        np.tile(x.ravel(), 40_000 // x.size + 1), np.tile(y.ravel(), 40_000 // x.size + 1)
    )
    for few, long in zip(once, many, strict=True):
        assert few.shape == (x.size,)
        np.testing.assert_array_equal(long[: x.size], few)
    np.testing.assert_allclose(np.dstack(field.slopes(at_x, at_y)), rays.slope, atol=5e-5)
    flat = field.through(x.ravel(), y.ravel(), relief.ravel())
    np.testing.assert_array_equal(flat[0], at_x.ravel())


@pytest.mark.parametrize("name", ["port", "tank", "surface", "leaning port"])
def test_near_the_axis_of_the_interfaces_a_straight_camera_sees_alike(name):
    photo = Pair.from_dict(content(name)).image1
    foot, axis = photo.foot, np.array([0.0, 0.0, 1.0])
    if photo.interface_normal is not None:
        axis = photo.interface_normal / np.linalg.norm(photo.interface_normal)
    alike = straight(foot)
    # The ray along the axis and one a thousandth beside it; both meet the plane.
    for beside in (np.zeros(3), np.array([1e-4, -2e-4, 0.0])):
        way = -axis + beside
        away = way[:2] * (-foot.distance / way[2])
        rays = object_rays(foot.nadir + away, foot)
        np.testing.assert_allclose(
            rays.slope, (alike.nadir - rays.position) / alike.distance, atol=1e-9
        )
