"""The kernel of intersection gives what the rows of numpy give, and leaves to them what fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimedia import (
    Brown,
    Fisheye,
    FlatInterface,
    GeometryError,
    Layers,
    PointStatus,
    intersect,
    project,
)
from multimedia.orientation import intersection
from multimedia.orientation.point_kernel import settled_points, views_of
from photocore.camera.distortion import Convention
from tests.multimedia.tank import LAYERS, cameras, control

WATER = Layers(indices=(1.0, 1.337))
COATED = Layers(indices=(1.0, 1.5, 1.4, 1.337), thicknesses=(8.0, 2.0))
PORT = FlatInterface(layers=LAYERS, point=(0, 0, -60), normal=(0.1, 0, 1), moves_with_camera=True)
LEANING = FlatInterface(layers=LAYERS, point=(5, 3, 2), normal=(0.05, -0.03, 1))
BENT = {"k1": 3e-5, "k2": 1e-8, "p1": 1e-5, "p2": -2e-5, "scale": 1.0005, "shear": 1e-4}


class Road:
    """The kernel in place of the one that waits until it pays, and which points it settles."""

    def __init__(self, run) -> None:
        self.run, self.settled = run, np.zeros(0, dtype=bool)

    def pays(self, _seconds: float) -> bool:
        return self.run is not None

    def __call__(self, *args):
        with np.errstate(all="ignore"):
            self.settled = self.run(*args)
        return self.settled


def tank(seed: int, count: int):
    """Return cameras, media and noisy image points with all that can be wrong with some."""
    rng = np.random.default_rng(seed)
    lenses = [Brown(), *(Brown(**BENT, convention=convention) for convention in Convention)]
    views = [replace(c, distortion=lenses[(seed + k) % 4]) for k, c in enumerate(cameras())]
    views = views[: 3 + seed % 2]
    kinds = [LAYERS, WATER, LEANING, PORT, None]
    media = [kinds[seed % 5]] * len(views) if seed % 3 else [kinds[k] for k in (0, 2, 3, 0)]
    media = media[: len(views)]
    points = control(count, seed)
    image = np.stack([project(c, points, m) for c, m in zip(views, media, strict=True)])
    image += rng.normal(0, 0.003, image.shape)
    sigma = rng.uniform(0.002, 0.005, image.shape)
    image[0, 0] = image[1, 1, 0] = image[:, 2] = image[1:, 3] = np.nan
    image[1, 4] += (0.3, -0.2)
    # A point in air, seen as if in the water; rays that part; rays out of the lens.
    image[:, 5] = np.stack([project(c, (5.0, 3.0, 60.0)) for c in views])
    image[:, 6] = image[::-1, 6] * (-3.0, 3.0)
    image[0, 7] = (1e3, -2e3)
    return views, image, media, sigma


def both(monkeypatch, run, views, image, media, sigma):
    """Return what kernel and rows find, and which points the kernel settled."""
    road = Road(run)
    monkeypatch.setattr(intersection, "settled_points", road)
    monkeypatch.setattr(intersection, "refuse_pixels", lambda *_: None)
    found = intersect(views, image, media, sigma=sigma)
    monkeypatch.setattr(intersection, "settled_points", Road(None))
    return found, intersect(views, image, media, sigma=sigma), road.settled


def equal(found, want, conditioned: float = 1.0) -> None:
    """Hold two results against each other, to rounding times how ill the points are conditioned."""
    for name in ("status", "rays"):
        assert getattr(found, name).tolist() == getattr(want, name).tolist()
    for name, limit in {
        "xyz": 1e-10, "covariance": 1e-12, "residuals": 1e-12, "standardised": 1e-8,
        "sigma0": 1e-9, "angle": 1e-13,
    }.items():  # fmt: skip
        one, other = getattr(found, name), getattr(want, name)
        assert one.shape == other.shape
        assert np.array_equal(np.isnan(one), np.isnan(other)), name
        scale = 1.0 + np.abs(np.nan_to_num(other))
        assert np.nanmax(np.abs(one - other) / scale, initial=0.0) < limit * conditioned, name


@pytest.mark.parametrize("seed", range(5))
def test_the_kernel_s_loops_give_what_the_rows_give(seed, monkeypatch):
    found, want, settled = both(monkeypatch, settled_points.plain, *tank(seed, 60))
    # Points that not all see, a gross error, and all that nothing is wrong with.
    assert settled[[0, 1, 4, *range(8, 60)]].all()
    assert not settled[[2, 3]].any()
    assert PointStatus.OK in want.status
    assert PointStatus.NO_RAY in want.status
    equal(found, want)


def test_nearly_parallel_rays_and_no_points_are_as_by_rows(monkeypatch):
    views = cameras()[:2]
    views[0] = replace(
        views[0], centre=views[1].centre + np.eye(3)[0] * 3, rotation=views[1].rotation
    )
    image = np.stack([project(c, control(3), LAYERS) for c in views])
    found, want, settled = both(monkeypatch, settled_points.plain, views, image, LAYERS, 0.003)
    assert settled.all()
    assert (found.status == PointStatus.WEAK).all()
    equal(found, want, 1e4)
    none, _, _ = both(monkeypatch, settled_points.plain, views, image[:, :0], LAYERS, 0.003)
    assert none.xyz.shape == (0, 3)


def test_what_the_kernel_does_not_know_is_left_to_the_rows():
    views, media = cameras(), intersection.as_media
    assert views_of(views, [media(LAYERS)] * 4) is not None
    assert views_of(views, [media(COATED)] * 4) is None
    assert views_of(views, [media(Layers(indices=(1.33, 1.0)))] * 4) is None
    assert views_of([replace(views[0], distortion=Fisheye())], [media(LAYERS)]) is None


def test_a_camera_below_the_water_is_refused_in_the_same_words(monkeypatch):
    views = cameras()
    views[2] = replace(views[2], centre=np.array([0.0, 0.0, -5.0]))
    said = []
    for run in (settled_points.plain, None):
        monkeypatch.setattr(intersection, "settled_points", Road(run))
        with pytest.raises(GeometryError) as refused:
            intersect(views, np.zeros((4, 1, 2)), LAYERS)
        said.append(str(refused.value))
    assert said[0] == said[1]


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(15))
def test_machine_code_gives_what_the_rows_give(seed, monkeypatch):
    pytest.importorskip("numba")
    views, image, media, sigma = tank(seed, 2500)
    found, want, settled = both(monkeypatch, settled_points, views, image, media, sigma)
    assert settled[8:].all()
    equal(found, want)
