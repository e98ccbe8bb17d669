"""Dense relief of three photos: far, near, and one a step aside."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from bifocal import Grid, InputError, Pair, PhotoSet, Quality, ReliefMap, dense_relief
from bifocal.relief_maps import fusion, set_relief
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.fusion import FUSION, PairRelief, fused
from bifocal.relief_maps.photo_evidence import Witness
from bifocal.relief_maps.registration import Registration
from bifocal.relief_maps.turned_plane import TurnedPlane
from tests.scenes import Exposure, bifocal_cameras, facade
from tests.scenes.sets import SetRendering, aside, render_set

DARKER = Exposure(gain=0.75, gamma=1.1)


@cache
def shot(width: int = 384) -> SetRendering:
    """Return the photos of three cameras; the wider ones show more about the same middle."""
    cameras = bifocal_cameras(size=(width, width * 2 // 3), pixel=0.01476)
    three = (cameras.far, cameras.near, aside(cameras.near, 1.5))
    exposures = (Exposure(), Exposure(), DARKER)
    return render_set(
        facade(seed=41, texel=0.01), three, rng=np.random.default_rng(41), exposures=exposures
    )


@cache
def of_three() -> ReliefMap:
    taken = shot(768)
    return dense_relief(taken.photos, *taken.images, gsd=taken.truth.gsd, bounds=taken.truth.bounds)


@cache
def of_two() -> ReliefMap:
    taken = shot(768)
    two = taken.photos.pair(0, 1)
    return dense_relief(two, *taken.images[:2], gsd=taken.truth.gsd, bounds=taken.truth.bounds)


def bands(relief: ReliefMap) -> list[np.ndarray]:
    return [relief.r, relief.sigma, relief.quality]


@pytest.mark.acceptance
def test_a_set_of_two_gives_what_the_pair_gives_in_any_order():
    taken, part = shot(768), {"gsd": shot(768).truth.gsd, "bounds": (-1.5, -1.0, 1.5, 1.0)}
    pair = dense_relief(taken.photos.pair(0, 1), *taken.images[:2], **part)
    for order in ((0, 1), (1, 0)):
        photos = PhotoSet(photos=tuple(taken.photos.photos[number] for number in order))
        found = dense_relief(photos, *(taken.images[number] for number in order), **part)
        assert found.used == ()
        for one, other in zip(bands(found), bands(pair), strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_third_photo_measures_the_nadir():
    taken = shot()
    part = {"gsd": taken.truth.gsd, "bounds": (-1.2, -1.2, 1.2, 1.2)}
    middle = []
    for photos, images in (
        (taken.photos, taken.images), (taken.photos.pair(0, 1), taken.images[:2]),
    ):  # fmt: skip
        found = dense_relief(photos, *images, **part)
        places = found.plane_positions()
        nadir = found.known & (np.hypot(places[..., 0], places[..., 1]) < 1)
        error = np.abs(found.r[nadir] - taken.truth.sample(places[nadir]))
        middle.append(np.nanmedian(error))
    assert middle[0] < 0.4 * middle[1]


@pytest.mark.acceptance
def test_a_third_photo_measures_the_nadir_and_what_the_pair_cannot_see():
    taken, three, two = shot(768), of_three(), of_two()
    assert three.used == (("1", "2"), ("1", "3"), ("2", "3"))
    seen = taken.visible.sum(axis=0) >= 2
    places = taken.truth.plane_positions()
    nadir = seen & (np.hypot(places[..., 0], places[..., 1]) < 1)

    def figures(found: ReliefMap) -> tuple[float, float, float, float]:
        error = np.where(found.known, np.abs(found.r - taken.truth.r), 1.0)
        lost = np.isin(found.quality, (Quality.UNKNOWN, Quality.HIDDEN))
        measured = seen & (found.quality == Quality.MEASURED)
        return (
            float(np.median(error[nadir])), float(lost[seen].mean()),
            float((error[seen] > 0.03).mean()), float((error < 2 * found.sigma)[measured].mean()),
        )  # fmt: skip

    (middle, lost, beyond, held), (middle_of_two, lost_of_two, beyond_of_two, _) = (
        figures(found) for found in (three, two)
    )
    assert middle < 0.4 * middle_of_two
    assert lost < 0.45 * lost_of_two
    assert beyond < 0.85 * beyond_of_two
    assert held > 0.88


@pytest.mark.acceptance
def test_a_photo_of_something_else_is_left_out_and_named():
    taken = shot(768)
    noise = np.random.default_rng(3).integers(0, 255, taken.images[2].shape).astype(np.uint8)
    found = dense_relief(
        taken.photos, *taken.images[:2], noise, gsd=taken.truth.gsd, bounds=taken.truth.bounds
    )
    assert found.used == (("1", "2"),)
    assert [note.split(" are left out")[0] for note in found.notes] == ["1 and 3", "2 and 3"]


def test_every_photo_of_the_set_is_asked_for():
    taken = shot()
    with pytest.raises(InputError, match="3 photos, 2 images were given"):
        dense_relief(taken.photos, *taken.images[:2])


GRID = Grid.from_bounds((-0.5, -0.5, 0.5, 0.5), gsd=0.02)


def witnesses() -> list[Witness]:
    """Return photos of nothing at all, which cannot decide."""
    grey = np.full((256, 384), 90, np.uint8)
    return [Witness.of(photo, grey, 0.02) for photo in shot().photos.photos]


def pair_relief(r: float, sigma: float, *, weight: float = 1.0) -> PairRelief:
    values = np.full(GRID.shape, r, np.float32), np.full(GRID.shape, sigma, np.float32)
    quality = np.full(GRID.shape, Quality.MEASURED, np.uint8)
    return PairRelief(MapBands(*values, quality), np.full(GRID.shape, weight, np.float32))


def test_pairs_that_agree_are_averaged_by_weight_and_promise_no_more_than_either():
    both = fused(
        [pair_relief(0.010, 0.004), pair_relief(0.013, 0.004, weight=2)], witnesses(), GRID
    )
    np.testing.assert_allclose(both.r, 0.012, atol=1e-6)
    assert (both.quality == Quality.MEASURED).all()
    assert (both.sigma >= 0.004).all()


def test_a_set_fits_as_its_worst_pair_and_is_as_sure_of_scale_as_its_best(monkeypatch):
    """Pairs of one map, whose photos misfit by 0.2, 0.5 and 0.1 px; the last has no base."""
    fits = iter([(0.2, 0.02, 1.5), (0.5, 0.03, 1.4), (0.1, 0.01, 0.0)])

    def measured(*_):
        systematic, per_scale, base = next(fits)
        registration = Registration(
            matched=0.9, across_median=0.1, shift=(0.0, 0.0), rotation=0.0, systematic=systematic,
            wall=0.0, false_relief_per_scale=per_scale, base=base,
        )  # fmt: skip
        return SimpleNamespace(registration=registration, working_gsd=0.02), pair_relief(0.0, 0.01)

    monkeypatch.setattr(set_relief, "_measured", measured)
    monkeypatch.setattr(set_relief, "_best_pairs", lambda *_: ((0, 1), (0, 2), (1, 2)))
    taken = shot()
    whole = dense_relief(
        taken.photos, *taken.images, gsd=GRID.gsd, bounds=(-0.5, -0.5, 0.5, 0.5)
    ).registration
    assert (whole.systematic, whole.false_relief_per_scale, whole.base) == (0.5, 0.01, 0.0)


def test_pairs_that_differ_are_unknown_where_photos_cannot_decide():
    apart = fused([pair_relief(0.0, 0.002), pair_relief(0.1, 0.002)], witnesses(), GRID)
    assert np.isnan(apart.r).all()
    assert (apart.quality == Quality.UNKNOWN).all()


def test_a_difference_nobody_sees_goes_into_sigma():
    near = fused([pair_relief(0.0, 0.002), pair_relief(0.02, 0.002)], witnesses(), GRID)
    assert (near.sigma > 0.0199).all()
    assert (near.quality == Quality.MEASURED).all()


def decided(*misfits: float, quality: Quality = Quality.MEASURED) -> MapBands:
    """Return the wall or a rail 1 m before it, of which the second is of some quality."""
    wall, rail = pair_relief(0.0, 0.002), pair_relief(1.0, 0.002)
    rail.bands.quality[:] = quality
    everywhere = np.ones(GRID.shape, bool)
    result = MapBands(*(np.zeros(GRID.shape, np.float32) for _ in range(2)), rail.bands.quality * 0)
    costs = np.stack([np.full(GRID.shape, value, np.float32) for value in misfits])
    fusion._decide(result, [wall, rail], costs, everywhere, FUSION.in_front * 9.5)
    return result


def test_what_stands_in_front_is_shown_where_it_fits_nearly_as_well():
    measured, interpolated = Quality.MEASURED, Quality.INTERPOLATED
    for misfits, right, quality in (
        ((0.5, 0.8), 1.0, interpolated), ((0.5, 1.1), 0.0, measured), ((0.8, 0.5), 1.0, measured),
    ):  # fmt: skip
        found = decided(*misfits)
        assert (found.r == np.float32(right)).all()
        assert (found.quality == quality).all()
        # What is seen to differ is decided: the sigma is that of the one that is taken.
        np.testing.assert_allclose(found.sigma, 0.002, rtol=1e-5)


def test_what_photos_show_best_is_shown_though_no_pair_measured_it():
    found = decided(1.5, 0.5, quality=Quality.INTERPOLATED)
    assert (found.r == 1.0).all()
    assert (found.quality == Quality.INTERPOLATED).all()


def test_photos_decide_between_pairs_where_they_can():
    taken = shot()
    truth = taken.truth
    greys = [image.mean(axis=2).astype(np.uint8) for image in taken.images]
    own = [Witness.of(p, g, truth.gsd) for p, g in zip(taken.photos.photos, greys, strict=True)]
    sigma = np.full(truth.shape, 0.002, np.float32)
    quality = np.full(truth.shape, Quality.MEASURED, np.uint8)
    weight = np.ones(truth.shape, np.float32)
    off = np.zeros(truth.shape, np.float32)
    off[:, 250:] = 0.25
    right, wrong = (
        PairRelief(MapBands(truth.r + shift, sigma, quality), weight) for shift in (0 * off, off)
    )
    found = fused([wrong, right], own, truth.grid)
    differ = taken.visible.all(axis=0) & (off > 0)
    error = np.abs(found.r - truth.r)[differ]
    assert (error < 0.01).mean() > 0.8
    assert (error > 0.01).mean() < 0.05


def test_a_turned_plane_sees_the_points_that_the_wall_does_and_brings_them_back():
    taken = shot()
    two = taken.photos.photos[1], taken.photos.photos[2]
    turn = TurnedPlane.for_base(two, np.zeros(2))
    assert TurnedPlane.for_base(taken.photos.photos[:2], np.zeros(2)) is None
    pair = Pair(image1=turn.photo(two[0]), image2=turn.photo(two[1]))
    xyz = np.array([[0.3, -0.4, 0.2], [-1.0, 1.0, -0.5]])
    there = (xyz - turn.middle) @ turn.rotation.T
    photos = two[::-1] if pair.exchanged else two
    for photo, own in zip(photos, (pair.image1, pair.image2), strict=True):
        np.testing.assert_allclose(own.project(there), photo.project(xyz), atol=1e-7)
    wide = Grid.from_bounds((-2.0, -2.0, 2.0, 2.0), gsd=0.02)
    x, y = np.meshgrid(wide.columns_x, wide.rows_y)
    axes = turn.rotation[2]
    level = 0.25  # of a wall in front of the plane, over the turned one
    height = (level - turn.rotation[0, 2] * x - turn.rotation[1, 2] * y) / axes[2]
    found = ReliefMap.from_relief(height, plane_from_pixel=wide.plane_from_pixel)
    back = turn.brought_back(found, GRID)
    np.testing.assert_allclose(back.r, level, atol=1e-4)
    assert (back.quality == Quality.MEASURED).all()
    assert replace(found, r=np.full_like(found.r, np.nan)).known.sum() == 0
