"""Masks without specks, and pictures without gaps that say what is not measured."""

from __future__ import annotations

import numpy as np

from bifocal import Grid, MapSurface, OrthoOptions, Pair, Photo, ReliefMap, Source, orthophoto
from bifocal.orthophotos.tuning import TIDYING
from bifocal.orthophotos.visibility import tidied
from bifocal.orthophotos.whole_picture import CompletedSurface

METRES = [[0.01, 0, -1.995], [0, -0.01, 1.995], [0, 0, 1]]
PAIR = Pair(
    image1=Photo(plane_from_pixel=METRES, nadir=(0, 0), distance=17.5),
    image2=Photo(plane_from_pixel=METRES, nadir=(0, 0), distance=9.5),
)
GRID = Grid.from_bounds((-2.0, -2.0, 2.0, 2.0), gsd=0.01)


def wall_with_a_gap() -> ReliefMap:
    relief = np.full(GRID.shape, 0.2, np.float32)
    relief[100:130, 100:130] = np.nan  # a window in the wall
    relief[:, 320:] = np.nan  # what nobody measured
    return ReliefMap.from_relief(relief, plane_from_pixel=GRID.plane_from_pixel)


def test_specks_and_hair_lines_are_no_shadows_and_pinholes_are_closed():
    hidden = np.zeros((100, 100), bool)
    hidden[10:14, 10:14] = True  # 16 px
    hidden[30:32, 10:90] = True  # long, but nowhere 3 px wide
    hidden[50:60, 10:90] = True
    hidden[54:56, 40:44] = False
    kept = tidied(hidden)
    wanted = np.zeros_like(hidden)
    wanted[50:60, 10:90] = True
    np.testing.assert_array_equal(kept, wanted)
    assert TIDYING.least_area > 16


def test_a_completed_surface_goes_on_from_the_known_to_the_plane():
    relief = wall_with_a_gap()
    whole = CompletedSurface(MapSurface.of_array(relief.r, GRID), GRID, PAIR.image1, 0.01)
    r, source = whole.window(GRID), whole.source(GRID)
    known = relief.known
    np.testing.assert_array_equal(r[known], relief.r[known])
    np.testing.assert_allclose(r[100:130, 100:130], 0.2, atol=1e-3)
    assert np.abs(r[:, 320:322] - 0.2).max() < 0.02
    assert np.abs(np.diff(r[:, 319:], axis=1)).max() < 0.02  # no step anywhere
    np.testing.assert_allclose(r[:, 390:], 0.0, atol=1e-6)
    assert (source[known] == Source.NONE).all()
    assert (source[100:130, 100:130] == Source.INTERPOLATED).all()
    assert (source[:, 395:] == Source.PLANE).all()
    low, high = whole.extremes((-2.0, -2.0, 2.0, 2.0))
    assert low <= r.min()
    assert high >= r.max()


def test_interpolated_relief_is_left_out_only_where_that_moves_the_picture_little():
    # Crumbs of nothing measured: near the nadir, far from it; a broad pane; a single thin rail.
    relief = np.zeros(GRID.shape, np.float32)
    told = np.ones(GRID.shape, bool)
    near, far, pane, rail = (
        np.s_[195:201, 215:221], np.s_[20:30, 20:30], np.s_[180:220, 260:300], np.s_[60:64, 100:200]
    )  # fmt: skip
    for part, r in ((near, -0.1), (far, -0.2), (pane, -0.03), (rail, 0.4)):
        relief[part], told[part] = r, False
    surface = MapSurface.of_array(relief, GRID, told)
    whole = CompletedSurface(surface, GRID, PAIR.image1, 0.01)
    r, source = whole.window(GRID), whole.source(GRID)
    np.testing.assert_array_equal(r[told], relief[told])
    assert np.abs(r[near]).max() < 1e-3  # so near the nadir 1 mm on the picture, of 5
    np.testing.assert_allclose(r[22:28, 22:28], -0.2)  # 0.2 m x 2.5 m / 17.5 m: 29 mm
    np.testing.assert_allclose(r[182:218, 262:298], -0.03)  # broad
    np.testing.assert_allclose(r[62, 105:195], 0.4)
    for part in (near, far, pane, rail):
        assert (source[part] == Source.INTERPOLATED).all()
    assert (source[told] == Source.NONE).all()


def test_the_interpolated_rim_of_a_raised_part_is_no_crumb():
    # What a step hides from the near photo is not measured: a fringe on top of the raised part.
    x, y = np.meshgrid(np.arange(400), np.arange(400))
    raised, top = ((x > 40 - n) & (x < 90 + n) & (y > 150 - n) & (y < 250 + n) for n in (3, 0))
    relief = np.where(raised, 0.3, 0.0).astype(np.float32)
    surface = MapSurface.of_array(relief, GRID, top | ~raised)
    whole = CompletedSurface(surface, GRID, PAIR.image1, 0.01)
    np.testing.assert_allclose(whole.window(GRID)[raised], 0.3, atol=1e-6)


def test_a_complete_orthophoto_has_no_gap_and_lists_what_is_not_measured():
    rng = np.random.default_rng(3)
    photo = rng.integers(1, 255, (400, 400, 3), dtype=np.uint8)
    relief = wall_with_a_gap()
    plain = orthophoto(PAIR, photo, relief, options=OrthoOptions(measured_only=True))
    whole = orthophoto(PAIR, photo, relief, options=OrthoOptions())
    gap = np.zeros(GRID.shape, bool)
    gap[104:126, 104:126] = True
    assert not plain.valid[gap].any()
    assert (whole.source[gap] == Source.INTERPOLATED).all()
    assert (whole.source[20:380, 396:] == Source.PLANE).mean() > 0.9
    seen = plain.valid
    np.testing.assert_array_equal(whole.image[seen], plain.image[seen])
    assert (whole.source[seen] == Source.IMAGE_1).all()
    # On the plane the photo comes back as it is, square to the wall and pixel on pixel.
    np.testing.assert_array_equal(whole.image[100:300, 398], photo[100:300, 398])


def test_what_no_photo_shows_is_not_told_as_estimated():
    photo = np.full((400, 260, 3), 90, np.uint8)
    whole = orthophoto(PAIR, photo, wall_with_a_gap(), options=OrthoOptions())
    assert (whole.source[104:126, 104:126] == Source.INTERPOLATED).all()
    assert (whole.source[:, 270:] == Source.NONE).all()
