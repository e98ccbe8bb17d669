"""`bifocal.align` and `bifocal.match` on arrays, against the cameras that took them."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest

import bifocal
from bifocal import GeometryError, InputError
from bifocal.orientation.align_workflow import basis

SIZE = (401, 301)
SCALE = [[0.01, 0, -2.0], [0, -0.01, 1.5], [0, 0, 1]]
PAIR = bifocal.Pair(
    image1=bifocal.Photo(plane_from_pixel=SCALE, nadir=(0, 0), distance=17.5),
    image2=bifocal.Photo(plane_from_pixel=SCALE, nadir=(0, 0), distance=9.5),
)
WALL = np.array(
    [
        [-1.5, -1, 0], [1.5, -1, 0.2], [1.4, 1.1, 0], [-1.5, 1, 0.1], [0.3, 0.2, -0.3],
        [-0.4, 0.5, 0.35], [0.9, -0.4, 0.0], [-0.8, -0.3, 0.15], [0.1, 1.2, 0.0],
    ]
)  # fmt: skip


def control(*, exchanged: bool = False) -> bifocal.Control:
    pixels1, pixels2 = PAIR.project(WALL)
    if exchanged:
        pixels1, pixels2 = pixels2, pixels1
    return bifocal.Control(
        ids=tuple("ABCDEFGHI"),
        xyz=WALL,
        sigma=np.full(WALL.shape, 0.001),
        pixels1=pixels1,
        pixels2=pixels2,
    )


def lens(distance: float) -> bifocal.Interior:
    return bifocal.Interior.from_focal(distance / 0.01, image_size=SIZE, sigma=5e-4, source="board")


def noise() -> np.ndarray:
    coarse = np.random.default_rng(3).integers(0, 255, (76, 101), np.uint8)
    return cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC)


@pytest.mark.parametrize("exchanged", [False, True])
def test_control_points_alone_give_both_cameras_in_either_order(exchanged: bool) -> None:
    lenses = (lens(9.5), lens(17.5)) if exchanged else (lens(17.5), lens(9.5))
    alignment = bifocal.align(None, None, interiors=lenses, control=control(exchanged=exchanged))
    pair = alignment.pair
    assert alignment.way == "control"
    assert [pair.image1.distance, pair.image2.distance] == pytest.approx([17.5, 9.5], abs=1e-4)
    np.testing.assert_allclose(pair.image1.nadir, [0, 0], atol=1e-3)
    np.testing.assert_allclose(
        np.concatenate(pair.project(WALL)), np.concatenate(PAIR.project(WALL)), atol=1e-3
    )
    assert any("exchanged" in text for text in alignment.remarks) == exchanged


def test_a_set_up_is_taken_as_it_is() -> None:
    site = bifocal.SiteMeasures(distance1=17.5, distance2=9.5, sigma=0.01)
    alignment = bifocal.align(
        noise(), None, interiors=(lens(17.5), lens(9.5)), site=site, as_set_up=True
    )
    pair = alignment.pair
    assert alignment.way == "as set up"
    np.testing.assert_allclose(
        np.concatenate(pair.project(WALL)), np.concatenate(PAIR.project(WALL)), atol=1e-9
    )
    assert alignment.deviations["distance1"] == pytest.approx(0.01)
    assert any("exactly as typed" in text for text in alignment.setup["assumed"])
    with pytest.raises(InputError, match="leave out control"):
        bifocal.align(
            None, None, interiors=(lens(17.5), lens(9.5)), site=site, control=control(),
            as_set_up=True,
        )  # fmt: skip
    with pytest.raises(InputError, match="focal length of image2"):
        bifocal.align(noise(), noise(), interiors=(lens(17.5), None), site=site, as_set_up=True)


@pytest.mark.acceptance
def test_photos_square_to_a_wall_at_known_distances() -> None:
    far = noise()
    # The near lens is 1.1 times as long as equal scale would ask for.
    zoom = np.array([[1.1, 0, -20], [0, 1.1, -15]])
    near = cv2.warpAffine(far, zoom, SIZE, flags=cv2.INTER_CUBIC)
    site = bifocal.SiteMeasures(distance1=17.5, distance2=9.5, parallel=True)
    alignment = bifocal.align(
        np.stack([far] * 3, axis=-1),
        near,
        interiors=(lens(17.5), lens(1.1 * 9.5)),
        site=site,
        line=("level", [[10, 150], [390, 150]]),
    )
    assert alignment.way == "site"
    assert alignment.pair.image1.distance == pytest.approx(17.5, abs=0.02)
    assert len(alignment.tie1) > 50


@pytest.mark.parametrize(
    ("site", "asked"),
    [(None, True), (bifocal.SiteMeasures(distance1=17.5, distance2=9.5), False)],
)
def test_without_a_tape_the_size_of_relief_is_said_to_be_weak(site, asked) -> None:
    points = dataclasses.replace(control(), sigma=np.full(WALL.shape, 0.003))
    lenses = [
        bifocal.Interior.from_focal(f, image_size=SIZE, sigma=0.04, source="EXIF")
        for f in (1750, 950)
    ]
    found = bifocal.align(None, None, interiors=tuple(lenses), control=points, site=site)
    said = [text for text in found.remarks if "tape one distance" in text]
    assert bool(said) == asked
    assert asked == (found.deviations["relief_scale"] > 0.01)
    if asked:
        share = 100 * found.deviations["relief_scale"]
        assert f"the size of relief is known only to {share:.1f} %" in said[0]


def test_an_alignment_says_in_one_line_what_its_sigmas_rest_on() -> None:
    lenses = lens(17.5), lens(9.5)
    found = bifocal.align(None, None, interiors=lenses, control=control())
    line = basis(found)
    assert line.startswith("Sigmas rest on: no common points; control points and tapes as precise")
    assert "with the covariance of its orientation; assumed: principal point of photo 1" in line
    assert "\n" not in line
    typed = bifocal.align(
        None, None, interiors=lenses, as_set_up=True,
        site=bifocal.SiteMeasures(distance1=17.5, distance2=9.5),
    )  # fmt: skip
    assert "distances, focal lengths and nadir points as typed" in basis(typed)


def test_what_cannot_be_meant_is_refused() -> None:
    with pytest.raises(InputError, match="image1: give the photo"):
        bifocal.align(None, None, control=control())
    small, line = bifocal.Interior.unknown((400, 300)), [[0, 0], [9, 9]]
    with pytest.raises(InputError, match="image2: is 401 x 301 px"):
        bifocal.align(noise(), noise(), interiors=(None, small))
    with pytest.raises(InputError, match="level or upright"):
        bifocal.align(noise(), noise(), line=("along", line))
    with pytest.raises(InputError, match=r"image1: expected shape \(h, w"):
        bifocal.match(PAIR, np.zeros(7, np.uint8), noise())
    for sigma in (0.0, -1e-4, 2.3, float("nan")):
        with pytest.raises(InputError, match="sigma_focal: must be a share"):
            dataclasses.replace(small, sigma_focal=sigma)
    with pytest.raises(InputError, match="focal: must be above zero"):
        dataclasses.replace(small, focal=0.0)


def test_points_matched_on_colour_photos_give_the_relief_of_the_wall() -> None:
    # A flat wall 0.5 m before the reference plane: photo 2 is photo 1 zoomed about the nadir.
    k = (9.5 / 9.0) / (17.5 / 17.0)
    nadir = np.array([200.0, 150.0])
    zoom = np.column_stack([k * np.eye(2), (1 - k) * nadir])
    image1 = noise()
    image2 = cv2.warpAffine(image1, zoom, SIZE, flags=cv2.INTER_CUBIC)
    colour = [np.stack([image] * 3, axis=-1) for image in (image1, image2)]
    for reliefs in ((9.6, 12.0), (0.3, 0.2)):
        with pytest.raises(GeometryError, match=r"below 9\.5 m only"):
            bifocal.match(PAIR, *colour, settings=bifocal.MatchSettings(relief_range=reliefs))
    points = bifocal.match(PAIR, *colour, settings=bifocal.MatchSettings(count=200, targets=False))
    table = PAIR.intersect(points.pixels1, points.pixels2, sigma_px=0.1)
    radius = np.linalg.norm(points.pixels1 - nadir, axis=1)
    assert len(points.ids) > 50
    np.testing.assert_allclose(table.xyz[radius > 120, 2], 0.5, atol=0.1)
    assert np.median(table.xyz[radius > 60, 2]) == pytest.approx(0.5, abs=0.01)
