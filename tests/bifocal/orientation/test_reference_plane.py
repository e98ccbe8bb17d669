"""Which of several planes is taken for the wall, and what is said of the others."""

from dataclasses import replace

import numpy as np
import pytest

from bifocal import GeometryError, Interior, SiteMeasures
from bifocal.orientation.orientation_report import orientation_in_words
from bifocal.orientation.walls.reference_plane import (
    NarrowFace,
    WallFace,
    choose_wall,
    faces,
    rivals_in_words,
    zero_sigma,
)
from tests.bifocal.orientation.layered_wall import SIZE, camera
from tests.builders.pinholes import project

CAMERAS = (camera(17.5), camera(9.5))
SITE = SiteMeasures(distance1=17.5, distance2=9.5, parallel=True)


def plinth_and_wall(plinth: int, wall: int, *, offset: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points of a plinth (below, at relief offset) and of a wall (above), and pixels."""
    rng = np.random.default_rng(2)
    low = np.column_stack([rng.uniform(-4, 4, plinth), rng.uniform(-3, -1, plinth)])
    high = np.column_stack([rng.uniform(-4, 4, wall), rng.uniform(-1, 3, wall)])
    relief = np.concatenate([np.full(plinth, offset), np.zeros(wall)])
    xyz = np.column_stack([np.concatenate([low, high]), relief + rng.normal(0, 0.003, len(relief))])
    return xyz, project(CAMERAS[0], xyz)


def interiors(ratio: float = 1.0) -> tuple[Interior, Interior]:
    made = [
        Interior.from_focal(focal, image_size=SIZE, sigma=0.02, source="test")
        for focal in (CAMERAS[0].matrix[0, 0], CAMERAS[1].matrix[0, 0] * ratio)
    ]
    return made[0], made[1]


def test_of_two_planes_of_like_size_the_one_at_equal_scale_is_the_wall() -> None:
    xyz, pixels = plinth_and_wall(1200, 900, offset=0.113)
    plane, found = choose_wall(xyz, pixels, CAMERAS, interiors(), SITE)
    assert plane[0] == pytest.approx(0.0, abs=0.001)
    assert [round(face.offset, 2) for face in found] == [0.0, 0.11]
    assert found[0].share == pytest.approx(900 / 2100, abs=0.01)


@pytest.mark.parametrize(
    ("plinth", "ratio", "site"),
    [(2400, 1.0, SITE), (1200, 1.2, SITE), (1200, 1.0, SiteMeasures(distance1=17.5))],
)
def test_else_the_largest_plane_is_the_wall(plinth, ratio, site) -> None:
    xyz, pixels = plinth_and_wall(plinth, 900, offset=0.113)
    plane, _ = choose_wall(xyz, pixels, CAMERAS, interiors(ratio), site)
    assert plane[0] == pytest.approx(0.113, abs=0.003)


def test_the_spot_named_in_the_warning_chooses_the_other_plane() -> None:
    xyz, pixels = plinth_and_wall(1200, 900, offset=0.113)
    _, found = choose_wall(xyz, pixels, CAMERAS, interiors(), SITE)
    text = rivals_in_words(found, SITE)
    assert "only 43 % of the details" in text
    col, row = found[1].pixel
    assert f"+113 mm, 57 % (--wall {col:.0f},{row:.0f})" in text
    named = SiteMeasures(distance1=17.5, distance2=9.5, parallel=True, wall=found[1].pixel)
    plane, found = choose_wall(xyz, pixels, CAMERAS, interiors(), named)
    assert plane[0] == pytest.approx(0.113, abs=0.002)
    assert found[0].offset == pytest.approx(0.0, abs=0.002)
    assert rivals_in_words(found, named) == ""


def test_a_spot_without_details_is_refused() -> None:
    xyz, pixels = plinth_and_wall(300, 900, offset=0.113)
    site = SiteMeasures(distance1=17.5, wall=(-900.0, 20.0))
    with pytest.raises(GeometryError, match="hardly any detail is common to both photos there"):
        choose_wall(xyz, pixels, CAMERAS, interiors(), site)


def test_one_rough_wall_is_one_face_and_no_warning() -> None:
    rng = np.random.default_rng(3)
    found = faces(rng.normal(0, 0.02, 3000), rng.uniform(0, 900, (3000, 2)), band=0.02)
    assert len(found) == 1
    assert rivals_in_words(found, SITE) == ""


def test_the_zero_of_relief_is_stated_no_better_than_the_planes_agree() -> None:
    sure = {"distance1": 0.01, "distance2": 0.01}
    assert not any("zero" in word for word in orientation_in_words(CAMERAS, sure, sigma_px=0.1))
    text = orientation_in_words(CAMERAS, {**sure, "relief_offset": 0.113}, sigma_px=0.1)[-1]
    assert "its zero is certain only to 113 mm" in text


def test_the_zero_of_relief_is_as_sure_as_the_faces_that_compete() -> None:
    here, other = WallFace(0.0, 0.30, (0.0, 0.0)), WallFace(-0.114, 0.23, (9.0, 9.0))
    # One of two such faces is the wall: 114 mm, with a chance of 23 in 53.
    assert zero_sigma([here, other]) == pytest.approx(0.114 * np.sqrt(23 / 53))
    assert zero_sigma([here, replace(other, share=0.1)]) == 0.0
    # Measured distances that contradict the other face settle it, by as much as they do.
    assert zero_sigma([here, replace(other, chance=0.1)]) == pytest.approx(0.031, abs=1e-3)
    assert zero_sigma([here, replace(other, chance=0.001)]) == 0.0


@pytest.mark.parametrize(("sigma", "least", "most"), [(0.02, 0.0, 0.06), (0.5, 0.06, 0.12)])
def test_measured_distances_tell_which_face_is_the_wall(sigma, least, most) -> None:
    xyz, pixels = plinth_and_wall(900, 1200, offset=0.113)
    site = replace(SITE, sigma=sigma)
    found = choose_wall(xyz, pixels, CAMERAS, interiors(), site, sigma_ratio=1e-3)[1]
    assert found[0].chance > 0.8
    assert least <= zero_sigma(found) < most


def test_a_wall_of_many_small_chances_is_a_wall() -> None:
    # A plain façade: 900 points, none more likely of the wall than of shallow relief around it.
    face = NarrowFace(np.zeros(3), 0.01, np.repeat([0.46, 0.4, 0.1], 300))
    assert face.members.tolist() == [True] * 600 + [False] * 300
    assert not NarrowFace(np.zeros(3), 0.0, np.zeros(9)).members.any()
