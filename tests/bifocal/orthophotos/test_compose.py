"""The orthophoto itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rasterio

import bifocal
from bifocal import (
    GeometryError,
    Grid,
    InputError,
    Lens,
    OrthoOptions,
    Orthophoto,
    Pair,
    Photo,
    ReliefMap,
    Source,
)
from tests.bifocal.orthophotos.wall_scene import (
    colour_at,
    hidden_at,
    make_pair,
    photo_of,
    relief_at,
    wall_grid,
)

GSD = 0.01
MEASURED = OrthoOptions(measured_only=True)


@pytest.fixture(scope="module")
def wall() -> tuple[Pair, np.ndarray, np.ndarray, ReliefMap]:
    size = (620, 360)
    pair = make_pair(GSD, size, (0.55, 0.35))
    grid = wall_grid(GSD)
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    relief = ReliefMap.from_relief(relief_at(x, y), plane_from_pixel=grid.plane_from_pixel)
    return pair, photo_of(pair.image1, size), photo_of(pair.image2, size), relief


def expected(grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    seen = ~hidden_at(x, y, nadir=(-0.3, -0.9), distance=10.0, step=0.004)
    # Pixels beside a step or a shadow mix two surfaces in the photo: compare away from them.
    r = relief_at(x, y)
    rough = np.zeros(r.shape, bool)
    for axis in (0, 1):
        for shift in (-2, -1, 1, 2):
            rough |= np.abs(np.roll(r, shift, axis) - r) > 0.06
            rough |= np.roll(~seen, shift, axis)
    return colour_at(x, y), seen & ~rough


def test_colours_stand_where_the_wall_is_not_where_the_photo_shows_them(
    wall: tuple[Pair, np.ndarray, np.ndarray, ReliefMap],
) -> None:
    pair, far, _, relief = wall
    ortho = bifocal.orthophoto(pair, far, relief)
    colours, clear = expected(ortho.grid)
    assert ortho.grid == relief.grid
    assert (ortho.valid & clear).sum() > 0.7 * clear.size
    error = ortho.image[clear].astype(float) - colours[clear]
    assert np.median(np.abs(error)) < 1.0
    # Without relief the same pixels are wrong by tens of grey levels where it is 0.2 m or more.
    flat = bifocal.orthophoto(pair, far, gsd=GSD, bounds=relief.bounds)
    off = flat.image[clear].astype(float) - colours[clear]
    assert np.mean(np.abs(off)) > 10 * np.mean(np.abs(error))


def test_bias_is_below_two_hundredths_of_a_pixel(
    wall: tuple[Pair, np.ndarray, np.ndarray, ReliefMap],
) -> None:
    pair, far, _, relief = wall
    ortho = bifocal.orthophoto(pair, far, relief)
    colours, clear = expected(ortho.grid)
    grid = ortho.grid
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    step = 1e-4
    gx = (colour_at(x + step, y) - colour_at(x - step, y)) / (2 * step) * GSD
    gy = (colour_at(x, y + step) - colour_at(x, y - step)) / (2 * step) * GSD
    design = np.stack([gx[clear], gy[clear]], -1)
    error = ortho.image[clear].astype(float) - colours[clear]
    keep = np.abs(error) < 10
    shift = np.linalg.lstsq(design[keep], error[keep], rcond=None)[0]
    assert np.abs(shift).max() < 0.02


def test_hidden_pixels_are_empty_and_counted(
    wall: tuple[Pair, np.ndarray, np.ndarray, ReliefMap],
) -> None:
    pair, far, _, relief = wall
    masked = bifocal.orthophoto(pair, far, relief, options=MEASURED)
    ghosts = bifocal.orthophoto(pair, far, relief, options=replace(MEASURED, mask_hidden=False))
    assert masked.hidden.sum() > 500
    assert (masked.image[masked.hidden] == 0).all()
    assert (masked.source[masked.hidden] == 0).all()
    assert ghosts.valid[masked.hidden].all()


def test_filling_closes_the_holes_and_says_so(
    wall: tuple[Pair, np.ndarray, np.ndarray, ReliefMap],
) -> None:
    pair, far, _, relief = wall
    masked = bifocal.orthophoto(pair, far, relief, options=MEASURED)
    filled = bifocal.orthophoto(pair, far, relief, options=replace(MEASURED, fill=True))
    assert (filled.source[masked.hidden] == 4).mean() > 0.99
    kept = masked.valid
    np.testing.assert_array_equal(filled.image[kept], masked.image[kept])
    assert (filled.source[kept] == 1).all()


@pytest.mark.acceptance
def test_an_offset_near_photo_shows_what_the_far_one_cannot_see() -> None:
    size = (620, 360)
    pair = make_pair(GSD, size, (0.55, 0.35))
    right = Photo(plane_from_pixel=pair.image2.plane_from_pixel, nadir=(3.0, -0.9), distance=6.0)
    pair = Pair(image1=pair.image1, image2=right)
    far, near = photo_of(pair.image1, size), photo_of(pair.image2, size)
    grid = wall_grid(GSD)
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    relief = ReliefMap.from_relief(relief_at(x, y), plane_from_pixel=grid.plane_from_pixel)
    one = bifocal.orthophoto(pair, far, relief, options=MEASURED)
    both = bifocal.orthophoto(pair, (far, near), relief, options=replace(MEASURED, feather=2))
    gained = one.hidden & both.valid
    assert gained.sum() > 0.5 * one.hidden.sum()
    assert np.isin(both.source[gained], (2, 3)).all()
    error = np.abs(both.image[gained].astype(float) - colour_at(x, y)[gained])
    assert np.median(error) < 3
    assert (both.source[one.valid & ~gained] > 0).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_nadir_photo_over_a_flat_wall_comes_back_exactly(dtype: type) -> None:
    rng = np.random.default_rng(3)
    photo = rng.integers(0, np.iinfo(dtype).max, (301, 407, 3), dtype=dtype, endpoint=True)
    matrix = [[0.00369, 0, -0.75], [0, -0.00369, 0.61], [0, 0, 1]]
    far = Photo(plane_from_pixel=matrix, nadir=(0.1, -0.2), distance=17.5)
    near = Photo(plane_from_pixel=matrix, nadir=(0.1, -0.2), distance=9.5)
    ortho = bifocal.orthophoto(Pair(image1=far, image2=near), photo)
    np.testing.assert_array_equal(ortho.image, photo)
    assert ortho.gsd == pytest.approx(0.00369)


def test_a_photo_ends_half_a_pixel_beyond_its_outermost_pixels() -> None:
    # A wall seen 1:1, the orthophoto 3 px wider on every side: the photo's own pixels, no more.
    photo = np.full((30, 40), 200, np.uint8)
    matrix = [[0.01, 0, -0.2], [0, -0.01, 0.15], [0, 0, 1]]
    far, near = (Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=d) for d in (17.5, 9.5))
    ortho = bifocal.orthophoto(
        Pair(image1=far, image2=near), photo, gsd=0.01, bounds=(-0.235, -0.175, 0.225, 0.185)
    )
    wanted = np.zeros((36, 46), bool)
    wanted[3:33, 3:43] = True
    np.testing.assert_array_equal(ortho.valid, wanted)


def test_a_flat_wall_before_the_plane_is_the_photo_scaled_about_the_nadir() -> None:
    # r = 1 m at d = 11 m: a pixel at q shows P = q (1 - 1/11); 10/11 of the pixel size.
    ramp = np.tile(np.arange(220, dtype=np.uint8), (200, 1))
    matrix = [[0.011, 0, -0.011 * 100], [0, -0.011, 0.011 * 100], [0, 0, 1]]
    far = Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=11.0)
    near = Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=6.0)
    ortho = bifocal.orthophoto(
        Pair(image1=far, image2=near), ramp, 1.0, gsd=0.010, bounds=(-0.505, -0.505, 0.505, 0.505)
    )
    np.testing.assert_array_equal(ortho.image[50], np.arange(50, 151))


def test_an_oblique_distorted_photo_goes_through_one_map() -> None:
    # A smooth pattern on the wall, photographed by the camera model itself point by point.
    lens = Lens(
        camera_matrix=[[900, 0, 400], [0, 900, 300], [0, 0, 1]],
        coefficients=[-0.12, 0.03, 0.001, -0.0005],
        image_size=(800, 600),
    )
    turn = np.array([[0.006, 0.0004, -2.5], [0.0003, -0.0062, 1.9], [0.0, 0.00005, 1.0]])
    far = Photo(plane_from_pixel=turn, nadir=(-1.0, 0.4), distance=9.0, lens=lens)
    near = Photo(plane_from_pixel=turn, nadir=(-1.0, 0.4), distance=5.0, lens=lens)
    columns, rows = np.meshgrid(np.arange(800.0), np.arange(600.0))
    q = far.plane_from_pixels(np.stack([columns, rows], -1))
    share = 1 - 0.3 / 9.0
    p = far.nadir + (q - far.nadir) * share
    photo = np.rint(127 + 100 * np.sin(6 * p[..., 0]) * np.cos(5 * p[..., 1])).astype(np.uint8)
    ortho = bifocal.orthophoto(
        Pair(image1=far, image2=near), photo, 0.3, gsd=0.006, bounds=(-1.5, -1.0, 1.4, 1.2)
    )
    x, y = np.meshgrid(ortho.grid.columns_x, ortho.grid.rows_y)
    truth = 127 + 100 * np.sin(6 * x) * np.cos(5 * y)
    assert ortho.valid.all()
    # 0.02 px of a gradient of 3.6 levels a pixel is 0.07; rounding of both images is 0.4 rms.
    assert np.abs(ortho.image.astype(float) - truth).max() < 1.6
    assert abs(np.mean(ortho.image.astype(float) - truth)) < 0.02


def test_a_coarse_orthophoto_averages_instead_of_skipping() -> None:
    checks = ((np.indices((600, 600)).sum(0) % 2) * 255).astype(np.uint8)
    matrix = [[0.001, 0, 0], [0, -0.001, 0], [0, 0, 1]]
    far = Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=11.0)
    near = Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=6.0)
    ortho = bifocal.orthophoto(Pair(image1=far, image2=near), checks, gsd=0.01)
    assert np.abs(ortho.image[5:-5, 5:-5].astype(int) - 127).max() <= 1


def test_nonsense_is_refused(wall: tuple[Pair, np.ndarray, np.ndarray, ReliefMap]) -> None:
    pair, far, _, relief = wall
    with pytest.raises(InputError, match="uint8, uint16"):
        bifocal.orthophoto(pair, far.astype(float), relief)
    with pytest.raises(InputError, match="1 x 1 px is not a photo"):
        bifocal.orthophoto(pair, far[:1, :1], relief)
    with pytest.raises(InputError, match="another wall"):
        bifocal.orthophoto(pair, far, relief, bounds=(500, 500, 501, 501))
    with pytest.raises(InputError, match="relief map"):
        bifocal.orthophoto(pair, far, np.zeros((4, 4)))
    with pytest.raises(InputError, match="not one of"):
        OrthoOptions(interpolation="best")  # type: ignore[arg-type]
    tilted = Photo(
        plane_from_pixel=[[0.01, 0, 0], [0, -0.01, 0], [0, 0.01, -1]], nadir=(0, 0), distance=9.0
    )
    with pytest.raises(GeometryError, match="horizon"):
        bifocal.orthophoto(Pair(image1=tilted, image2=pair.image2), far)


def test_an_orthophoto_is_written_with_its_source_and_place(tmp_path) -> None:
    colours = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    place = Grid.from_bounds((0.0, 0.0, 2.0, 1.0), gsd=0.5).plane_from_pixel
    source = np.full((2, 4), Source.IMAGE_1, np.uint8)
    hidden = np.zeros((2, 4), bool)
    ortho = Orthophoto(image=colours, source=source, hidden=hidden, plane_from_pixel=place)
    ortho.write(tmp_path / "ortho.tif")
    with rasterio.open(tmp_path / "ortho.tif") as file:
        np.testing.assert_array_equal(file.read()[:3].transpose(1, 2, 0), colours)
        assert (file.read(4) == Source.IMAGE_1).all()
        assert file.transform == ortho.transform
