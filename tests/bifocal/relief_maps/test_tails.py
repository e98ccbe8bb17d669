"""What keeps phantoms, noise and wrongly measured pixels out of a relief map, by hand cases."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from bifocal import Grid, Pair, Photo, Quality
from bifocal.relief_maps import (
    coarse_level,
    edges,
    evidence,
    flow,
    forward_projection,
    levels,
    occluded_regions,
    occluding_edges,
    smoothing,
    snapping,
    stages,
)
from bifocal.relief_maps.coarse_level import COARSE
from bifocal.relief_maps.edges import EDGES
from bifocal.relief_maps.evidence import EVIDENCE
from bifocal.relief_maps.forward_projection import PROJECTION, MapBands
from bifocal.relief_maps.frame import Frame, radial_stretch
from bifocal.relief_maps.levels import LEVELS
from bifocal.relief_maps.map_completion import MAP, _spread_inwards, tidied
from photocore.shrinkage import shrink_noise

METRES = [[0.01, 0, -0.995], [0, -0.01, 0.995], [0, 0, 1]]
FAR, NEAR = (Photo(plane_from_pixel=METRES, nadir=(0, 0), distance=d) for d in (17.5, 9.5))


def frame_of(pair: Pair, side: int = 200) -> Frame:
    grid = Grid.from_bounds((-1.0, -1.0, 1.0, 1.0), gsd=2.0 / side)
    grey, seen = np.zeros(grid.shape, np.uint8), np.ones(grid.shape, bool)
    return Frame(grid=grid, image1=grey, image2=grey, seen1=seen, seen2=seen, pair=pair)


def test_a_spike_that_nothing_validates_is_held_back_and_a_validated_one_is_not():
    relief = np.zeros((192, 192), np.float32)
    relief[90:100, 90:100] = 2.0
    valid = np.ones(relief.shape, bool)
    np.testing.assert_array_equal(evidence.held_back(relief, valid, 9.5), relief)
    valid[85:105, 85:105] = False
    held = evidence.held_back(relief, valid, 9.5)
    # Nothing around it is above 0 m: 0.2 % of 9.5 m are left.
    np.testing.assert_allclose(held[90:100, 90:100], 0.019, rtol=1e-6)
    np.testing.assert_array_equal(held[valid], relief[valid])


def test_relief_between_two_validated_surfaces_is_left_alone():
    relief = np.zeros((192, 192), np.float32)
    relief[:, 96:] = 0.5
    relief[:, 90:102] = np.linspace(0, 0.5, 12)
    valid = np.ones(relief.shape, bool)
    valid[:, 88:104] = False
    np.testing.assert_array_equal(evidence.held_back(relief, valid, 9.5), relief)


def test_where_nothing_far_and_wide_is_validated_relief_stays():
    relief = np.full((640, 640), 3.0, np.float32)
    nothing = np.zeros(relief.shape, bool)
    np.testing.assert_array_equal(evidence.held_back(relief, nothing, 9.5), relief)


def test_smoothing_survives_any_sigma():
    rng = np.random.default_rng(4)
    relief = rng.normal(0.5, 0.01, (128, 128)).astype(np.float32)
    sigma = np.full(relief.shape, 1e-9, np.float32)
    sigma[::3] = 1e4
    smooth = shrink_noise(relief, sigma)
    assert relief.min() - 0.01 < smooth.min() < smooth.max() < relief.max() + 0.01


def test_smoothing_leaves_the_unknown_unknown_and_gives_it_no_say():
    relief = np.full((64, 64), 0.5, np.float32)
    relief[:, 40:] = np.nan
    smooth = shrink_noise(relief, np.full_like(relief, 0.05), MAP.map_windows)
    np.testing.assert_array_equal(np.isnan(smooth), np.isnan(relief))
    np.testing.assert_allclose(smooth[:, :40], 0.5, atol=1e-5)


def test_imprecise_relief_is_drawn_to_the_wall_and_to_the_pilaster_before_it():
    rng = np.random.default_rng(5)
    truth = np.zeros((256, 256), np.float32)
    truth[:, 100:160] = 0.11
    sigma = np.full_like(truth, 0.01)
    relief = truth + rng.normal(0, 0.01, truth.shape).astype(np.float32)
    drawn = levels.drawn_to_levels(relief, sigma, np.ones(truth.shape, bool))
    before, after = (np.abs(r - truth).mean() for r in (relief, drawn))
    assert after < 0.7 * before
    assert np.abs(drawn - relief).max() <= LEVELS.share * 0.01 + 1e-6


def test_precise_relief_and_slopes_are_not_drawn_anywhere():
    slope = np.broadcast_to(np.linspace(0, 1, 512, dtype=np.float32), (512, 512)).copy()
    everywhere = np.ones(slope.shape, bool)
    precise = levels.drawn_to_levels(slope, np.full_like(slope, 0.002), everywhere)
    np.testing.assert_array_equal(precise, slope)
    vague = levels.drawn_to_levels(slope, np.full_like(slope, 0.01), everywhere)
    # But for the ends of the count, where there is only one side.
    assert np.abs(vague - slope)[:, 30:-30].max() < 0.003


def test_validated_relief_wins_against_higher_relief_that_is_not():
    frame = frame_of(Pair(image1=FAR, image2=NEAR))
    r = np.zeros(frame.grid.shape, np.float32)
    quality = np.full(r.shape, Quality.MEASURED, np.uint8)
    # Two metres high pixels of photo 1 at 80 to 90 px land at s (1 - 2 / 17.5): 71 to 80 px.
    r[95:105, 180:190], quality[95:105, 180:190] = 2.0, Quality.INTERPOLATED
    bands = MapBands(r, np.full_like(r, 0.001), quality)
    everywhere = np.ones(r.shape, bool)
    low = forward_projection.to_plane(frame, bands, everywhere, frame.grid)
    assert np.nanmax(low.r[95:105, 172:178]) == 0.0
    quality[:] = Quality.MEASURED
    high = forward_projection.to_plane(frame, bands, everywhere, frame.grid)
    assert np.nanmin(high.r[98:102, 173:178]) == 2.0


def test_what_stands_before_the_wall_hides_a_strip_as_wide_as_geometry_says():
    # A slab 0.5 m thick up to 60 px from the nadir hides, from 9.5 m, 60 * 0.5 / 9 = 3.3 px.
    grid = Grid.from_bounds((-1.0, -1.0, 1.0, 1.0), gsd=0.01)
    relief = np.zeros(grid.shape, np.float32)
    relief[60:140, 120:160] = 0.5
    hidden = forward_projection.hidden_on_map(relief, grid, NEAR.foot)
    middle = hidden[95:105]
    assert middle[:, 160:162].all()
    assert not middle[:, 164:].any()
    assert not middle[:, :160].any()


def test_masks_grow_towards_the_nadir_only():
    mask = np.zeros((101, 101), bool)
    mask[50, 80] = True
    grown = _spread_inwards(mask, np.array([50.0, 50.0]), 3)
    assert np.flatnonzero(grown[50]).tolist() == [77, 78, 79, 80]
    assert grown.sum() == 4


def test_floating_pieces_go_and_pinholes_are_closed():
    r = np.zeros((300, 300), np.float32)
    r[:, 200:] = np.nan
    r[100:130, 250:280] = 0.0  # 900 px by themselves
    r[50:54, 50:54] = np.nan
    bands = MapBands(r, np.full_like(r, 0.01), np.ones(r.shape, np.uint8))
    tidied(bands)
    assert np.isnan(bands.r[:, 205:]).all()
    assert (bands.quality[:, 205:] == Quality.UNKNOWN).all()
    assert np.isfinite(bands.r[:, :195]).all()


def test_the_pixels_of_an_oblique_photo_are_longer_along_its_slant():
    square = Pair(image1=FAR, image2=NEAR)
    np.testing.assert_allclose(radial_stretch(frame_of(square)), 1.0, atol=1e-6)
    # Photos whose pixels are twice as long in X: to the right of the nadir the radius is X.
    longer = [[0.02, 0, -1.99], [0, -0.01, 0.995], [0, 0, 1]]
    far, near = (replace(photo, plane_from_pixel=np.array(longer)) for photo in (FAR, NEAR))
    stretched = radial_stretch(frame_of(Pair(image1=far, image2=near)))
    assert abs(stretched[100, 190] - 2.0) < 0.01
    assert abs(stretched[10, 100] - 0.5) < 0.01


def falling(frame: Frame, relief: np.ndarray, misfit: np.ndarray) -> np.ndarray:
    everywhere = np.ones(relief.shape, bool)
    return ~evidence.without_falling(frame, relief, misfit, 0.0, np.False_, everywhere)


def test_what_falls_away_from_camera_2_where_the_photos_do_not_fit_is_not_measured():
    frame = frame_of(Pair(image1=FAR, image2=NEAR))
    x = np.arange(200) - 99.5
    # A pilaster 0.5 m before the wall, 40 to 60 px from the nadir, whose flanks flow runs over.
    profile = np.interp(x, [32, 40, 60, 68], [0.0, 0.5, 0.5, 0.0])
    relief = np.broadcast_to(profile, (200, 200)).astype(np.float32)
    # At 64 px a ray of camera 2 sinks by 9.25 m / 64 px = 145 mm a pixel, the outer flank by 62.5.
    row = falling(frame, relief, np.full(relief.shape, 8.5, np.float32))[99]
    assert row[np.abs(x - 64) < 2].all()
    assert not row[x < 58].any()
    assert not row[x > 71].any()
    assert not falling(frame, relief, np.full(relief.shape, 2.0, np.float32)).any()


def test_less_parallax_takes_less_misfit_to_doubt_what_falls_away():
    x = np.arange(200) - 99.5
    profile = np.interp(x, [40, 60, 68], [0.5, 0.5, 0.0])
    relief = np.broadcast_to(profile, (200, 200)).astype(np.float32)
    misfit = np.full(relief.shape, 3.0, np.float32)
    doubted = []
    for distance in (9.5, 14.0):
        frame = frame_of(Pair(image1=FAR, image2=replace(NEAR, distance=distance)))
        doubted.append(falling(frame, relief, misfit)[99, 158:169].any())
    assert doubted == [False, True]


def test_cameras_beside_each_other_have_a_limit_of_their_own_in_a_set_alone():
    pair = Pair(image1=FAR, image2=replace(FAR, distance=17.4, nadir=(8.0, 0.0)))
    frame = frame_of(pair)
    plain = EVIDENCE.falls_away * (1 - 17.4 / 17.5) ** EVIDENCE.falls_power
    precise = edges.precision(0.0)
    expected = precise * plain + (1 - precise) * EVIDENCE.falls_away_imprecise
    assert evidence.most_falling(frame) == expected
    of_set = evidence.most_falling(replace(frame, sideways=True))
    assert np.shape(of_set) == frame.grid.shape
    assert (of_set > 10 * expected).all()


def step_in_photo_1(edge: float, height: float, difference: float) -> Frame:
    """Return a frame whose photo 1 shows a surface right of X = edge [px from the nadir]."""
    frame = frame_of(Pair(image1=FAR, image2=NEAR))
    x = np.arange(200) - 99.5
    # Magnified about the nadir, Eq. (1); the pixel that the edge runs through is mixed.
    share = np.clip(x + 0.5 - edge * 17.5 / (17.5 - height), 0, 1)
    rng = np.random.default_rng(5)
    grey = 80 + difference * share[None, :] + rng.normal(0, 1.5, (200, 200))
    return replace(frame, image1=np.rint(grey).astype(np.uint8))


def snapped_row(frame: Frame, steps_at: float, below: float, above: float) -> np.ndarray:
    x = np.arange(200) - 99.5
    relief = np.broadcast_to(np.where(x > steps_at, above, below), (200, 200)).astype(np.float32)
    nothing = np.zeros(relief.shape, np.float32)
    bands = MapBands(relief, nothing, nothing.astype(np.uint8))
    return snapping.snapped(frame, bands, frame.grid).r[20:180]


@pytest.mark.parametrize("edge", [40.1, 40.3, 40.7, 40.9])
@pytest.mark.parametrize("off", [-1.0, 0.0, 1.0])
def test_a_step_moves_to_the_edge_that_photo_1_shows_of_it(edge, off):
    found = snapped_row(step_in_photo_1(edge, 0.3, 60.0), edge + off, 0.0, 0.3)
    true = np.where(np.arange(200) - 99.5 > edge, 0.3, 0.0)
    np.testing.assert_allclose(found, np.broadcast_to(true, found.shape), atol=1e-6)


@pytest.mark.parametrize(
    ("difference", "off", "below", "above"),
    [(10.0, 1.0, 0.0, 0.3), (60.0, 4.0, 0.0, 0.3), (60.0, 1.0, 0.3, 0.0), (60.0, 1.0, 0.0, 0.02)],
    ids=["faint", "far", "falling outwards", "low"],
)
def test_a_step_stays_where_its_edge_is_not_sure(difference, off, below, above):
    frame = step_in_photo_1(40.3, max(below, above), difference)
    found = snapped_row(frame, 40.3 + off, below, above)
    kept = np.where(np.arange(200) - 99.5 > 40.3 + off, above, below)
    np.testing.assert_allclose(found, np.broadcast_to(kept, found.shape), atol=1e-6)


def test_a_ramp_counts_by_its_parallax_a_pixel():
    relief = np.broadcast_to(0.02 * np.arange(40.0), (40, 40)).astype(np.float32)
    # 0.02 m a pixel are 0.15 px of parallax at 7.5 px/m: half of what makes a ramp.
    steep = edges._ramp(relief, np.float32(7.5))[20, 20]
    np.testing.assert_allclose(steep, 0.5 * EDGES.ramp, rtol=1e-4)
    np.testing.assert_allclose(edges._ramp(relief, np.float32(75))[20, 20], EDGES.ramp, rtol=1e-6)
    assert not edges._ramp(np.full((40, 40), 0.3, np.float32), np.float32(75)).any()


def test_only_a_pixel_that_fits_and_has_texture_is_pardoned_for_not_coming_back():
    frame = frame_of(Pair(image1=FAR, image2=NEAR))
    texture = np.zeros((200, 200), np.uint8)
    texture[:100, ::8] = 200  # above; below there is nothing to tell one place from another
    misfit = np.full(texture.shape, 3.0, np.float32)
    misfit[:, 100:] = 9.0
    zero = np.zeros(texture.shape, np.float32)
    matched = flow.Measurement(r=zero, across=zero, loop=zero + 2, sigma_px=zero + 0.03)
    frame, sigma = replace(frame, image1=texture), zero + 0.001
    nowhere = np.zeros(texture.shape, bool)
    pardoned = evidence.with_pardoned(frame, matched, sigma, misfit, nowhere, None)
    assert pardoned[10:90, 10:90].all()
    assert not pardoned[:, 102:].any()
    assert not pardoned[112:].any()
    for worse in (replace(matched, loop=zero + 6), replace(matched, across=zero + 0.6)):
        assert not evidence.with_pardoned(frame, worse, sigma, misfit, nowhere, None).any()


def test_the_side_face_of_a_step_is_put_nowhere_and_the_step_stands_on_its_line():
    frame = frame_of(Pair(image1=FAR, image2=NEAR))
    x = np.arange(200) - 99.5
    # A pier 2 m before the wall, 60 to 80 px from the nadir: photo 1 sees its foot at 60 px and its
    # inner edge at 60 / (1 - 2 / 17.5) = 67.7 px, and flow runs from the one to the other.
    profile = np.interp(x, [59, 69, 90, 94], [0.0, 2.0, 2.0, 0.0])
    relief = np.broadcast_to(profile, (200, 200)).astype(np.float32)
    row = forward_projection.side_faces(frame, relief, np.False_)[99]
    assert row[(x > 60) & (x < 68)].all()
    assert not row[(x < 57) | (x > 71)].any()
    nothing = np.zeros_like(relief)
    matched = flow.Measurement(
        r=relief, across=nothing, loop=nothing, sigma_px=nothing + np.float32(0.001)
    )
    found = stages.relief_map(frame, matched, (-1.0, 3.0), frame.grid).r[99]
    assert np.abs(found[(x > 50) & (x < 59)]).max() < 1e-3
    assert np.abs(found[(x > 61) & (x < 79)] - 2.0).max() < 1e-3


def test_half_the_resolution_lies_where_the_whole_one_does():
    frame = frame_of(Pair(image1=FAR, image2=NEAR), side=201)
    half = coarse_level.halved(frame)
    assert half.grid.shape == (100, 100)
    # Its first pixel covers the first four of the whole one; the odd last row is dropped.
    place = frame.grid.pixel_of(np.array([half.grid.x0, half.grid.y0]))
    np.testing.assert_allclose(place, [0.5, 0.5], atol=1e-9)
    slope = np.broadcast_to(frame.grid.columns_x, frame.grid.shape).astype(np.float32)
    large = coarse_level._enlarged(
        np.broadcast_to(half.grid.columns_x, half.grid.shape).astype(np.float32), frame
    )
    np.testing.assert_allclose(large[:, 1:199], slope[:, 1:199], atol=1e-6)


def test_plaster_that_is_lost_in_noise_is_known_better_at_half_the_resolution():
    rng = np.random.default_rng(9)
    side = 320
    frame = frame_of(Pair(image1=FAR, image2=NEAR), side=side)
    shades = cv2.GaussianBlur(rng.normal(0, 1, (side, side)), (0, 0), 5.0)
    shades *= 5 / shades.std()
    # A wall at 0.3 m: photo 2 is photo 1 enlarged by (9.5 / 9.2) / (17.5 / 17.2).
    k, middle = (9.5 / 9.2) / (17.5 / 17.2), (side - 1) / 2
    zoom = np.array([[k, 0, middle * (1 - k)], [0, k, middle * (1 - k)]])
    second = cv2.warpAffine(shades, zoom, (side, side), borderMode=cv2.BORDER_REPLICATE)
    photos = [
        np.clip(128 + image + rng.normal(0, 5, image.shape), 0, 255).astype(np.uint8)
        for image in (shades, second)
    ]
    frame = replace(frame, image1=photos[0], image2=photos[1])
    first = np.full((10, 10), 0.25, np.float32)
    fine = flow.measure(frame, first)
    assert coarse_level.is_unsure(fine)
    both, known, _ = coarse_level.backed(frame, fine, first)
    assert known.mean() > 0.1
    before, after = (np.abs(found.r[known] - 0.3).mean() for found in (fine, both))
    assert after < 0.85 * before
    valid = ~known & (np.abs(both.r - fine.r) < COARSE.gross)
    np.testing.assert_array_equal(both.r[valid], fine.r[valid])


def test_a_wall_is_plain_by_its_plain_part_however_strong_the_edges_on_it():
    rng = np.random.default_rng(3)
    noise = rng.normal(0, 1.5, (200, 200))
    frame = frame_of(Pair(image1=FAR, image2=NEAR))
    plaster = np.full((200, 200), 150.0)
    plaster[:, ::40] = 20.0  # bars: 15 px around them half of the wall has contrast
    stone = 150 + 8 * cv2.GaussianBlur(rng.normal(0, 12, (200, 200)), (0, 0), 2.0)
    for wall, plain in ((plaster, True), (stone, False)):
        image = np.clip(wall + noise, 0, 255).astype(np.uint8)
        assert flow._is_plain(replace(frame, image1=image)) is plain


def test_on_plain_walls_filled_relief_leans_on_what_is_interpolated():
    def lost(*, plain: bool) -> int:
        r = np.zeros((200, 200), np.float32)
        bands = MapBands(r, np.full_like(r, 0.1), np.full(r.shape, Quality.HIDDEN, np.uint8))
        bands.quality[:, :100] = Quality.MEASURED
        bands.quality[:, 100:140] = Quality.INTERPOLATED
        matched = flow.Measurement(r=r, across=r, loop=r, sigma_px=r, plain=plain)
        forward_projection.forget_outside(bands, matched)
        return int(np.isnan(bands.r[100]).sum())

    # Hidden is what lies beyond 140 px; OpenCV's distances run up to 5 % short.
    assert lost(plain=False) == 60
    assert abs(lost(plain=True) - (60 - PROJECTION.fringe_hidden)) < 3


def fat_slab() -> tuple[Frame, MapBands]:
    """A slab 0.5 m before the wall, whose rim stands 60 px from the nadir; the map has it fatter.

    Photo 1 shows the rim at 60 / (1 - 0.5 / 17.5) = 61.8 px; camera 2 cannot see 3.2 px behind it.
    """
    frame = frame_of(Pair(image1=FAR, image2=NEAR))
    x = np.arange(200) - 99.5
    image = np.full((200, 200), 60, np.uint8)
    image[:, x < 61.8] = 150
    r = np.zeros((200, 200), np.float32)
    quality = np.full(r.shape, Quality.MEASURED, np.uint8)
    for row in range(200):
        fat = 2 + (row // 5) % 2
        r[row, (x > 20) & (x < 60 + fat)] = 0.5
        quality[row, (x > 58) & (x < 66)] = Quality.INTERPOLATED
    return replace(frame, image1=image), MapBands(r, np.full_like(r, 0.001), quality)


def test_a_rim_that_flow_made_too_fat_is_drawn_in_to_the_edge_of_the_photo():
    frame, bands = fat_slab()
    occluding_edges.drawn_in(frame, bands, frame.grid)
    x = np.arange(200) - 99.5
    middle = bands.r[80:120]
    np.testing.assert_array_equal(middle[:, (x > 20) & (x < 60)], 0.5)
    np.testing.assert_array_equal(middle[:, x > 61], 0)
    assert (bands.quality[80:120, (x > 61) & (x < 62)] == Quality.HIDDEN).all()


def test_rims_stay_where_they_are_measured_and_where_the_photo_shows_no_edge():
    frame, bands = fat_slab()
    plain, fat = replace(frame, image1=np.full_like(frame.image1, 120)), bands.r.copy()
    occluding_edges.drawn_in(plain, bands, frame.grid)
    np.testing.assert_array_equal(bands.r, fat)
    bands.quality[:] = Quality.MEASURED
    occluding_edges.drawn_in(frame, bands, frame.grid)
    np.testing.assert_array_equal(bands.r, fat)


@pytest.mark.parametrize("upright", [False, True])
def test_the_farthest_rim_of_a_map_that_is_not_square_is_seen(upright):
    """A slab's rim 378 px from the nadir, which lies on the short edge of 400 x 120 px.

    It hides 378 x 47 mm / (17.5 - 0.047) = 1.02 px from camera 1. Were the map taken for one of
    120 x 400 px, nothing of it were farther than 361 px: there it would hide less than a pixel.
    """
    photos = [replace(photo, nadir=(0.0, 0.0)) for photo in (FAR, NEAR)]
    grid = Grid.from_bounds((0.0, -0.6, 4.0, 0.6), gsd=0.01)
    r = np.zeros(grid.shape, np.float32)
    r[:, 300:378] = 0.047
    quality = np.full(r.shape, Quality.MEASURED, np.uint8)
    quality[:, 370:390] = Quality.INTERPOLATED
    if upright:  # the same, turned to the left about the nadir
        grid = Grid.from_bounds((-0.6, 0.0, 0.6, 4.0), gsd=0.01)
        r, quality = (np.ascontiguousarray(np.rot90(part)) for part in (r, quality))
    grey, all_of_it = np.zeros(grid.shape, np.uint8), np.ones(grid.shape, bool)
    frame = Frame(grid=grid, image1=grey, image2=grey, seen1=all_of_it, seen2=all_of_it,
                  pair=Pair(image1=photos[0], image2=photos[1]))  # fmt: skip
    rims = occluding_edges._falling(frame, MapBands(r, np.full_like(r, 0.001), quality), grid)
    nadir = grid.pixel_of(np.zeros(2))
    away = np.hypot(rims.column - nadir[0], rims.row - nadir[1])
    # Of 120 rows those 18 px from the borders are not looked at.
    assert len(away) == 120 - 2 * 18
    assert 377 < away.min() <= away.max() < 380
    np.testing.assert_allclose(rims.behind, 0, atol=1e-7)


def looping(loop: np.ndarray) -> flow.Measurement:
    return flow.Measurement(r=loop, across=loop, loop=loop, sigma_px=loop)


def test_a_door_of_which_camera_2_sees_half_stays_one_door():
    # Wall at 0 m right of the door, door 1.4 m behind it; on its last 0.6 m matching is lost.
    pair = Pair(
        image1=Photo(plane_from_pixel=METRES, nadir=(6.0, 0.0), distance=9.4),
        image2=Photo(plane_from_pixel=METRES, nadir=(7.0, 0.0), distance=6.0),
    )
    frame = frame_of(pair, side=400)
    truth = np.zeros(frame.grid.shape, np.float32)
    truth[:, :240] = -1.4
    found, loop = truth.copy(), np.zeros(truth.shape, np.float32)
    found[:, 160:240] = np.random.default_rng(3).uniform(-1.4, 0.0, (400, 80))
    loop[:, 160:240] = 60.0
    mended = occluded_regions.put_behind(frame, found, looping(loop), loop == 0)
    assert (np.abs(mended - truth) < 0.05).mean() > 0.99
    # What a loop shorter than a ramp's explains is imprecise, not lost.
    np.testing.assert_array_equal(
        occluded_regions.put_behind(frame, found, looping(loop / 15), loop == 0), found
    )


def test_a_lost_region_that_camera_2_would_see_is_left_alone():
    pair = Pair(
        image1=Photo(plane_from_pixel=METRES, nadir=(6.0, 0.0), distance=9.4),
        image2=Photo(plane_from_pixel=METRES, nadir=(7.0, 0.0), distance=6.0),
    )
    frame = frame_of(pair, side=400)
    relief, loop = np.zeros(frame.grid.shape, np.float32), np.zeros(frame.grid.shape, np.float32)
    relief[:, 160:240], loop[:, 160:240] = 0.3, 60.0
    mended = occluded_regions.put_behind(frame, relief, looping(loop), loop == 0)
    np.testing.assert_array_equal(mended, relief)


def test_teeth_of_a_step_go_where_nobody_measured_it():
    rng, relief = np.random.default_rng(3), np.zeros((200, 120), np.float32)
    for row in range(200):
        relief[row, : 60 + rng.integers(0, 7)] = 0.8
    teeth = {}
    for quality in (Quality.MEASURED, Quality.HIDDEN):
        bands = MapBands(relief, np.zeros_like(relief), np.full(relief.shape, quality, np.uint8))
        straight = smoothing.straightened(bands).r
        assert np.isin(straight, np.float32([0, 0.8])).all()
        teeth[quality] = np.count_nonzero(np.diff(straight > 0.4, axis=0))
    assert teeth[Quality.HIDDEN] < 0.6 * teeth[Quality.MEASURED], teeth
