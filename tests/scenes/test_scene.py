"""The scene generator against geometry worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.scenes import (
    RICH,
    Exposure,
    Scene,
    SetupErrors,
    Target,
    bifocal_cameras,
    demo_scene,
    facade,
    render,
)
from tests.scenes.shapes import boss, box, column, prism
from tests.scenes.tracing import Tracer
from tests.scenes.truth import look_square_on, relief_truth, visible_from
from tests.scenes.wet import under_water

PIXEL = 0.02
SIZE = (320, 240)  # 6.4 x 4.8 m
CAMERAS = bifocal_cameras(size=SIZE, pixel=PIXEL)
BOUNDS = (-3.2, -2.4, 3.2, 2.4)


def looked_at(scene: Scene, *places: tuple[float, float]) -> list[float]:
    return look_square_on(Tracer(scene), np.array(places))[0].tolist()


def test_relief_of_every_kind_of_body_is_what_its_equation_says():
    plain = RICH.wall
    scene = Scene(wall=plain)
    scene.add(box((-1, 0), (-1, 1), (-0.1, 0.4), plain))
    scene.add(prism([(1.5, -0.1), (1.5, 0.5), (2.0, 0.0), (2.0, -0.1)], (-3, 3), plain))
    scene.add(column((1.0, 0.05), 0.3, (-1, 1), plain), boss((2.5, 0, 0), (0.2, 0.2, 0.1), plain))
    outer = scene.sink(box((-3, -2), (-1, 1), (-0.5, 0.0), plain))
    scene.sink(box((-2.8, -2.2), (-0.5, 0.5), (-0.7, -0.5), plain, parent=outer))
    found = looked_at(
        scene, (-0.5, 0), (0.5, 0), (0, 1.6), (1.0, 0), (1.18, 0), (2.6, 0), (-2.1, 0), (-2.5, 0)
    )
    # Column: 0.05 + sqrt(0.3² - 0.18²) = 0.29; boss: 0.1 sqrt(1 - 0.5²).
    wanted = [0.4, 0.0, 0.4, 0.35, 0.29, 0.1 * np.sqrt(0.75), -0.5, -0.7]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_the_strip_hidden_behind_a_step_has_the_width_of_the_rule():
    """A ray over an edge of height h at distance R from the nadir lands R h / (d - h) beyond."""
    scene = Scene(wall=RICH.wall)
    height, edge = 0.5, 2.0
    scene.add(box((1.0, edge), (-9, 9), (-0.1, height), RICH.wall))
    tracer = Tracer(scene)
    truth = relief_truth(tracer, bounds=(1.9, -0.01, 2.3, 0.01), gsd=0.0005)
    for camera, distance in ((CAMERAS.far, 17.5), (CAMERAS.near, 9.5)):
        row = visible_from(tracer, camera, truth)[5]
        hidden = truth.plane_positions(slice(5, 6))[0, ~row, 0]
        assert hidden.min() == pytest.approx(edge, abs=0.0005)
        assert hidden.max() - edge == pytest.approx(edge * height / (distance - height), abs=0.0006)


def test_what_the_far_camera_cannot_see_the_near_one_cannot_either():
    scene = Scene(wall=RICH.wall)
    scene.add(box((1.0, 2.0), (0.5, 1.5), (-0.1, 0.5), RICH.wall))
    scene.sink(box((-2, -1), (-1, 1), (-0.6, 0.0), RICH.wall))
    tracer = Tracer(scene)
    truth = relief_truth(tracer, bounds=BOUNDS, gsd=0.01)
    far, near = (visible_from(tracer, camera, truth) for camera in (CAMERAS.far, CAMERAS.near))
    assert (~far).sum() > 1000
    assert not (near & ~far & (np.abs(truth.plane_positions()) < 2.3).all(-1)).any()


def test_the_centroid_of_a_painted_disc_is_at_its_exact_pixel():
    scene = Scene(wall=RICH.wall.__class__(colour=(0.5, 0.5, 0.5), contrast=0.0), texel=0.005)
    scene.add(box((0.7, 1.7), (0.4, 1.4), (-0.1, 0.3), scene.wall))
    scene.targets.append(Target(name="A", position=(1.23, 0.87), diameter=0.2))
    quiet = (Exposure(noise=0.0), Exposure(noise=0.0))
    result = render(scene, CAMERAS, rng=np.random.default_rng(0), exposures=quiet)
    point = result.targets[0]
    assert point.seen
    assert point.xyz.tolist() == pytest.approx([1.23, 0.87, 0.3])
    # By hand: column = 159.5 + 1.23 * 17.5 / (17.5 - 0.3) / 0.02.
    assert point.pixel1[0] == pytest.approx(159.5 + 1.23 * 17.5 / 17.2 / PIXEL)
    for image, pixel in ((result.image1, point.pixel1), (result.image2, point.pixel2)):
        column, row = np.round(pixel).astype(int)
        patch = image[row - 6 : row + 7, column - 6 : column + 7, 1].astype(float)
        weight = patch.max() - patch  # the white around the disc fills the window
        v, u = np.mgrid[-6:7, -6:7]
        offset = np.array([(u * weight).sum(), (v * weight).sum()]) / weight.sum()
        assert np.array([column, row]) + offset == pytest.approx(pixel, abs=0.02)


def test_the_pair_file_projects_points_to_the_pixels_of_the_cameras():
    cameras = bifocal_cameras(errors=SetupErrors(tilt_deg=2.0), rng=np.random.default_rng(4))
    xyz = np.random.default_rng(5).uniform([-5, -3, -0.7], [5, 3, 1.0], size=(50, 3))
    for camera, pixels in zip((cameras.far, cameras.near), cameras.exact.project(xyz), strict=True):
        np.testing.assert_allclose(camera.view_of(xyz), pixels, atol=1e-8)
    assert cameras.nominal.image1.nadir.tolist() == [0.0, 0.0]


@pytest.mark.acceptance
def test_a_rendering_is_reproducible_and_its_photos_show_the_gain():
    scene = facade(seed=3, texel=0.05)
    cameras = bifocal_cameras(size=(96, 64), pixel=0.118)
    dim = Exposure(gain=0.7, gamma=1.2, vignetting=0.3)
    first, again = (
        render(scene, cameras, rng=np.random.default_rng(1), exposures=(Exposure(), dim))
        for _ in range(2)
    )
    np.testing.assert_array_equal(first.image2, again.image2)
    assert first.image2.mean() < 0.7 * first.image1.mean()
    assert first.truth.r.max() > 0.85
    assert first.truth.r.min() < -0.6


@pytest.mark.acceptance
def test_the_demo_scene_has_targets_that_both_cameras_see():
    cameras = bifocal_cameras(size=(192, 128), pixel=0.059)
    result = render(demo_scene(texel=0.04), cameras, rng=np.random.default_rng(1))
    assert sum(target.seen for target in result.targets) >= 24
    assert any(target.xyz[2] > 0.1 for target in result.targets)


def test_a_long_cornice_seen_through_a_port_is_whole():
    """Its ends, seen far out, bend away from its middle; by its corners alone that was left out."""
    cameras = under_water(CAMERAS, indices=(1.0, 1.49, 1.337), thicknesses=(0.05,), z0=(0.25, 0.25))
    span, y = np.linspace(-9, 9, 37), 1.9
    scene = Scene(wall=RICH.wall)
    scene.add(box((-9.0, 9.0), (y - 0.05, y + 0.05), (-0.1, 0.1), RICH.trim))
    for camera in (cameras.far, cameras.near):
        low, high = np.split(Tracer(scene).bounds(camera)[0], 2)
        seen = camera.view_of(np.column_stack([span, 0 * span + y, 0 * span]))
        assert ((seen >= low) & (seen <= high)).all()
    middle = cameras.near.view_of(np.array([[0.0, y, 0.1]]))[0]
    ends = cameras.near.view_of(np.array([[9.0, y - 0.05, -0.1]]))[0]
    assert middle[1] - ends[1] > 0.1 * SIZE[0]  # so far does it bend
