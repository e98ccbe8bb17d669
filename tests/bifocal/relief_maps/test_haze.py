"""Photos taken through hazy water: which grey values they are matched by."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bifocal import dense_relief
from bifocal.files.images import as_grey
from bifocal.relief_maps import dense_matching
from bifocal.relief_maps.haze import greys_through_water
from tests.scenes import RICH, Scene, bifocal_cameras, render
from tests.scenes.rendering import Haze
from tests.scenes.shapes import box
from tests.scenes.wet import pair_through_media, under_water


def pictured(rng, contrast, shape=(200, 300)):
    """Return a texture and its photo: channels of given contrasts under a veil, with noise."""
    texture = cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), 2.0)
    texture /= texture.std()
    light = texture[..., None] * np.asarray(contrast) + (30.0, 90.0, 110.0)
    noisy = light + 1.5 * rng.standard_normal(light.shape)
    return texture, np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def test_channels_weigh_by_the_texture_they_still_have():
    """Noise 1.5 each: 0.1, 4 and 2 weigh so that noise is hypot of the weights, 0.25 of a sigma."""
    texture, photo = pictured(np.random.default_rng(5), (0.1, 4.0, 2.0))
    found = greys_through_water(photo, photo)[0].astype(float)
    plain = as_grey(photo, "photo").astype(float)
    noise = [np.sqrt(1 / np.corrcoef(g.ravel(), texture.ravel())[0, 1] ** 2 - 1)
             for g in (found, plain)]  # fmt: skip
    best = 1.5 / np.hypot(4.0, 2.0)
    assert noise[0] < 1.1 * best
    assert noise[1] > 1.2 * best  # what the mean of the channels has


def test_contrast_lost_in_the_water_is_restored():
    texture, photo = pictured(np.random.default_rng(6), (1.0, 4.0, 3.0))
    found = greys_through_water(photo, photo)[0]
    assert as_grey(photo, "photo").std() < 4
    assert found.std() > 35
    assert np.isin(found, (0, 255)).mean() < 0.01
    wide = photo.astype(np.uint16) * 257
    np.testing.assert_allclose(greys_through_water(wide, wide)[0].astype(int), found, atol=1)
    grey = greys_through_water(as_grey(photo, "photo"), photo)[0]
    assert np.corrcoef(grey.ravel(), texture.ravel())[0, 1] > 0.9


@pytest.mark.acceptance
def test_relief_in_turbid_water_is_better_for_it(monkeypatch):
    """6 % of the green light arrive: median error 14 mm, 69 by the mean of the channels."""
    haze = Haze(attenuation=(0.3, 0.16, 0.18), backscatter=(0.25, 0.15, 0.16), veil=(0.1, 0.4, 0.3))
    scene = Scene(wall=RICH.wall, texel=0.01)
    scene.add(box((0.7, 1.9), (0.3, 1.2), (-0.1, 0.3), RICH.trim))
    scene.add(box((-2.0, -1.2), (-1.0, 0.9), (-0.1, 0.5), RICH.trim))
    cameras = under_water(
        bifocal_cameras(size=(360, 240), pixel=0.0148), indices=(1.0, 1.49, 1.337),
        thicknesses=(0.05,), z0=(0.25, 0.25),
    )  # fmt: skip
    taken = render(scene, cameras, rng=np.random.default_rng(4), haze=haze)
    pair, grid = pair_through_media(cameras), taken.truth.grid

    def errors():
        found = dense_relief(pair, taken.image1, taken.image2, gsd=grid.gsd, bounds=grid.bounds)
        off = np.abs(found.r - taken.truth.r)[taken.visible1 & taken.visible2]
        assert np.isfinite(off).mean() > 0.98
        return np.nanmedian(off), np.nanmean(off)

    ours = errors()
    monkeypatch.setattr(
        dense_matching, "greys_through_water",
        lambda one, two: (as_grey(one, "image1"), as_grey(two, "image2")),
    )  # fmt: skip
    mean_of_channels = errors()
    assert ours[0] < 0.5 * mean_of_channels[0]
    assert ours[1] < 0.5 * mean_of_channels[1]
