"""Dense relief against the exact relief of rendered façades, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from bifocal import Grid, Pair, Photo, Quality, dense_relief
from bifocal.model.image import as_grey
from bifocal.orientation.adjustment.pair_observations import at
from bifocal.relief_maps import edges, flow, forward_projection, seed
from bifocal.relief_maps.dense_matching import _resampled
from bifocal.relief_maps.forward_projection import PROJECTION, MapBands
from bifocal.relief_maps.frame import common_bounds, make_frame, working_grid
from bifocal.relief_maps.orientation_sigma import orientation_sigma
from bifocal.relief_maps.registration import _along_wall
from bifocal.relief_maps.relief_files import hatched, shaded
from multimedia import GeometryError, InputError
from photocore.shrinkage import shrink_noise
from tests.scenes import RICH, Rendering, Scene, SetupErrors, bifocal_cameras, facade, render
from tests.scenes.shapes import box

PIXEL = 0.0148


@cache
def shot(seed_: int = 5, d2: float = 9.5) -> Rendering:
    """Return a small rendered pair: 768 x 512 px."""
    cameras = bifocal_cameras(size=(768, 512), pixel=PIXEL, d2=d2)
    return render(facade(seed=seed_, texel=0.01), cameras, rng=np.random.default_rng(seed_))


@cache
def result():
    return dense_relief(shot().pair, shot().image1, shot().image2)


def away_from_edges(truth: np.ndarray, pixels: int = 8) -> np.ndarray:
    import cv2

    kernel = np.ones((3, 3), dtype=np.uint8)
    steps = cv2.dilate(truth, kernel) - cv2.erode(truth, kernel) > 0.03
    near = cv2.dilate(steps.astype(np.uint8), np.ones((2 * pixels + 1,) * 2, dtype=np.uint8))
    return near == 0


@pytest.mark.acceptance
def test_the_map_lies_on_the_pixels_of_an_ideal_far_photo():
    np.testing.assert_allclose(result().plane_from_pixel, shot().truth.plane_from_pixel, atol=1e-9)
    assert result().shape == (512, 768)


def test_relief_of_smooth_parts_is_right_to_millimetres():
    truth = shot().truth.r
    both = shot().visible1 & shot().visible2 & away_from_edges(truth)
    error = np.abs(result().r - truth)[both]
    assert np.median(error) < 0.003
    assert (error > 0.03).mean() < 0.05


def test_the_deep_door_and_the_high_cornice_are_found():
    truth, both = shot().truth.r, shot().visible1 & shot().visible2
    smooth_ = away_from_edges(truth, 4)
    for part in (truth < -0.5, truth > 0.85):
        chosen = both & part & smooth_
        assert chosen.sum() > 500
        assert np.median(np.abs(result().r - truth)[chosen]) < 0.02


def test_two_sigma_hold_most_errors_of_measured_pixels():
    truth = shot().truth.r
    chosen = (result().quality == Quality.MEASURED) & away_from_edges(truth)
    chosen &= shot().visible1 & shot().visible2
    assert (np.abs(result().r - truth) < 2 * result().sigma)[chosen].mean() > 0.8


def test_what_no_camera_sees_is_never_called_measured():
    unseen = ~shot().visible1 & ~shot().visible2
    assert (result().quality[unseen] == Quality.MEASURED).mean() < 0.35
    assert np.isnan(result().r[result().quality == Quality.UNKNOWN]).all()
    assert np.isfinite(result().r[result().quality != Quality.UNKNOWN]).all()


def test_photos_that_fit_are_not_blamed_but_the_scale_is_always_mentioned():
    registration = result().registration
    assert registration.systematic < 0.05
    assert abs(registration.wall) < 0.2
    assert len(registration.remarks) <= 2
    # B = 17.5 * 9.5 / 8 = 20.8 m: 0.1 % are 21 mm.
    assert "21 mm" in registration.remarks[-1]


@pytest.mark.acceptance
def test_offset_and_tilted_cameras_give_the_same_relief():
    errors = SetupErrors(tilt_deg=1.5, offset=0.3, distance=0.02)
    cameras = bifocal_cameras(
        size=(768, 512), pixel=PIXEL, errors=errors, rng=np.random.default_rng(2)
    )
    other = render(facade(seed=5, texel=0.01), cameras, rng=np.random.default_rng(3))
    grid = other.truth.grid
    found = dense_relief(other.pair, other.image1, other.image2, gsd=grid.gsd, bounds=grid.bounds)
    assert found.shape == other.truth.shape
    both = other.visible1 & other.visible2 & away_from_edges(other.truth.r)
    error = np.abs(found.r - other.truth.r)[both]
    assert np.nanmedian(error) < 0.004
    assert np.isfinite(error).mean() > 0.97


def test_bounds_and_gsd_are_kept():
    found = dense_relief(
        shot().pair, shot().image1, shot().image2, gsd=0.02, bounds=(3.5, -2.5, 5.5, 0.5)
    )
    assert found.shape == (150, 100)
    assert found.bounds == pytest.approx((3.5, -2.5, 5.5, 0.5))
    wanted = shot().truth.sample(found.plane_positions())
    assert np.nanmedian(np.abs(found.r - wanted)) < 0.005


def test_a_finer_gsd_than_the_photo_is_interpolated():
    found = dense_relief(
        shot().pair, shot().image1, shot().image2, gsd=PIXEL / 2, bounds=(3.5, -2.5, 5.5, 0.5)
    )
    assert found.gsd == PIXEL / 2
    wanted = shot().truth.sample(found.plane_positions())
    assert np.nanmedian(np.abs(found.r - wanted)) < 0.005


def test_fast_quality_is_coarser_but_covers_the_same():
    found = dense_relief(shot().pair, shot().image1, shot().image2, quality="fast")
    assert found.shape == result().shape
    assert found.working_gsd == pytest.approx(2 * PIXEL)
    error, standard = (np.abs(relief.r - shot().truth.r) for relief in (found, result()))
    assert np.nanmedian(standard) < np.nanmedian(error) < 2.2 * np.nanmedian(standard)
    assert (standard > 0.03).mean() < (error > 0.03).mean() < 1.7 * (standard > 0.03).mean()


def test_a_map_finer_than_the_photos_were_matched_has_steps_not_ramps():
    relief = np.tile(np.where(np.arange(60) < 30, 0.0, 0.4), (50, 1))
    band = relief.astype(np.float32)
    bands = MapBands(band, np.full_like(band, 0.01), np.ones(band.shape, np.uint8))
    grid = Grid.from_bounds((0.0, 0.0, 6.0, 5.0), gsd=0.1)
    finer = _resampled(bands, grid, Grid.from_bounds(grid.bounds, gsd=0.04))
    assert finer.r.shape == (125, 150)
    assert set(np.unique(finer.r)) == {np.float32(0), np.float32(0.4)}


@pytest.mark.acceptance
def test_pairs_of_little_difference_in_distance_work_too():
    other = shot(6, 14.0)
    found = dense_relief(other.pair, other.image1, other.image2)
    both = other.visible1 & other.visible2 & away_from_edges(other.truth.r)
    assert np.nanmedian(np.abs(found.r - other.truth.r)[both]) < 0.01


def test_sixteen_bit_photos_give_the_same_relief():
    wide = [image.astype(np.uint16) * 256 for image in (shot().image1, shot().image2)]
    part = {"gsd": 0.03, "bounds": (3.5, -2.5, 5.5, 0.5)}
    again = dense_relief(shot().pair, *wide, **part)
    np.testing.assert_array_equal(
        again.r, dense_relief(shot().pair, shot().image1, shot().image2, **part).r
    )


def shifted_pair(metres: float, angle_deg: float = 0.0) -> Pair:
    """Return the pair with photo 2 put wrongly on the plane."""
    pair = shot().pair
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    move = np.array([[c, -s, metres], [s, c, 0.0], [0, 0, 1.0]])
    second = replace(pair.image2, plane_from_pixel=move @ pair.image2.plane_from_pixel)
    return replace(pair, image2=second)


def test_a_shifted_photo_is_flagged_with_the_shift():
    found = dense_relief(shifted_pair(1.5 * PIXEL), shot().image1, shot().image2)
    assert found.registration.shift[0] == pytest.approx(1.5, abs=0.3)
    assert "do not fit exactly" in found.registration.remarks[0]


def test_a_rotated_photo_is_refused():
    with pytest.raises(GeometryError, match=r"not registered: .*`bifocal align"):
        dense_relief(shifted_pair(0.0, 2.0), shot().image1, shot().image2)


def test_photos_of_different_walls_are_refused():
    noise = np.random.default_rng(0).integers(0, 256, shot().image2.shape, dtype=np.uint8)
    with pytest.raises(GeometryError, match="can be matched between the two photos"):
        dense_relief(shot().pair, shot().image1, noise)


def test_photos_without_common_area_are_refused():
    with pytest.raises(GeometryError, match="no common area"):
        dense_relief(shifted_pair(100.0), shot().image1, shot().image2)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"gsd": 1e-5}, "Is the unit right"),
        ({"gsd": 10.0}, "Is the unit"),
        ({"gsd": -1.0}, "gsd"),
        ({"bounds": (50.0, 50.0, 60.0, 60.0)}, "lie outside what both photos see"),
        ({"bounds": (1.0, 0.0, -1.0, 2.0)}, "bounds"),
        ({"gsd": 1.0}, "Is the unit"),
        ({"relief_range": (1.0, -1.0)}, "least and the greatest"),
        ({"relief_range": (0.0, 9.4)}, "below 90 % of d2"),
        ({"quality": "superb"}, "expected fast, standard, best"),
    ],
)
def test_impossible_options_are_refused(options, said):
    with pytest.raises(InputError, match=said):
        dense_relief(shot().pair, shot().image1, shot().image2, **options)


def test_images_that_are_none_are_refused():
    with pytest.raises(InputError, match="1 x 1 px is too small"):
        dense_relief(shot().pair, np.zeros((1, 1, 3), np.uint8), shot().image2)
    with pytest.raises(InputError, match="found float64"):
        dense_relief(shot().pair, np.zeros((64, 64)), shot().image2)
    with pytest.raises(InputError, match="expected shape"):
        dense_relief(shot().pair, np.zeros((64, 64, 7), np.uint8), shot().image2)


def small_frame():
    images = [as_grey(image, "image") for image in (shot().image1, shot().image2)]
    box = common_bounds(shot().pair, (images[0].shape, images[1].shape))
    return make_frame(shot().pair, *images, working_grid(shot().pair, images[0].shape, box, PIXEL))


def test_an_ideal_photo_is_not_resampled():
    np.testing.assert_array_equal(small_frame().image1, as_grey(shot().image1, "image1"))


def test_a_photo_brought_to_a_coarser_grid_stays_where_it_was():
    # Grey rises by 0.5 a column and 0.6 a row, which averaging keeps: half a pixel of the coarser
    # grid too far is 2 grey levels and more, rounding at most one half.
    columns, rows = np.meshgrid(np.arange(256.0), np.arange(160.0))
    ramp = np.rint(20 + 0.5 * columns + 0.6 * rows).astype(np.uint8)
    metres = [[0.02, 0, -0.02 * 127.5], [0, -0.02, 0.02 * 79.5], [0, 0, 1]]
    far, near = (Photo(plane_from_pixel=metres, nadir=(0, 0), distance=d) for d in (17.5, 9.5))
    grid = Grid.from_bounds((-2.0, -1.2, 2.0, 1.2), gsd=0.083)
    frame = make_frame(Pair(image1=far, image2=near), ramp, ramp, grid)
    places = np.stack(np.meshgrid(grid.columns_x, grid.rows_y), axis=-1)
    wanted = 20 + (places * [50, -50] + [127.5, 79.5]) @ [0.5, 0.6]
    assert frame.seen1.all()
    assert abs((frame.image1 - wanted).mean()) < 0.6


def test_relief_that_falls_away_outwards_is_a_ramp_and_that_which_rises_is_none():
    # By hand: r = -k x falls away to the right; there a pixel's width of the photo is spread over
    # 1 + 2 k x / d1 pixels of the plane, beyond the limit of 1.3 where x > 0.15 d1 / k.
    frame = small_frame()
    x, y = frame.from_centre()
    limit = PROJECTION.stretch - 1
    for axis in (x + 0 * y, y + 0 * x):
        covered = forward_projection.stretch(frame, (-0.01 * axis).astype(np.float32))
        falling = covered > PROJECTION.stretch
        wanted = axis > limit / 2 * 17.5 / 0.01
        clear = np.abs(axis - limit / 2 * 17.5 / 0.01) > 2
        clear[0] = clear[-1] = clear[:, 0] = clear[:, -1] = False
        np.testing.assert_array_equal(falling[clear], wanted[clear])


def test_a_pixel_covers_as_much_of_the_wall_by_bent_rays_that_are_straight():
    frame = small_frame()
    x, y = frame.from_centre()
    distance = np.float32(frame.foot(1).distance)
    straight = SimpleNamespace(
        pair=SimpleNamespace(refracted=True), grid=frame.grid, foot=frame.foot,
        slopes=lambda *_: (-x / distance, -y / distance),
    )  # fmt: skip
    relief = (0.004 * x - 0.006 * y + 0.1).astype(np.float32)
    covered = [forward_projection.stretch(one, relief) for one in (frame, straight)]
    np.testing.assert_allclose(covered[1], covered[0], rtol=1e-5)


@pytest.mark.parametrize("reverse", [False, True])
def test_costs_run_along_both_diagonals_alike(reverse):
    """Of a volume of 5 x 7 places and 4 steps of relief, and the same seen in a mirror."""
    rng = np.random.default_rng(2)
    cost = rng.uniform(0, 30, (5, 7, 4)).astype(np.float32)
    image = rng.uniform(0, 90, (5, 7)).astype(np.float32)
    totals = np.zeros((2, *cost.shape), np.float32)
    seed._add_path(cost, image, totals[0], 1, 1, reverse=reverse)
    seed._add_path(cost[:, ::-1], image[:, ::-1], totals[1][:, ::-1], 1, -1, reverse=reverse)
    np.testing.assert_array_equal(totals[0], totals[1])
    first = 4 if reverse else 0
    np.testing.assert_array_equal(totals[0][first], cost[first])


def test_the_coarse_sweep_finds_relief_to_a_few_centimetres():
    frame = small_frame()
    coarse, factor = seed.coarse_relief(frame)
    truth = shot().truth.r[factor // 2 :: factor, factor // 2 :: factor]
    height, width = (min(a, b) for a, b in zip(truth.shape, coarse.shape, strict=True))
    error = np.abs(coarse[:height, :width] - truth[:height, :width])
    assert np.median(error) < 0.06


def test_sigma_is_the_base_factor_times_the_matching_precision_over_the_radius():
    frame = small_frame()
    flat = np.zeros(frame.grid.shape, dtype=np.float32)
    sigma = flow.sigma_of_relief(frame, flat, flat + np.float32(0.1))
    # By hand: 0.1 px * 20.78125 m / 300 px at 300 px to the right of the nadir (383.5, 255.5).
    x = 383.5 + 300.5
    assert sigma[255, int(x)] == pytest.approx(0.1 * 20.78125 / 300.5, rel=1e-4)


def test_the_precision_of_the_set_up_is_added_cell_by_cell_where_it_is_stated():
    covariance = np.zeros((24, 24))
    # Of the scale of photo 2, and of distances at the scales as they are: f goes with d.
    covariance[at("focal length", 2), at("focal length", 2)] = 1e-8
    for number, distance, sigma in ((1, 17.5, 0.01), (2, 9.5, 0.02)):
        rows = [at("Z", number), at("focal length", number)]
        both = np.array([sigma, sigma / distance])
        covariance[np.ix_(rows, rows)] += np.outer(both, both)
    pair = replace(shot().pair, orientation=covariance)
    grid = Grid.from_bounds((-2.0, -1.0, 2.0, 1.0), gsd=0.02)
    relief = np.tile(np.linspace(0.0, 1.0, grid.width, dtype=np.float32), (grid.height, 1))
    sigma = orientation_sigma(pair, relief, grid)
    # By hand: B 1e-4 = 2.078 mm; per metre of relief 9.5 / (17.5 * 8) * 10 mm = 0.679 mm and
    # 17.5 / (9.5 * 8) * 20 mm = 4.605 mm. From k = (1 - r/d1) / (1 - r/d2) they shrink, as relief
    # comes nearer, with both brackets, with the second and with the first.
    for column, r in ((0, 0.0), (-1, 1.0)):
        far, near = 1 - r / 17.5, 1 - r / 9.5
        parts = (2.078 * far * near, 0.679 * r * near, 4.605 * r * far)
        wanted = np.linalg.norm(parts)
        away = np.abs(grid.rows_y) > 0.3
        np.testing.assert_allclose(1000 * sigma[away, column], wanted, rtol=0.02)
    everywhere = pair.covariance_of_orientation(
        np.column_stack([grid.columns_x, np.full(grid.width, 0.5), relief[0].astype(float)])
    )
    row = int(np.argmin(np.abs(grid.rows_y - 0.5)))
    np.testing.assert_allclose(sigma[row], np.sqrt(everywhere[:, 2, 2]), rtol=0.02)
    assert not orientation_sigma(shot().pair, relief, grid).any()


def test_light_falls_on_relief_from_the_upper_left():
    """Slopes of 0.8 to either side, halved: n = (-+0.4, 0, 1) against the light, a wall being 1."""
    roof = (0.8 * np.minimum(np.arange(40.0), np.arange(40.0)[::-1])).astype(np.float32)
    shade = shaded(np.full((4, 40, 3), 0.5), np.tile(roof, (4, 1)), 1.0)[2, :, 0]
    light, length = np.array([-0.45, 0.74]) / 0.74, np.hypot(0.4, 1)
    expected = [0.5 * (np.dot((-s, 1.0), light) / length) ** 0.8 for s in (0.4, -0.4)]
    np.testing.assert_allclose(shade[[5, 35]], expected, rtol=1e-6)


def test_flow_of_a_known_zoom_gives_its_relief_and_nothing_across():
    frame = small_frame()
    x, y = frame.from_centre()
    k = 9.5 * (17.5 - 0.7) / (17.5 * (9.5 - 0.7))
    zoom = np.dstack(np.broadcast_arrays((k - 1) * x, (k - 1) * y)).astype(np.float32)
    relief, across = flow.split(frame, zoom)
    assert relief[10, 10] == pytest.approx(0.7, abs=1e-4)
    assert np.abs(across).max() < 1e-3


def test_smoothing_quiets_a_flat_wall_and_keeps_a_step():
    rng = np.random.default_rng(1)
    wall = np.zeros((80, 80), dtype=np.float32)
    wall[:, 40:] = 0.5
    noisy = wall + rng.normal(0, 0.01, wall.shape).astype(np.float32)
    quiet = shrink_noise(noisy, np.full_like(wall, 0.01))
    assert np.std((quiet - wall)[:, 15:25]) < 0.003
    assert np.abs(quiet - wall)[10:-10, 38:42].max() < 0.06


def test_a_ramp_over_a_step_is_made_sharp():
    """A slab 0.3 m thick: its front appears in photo 1 enlarged by d1 / (d1 - r)."""
    import cv2

    scene = Scene(wall=RICH.wall, texel=0.01)
    scene.add(box((0.8, 2.2), (0.6, 1.6), (-0.1, 0.3), RICH.trim))
    cameras = bifocal_cameras(size=(400, 300), pixel=PIXEL)
    taken = render(scene, cameras, rng=np.random.default_rng(1))
    images = [as_grey(image, "image") for image in (taken.image1, taken.image2)]
    bounds = common_bounds(taken.pair, (images[0].shape, images[1].shape))
    frame = make_frame(
        taken.pair, *images, working_grid(taken.pair, images[0].shape, bounds, PIXEL)
    )
    x, y = (axis * PIXEL * (17.5 - 0.3) / 17.5 for axis in frame.from_centre())
    slab = (x > 0.8) & (x < 2.2) & (-y > 0.6) & (-y < 1.6)
    relief = np.where(slab, 0.3, 0.0).astype(np.float32)
    blurred = cv2.GaussianBlur(relief, (0, 0), 2.0)
    sharp, misfit = edges.sharpen(frame, blurred, np.False_)
    # Photos do not fit at relief that is wrong by more than the noise of the texture.
    wrong = np.abs(blurred - relief) > 0.1
    assert np.median(misfit[wrong]) > 1.5 * np.median(misfit[slab & ~wrong])
    assert np.abs(sharp - relief).mean() < 0.75 * np.abs(blurred - relief).mean()


def test_hidden_strips_take_the_surface_behind():
    grid = small_frame().grid.window(0, 0, 768, 512)
    r = np.zeros(grid.shape, dtype=np.float32)
    r[:, 500:560] = 0.4
    holes = np.zeros(grid.shape, dtype=bool)
    holes[:, 560:575] = True
    r[holes] = np.nan
    layer = forward_projection.MapBands(r, np.zeros_like(r), np.ones(grid.shape, dtype=np.uint8))
    filled = forward_projection.fill_from_behind(layer, holes, grid, np.zeros(2))
    middle = slice(200, 312)
    assert filled[middle, 560:575].all()
    np.testing.assert_array_equal(layer.r[middle, 560:575], 0.0)
    assert (layer.quality[middle, 560:575] == Quality.HIDDEN).all()


def test_relief_beyond_the_outermost_measured_is_forgotten_and_holes_are_kept():
    quality = np.full((200, 200), 3, np.uint8)
    quality[60:, :] = 1
    quality[100:140, 80:120] = 2  # a window pane, surrounded
    layer = forward_projection.MapBands(
        np.ones((200, 200), np.float32), np.ones((200, 200), np.float32), quality
    )
    matched = flow.Measurement(r=layer.r, across=layer.r, loop=layer.r, sigma_px=layer.sigma)
    forward_projection.forget_outside(layer, matched)
    assert np.isnan(layer.r[:30]).all()
    assert (layer.quality[:30] == 0).all()
    assert np.isnan(layer.sigma[:30]).all()
    assert np.isfinite(layer.r[40:]).all()


def test_a_preview_hatches_what_is_not_measured():
    grey = np.full((40, 40, 3), [0.9, 0.1, 0.1])
    where = np.zeros((40, 40), dtype=bool)
    where[:, 20:] = True
    picture = hatched(grey, where)
    np.testing.assert_array_equal(picture[:, :20], grey[:, :20])
    assert (np.ptp(picture[:, 20:], axis=-1) < 0.2).all()
    assert len(np.unique(picture[:, 20:, 0])) == 2


def test_photos_from_beside_each_other_are_told_what_a_shift_along_the_base_does():
    feet, distances = np.array([[-1.0, 0.5], [4.0, 0.5]]), (10.0, 9.0)
    grid = Grid.from_bounds((0.0, -1.0, 4.0, 3.0), gsd=0.01)
    frame = SimpleNamespace(
        foot=lambda number: SimpleNamespace(nadir=feet[number - 1]), distances=distances, grid=grid
    )
    base, relief = _along_wall(frame)
    assert base == pytest.approx(5.0)
    # Rays to one place of the plane in photo 1, and a pixel beside it in photo 2.
    place = np.array([2.0, 1.0])
    away = (place - feet[1]) / distances[1] - (place - feet[0]) / distances[0]
    shifted = place - grid.gsd * away / np.linalg.norm(away)
    ways = [place - feet[0], shifted - feet[1]]
    heights = np.linspace(-0.1, 0.1, 200_001)
    at = [
        foot + np.outer((d - heights) / d, way)
        for foot, way, d in zip(feet, ways, distances, strict=True)
    ]
    nearest = heights[np.linalg.norm(at[0] - at[1], axis=1).argmin()]
    assert abs(nearest) == pytest.approx(relief, rel=0.01)

    beside = replace(result().registration, base=base, false_relief_per_shift=relief)
    assert beside.remarks[-1].startswith("the cameras stand 5.0 m apart along the wall")
    assert f"shifts by {100 * relief:.1f} mm" in beside.remarks[-1]
    assert not any("relative scale" in one for one in beside.remarks)
