"""Photographs as cameras deliver them, against what can be told of each fault by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import RICH, Exposure, Material, Scene, bifocal_cameras, render
from tests.scenes.shapes import boss, box
from tests.scenes.tracing import Tracer
from tests.scenes.truth import look_square_on
from tests.scenes.unseen import KEPT, TAKINGS, TUNED

SIZE, PIXEL = (96, 64), 0.05
CAMERAS = bifocal_cameras(size=SIZE, pixel=PIXEL)
QUIET = (Exposure(noise=0.0), Exposure(noise=0.0))


def taken(scene: Scene, cameras=CAMERAS, exposures=QUIET, **options):
    return render(scene, cameras, rng=np.random.default_rng(1), exposures=exposures, **options)


def test_a_lens_residual_moves_pixels_by_its_rms_and_not_the_pair_file():
    far = replace(CAMERAS.far, residual=0.3)
    pixels = np.stack(np.meshgrid(np.arange(96.0), np.arange(64.0)), axis=-1).reshape(-1, 2)
    bent, straight = (
        origin + ray * (origin[:, 2:] / -ray[:, 2:])
        for origin, ray in (camera.emitted(pixels) for camera in (far, CAMERAS.far))
    )
    moved = np.hypot(*(bent - straight)[:, :2].T) / PIXEL
    assert np.sqrt(np.mean(moved**2)) == pytest.approx(0.3, rel=0.25)
    np.testing.assert_array_equal(
        far.photo().plane_from_pixel, CAMERAS.far.photo().plane_from_pixel
    )


def test_jpeg_loses_little_and_the_more_the_lower_its_quality():
    scene = Scene(wall=RICH.stone, texel=PIXEL)
    best = taken(scene).image1.astype(int)
    lost = [
        np.abs(taken(scene, exposures=(replace(QUIET[0], jpeg=q), QUIET[1])).image1 - best).mean()
        for q in (95, 75)
    ]
    assert 0 < lost[0] < lost[1] < 8


def test_who_walks_on_is_in_each_photo_elsewhere_and_not_in_the_truth():
    scene = Scene(wall=RICH.wall, texel=PIXEL)
    cloth = Material(colour=(0.05, 0.05, 0.05), contrast=0.0)
    passing = tuple([boss((x, 0.0, 0.5), (0.3, 0.6, 0.2), cloth)] for x in (-1.0, 1.0))
    shot = taken(scene, passing=passing)
    np.testing.assert_array_equal(shot.truth.r, 0.0)
    middles = [np.nonzero(image.sum(-1) < 90)[1].mean() for image in (shot.image1, shot.image2)]
    assert middles[0] < 0.4 * SIZE[0] < 0.6 * SIZE[0] < middles[1]
    hidden = [np.nonzero(~seen)[1].mean() for seen in (shot.visible1, shot.visible2)]
    assert hidden[0] < 0.4 * SIZE[0] < 0.6 * SIZE[0] < hidden[1]


def test_what_glass_mirrors_stands_elsewhere_in_both_photos():
    """A mirror on the wall shows the other side of the street, with a parallax of its own."""
    glass = Material(colour=(0.1, 0.1, 0.1), contrast=0.0, mirror=0.8)
    scene = Scene(wall=glass, texel=PIXEL)
    shot = taken(scene)
    grey = [image.mean(-1) for image in (shot.image1, shot.image2)]
    plain = taken(Scene(wall=replace(glass, mirror=0.0), texel=PIXEL))
    assert grey[0].std() > 5 > plain.image1.std()
    assert np.abs(grey[0] - grey[1]).mean() > 0.3 * grey[0].std()


@pytest.mark.parametrize("name", sorted(TAKINGS))
def test_every_scene_stands_within_reach_of_the_wall_and_varies_with_its_seed(name):
    taking = TAKINGS[name]
    places = np.stack(np.meshgrid(np.linspace(-5, 5, 60), np.linspace(-3, 3, 40)), -1)
    relief = [
        look_square_on(
            Tracer(taking.layout(seed=seed, palette=taking.palette)), places.reshape(-1, 2)
        )[0]
        for seed in (TUNED[0], KEPT[0])
    ]
    assert -2.5 < np.min(relief) <= 0 < np.max(relief) < 1.5
    assert not np.array_equal(*relief)


def test_a_box_that_mirrors_still_hides_what_is_behind_it():
    glass = Material(colour=(0.1, 0.1, 0.1), mirror=0.5)
    scene = Scene(wall=RICH.wall, texel=PIXEL)
    scene.add(box((-0.5, 0.5), (-0.5, 0.5), (-0.1, 0.3), glass))
    assert taken(scene).truth.r.max() == pytest.approx(0.3)
