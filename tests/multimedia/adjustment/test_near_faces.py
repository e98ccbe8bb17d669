"""Points close to the water surface, from cameras that put them above it at first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimedia import (
    FlatInterface,
    GeometryError,
    ImagePoints,
    ObjectPoints,
    Project,
    Unknowns,
    bundle_adjust,
    project,
)
from multimedia.media.projection import project_with_jacobian
from multimedia.orientation.object_rays import image_rays
from tests.multimedia.adjustment.test_wand import WALL, WAND, apart, waved
from tests.multimedia.tank import LAYERS

FREE = Unknowns(control="free", scale_bars=(WAND,))
HIGH = np.array([(10.0, -20.0, 4.0), (-30.0, 12.0, 25.0), (0.0, 0.0, 0.01)])


def of_two(start: Project) -> Project:
    """Return a project of its first two cameras."""
    images, views = start.image_points, start.cameras[:2]
    rows = [k for k, name in enumerate(images.cameras) if name in {c.name for c in views}]
    few = ImagePoints(cameras=tuple(images.cameras[k] for k in rows),
                      ids=tuple(images.ids[k] for k in rows), image=images.image[rows])  # fmt: skip
    return replace(start, cameras=views, media_of=("wall",) * 2, image_points=few)


@pytest.mark.parametrize("wall", [
    WALL, FlatInterface(layers=LAYERS, point=(0, 0, -480.0), moves_with_camera=True),
])  # fmt: skip
def test_on_the_way_rays_go_back_from_the_face_in_the_objects_medium(wall: FlatInterface):
    camera = waved(1, 1)[0][0]
    step = 1e-4 * np.concatenate([np.eye(3), -np.eye(3)])
    places = HIGH if wall is WALL else camera.centre + (HIGH - [0, 0, 480.0]) @ camera.rotation.T
    view = project_with_jacobian(camera, places, wall, before=0.2)
    origins, along = image_rays(camera, view.image, wall)
    way = places - origins
    depth = (way * along).sum(axis=1)
    assert (depth < 0).all()
    assert np.abs(way - depth[:, None] * along).max() < 1e-10
    moved = [project_with_jacobian(camera, places + s, wall, before=0.2).image for s in step]
    slopes = np.stack([(moved[k] - moved[k + 3]) / 2e-4 for k in range(3)], axis=2)
    assert np.abs(view.by_point - slopes).max() < 1e-7
    assert np.isnan(project_with_jacobian(camera, places, wall).image).all()
    assert np.isnan(project(camera, places, wall)).all()


def test_two_cameras_that_put_shallow_points_above_the_surface_are_adjusted():
    truth, start = waved(30, 60, highest=-1.0)
    rng = np.random.default_rng(5)
    flat = rng.uniform((-60, -50, -4.0), (60, 50, -1.0), (30, 3))
    pair = of_two(start)
    images, names = pair.image_points, tuple(f"top{k}" for k in range(30))
    pixels = np.concatenate([project(camera, flat, WALL) for camera in truth[:2]])
    pixels += 0.001 * rng.standard_normal(pixels.shape)
    off = np.array([0.0, 0.0, 4.0, 0.01, 0.0, 0.0])
    views = tuple(
        camera.stepped(("X0", "Y0", "Z0", "omega", "phi", "kappa"), sign * off)
        for sign, camera in zip((1.0, -1.0), truth, strict=False)
    )
    shallow = replace(pair, cameras=views, image_points=ImagePoints(
        cameras=images.cameras + tuple(c.name for c in truth[:2] for _ in names),
        ids=images.ids + names * 2, image=np.concatenate([images.image, pixels]),
    ))  # fmt: skip
    result = bundle_adjust(shallow, FREE)
    assert result.sigma0 == pytest.approx(0.001, rel=0.2)
    points = result.project.object_points
    rows = [points.ids.index(name) for name in names]
    assert (np.abs(points.xyz[rows, 2] - flat[:, 2]) < 4.0 * points.sigma[rows, 2]).all()


def with_high_point(height: float, start: Project, truth) -> Project:
    """Return a project with a point so far above the surface, as if its rays went back to it."""
    images, place = start.image_points, np.array([[5.0, 5.0, height]])
    pixels = [project_with_jacobian(c, place, WALL, before=0.2).image for c in truth]
    return replace(start, image_points=ImagePoints(
        cameras=images.cameras + tuple(c.name for c in truth), ids=images.ids + ("high",) * 4,
        image=np.concatenate([images.image, *pixels]),
    ))  # fmt: skip


def test_points_that_come_out_before_the_surface_are_told_or_left_out():
    truth, start = waved(8, 8)
    clean = bundle_adjust(start, FREE)
    result = bundle_adjust(with_high_point(15.0, start, truth), FREE)
    assert "4 image points left out" in result.remarks[0]
    assert "high in cam1" in result.remarks[0]
    assert (result.weights[-4:] == 0).all()
    assert result.sigma0 == pytest.approx(clean.sigma0, rel=1e-6)
    few = tuple(result.project.cameras)
    assert np.abs(apart(few) - apart(clean.project.cameras)).max() < 1e-6
    within = bundle_adjust(with_high_point(2.0, start, truth), FREE)
    assert any("1 points came out before the last face" in text for text in within.remarks)


def test_control_that_would_lie_before_the_surface_is_refused():
    truth, start = waved(8, 8)
    high = with_high_point(15.0, replace(start, cameras=tuple(truth)), truth)
    control = ObjectPoints(ids=("high",), xyz=np.array([[5.0, 5.0, 15.0]]),
                           sigma=np.zeros((1, 3)))  # fmt: skip
    with pytest.raises(GeometryError, match=r"high in cam1|high would lie before"):
        bundle_adjust(replace(high, object_points=control), Unknowns(scale_bars=(WAND,)))
