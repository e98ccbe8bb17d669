"""The pair file and the general intersection: exactness, covariance, flags, refusals."""

from __future__ import annotations

import csv
import importlib.util
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bifocal import (
    SAMPLE,
    FlagLimits,
    GeometryError,
    InputError,
    Lens,
    Pair,
    Photo,
    PointObservations,
    rays,
    read_image,
    relief,
)
from bifocal.model.flags import point_flags
from bifocal.survey.point_survey import solve_points
from bifocal.survey.remarks import point_remarks

GSD = 0.00369
METRES = np.array([[GSD, 0, -5.67], [0, -GSD, 3.78], [0, 0, 1.0]])


def ideal(d2=9.5):
    return Pair(
        image1=Photo(plane_from_pixel=METRES, nadir=[0, 0], distance=17.5),
        image2=Photo(plane_from_pixel=METRES, nadir=[0, 0], distance=d2),
    )


def tilted():
    """Return a hand-held pair: tilted photos, different pixels, cameras 0.4 m off each other."""
    far = np.array([[0.004, 1e-5, -6.1], [2e-5, -0.0041, 4.0], [1e-6, -4e-6, 1.0]])
    near = np.array([[0.003, -3e-5, -4.1], [1e-5, -0.0031, 3.2], [-5e-6, 3e-6, 1.0]])
    return Pair(
        image1=Photo(plane_from_pixel=far, nadir=[0.3, -0.2], distance=14.2),
        image2=Photo(plane_from_pixel=near * -2.5, nadir=[-0.1, 0.15], distance=8.7),
    )


def scene(count=500, seed=1):
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [rng.uniform(-4, 4, count), rng.uniform(-3, 3, count), rng.uniform(-0.8, 1.0, count)]
    )


@pytest.mark.parametrize("pair", [ideal(), ideal(14.0), tilted()], ids=["35/19", "35/28", "free"])
def test_projected_points_are_intersected_where_they_were(pair):
    xyz = scene()
    found = pair.intersect(*pair.project(xyz))
    away = np.hypot(*(xyz[:, :2] - pair.zoom_centre).T) > 0.5
    np.testing.assert_allclose(found.xyz[away], xyz[away], atol=2e-12)
    assert np.abs(found.residuals).max() < 1e-9


def test_pixels_of_an_ideal_pair_are_counted_right_and_down_from_its_nadir_points():
    pair = Pair.ideal(
        d1=17.5, d2=9.5, c1=35, c2=19, pixel_size=0.0074, nadir1=(1536, 1024), nadir2=(1500, 1000)
    )
    # By hand: 0.0074 mm * 0.5 m/mm = 3.7 mm on the wall; 100 px right and 50 px up of the nadir.
    for photo, pixel in ((pair.image1, (1636, 974)), (pair.image2, (1600, 950))):
        np.testing.assert_allclose(photo.plane_from_pixels([pixel]), [[0.37, 0.185]], rtol=1e-12)
    unstated = Pair.ideal(d1=17.5, d2=9.5, pixel_size=0.0074)
    for photo in (unstated.image1, unstated.image2):
        assert photo.plane_from_pixels([[0, 0]]).tolist() == [[0, 0]]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"d2": -9.5}, "^d2: must be above zero"),
        ({"c1": 0.0}, "^c1: must be above zero"),
        ({"nadir2": (1.0, 2.0, 3.0), "pixel_size": 0.0074}, "^nadir2: "),
    ],
)
def test_a_wrong_value_of_an_ideal_pair_is_named(wrong, message):
    with pytest.raises(InputError, match=message):
        Pair.ideal(**({"d1": 17.5, "d2": 9.5, "c1": 35.0, "c2": 19.0} | wrong))


def test_an_ideal_pair_equals_the_closed_form_to_1e_12():
    pair, xyz = ideal(), scene()
    xyz = xyz[np.hypot(*xyz[:, :2].T) > 0.5]
    first, second = pair.project(xyz)
    s1 = np.hypot(*pair.image1.plane_from_pixels(first).T)
    s2 = np.hypot(*pair.image2.plane_from_pixels(second).T)
    expected = relief(s1, s2, d1=17.5, d2=9.5)
    np.testing.assert_allclose(
        pair.intersect(first, second).xyz[:, 2], expected, rtol=1e-12, atol=1e-12
    )


def test_displacements_are_counted_from_the_nadir_of_their_own_photo():
    pair, xyz = tilted(), scene()
    found = pair.intersect(*pair.project(xyz))
    for e, photo in ((found.e1, pair.image1), (found.e2, pair.image2)):
        # Similar triangles: |P - N| on the wall is seen |P - N| d / (d - r) from the nadir.
        radius, r = np.hypot(*(xyz[:, :2] - photo.nadir).T), xyz[:, 2]
        np.testing.assert_allclose(e, radius * r / (photo.distance - r), atol=1e-9)


def test_precision_makes_a_point_weak_above_half_the_limit_and_uncertain_above_it():
    sigma = np.array([0.0199, 0.0201, 0.0399, 0.0401])
    nothing = np.zeros(4, dtype=bool)
    flags = point_flags(
        at_nadir=nothing, standardised=np.zeros(4), incomplete=nothing, relief=np.ones(4),
        sigma_r=sigma, near_distance=9.5, limits=FlagLimits(sigma_r_max=0.04),
    )  # fmt: skip
    assert flags == ("OK", "WEAK", "WEAK", "UNCERTAIN")


def test_every_pair_is_a_zoom_about_e():
    pair, xyz = tilted(), scene()
    q1 = pair.image1.plane_from_pixels(pair.project(xyz)[0])
    q2 = pair.image2.plane_from_pixels(pair.project(xyz)[1])
    d1, d2 = pair.image1.distance, pair.image2.distance
    n1, n2 = pair.image1.nadir, pair.image2.nadir
    e = (d1 * n2 - d2 * n1) / (d1 - d2)
    k = d2 * (d1 - xyz[:, 2]) / (d1 * (d2 - xyz[:, 2]))
    np.testing.assert_allclose(q2 - e, k[:, None] * (q1 - e), atol=1e-12)
    np.testing.assert_allclose(rays.zoom_factor(xyz[:, 2], d1=d1, d2=d2), k)
    np.testing.assert_allclose(rays.relief_from_zoom(k, d1=d1, d2=d2), xyz[:, 2], atol=1e-12)


def test_the_intersection_is_the_least_squares_one():
    from scipy.optimize import least_squares

    pair, xyz = tilted(), scene(20)
    rng = np.random.default_rng(5)
    picks = [p + rng.normal(0, 0.5, p.shape) for p in pair.project(xyz)]
    found = pair.intersect(*picks)
    for i in range(20):

        def misses(point, i=i):
            first, second = pair.project(point[None])
            return np.concatenate([(picks[0][i] - first[0]), (picks[1][i] - second[0])])

        best = least_squares(misses, found.xyz[i], xtol=1e-15, ftol=1e-15, gtol=1e-15)
        # The picks' precision is carried to the plane at the pick itself: second-order difference.
        np.testing.assert_allclose(found.xyz[i], best.x, atol=0.02 * found.sigma[i].max())


@pytest.mark.parametrize("pair", [ideal(), tilted()], ids=["ideal", "free"])
def test_covariances_explain_the_scatter_of_noisy_picks(pair):
    point = np.repeat([[2.1, -1.4, 0.6]], 100_000, axis=0)
    rng = np.random.default_rng(9)
    picks = [p + rng.normal(0, 0.4, p.shape) for p in pair.project(point)]
    found = pair.intersect(*picks, sigma_px=0.4)
    formal = pair.intersect(*[p[:1] for p in pair.project(point)], sigma_px=0.4)
    ratio = found.xyz.std(axis=0) / formal.sigma[0]
    np.testing.assert_allclose(ratio, 1.0, atol=0.02)
    correlation = np.corrcoef(found.xyz.T)[0, 2]
    c = formal.covariance[0]
    assert correlation == pytest.approx(c[0, 2] / np.sqrt(c[0, 0] * c[2, 2]), abs=0.02)
    assert found.standardised.std() == pytest.approx(1.0, abs=0.02)


@pytest.mark.acceptance
def test_uncertain_distances_scale_and_nadirs_enter_the_covariance():
    point = np.array([[2.1, -1.4, 0.6]])
    rng = np.random.default_rng(4)
    given = {"sigma_d1": 0.02, "sigma_d2": 0.01, "sigma_scale": 5e-4, "sigma_nadir": 0.01}
    pair = ideal()
    first, second = pair.project(point)
    formal = pair.intersect(first, second, sigma_px=1e-6, **given)
    drawn = []
    for _ in range(4000):
        photos = []
        for photo, sigma in ((pair.image1, 0.02), (pair.image2, 0.01)):
            nadir = photo.nadir + rng.normal(0, 0.01, 2)
            photos.append(
                replace(photo, nadir=nadir, distance=photo.distance + rng.normal(0, sigma))
            )
        stretch = 1 + rng.normal(0, 5e-4)
        scale = np.diag([stretch, stretch, 1.0])
        photos[1] = replace(photos[1], plane_from_pixel=scale @ METRES)
        moved = Pair(image1=photos[0], image2=photos[1])
        drawn.append(moved.intersect(first, second, sigma_px=1e-6).xyz[0])
    np.testing.assert_allclose(np.std(drawn, axis=0) / formal.sigma[0], 1.0, atol=0.05)


def test_a_mispicked_point_is_named_with_its_size_in_pixels():
    pair, xyz = ideal(), scene(50)
    xyz[7] = [3.0, 2.0, 0.4]
    first, second = pair.project(xyz)
    across = np.array([2.0, 3.0]) / np.hypot(2, 3)  # image rows run down: across the radius
    second[7] += 8 * across
    found = pair.intersect(first, second, sigma_px=0.5)
    assert found.flags[7] == "OFF-RADIAL"
    assert abs(found.misfit[7]) == pytest.approx(8.0, abs=0.05)
    points = PointObservations(ids=tuple(f"P{i}" for i in range(50)), pixels1=first, pixels2=second)
    (sentence,) = point_remarks(points, solve_points(pair, points, sigma_px=0.5), None)
    assert sentence.startswith(
        f"P7: the two picks miss each other by {abs(found.misfit[7]):.3g} px"
    )


def test_near_the_nadir_points_are_uncertain_and_finite_and_on_it_undefined():
    pair = ideal()
    xyz = np.array([[0.01, 0.0, 0.3], [0.0, 0.0, 0.3], [3.0, 0.0, 0.3]])
    found = pair.intersect(*pair.project(xyz))
    assert found.flags == ("UNCERTAIN", "NADIR", "OK")
    assert np.isfinite(found.xyz[0]).all()
    assert np.isnan(found.xyz[1, 2])


def test_a_point_on_the_plane_says_so():
    pair = ideal()
    assert pair.intersect(*pair.project([[3.0, 1.0, 0.0]])).flags == ("ON-PLANE",)


def test_points_measured_in_one_photo_only_are_undefined():
    pair = ideal()
    found = pair.intersect([[100.0, 200.0]], [[np.nan, np.nan]])
    assert found.flags == ("CHECK",)
    assert np.isnan(found.xyz).all()


def test_no_points_give_no_points():
    assert len(ideal().intersect(np.zeros((0, 2)), np.zeros((0, 2)))) == 0


def test_masked_picks_are_unknown_and_words_are_none():
    picks = np.array([[[100.0, 100.0], [400.0, 90.0]], [[200.0, 300.0], [50.0, 60.0]]])
    masked = np.ma.masked_array(picks * 1.01, mask=False)
    masked[1, 0, 0] = np.ma.masked
    found = ideal().intersect(picks, masked)
    assert found.xyz.shape == (2, 2, 3)
    np.testing.assert_array_equal(np.isnan(found.xyz).any(axis=-1), [[False, False], [True, False]])
    with pytest.raises(InputError, match="pixels2: expected numbers, found"):
        ideal().intersect([[1, 2]], [["1", "2"]])
    with pytest.raises(InputError, match=r"pixels1: expected points of shape \(..., 2\)"):
        ideal().intersect([1, 2, 3], [1, 2, 3])


def test_unequal_numbers_of_picks_are_refused():
    with pytest.raises(InputError, match="both have shape"):
        ideal().intersect(np.zeros((2, 2)), np.zeros((3, 2)))


@pytest.mark.parametrize(
    ("precision", "words"),
    [
        ({"sigma_px": 0.0}, "above zero"),
        ({"sigma_px": -1.0}, "above zero"),
        ({"sigma_d1": -5.0}, "zero or more"),
        ({"sigma_d2": np.nan}, "zero or more"),
        ({"sigma_scale": np.inf}, "zero or more"),
        ({"sigma_nadir": 1e300}, "zero or more"),
        ({"sigma_r_max": 0.0}, "above zero"),
    ],
)
def test_a_precision_that_cannot_be_is_refused_by_name(precision, words):
    with pytest.raises(InputError, match=f"^{next(iter(precision))}: must be {words}"):
        ideal().intersect([[100, 100]], [[110, 110]], **precision)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("distance", 1e300, "distance: must be above zero"),
        ("distance", 1e30, "distance: must be above zero"),
        ("distance", 1.2e5, "distance: 120000.0 m is beyond reason"),
        ("nadir", [1e300, 0.0], "nadir: .* beyond reason"),
        ("sigma_pixel", 1e300, "sigma_pixel: must be above zero"),
    ],
)
def test_numbers_beyond_reason_are_refused(key, value, words):
    given = {"plane_from_pixel": METRES, "nadir": [0, 0], "distance": 17.5} | {key: value}
    with pytest.raises(InputError, match=words):
        Photo(**given)


def test_lens_distortion_is_taken_off_and_put_back(tmp_path):
    lens = Lens(
        camera_matrix=[[3000, 0, 1536], [0, 3000, 1024], [0, 0, 1]],
        coefficients=[-0.12, 0.05, 1e-4, -2e-4, 0.0], image_size=(3072, 2048),
    )  # fmt: skip
    lens.write(tmp_path / "lens.json")
    data = ideal().to_dict()
    data["image1"] = {**data["image1"], "lens": "lens.json"}
    (tmp_path / "a.pair.json").write_text(json.dumps(data, default=np.ndarray.tolist))
    pair = Pair.read(tmp_path / "a.pair.json")
    xyz = scene(100)
    first, second = pair.project(xyz)
    assert np.abs(first - ideal().project(xyz)[0]).max() > 5
    away = np.hypot(*xyz[:, :2].T) > 0.5
    found = pair.intersect(first, second)
    np.testing.assert_allclose(found.xyz[away], xyz[away], atol=1e-7)
    pair.write(tmp_path / "b.pair.json")
    assert json.loads((tmp_path / "b.pair.json").read_text())["image1"]["lens"] == "lens.json"


# The file


def write(tmp_path, **changes):
    data = json.loads(json.dumps(ideal().to_dict(), default=np.ndarray.tolist))
    for key, value in changes.items():
        data["image1"][key] = value
    path = tmp_path / "wall.pair.json"
    path.write_text(json.dumps(data))
    return path


def test_unknown_keys_survive_reading_and_writing(tmp_path):
    data = json.loads(write(tmp_path, principal_distance=35, mine="kept").read_text())
    data["setup"] = {"a": [1, 2]}
    data["anything"] = "kept"
    (tmp_path / "in.pair.json").write_text(json.dumps(data))
    Pair.read(tmp_path / "in.pair.json").write(tmp_path / "out.pair.json")
    assert json.loads((tmp_path / "out.pair.json").read_text()) == data


def test_swapped_images_are_exchanged_and_said():
    pair = ideal()
    swapped = Pair(image1=pair.image2, image2=pair.image1)
    assert swapped.image1.distance == 17.5
    assert "exchanged" in swapped.remarks[0]
    assert swapped.exchanged
    assert not pair.exchanged
    assert replace(swapped, remarks=()).exchanged


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"plane_from_pixel": [[1, 2, 3], [2, 4, 6], [0, 0, 1]]}, GeometryError, "singular"),
        ({"plane_from_pixel": [[1, 2], [3, 4]]}, InputError, "plane_from_pixel"),
        ({"plane_from_pixel": "..."}, InputError, "plane_from_pixel"),
        ({"nadir": [0, None]}, InputError, "nadir"),
        ({"distance": 0}, InputError, "distance"),
        ({"distance": 9.5}, GeometryError, "same distance"),
        ({"distance": [1, 2]}, InputError, "distance: expected one number"),
        ({"distance": 10**400}, InputError, "distance: holds a whole number above"),
        ({"nadir": [0, 10**400]}, InputError, "nadir: holds a whole number above"),
        ({"file": 3}, InputError, "file"),
        ({"lens": "none.json"}, InputError, "lens file"),
        (
            {"principal_distance": "abc"},
            InputError,
            '"image1": principal_distance: expected numbers',
        ),
        ({"pixel_size": -1}, InputError, '"image1": pixel_size: must be above zero'),
    ],
)
def test_every_bad_value_is_named_with_file_and_key(tmp_path, changes, error, message):
    with pytest.raises(error, match=message) as caught:
        Pair.read(write(tmp_path, **changes))
    assert "wall.pair.json" in str(caught.value)


def test_what_is_no_pair_file_is_said(tmp_path):
    with pytest.raises(InputError, match="no such pair file"):
        Pair.read(tmp_path / "none.json")
    (tmp_path / "x.json").write_text("{,}")
    with pytest.raises(InputError, match="line 1"):
        Pair.read(tmp_path / "x.json")
    (tmp_path / "y.json").write_text('{"format": "other/2"}')
    with pytest.raises(InputError, match="bifocal-pair/1"):
        Pair.read(tmp_path / "y.json")


# Real photos


def example():
    path = Path(__file__).parents[3] / "examples" / "pair_from_geometry.py"
    spec = importlib.util.spec_from_file_location("pair_from_geometry", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("name", "median", "rms", "sigma_px"),
    [("church_1", 0.0042, 0.0078, 0.36), ("church_2", 0.0105, 0.020, 0.32)],
)
def test_the_church_is_measured_as_precisely_as_the_pair_allows(
    data_dir, tmp_path, name, median, rms, sigma_px
):
    example().main(data_dir / "facade_pairs" / name, tmp_path)
    pair = Pair.read(tmp_path / f"{name}.pair.json")
    assert (pair.folder / pair.image1.file).resolve().is_file()
    with (tmp_path / "points.csv").open() as file:
        rows = np.array([[float(v) for v in row] for row in list(csv.reader(file))[1:]])
    found = pair.intersect(rows[:, 1:3], rows[:, 3:5])
    spread = 1.4826 * np.median(np.abs(found.standardised)) * found.sigma_px
    assert spread == pytest.approx(sigma_px, abs=0.02)
    found = pair.intersect(rows[:, 1:3], rows[:, 3:5], sigma_px=spread)
    away = np.hypot(*(found.xyz[:, :2] - pair.image2.nadir).T) > 4
    used = away & (np.array(found.flags) != "OFF-RADIAL")
    error = found.xyz[:, 2] - rows[:, 5]
    assert np.median(np.abs(error[away])) <= median
    assert np.sqrt(np.mean(error[used] ** 2)) <= rms
    pull = error[away] / found.sigma[away, 2]
    assert 0.7 <= 1.4826 * np.median(np.abs(pull)) <= 1.4


def test_the_semireal_check_points_are_met_to_a_fifth_of_a_millimetre(data_dir):
    folder = data_dir / "semireal_church"
    truth = json.loads((folder / "truth.json").read_text())
    photos = {}
    for view in truth["views"]:
        gsd, (cx, cy), (nx, ny) = (
            view["m_per_px_on_plane"], view["principal_point_px"], view["nadir_wall_m"],
        )  # fmt: skip
        matrix = [[gsd, 0, nx - gsd * cx], [0, -gsd, ny + gsd * cy], [0, 0, 1]]
        photos[view["file"]] = Photo(
            plane_from_pixel=matrix, nadir=[nx, ny], distance=view["distance_m"]
        )
    pair = Pair(image1=photos["d18.png"], image2=photos["d9.png"])
    with (folder / "checkpoints.csv").open() as file:
        rows = np.array([[float(v) for v in row] for row in list(csv.reader(file))[1:]])
    found = pair.intersect(rows[:, 6:8], rows[:, 4:6])
    away = np.hypot(*(rows[:, 1:3] - pair.zoom_centre).T) > 0.5
    assert np.abs(found.xyz[away, 2] - rows[away, 3]).max() < 2e-3
    assert np.median(np.abs(found.xyz[away] - rows[away, 1:4])) < 2e-4


def test_the_photos_of_a_pair_give_their_pictures(tmp_path: Path) -> None:
    pair = Pair.read(SAMPLE / "facade.pair.json")
    picture = pair.photo1.image
    assert picture.shape[1::-1] == pair.photo1.image_size
    np.testing.assert_array_equal(picture, read_image(pair.photo_file(1)))
    moved = replace(pair, folder=tmp_path)
    with pytest.raises(InputError, match=re.escape(f"{moved.photo2.path}: no such image")):
        _ = moved.photo2.image
    with pytest.raises(InputError, match='add its "file"'):
        _ = Pair.ideal(d1=2.0, d2=1.0).photo1.image
