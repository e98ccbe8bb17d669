"""Cameras calibrated by a wand of known length that is moved about, and by particles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimedia import (
    Brown,
    FlatInterface,
    GeometryError,
    ImagePoints,
    InputError,
    Project,
    ScaleBar,
    Unknowns,
    bundle_adjust,
    project,
)
from multimedia.media.camera import EXTERIOR
from tests.multimedia.tank import LAYERS, cameras

WAND = ScaleBar(first="@a", second="@b", length=80.0, sigma=0.02)
WALL = FlatInterface(layers=LAYERS)


def waved(
    places: int, particles: int, *, highest: float = -30.0, depth: float = 1.0
) -> tuple[list, Project]:
    """Return the true cameras, and a project that knows them badly and no object point. [mm]"""
    rng = np.random.default_rng(2)
    truth = [replace(c, distortion=Brown()) for c in cameras()]
    middle = rng.uniform((-35, -30, -130), (35, 30, -60), (places, 3))
    way = rng.standard_normal((places, 3))
    way *= 40.0 / np.linalg.norm(way, axis=1)[:, None]
    cloud = rng.uniform((-60, -50, -160), (60, 50, highest), (particles, 3))
    xyz = np.concatenate([middle - way, middle + way, cloud])
    if depth < 1.0:  # the wand stays level
        xyz[:, 2] = -80.0 + depth * (xyz[:, 2] + 80.0)
    ids = (*(f"{k}a" for k in range(places)), *(f"{k}b" for k in range(places)),
           *(f"p{k}" for k in range(particles)))  # fmt: skip
    image = np.concatenate([project(camera, xyz, WALL) for camera in truth])
    image += 0.001 * rng.standard_normal(image.shape)
    off = np.array([3.0, 3.0, 3.0, 0.005, 0.005, 0.005])
    start = [camera.stepped(EXTERIOR, off * rng.standard_normal(6)) for camera in truth]
    return truth, Project(
        cameras=tuple(start), media={"wall": WALL}, media_of=("wall",) * 4, unit="mm",
        sigma_image=0.001,
        image_points=ImagePoints(
            cameras=tuple(c.name for c in truth for _ in ids), ids=ids * 4, image=image
        ),
    )  # fmt: skip


PAIRS = [(i, j) for i in range(4) for j in range(i)]


def apart(views) -> np.ndarray:
    """Return the distances between cameras, which no datum changes."""
    return np.array([np.linalg.norm(views[i].centre - views[j].centre) for i, j in PAIRS])


def sigma_apart(result) -> np.ndarray:
    """Return the standard deviations of these distances."""
    views, names, found = result.project.cameras, list(result.names), []
    for i, j in PAIRS:
        way = views[i].centre - views[j].centre
        slope = np.zeros(len(names))
        for axis, part in zip(("X0", "Y0", "Z0"), way / np.linalg.norm(way), strict=True):
            slope[names.index(f"{views[i].name}:{axis}")] = part
            slope[names.index(f"{views[j].name}:{axis}")] = -part
        found.append(np.sqrt(slope @ result.covariance @ slope))
    return np.array(found)


def test_a_wand_and_particles_give_cameras_and_scale():
    truth, given = waved(20, 30)
    result = bundle_adjust(given, Unknowns(control="free", scale_bars=(WAND,)))
    assert result.sigma0 == pytest.approx(0.001, rel=0.15)
    assert np.abs(apart(given.cameras) - apart(truth)).max() > 5.0
    error = apart(result.project.cameras) - apart(truth)
    sigma = sigma_apart(result)
    assert (np.abs(error) < 3.0 * sigma).all()
    assert sigma.max() < 0.4
    points = dict(zip(result.project.object_points.ids, result.project.object_points.xyz,
                      strict=True))  # fmt: skip
    lengths = [np.linalg.norm(points[f"{k}a"] - points[f"{k}b"]) for k in range(20)]
    assert np.abs(np.array(lengths) - 80.0).max() < 0.05


def test_a_wand_that_is_waved_in_one_plane_is_told():
    for depth in (0.03, 0.5):
        _, start = waved(30, 0, depth=depth)
        bar = replace(WAND, length=75.0, sigma=5.0)
        remarks = bundle_adjust(start, Unknowns(control="free", scale_bars=(bar,))).remarks
        assert any("in a plane" in text for text in remarks) == (depth < 0.1), depth


def test_points_right_below_the_surface_start_inside_and_are_adjusted():
    """From cameras 3 mm off their rays meet above it, at first."""
    truth, shallow = waved(20, 30, highest=-1.0)
    rng = np.random.default_rng(4)
    few = rng.uniform((-40, -40, -1.5), (40, 40, -0.5), (5, 3))
    ids = tuple(f"top{k}" for k in range(5))
    image = np.concatenate([project(camera, few, WALL) for camera in truth])
    images = shallow.image_points
    more = replace(
        shallow,
        image_points=ImagePoints(
            cameras=images.cameras + tuple(c.name for c in truth for _ in ids),
            ids=images.ids + ids * 4,
            image=np.concatenate([images.image, image]),
        ),
    )
    result = bundle_adjust(more, Unknowns(control="free", scale_bars=(WAND,)))
    assert np.abs(apart(result.project.cameras) - apart(truth)).max() < 1.5
    assert result.sigma0 < 0.0012
    # Rays that meet nowhere near are refused as before.
    wrong = replace(more.image_points, image=np.roll(more.image_points.image, 60, axis=0))
    with pytest.raises(GeometryError, match="do not meet"):
        bundle_adjust(replace(more, image_points=wrong), Unknowns(control="free"))


def test_a_wand_of_which_no_place_is_measured_is_refused():
    _, given = waved(3, 10)
    for first, second, text in (("@x", "@y", "no two points"), ("@a", "b", "one @ in both")):
        bar = replace(WAND, first=first, second=second)
        with pytest.raises(InputError, match=text):
            bundle_adjust(given, Unknowns(control="free", scale_bars=(bar,)))
