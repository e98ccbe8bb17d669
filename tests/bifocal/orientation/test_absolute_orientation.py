"""Pairs set up from photos of a wall of boards whose relief and cameras are known."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from bifocal import Control, GeometryError, Interior, SiteMeasures
from photocore.camera.pinhole import triangulate
from tests.bifocal.orientation.layered_wall import BOARDS, SIZE, camera, photograph, relief_at, take
from tests.builders.orientation import PhotoInput, orient_pair
from tests.builders.pinholes import project

FAR = camera(16.0, turn_deg=(0.3, -0.2, 0.15), shift=(5.0, -4.0))
NEAR = camera(9.0, offset=(0.05, -0.04), turn_deg=(-0.2, 0.25, -0.2), shift=(-4.0, 3.0))


@pytest.fixture(scope="module")
def views():
    return take(FAR, NEAR)


def inputs(views, *, sigma: float = 0.005) -> tuple[PhotoInput, PhotoInput]:
    made = [
        PhotoInput(
            grey=image,
            interior=Interior.from_focal(
                cam.matrix[0, 0] * 1.002, image_size=SIZE, sigma=sigma, source="test"
            ),
            name=name,
        )
        for image, cam, name in zip(
            (views.far, views.near), views.cameras, ("far.jpg", "near.jpg"), strict=True
        )
    ]
    return made[0], made[1]


def relief_error(made) -> np.ndarray:
    """Return the relief of the truth's own pixels by the cameras found, minus the truth. [m]"""
    rng = np.random.default_rng(0)
    xyz = np.column_stack([rng.uniform(-5, 5, (400, 2)) * [1, 0.7], np.zeros(400)])
    xyz[:, 2] = relief_at(xyz)
    found = triangulate(*made.adjusted.cameras, project(FAR, xyz), project(NEAR, xyz))
    return found[:, 2] - xyz[:, 2]


@pytest.mark.acceptance
def test_the_photos_alone_with_one_distance_give_the_relief(views) -> None:
    made = orient_pair(inputs(views), control=Control(), site=SiteMeasures(distance1=16.0))
    error = relief_error(made)
    # 0.5 % of the focal ratio is 2 % of relief; boards stand out by 0.3 m.
    assert np.median(np.abs(error)) < 0.008
    assert made.adjusted.cameras[1].centre[2] == pytest.approx(9.0, rel=0.01)


@pytest.mark.acceptance
@pytest.mark.long
def test_both_distances_square_to_the_wall_give_the_relief(views) -> None:
    site = SiteMeasures(distance1=16.0, distance2=9.0, parallel=True)
    made = orient_pair(inputs(views, sigma=0.02), control=Control(), site=site)
    assert np.median(np.abs(relief_error(made))) < 0.003
    assert any("parallel" in text for text in made.assumed)


@pytest.mark.acceptance
def test_four_wall_points_and_one_relief_point_repair_the_set_up(views) -> None:
    xyz = np.array(
        [[-4.5, 2.9, 0], [4.6, 3.0, 0], [-0.9, -3.5, 0], [1.2, 2.8, 0], [-4.6, -1, 0.35]]
    )
    rng = np.random.default_rng(1)
    points = Control(
        ids=tuple("abcde"),
        xyz=xyz,
        sigma=np.full((5, 3), 0.001),
        pixels1=project(FAR, xyz) + rng.normal(0, 0.1, (5, 2)),
        pixels2=project(NEAR, xyz) + rng.normal(0, 0.1, (5, 2)),
    )
    made = orient_pair(inputs(views, sigma=0.02), control=points, site=SiteMeasures(sigma_pick=0.1))
    error = relief_error(made)
    assert np.median(np.abs(error)) < 0.004
    for found, true in zip(made.adjusted.cameras, (FAR, NEAR), strict=True):
        assert found.centre[2] == pytest.approx(true.centre[2], rel=0.02)


@pytest.mark.acceptance
@pytest.mark.long
def test_a_dark_photo_is_matched_all_the_same(views) -> None:
    dark = (views.near * 0.2 + 5).astype(np.uint8)
    first, second = inputs(views)
    second = PhotoInput(grey=dark, interior=second.interior, name="near.jpg")
    made = orient_pair((first, second), control=Control(), site=SiteMeasures(distance1=16.0))
    assert np.median(np.abs(relief_error(made))) < 0.012


@pytest.mark.acceptance
def test_exchanged_photos_are_noticed_when_the_lens_stayed_the_same() -> None:
    # With one lens the near photo simply shows everything larger.
    far, near = camera(16.0, focal=1400.0), camera(10.0, focal=1400.0, offset=(0.3, 0.0))
    shot = take(far, near, seed=3)
    first, second = inputs(shot)
    made = orient_pair((second, first), control=Control(), site=SiteMeasures(distance1=16.0))
    assert made.exchanged
    assert "was" not in made.remarks[0] or made.remarks[0]
    assert made.adjusted.cameras[0].centre[2] == pytest.approx(16.0, abs=0.05)


def test_one_photo_twice_is_refused(views) -> None:
    first, second = inputs(views)
    twin = PhotoInput(grey=first.grey, interior=second.interior, name="near.jpg")
    with pytest.raises(GeometryError, match="are the same photo"):
        orient_pair((first, twin), control=Control(), site=SiteMeasures(distance1=16.0))


@pytest.mark.acceptance
def test_two_shots_from_one_place_are_refused(views) -> None:
    again = photograph(FAR, noise=3.0)
    first, second = inputs(views)
    twin = PhotoInput(grey=again[:, :-40][:, 40:], interior=second.interior, name="again.jpg")
    with pytest.raises(GeometryError, match=r"same|no parallax|one place"):
        orient_pair((first, twin), control=Control(), site=SiteMeasures(distance1=16.0))


@pytest.mark.acceptance
def test_zoom_without_walking_is_called_the_classic_mistake(views) -> None:
    zoomed = camera(16.0, focal=FAR.matrix[0, 0] * 0.6, turn_deg=(0.5, 0.3, 0.0))
    first, second = inputs(views)
    second = PhotoInput(
        grey=photograph(zoomed),
        interior=Interior.from_focal(
            zoomed.matrix[0, 0], image_size=SIZE, sigma=0.02, source="test"
        ),
        name="zoom.jpg",
    )
    with pytest.raises(GeometryError, match="classic mistake"):
        orient_pair((first, second), control=Control(), site=SiteMeasures(distance1=16.0))


@pytest.mark.acceptance
def test_a_wall_without_relief_is_refused_by_auto_and_taken_with_both_distances() -> None:
    flat = take(FAR, NEAR, seed=5, boards=())
    with pytest.raises(GeometryError, match="no parallax: nothing in the photos stands out"):
        orient_pair(inputs(flat), control=Control(), site=SiteMeasures(distance1=16.0))
    site = SiteMeasures(distance1=16.0, distance2=9.0, parallel=True)
    made = orient_pair(inputs(flat), control=Control(), site=site)
    assert made.adjusted.cameras[1].centre[2] == pytest.approx(9.0, abs=0.02)


@pytest.mark.acceptance
def test_two_different_walls_are_refused(views) -> None:
    first, second = inputs(views)
    other = PhotoInput(
        grey=photograph(NEAR, seed=9), interior=second.interior, name="elsewhere.jpg"
    )
    with pytest.raises(GeometryError, match="too little in common"):
        orient_pair((first, other), control=Control(), site=SiteMeasures(distance1=16.0))


def test_a_blurred_photo_is_named(views) -> None:
    first, second = inputs(views)
    soft = cv2.GaussianBlur(views.near, (0, 0), 5.0)
    blurred = PhotoInput(grey=soft, interior=second.interior, name="near.jpg")
    with pytest.raises(GeometryError, match=r"near\.jpg: the photo is blurred"):
        orient_pair((first, blurred), control=Control(), site=SiteMeasures(distance1=16.0))


@pytest.mark.acceptance
def test_without_any_distance_there_is_no_scale(views) -> None:
    with pytest.raises(GeometryError, match="nothing gives the scale"):
        orient_pair(inputs(views), control=Control(), site=SiteMeasures())


@pytest.mark.acceptance
@pytest.mark.long
def test_a_length_on_the_wall_gives_the_scale(views) -> None:
    ends = np.array([[-4.5, 2.9, 0.0], [4.6, 3.0, 0.0]])
    unknown = np.array([[np.nan, np.nan, 0.0]] * 2)
    points = Control(
        ids=("a", "b"),
        xyz=unknown,
        sigma=np.full((2, 3), 0.002),
        pixels1=project(FAR, ends),
        pixels2=np.full((2, 2), np.nan),
        lengths=((0, 1, float(np.linalg.norm(ends[0] - ends[1]))),),
    )
    made = orient_pair(inputs(views), control=points, site=SiteMeasures())
    assert made.adjusted.cameras[0].centre[2] == pytest.approx(16.0, rel=0.01)


@pytest.mark.acceptance
@pytest.mark.long
def test_equal_distances_are_refused(views) -> None:
    beside = camera(15.9, offset=(4.0, 0.0), turn_deg=(0.0, 14.0, 0.0))
    first, second = inputs(views)
    second = PhotoInput(
        grey=photograph(beside),
        interior=Interior.from_focal(
            beside.matrix[0, 0], image_size=SIZE, sigma=0.001, source="test"
        ),
        name="beside.jpg",
    )
    with pytest.raises(GeometryError, match="hardly any change of distance"):
        orient_pair((first, second), control=Control(), site=SiteMeasures(distance1=16.0))


def test_boards_do_not_overlap() -> None:
    centres = np.array([[x + w / 2, y + h / 2, r] for x, y, w, h, r in BOARDS])
    np.testing.assert_array_equal(relief_at(centres), centres[:, 2])


@pytest.mark.acceptance
def test_photos_of_different_walls_are_refused_where_control_contradicts_itself(views) -> None:
    """Of a wall and another one only picks that were guessed agree with nothing."""
    rng = np.random.default_rng(3)
    xyz = np.column_stack([rng.uniform(-4, 4, 9), rng.uniform(-2.5, 2.5, 9), rng.uniform(0, 1, 9)])
    pixels = [project(camera, xyz) for camera in (FAR, NEAR)]
    pixels[1][:3] += [[300, -200], [-250, 150], [200, 280]]
    control = Control(
        ids=tuple("abcdefghi"), xyz=xyz, sigma=np.full((9, 3), 0.003),
        pixels1=pixels[0], pixels2=pixels[1],
    )  # fmt: skip
    first, second = inputs(views)
    other = replace(second, grey=photograph(NEAR, seed=11), name="other.jpg")
    with pytest.raises(GeometryError, match=r"other\.jpg show different walls.*3 of these"):
        orient_pair((first, other), control=control, site=SiteMeasures())
