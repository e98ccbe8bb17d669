"""Dense relief and orthophotos of a wall photographed through ports and through a water surface.

The photos are rendered by casting refracted rays (tests/scenes/wet.py); lengths are five times
those of a tank: refraction knows no scale.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from bifocal import InputError, dense_relief, match, orthophoto
from bifocal.model.image import as_grey
from bifocal.rays import plane_position, point_on_ray, straight
from bifocal.relief_maps import evidence
from bifocal.relief_maps.frame import make_frame, offsets
from tests.cases import few_by_default
from tests.scenes import RICH, Rendering, Scene, bifocal_cameras, render
from tests.scenes.shapes import box
from tests.scenes.wet import pair_through_media, under_water

PIXEL = 0.0148
LEVEL = ((0.0, 0.0), (0.0, 0.0))
#: Media, the camera centres' distances to the first interface [m] and by what it leans [deg];
#: None in air.
LEANS = ((6.0, -4.0), (4.0, -5.0))
MEDIA = {
    "air": None,
    "port": ((1.0, 1.49, 1.337), (0.05,), (0.25, 0.25)),
    "leaning port": ((1.0, 1.49, 1.337), (0.05,), (0.25, 0.25), LEANS),
    "surface": ((1.0, 1.337), (), (14.5, 6.5)),
}


@cache
def shot(name):
    """Return rendering, pair and far camera of a wall with slabs and a recess, 360 x 240 px."""
    scene = Scene(wall=RICH.wall, texel=0.01)
    scene.add(box((0.7, 1.9), (0.3, 1.2), (-0.1, 0.3), RICH.trim))
    scene.add(box((-2.0, -1.2), (-1.0, 0.9), (-0.1, 0.5), RICH.trim))
    scene.add(box((-0.5, 0.8), (-1.1, -0.6), (-0.1, 0.15), RICH.trim))
    cameras = bifocal_cameras(size=(360, 240), pixel=PIXEL)
    if MEDIA[name] is None:
        taken = render(scene, cameras, rng=np.random.default_rng(4))
        return taken, taken.pair, cameras.far
    indices, thicknesses, z0, *leans = MEDIA[name]
    wet = under_water(
        cameras, indices=indices, thicknesses=thicknesses, z0=z0, leans=leans[0] if leans else LEVEL
    )
    taken = render(scene, wet, rng=np.random.default_rng(4))
    return taken, pair_through_media(wet), wet.far


@cache
def relief(name):
    taken, pair, _ = shot(name)
    grid = taken.truth.grid
    return dense_relief(pair, taken.image1, taken.image2, gsd=grid.gsd, bounds=grid.bounds)


def errors(taken: Rendering, found) -> np.ndarray:
    error = np.abs(found.r - taken.truth.r)[taken.visible1 & taken.visible2]
    assert np.isfinite(error).mean() > 0.98
    return error[np.isfinite(error)]


@pytest.mark.parametrize(
    "name", few_by_default(["port", "leaning port", "surface"], "leaning port")
)
def test_relief_through_media_is_good_to_hundredths_of_a_pixel(name):
    """2.4 and 3.1 mm of median, 6.1 and 6.4 mm of mean here; 1 px at a metre is 0.3 m of relief.

    In air 1.1 and 3.6 mm: there the far photo's own pixels are matched, here both are resampled.
    """
    found = errors(shot(name)[0], relief(name))
    assert np.median(found) < 0.004
    assert found.mean() < 0.008


def test_photos_are_continued_beyond_their_rim_where_media_bend_it():
    """The rim runs across the grid; matching along an edge to black went wrong there."""
    taken, pair, _ = shot("port")
    grid = taken.truth.grid
    frame = make_frame(pair, as_grey(taken.image1, "1"), as_grey(taken.image2, "2"), grid)
    for image, seen in ((frame.image1, frame.seen1), (frame.image2, frame.seen2)):
        assert not seen.all()
        row = grid.height // 2
        left = int(np.flatnonzero(seen[row])[0])
        assert left > 1
        np.testing.assert_allclose(image[row, :left].astype(float), image[row, left], atol=20)


def test_relief_before_the_water_surface_is_refused_by_its_name():
    taken, pair, _ = shot("surface")
    with pytest.raises(InputError, match="relief_range: the last interface lies 3 m"):
        dense_relief(pair, taken.image1, taken.image2, relief_range=(3.1, 3.5))


@pytest.mark.parametrize("name", few_by_default(["port", "surface"], "surface"))
def test_neglecting_refraction_would_cost_centimetres(name):
    taken, pair, _ = shot(name)
    xyz = np.concatenate([taken.truth.plane_positions(), taken.truth.r[..., None]], axis=-1)
    both = taken.visible1 & taken.visible2
    points = xyz[both][::97].astype(np.float64)
    off = pair.in_air().intersect(*pair.project(points)).xyz - points
    assert np.nanmean(np.abs(off[:, 2])) > 10 * errors(taken, relief(name)).mean()


@pytest.mark.parametrize(
    "name", few_by_default(["port", "leaning port", "surface"], "leaning port", "surface")
)
def test_the_orthophoto_shows_each_place_its_own_pixel(name):
    taken, pair, camera = shot(name)
    places = taken.truth.plane_positions()
    truth = np.concatenate([places, taken.truth.r[..., None]], axis=-1).astype(np.float64)
    measured = np.concatenate([places, relief(name).r[..., None]], axis=-1).astype(np.float64)
    seen = camera.view_of(truth.reshape(-1, 3)).reshape(*places.shape)
    np.testing.assert_allclose(pair.image1.project(truth), seen, atol=1e-6)
    off = np.linalg.norm(pair.image1.project(measured) - seen, axis=-1)
    both = taken.visible1 & taken.visible2 & np.isfinite(off)
    assert (off[both] < 1).mean() > 0.985
    # What the raster itself shows, from the exact relief: the rendered photo at those pixels.
    picture = orthophoto(pair, taken.image1, taken.truth).image.astype(np.float64)
    import cv2

    wanted = cv2.remap(taken.image1, seen.astype(np.float32), None, cv2.INTER_CUBIC)
    shown = taken.visible1 & (picture.sum(axis=-1) > 0)
    assert shown.mean() > (0.7 if name == "leaning port" else 0.8)  # it shows less of the scene
    assert np.abs(picture - wanted)[shown].mean() < 0.5


@pytest.mark.parametrize(
    "name", few_by_default(["air", "port", "leaning port", "surface"], "leaning port")
)
def test_hidden_pixels_are_found_as_in_air(name):
    taken, pair, camera = shot(name)
    found = orthophoto(pair, taken.image1, taken.truth).hidden
    truth = np.concatenate([taken.truth.plane_positions(), taken.truth.r[..., None]], axis=-1)
    seen = camera.view_of(truth.reshape(-1, 3).astype(np.float64)).reshape(*found.shape, 2)
    inside = ((seen >= -0.5) & (seen < [359.5, 239.5])).all(axis=-1)
    hidden = inside & ~taken.visible1
    assert hidden.sum() > 100
    assert (found & hidden).sum() > 0.55 * hidden.sum()
    assert (found & taken.visible1).sum() < 0.005 * found.size


@pytest.mark.parametrize("name", few_by_default(["port", "surface"], "surface"))
def test_homologous_points_are_found_along_bent_lines(name):
    taken, pair, _ = shot(name)
    found = match(pair, taken.image1, taken.image2)
    assert len(found.ids) > 150
    points = pair.intersect(found.pixels1, found.pixels2, sigma_px=0.1)
    true = taken.truth.sample(points.xyz[:, :2])
    off = np.abs(points.xyz[:, 2] - true)
    assert np.nanmedian(off) < 0.015
    assert np.median(np.abs(points.misfit)) < 0.1


@pytest.mark.parametrize("name", ["air", "port", "leaning port", "surface"])
def test_relief_falls_away_by_the_slope_of_the_bent_ray(name):
    """At 2 % more misfit than the limit a ramp is doubted, at 2 % less it is not."""
    taken, pair, _ = shot(name)
    grid = taken.truth.grid
    grey = as_grey(taken.image1, "1"), as_grey(taken.image2, "2")
    frame = make_frame(pair, *grey, grid, (-0.5, 0.0))
    foot = pair.image2.foot
    # Outwards from where the ray square to the plane meets it.
    x, y = offsets(grid.shape, grid.pixel_of(straight(foot).nadir))
    steepness = 0.1  # of relief falling outwards, metres per metre
    relief = (-steepness * np.hypot(x, y) * grid.gsd).astype(np.float32)
    row, column = 40, 60
    place = np.array([grid.columns_x[column], grid.rows_y[row]])
    # Along the ray through that place (X, Y) moves by this much per metre of relief.
    r = float(relief[row, column])
    ray = plane_position(np.append(place, r), foot)
    ends = [point_on_ray(ray, np.array(r + step), foot)[:2] for step in (-0.01, 0.01)]
    slope = np.linalg.norm(ends[1] - ends[0]) / 0.02
    limit = np.sqrt(evidence.most_falling(frame) / (steepness * slope))
    for factor, expected in ((1.02, True), (0.98, False)):
        misfit = np.full(grid.shape, factor * limit, np.float32)
        everywhere = np.ones(grid.shape, bool)
        left = evidence.without_falling(frame, relief, misfit, 0.0, np.False_, everywhere)
        assert left[row, column] != expected
