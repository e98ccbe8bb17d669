"""A plane sweep finds bars that are narrower than their own parallax."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from bifocal import Foot, Grid, MapSurface, dense_relief
from bifocal.model.image import as_grey
from bifocal.orthophotos.visibility import hidden_from
from bifocal.rays import zoom_factor
from bifocal.relief_maps import evidence, plane_sweep, second_hypothesis
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import common_bounds, make_frame, working_grid
from bifocal.relief_maps.second_hypothesis import HYPOTHESIS
from bifocal.relief_maps.smoothing import straightened
from bifocal.relief_maps.stages import STAGES
from tests.scenes import RICH, CameraPair, Rendering, Scene, bifocal_cameras, render
from tests.scenes.balconies import balconies


def corner(scene: Scene, middle: tuple[float, float], size: tuple[int, int]) -> Rendering:
    """Return a pair of which only a window about a place of the wall is photographed."""
    whole = bifocal_cameras(size=size)
    cameras = []
    for camera in (whole.far, whole.near):
        matrix = camera.matrix.copy()
        matrix[:2, 2] += np.array([-middle[0], middle[1]]) * matrix[0, 0] / camera.centre[2]
        cameras.append(replace(camera, matrix=matrix))
    pair = CameraPair(
        far=cameras[0], near=cameras[1], nominal_far=cameras[0], nominal_near=cameras[1]
    )
    return render(scene, pair, rng=np.random.default_rng(1))


@cache
def railing() -> tuple[Rendering, np.ndarray]:
    """Return a pair of the corner of a balcony, and where its railing stands on the map."""
    shot = corner(balconies(seed=1104, palette=RICH), (-3.9, 0.3), (440, 320))
    truth = shot.truth.r
    body = cv2.morphologyEx(truth, cv2.MORPH_OPEN, np.ones((23, 23), np.uint8))
    return shot, shot.visible1 & shot.visible2 & (truth - body > 0.3)


@pytest.mark.acceptance
def test_a_railing_is_found_that_flow_cannot_find(monkeypatch):
    # There is little else in the picture.
    anywhere = replace(HYPOTHESIS, least_valid=0.0, least_backed=0.0)
    monkeypatch.setattr(second_hypothesis, "HYPOTHESIS", anywhere)
    shot, rail = railing()
    grid = shot.truth.grid
    found = dense_relief(shot.pair, shot.image1, shot.image2, gsd=grid.gsd, bounds=grid.bounds)
    right = np.abs(found.r - shot.truth.r) < 0.05
    assert rail.mean() > 0.05
    assert right[rail].mean() > 0.35  # flow alone finds nothing of it
    assert right[(shot.visible1 & shot.visible2 & ~rail)].mean() > 0.9  # flow alone 0.82


def test_only_an_even_part_that_both_photos_show_alike_is_backed():
    cameras, rng = bifocal_cameras(size=(400, 300)), np.random.default_rng(1)
    grey = cv2.GaussianBlur(rng.integers(0, 256, (300, 400), np.uint8), (0, 0), 1.0)
    pair = cameras.nominal
    box = common_bounds(pair, (grey.shape, grey.shape))
    frame = make_frame(
        pair, grey, grey, working_grid(pair, grey.shape, box, pair.image1.gsd((400, 300))), None
    )
    far = cv2.resize(grey, frame.grid.shape[::-1])
    zoom = float(zoom_factor(0.8, d1=frame.distances[0], d2=frame.distances[1]))
    shift = (1 - zoom) * np.asarray(frame.centre)
    near = cv2.warpAffine(
        far, np.array([[zoom, 0, shift[0]], [0, zoom, shift[1]]]), far.shape[::-1]
    )
    even, moved, rough, behind = (np.s_[20:60, x : x + 40] for x in (20, 90, 250, 320))
    place = [
        slice(*(np.array([s.start - 8, s.stop + 8]) * zoom + t).astype(int))
        for s, t in zip(moved, shift[::-1], strict=True)
    ]
    near[tuple(place)] = rng.integers(0, 256, near[tuple(place)].shape)
    frame = replace(
        frame,
        image1=far,
        image2=near,
        seen1=np.ones(far.shape, bool),
        seen2=np.ones(far.shape, bool),
    )
    relief, no = np.zeros(far.shape, np.float32), np.zeros(far.shape, bool)
    taken = no.copy()
    for part in (even, moved, rough, behind):
        relief[part], taken[part] = 0.8, True
    relief[rough] += rng.uniform(-0.3, 0.3, (40, 40))
    relief[behind] = -0.8
    level = second_hypothesis._Level(frame, np.zeros(far.shape, np.float32), no, no)
    found = second_hypothesis._Found(relief, relief, relief)
    backed = second_hypothesis._backed(level, found, taken)
    assert backed[even].mean() > 0.9
    assert not any(backed[part].any() for part in (moved, rough, behind))


def small_frame(*greys):
    """Return a frame of 400 x 300 px of two grey photos."""
    cameras = bifocal_cameras(size=(400, 300))
    box = common_bounds(cameras.nominal, ((300, 400),) * 2)
    work = working_grid(cameras.nominal, (300, 400), box, cameras.nominal.image1.gsd((400, 300)))
    return make_frame(cameras.nominal, *greys, work, None)


def test_pieces_of_a_rail_vouch_for_each_other_and_scatter_goes():
    rng, grey = np.random.default_rng(1), np.zeros((300, 400), np.uint8)
    frame = small_frame(grey, grey)
    relief, taken = np.zeros(frame.grid.shape, np.float32), np.zeros(frame.grid.shape, bool)
    rail, scatter, dense = np.s_[40:43, 20:120], np.s_[20:60, 200:240], np.s_[120:200, 200:300]
    taken[rail] = taken[scatter][::3, ::3] = taken[dense] = True
    taken[rail][:, ::7] = False  # in pieces of 12 px
    relief[rail] = 0.8
    relief[scatter] = rng.uniform(-3, 3, (40, 40))
    relief[dense] = rng.uniform(-1, 1, (80, 100))  # 45 alike around each, but by chance
    level = second_hypothesis._Level(frame, 0 * relief, ~taken, ~taken)
    found = second_hypothesis._Found(relief, relief, relief)
    kept = second_hypothesis._in_company(level, found, taken)
    assert kept[rail][taken[rail]].mean() > 0.8
    assert kept[scatter].sum() < 0.05 * taken[scatter].sum()
    assert kept[dense].mean() < 0.1
    assert not kept[~taken].any()
    assert not second_hypothesis._in_company(level, found, kept & False).any()


def test_what_fits_better_by_no_more_than_photos_differ_is_chance():
    rng, grey = np.random.default_rng(2), np.full((300, 400), 90, np.uint8)
    noisy = [rng.normal(90, 12, grey.shape).astype(np.uint8) for _ in range(2)]
    for photos, share in ((noisy, 0), ((grey, grey), 1)):
        frame = small_frame(*photos)
        shape, part = frame.grid.shape, np.s_[20:60, 20:60]
        relief, valid = np.zeros(shape, np.float32), np.ones(shape, bool)
        swept = np.full(shape, np.nan, np.float32)
        swept[part] = 1.0
        level = second_hypothesis._Level(frame, relief, valid, valid)
        better = np.full(shape, 1.5 * HYPOTHESIS.better, np.float32)
        found = second_hypothesis._Found(swept, relief, better)
        assert second_hypothesis._taken(level, found)[part].mean() == share


def test_small_finds_are_never_called_measured():
    stages = [stage.run for stage in STAGES]
    # What comes back to itself is pardoned, and what is found is taken to.
    assert stages.index(evidence.with_pardoned) < stages.index(second_hypothesis.without_small)
    swept, measured = np.zeros((2, 60, 80), bool)
    whole, piece = np.s_[10:15, 20:60], np.s_[30:33, 20:50]
    swept[whole] = swept[piece] = measured[:, 10:] = True
    kept = second_hypothesis.without_small(swept, measured)
    assert not kept[piece].any()
    assert np.array_equal(kept | (swept & (np.arange(60) >= 30)[:, None]), measured)
    assert np.array_equal(second_hypothesis.without_small(swept & False, measured), measured)


@pytest.mark.acceptance  # compiles
def test_numpy_and_machine_code_give_the_same_bits(monkeypatch):
    shot, _ = railing()
    greys = (as_grey(image, "photo") for image in (shot.image1, shot.image2))
    frame = make_frame(shot.pair, *greys, shot.truth.grid)
    box = slice(60, 100), slice(20, 75)
    tried = plane_sweep.Hypotheses.near(frame, box, np.repeat(np.float32([-0.2, 0, 1.0]), 20))
    assert (np.diff(tried.numbers) > 1).any()  # relief jumps over what is left out
    found = []
    for compiled in (True, False):
        monkeypatch.setattr(type(plane_sweep._compare), "pays", lambda *_, way=compiled: way)
        found.append(plane_sweep.swept(frame, box, tried))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_straightening_keeps_a_bar_and_leaves_unknown_what_is():
    r = np.full((60, 60), -0.5, np.float32)
    r[:, 20:25] = 0.5
    r[:, 40:44] = np.nan
    straight = straightened(MapBands(r, np.full_like(r, 0.01), np.ones(r.shape, np.uint8))).r
    np.testing.assert_array_equal(straight[5:-5], r[5:-5])


def test_a_rail_hides_by_its_face_where_the_wall_behind_it_is_measured():
    grid = Grid.from_bounds((1.0, -0.2, 3.0, 0.2), gsd=0.004)
    rail = np.abs(grid.columns_x - 2.0) < 0.011
    r = np.where(rail, 1.0, 0.0) * np.ones((grid.height, 1))
    camera = Foot(np.array([0.0, 0.0]), 10.0)
    for measured in (True, False):
        flags = np.full(grid.shape, measured)
        surface = MapSurface.of_array(r.astype(np.float32), grid, flags)
        hidden = hidden_from(surface, grid, camera, r.astype(np.float32))[50]
        face = np.abs(grid.columns_x - 2.0 / 0.9) < 0.008  # Eq. (1): seen at 2 d / (d - r)
        below = (grid.columns_x > 2.03) & (grid.columns_x < 2.19)
        assert hidden[face].all()
        assert hidden[below].all() != measured
        assert hidden[below].any() != measured


@pytest.mark.parametrize("labels", [1, 7, 300])
def test_the_first_of_the_least_labels_is_chosen(labels):
    total = np.random.default_rng(3).integers(0, 40, (9, labels, 11)).astype(np.int16)
    assert np.array_equal(plane_sweep._best(total), total.argmin(1))
