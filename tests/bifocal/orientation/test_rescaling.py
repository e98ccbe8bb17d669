"""A pair that the photos alone gave gets its scale from one measure; one lens nobody measured."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bifocal import SAMPLE, Interior, Pair
from bifocal.collimation.proposals import rescale
from bifocal.model.homography import apply_homography
from bifocal.model.orientation_precision import NAMES
from bifocal.orientation.rescaling import scaled_by_distance, scaled_by_length
from bifocal.orientation.starts.relative_orientation import Ties, sought_focal
from multimedia import GeometryError, InputError
from photocore.camera.pinhole import Pinhole, camera_matrix, plane_transfer, project
from photocore.camera.rotation import rotation_from_vector
from photocore.remarks import KEYS, learn

ENDS = np.array([[300.0, 250.0], [1200.0, 700.0]])


@pytest.fixture(scope="module")
def pair() -> Pair:
    """The sample with the covariance of an adjustment that holds the far distance to 2 cm."""
    sigma = dict.fromkeys(NAMES, 0.0)
    for number in (1, 2):
        sigma |= {f"focal length {number}": 1e-3, f"turn X {number}": 1e-3}
    sigma |= {"Z 1": 0.02, "Z 2": 0.015, "X 2": 0.01}
    covariance = np.diag([sigma[name] ** 2 for name in NAMES])
    setup = {
        "planes": [{"offset": 0.0, "share": 0.6, "pixel": [1, 2]},
                   {"offset": 0.08, "share": 0.5, "pixel": [3, 4]}],
        "doubts": ["CHECK THE WALL: other planes compete"],
        "wall_relief_mm": [{"zone": "top left", "points": 9, "median": 1.0, "spread": 2.0}],
    }  # fmt: skip
    read = Pair.read(SAMPLE / "facade.pair.json")
    return replace(read, orientation=covariance, extra={**read.extra, "setup": setup})


def apart(pair: Pair, number: int) -> float:
    return float(np.hypot(*np.diff(pair.photo(number).plane_from_pixels(ENDS), axis=0)[0]))


def test_a_length_multiplies_all_lengths_and_nothing_else(pair: Pair) -> None:
    scaled = scaled_by_length(pair, 2, ENDS, 3.0, sigma=0.01)
    assert apart(scaled, 2) == pytest.approx(3.0, abs=1e-9)
    factor = 3.0 / apart(pair, 2)
    assert scaled.d1 == pytest.approx(factor * pair.d1)
    one, other = (p.intersect([[300, 250.0]], [[310, 255.0]]).xyz for p in (pair, scaled))
    np.testing.assert_allclose(other, factor * one, rtol=1e-9)
    setup = scaled.extra["setup"]
    assert setup["planes"][1]["offset"] == pytest.approx(0.08 * factor)
    assert setup["wall_relief_mm"][0]["spread"] == pytest.approx(2 * factor)
    assert f"{80 * factor:+.0f} mm" in setup["doubts"][0]
    assert f"Far camera {scaled.d1:.3f} m" in setup["words"][0]


def test_the_page_renews_what_it_told_about_the_wall(pair: Pair, tmp_path: Path) -> None:
    told = "Prüfen: 80 mm."
    learn({KEYS: {told: {"key": "orientation.rivals", "values": {}, "level": "doubt"}}})
    setup = {**pair.extra["setup"], "doubts": [told]}
    path = tmp_path / "w.pair.json"
    replace(pair, extra={**pair.extra, "setup": setup}).write(path)
    report = rescale(path, {"remarks": ["It leans.", told]}, ["distance", 1, 35.0, 0.01])
    assert report["remarks"] == ["It leans.", *Pair.read(path).extra["setup"]["doubts"]]
    assert f"{80 * 35.0 / pair.d1:+.0f} mm" in report["remarks"][1]


def test_the_scale_a_pair_had_leaves_nothing_in_its_covariance(pair: Pair) -> None:
    """By whatever distance it was oriented: after the measure only that counts."""
    wrong = scaled_by_distance(pair, 1, 5.0, sigma=0.5)
    for measured in (
        lambda one: scaled_by_distance(one, 1, 17.5, sigma=0.1),
        lambda one: scaled_by_length(one, 1, ENDS, 3.0, sigma=0.01),
    ):
        first, second = measured(pair).orientation, measured(wrong).orientation
        np.testing.assert_allclose(first, second, atol=1e-12)
    distance = scaled_by_distance(wrong, 1, 17.5, sigma=0.1)
    sigma = np.sqrt(np.diag(distance.orientation))
    assert sigma[NAMES.index("Z 1")] == pytest.approx(0.1)
    assert distance.extra["setup"]["standard_deviations"]["distance1"] == pytest.approx(0.1)


def test_what_is_no_measure_is_refused(pair: Pair) -> None:
    with pytest.raises(GeometryError, match="farther apart"):
        scaled_by_length(pair, 1, np.array([[5.0, 5.0], [5.5, 5.0]]), 1.0, sigma=0.01)
    with pytest.raises(InputError, match="length"):
        scaled_by_length(pair, 1, ENDS, -1.0, sigma=0.01)


def test_the_focal_length_of_one_unknown_lens_is_found_from_common_points() -> None:
    rng = np.random.default_rng(4)
    size, focal = (3000, 2000), 3900.0
    matrix = camera_matrix(focal, 1.0, 1499.5, 999.5)
    face = np.diag([1.0, -1.0, -1.0])
    far = Pinhole(matrix, rotation_from_vector([0.05, -0.1, 0]) @ face, np.array([0, 0, 15.0]))
    near = Pinhole(matrix, rotation_from_vector([0.1, 0.2, 0]) @ face, np.array([1, 0.4, 10.0]))
    xyz = rng.uniform((-3, -2, 0), (3, 2, 0), (400, 3))
    xyz[250:, 2] = rng.uniform(-1, 1, 150)
    seen = [project(camera, xyz) for camera in (far, near)]
    homography = plane_transfer(far, near, np.zeros(3))
    np.testing.assert_allclose(
        apply_homography(homography, seen[0][:250]), seen[1][:250], atol=1e-6
    )
    ties = Ties(
        pixels1=seen[0], pixels2=seen[1], seen1=seen[0], seen2=seen[1], homography=homography,
        on_plane=np.arange(400) < 250, tolerance=1.5,
    )  # fmt: skip
    found = sought_focal(ties, (Interior.sought(size), Interior.sought(size)))
    assert found[0].focal == found[1].focal == pytest.approx(1.3 * 3000)
    assert found[0].is_sought
    assert not found[0].is_assumed
