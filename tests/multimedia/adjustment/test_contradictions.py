"""Gross errors of image points beside poses that are stated: left out and named, or refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimedia import (
    FlatInterface,
    GeometryError,
    ImagePoints,
    ObjectPoints,
    PhotogrammetryError,
    Project,
    Unknowns,
    bundle_adjust,
)
from multimedia.media.camera import EXTERIOR
from multimedia.orientation.stray_rays import _ends_apart, without_rows
from tests.multimedia import tank
from tests.multimedia.adjustment.test_start_poses import FREE, NOISE, waved

ROBUST = replace(FREE, robust=2.5)


def posed(scene: str) -> Project:
    """Return what cameras see of a wand and particles, from poses 2 mm and 0.2 degrees off."""
    truth, start = waved(scene, places=12, particles=10)
    rng = np.random.default_rng(11)
    off = np.array([2.0, 2.0, 2.0, 0.0035, 0.0035, 0.0035])
    views = tuple(camera.stepped(EXTERIOR, off * rng.standard_normal(6)) for camera in truth)
    return replace(start, cameras=views, without_pose=())


def spoilt(start: Project) -> tuple[Project, list[int]]:
    """Return a project with an error of 80 px and two names exchanged, and those rows."""
    points = start.image_points
    rows = [20, points.ids.index("3a"), points.ids.index("p4")]
    image = points.image.copy()
    image[rows[0]] += [0.6, -0.75]
    image[rows[1:]] = image[rows[:0:-1]]
    return replace(start, image_points=replace(points, image=image)), rows


@pytest.mark.parametrize("scene", ["glass", "two walls", "air"])
def test_gross_errors_are_left_out_and_named_beside_robust_weights(scene):
    project, rows = spoilt(posed(scene))
    points = project.image_points
    result = bundle_adjust(project, ROBUST)
    assert np.flatnonzero(result.weights[:, 0] == 0).tolist() == sorted(rows)
    assert "3 image points left out" in result.remarks[0]
    for row in rows:
        assert f"{points.ids[row]} in {points.cameras[row]}" in result.remarks[0]
        assert any(f"point {points.ids[row]} in" in text for text in result.suspects())
    is_out = np.isin(np.arange(len(points.ids)), rows)
    clean = bundle_adjust(without_rows(project, is_out), FREE)
    assert result.sigma0 == pytest.approx(clean.sigma0, rel=0.05)
    assert result.sigma0 == pytest.approx(NOISE, rel=0.25)


def test_without_robust_weights_they_are_named_with_what_mends_it():
    project, rows = spoilt(posed("glass"))
    with pytest.raises(GeometryError) as error:
        bundle_adjust(project, FREE)
    points = project.image_points
    assert "3 image points contradict the others by far" in str(error.value)
    assert "--robust 2.5" in str(error.value)
    for row in rows:
        assert f"{points.ids[row]} in {points.cameras[row]}" in str(error.value)


def test_of_two_rays_that_contradict_each_other_both_are_named():
    """Nothing says which of them is wrong."""
    project = posed("glass")
    points = project.image_points
    pairs = list(zip(points.cameras, points.ids, strict=True))
    row = pairs.index(("c0", "p4"))
    image = points.image.copy()
    image[row] += [0.7, 0.7]
    project = replace(project, image_points=replace(points, image=image))
    third = np.array([pair == ("c2", "p4") for pair in pairs])
    result = bundle_adjust(without_rows(project, third), ROBUST)
    assert "p4 in c0, p4 in c1" in result.remarks[0]


def test_where_most_does_not_fit_no_image_point_is_blamed():
    project = posed("glass")
    points = project.image_points
    of_camera = np.array([camera == "c1" for camera in points.cameras])
    image = points.image.copy()
    image[of_camera] = np.random.default_rng(1).permutation(image[of_camera])
    project = replace(project, image_points=replace(points, image=image))
    for unknowns in (FREE, ROBUST):
        with pytest.raises(PhotogrammetryError) as error:
            bundle_adjust(project, unknowns)
        assert "image points contradict" not in str(error.value)


def test_they_are_named_beside_a_result_that_has_followed_them():
    """A pick .7 mm off and two names exchanged, where 160 images of control hold four cameras."""
    views, points = tank.cameras(), tank.control(40)
    ids = tuple(f"p{i}" for i in range(40))
    images = tank.images(views, points, NOISE)
    images[1, 7] += [0.5, 0.5]
    images[2, [3, 12]] = images[2, [12, 3]]
    project = Project(
        cameras=tuple(views),
        media={"tank": FlatInterface(layers=tank.LAYERS)},
        media_of=("tank",) * 4,
        object_points=ObjectPoints(ids=ids, xyz=points, sigma=np.zeros_like(points)),
        image_points=ImagePoints(
            cameras=tuple(camera.name for camera in views for _ in ids),
            ids=ids * 4,
            image=images.reshape(-1, 2),
        ),
        sigma_image=NOISE,
        unit="mm",
    )
    words = " ".join(bundle_adjust(project, Unknowns()).remarks)
    for name in ("p7 in cam2", "p3 in cam3", "p12 in cam3"):
        assert name in words


@pytest.mark.parametrize(("off", "apart"), [(10.0, False), (20.0, True)])
def test_ends_are_apart_beyond_what_the_noise_of_rays_explains(off, apart):
    """Two cameras 2 m before points whose distances are exact but one; a ray is good to 1 mm."""
    origins = np.array([[[-0.5, 0.0, 2.0]], [[0.5, 0.0, 2.0]]])
    ends = np.array(
        [[0.0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0.1, 0.4, 0], [0.3, 0.3, 0], [0, 0, 1]]
    )
    along = ends - origins
    way = float(np.median(np.linalg.norm(along, axis=2)))
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    distances = [
        (a, b, float(np.linalg.norm(ends["abcdef".index(a)] - ends["abcdef".index(b)])))
        for a, b in ("ab", "cd", "ef")
    ]
    distances[0] = ("a", "b", 0.3 + off * 0.001)
    strayed = _ends_apart(origins + 0 * along, along, "abcdef", distances, 0.001 / way)
    assert strayed[:, :2].all() == strayed[:, :2].any() == apart
    assert not strayed[:, 2:].any()
