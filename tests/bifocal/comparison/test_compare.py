"""What has changed on a wall: found where it has, not where it has not, with honest numbers."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import cv2
import ezdxf
import numpy as np
import pytest
import rasterio
from click.testing import CliRunner
from openpyxl import load_workbook

from bifocal import Grid, InputError, Quality, ReliefMap, compare
from bifocal.comparison import workflow
from bifocal.comparison.chance import Patches, chance
from bifocal.comparison.change import without_parallax
from bifocal.comparison.photo_evidence import photos_at_hand
from bifocal.comparison.workflow import compare_files
from bifocal.files.made_from import PAIR_TAG, MadeFrom
from photocore.images import write_image
from tests.builders.commands import bifocal_command as bifocal
from tests.scenes import bifocal_cameras, render
from tests.scenes.facade import RICH
from tests.scenes.shapes import Scene, box

GRID = Grid.from_bounds((0.0, 0.0, 4.0, 3.0), gsd=0.04)
SIGMA = 0.003
#: 0.2 m2 of the wall.
PART = np.s_[25:36, 30:41]


def noise(rng: np.random.Generator) -> np.ndarray:
    """Return errors of variance 1 as dense relief has them: most hang together over 0.08 m."""
    wide = rng.standard_normal((2, GRID.height + 80, GRID.width + 80))
    parts = [cv2.GaussianBlur(field, (0, 0), radius)[40:-40, 40:-40]
             for field, radius in zip(wide, (1.0, 4.0), strict=True)]  # fmt: skip
    gains = [2 * np.sqrt(np.pi) * radius for radius in (1.0, 4.0)]
    own = rng.standard_normal(GRID.shape)
    return 0.95 * gains[0] * parts[0] + 0.2 * gains[1] * parts[1] + 0.25 * own


def measured(rng: np.random.Generator, *, moved: float = 0.0, offset: float = 0.0) -> ReliefMap:
    r = SIGMA * noise(rng) + offset
    r[PART] += moved
    flat = ReliefMap.from_relief(r, plane_from_pixel=GRID.plane_from_pixel)
    return replace(flat, sigma=np.full(GRID.shape, SIGMA))


def test_nothing_is_told_where_nothing_changed_and_a_bulge_of_three_sigma_is_found():
    moved, ratios = 3 * SIGMA * np.sqrt(2), []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        before = measured(rng)
        still = compare(before, measured(rng))
        assert still.regions == (), seed
        assert 0.04 < still.correlation_length < 0.2
        regions = compare(before, measured(rng, moved=moved)).regions
        if not regions:
            continue
        (bulge,) = regions
        # One of the ten is outlined by patches of twice the width: its middle is as coarse.
        assert pytest.approx((1.4, 1.8), abs=0.2) == (bulge.X, bulge.Y)
        assert bulge.area == pytest.approx(0.1936, abs=3.5 * bulge.sigma_area)
        assert bulge.sigma_area < bulge.area
        ratios.append((bulge.volume - 0.1936 * moved) / bulge.sigma_volume)
    # The mean of four errors in sigmas is good to 0.5, their root mean square to 0.35.
    assert len(ratios) >= 3
    assert np.abs(np.mean(ratios)) < 1.9
    assert 0.2 < np.sqrt(np.mean(np.square(ratios))) < 2.6


def test_what_only_larger_patches_prove_is_a_region_with_its_volume():
    """A sheet of 0.56 m2 that came forward by 1.6 standard deviations of a map's pixel."""
    fine, moved, wide = (
        GRID.plane_from_pixel * [[0.5], [0.5], [1]],
        1.6 * SIGMA,
        np.s_[15:50, 30:70],
    )
    for seed in range(2):
        rng = np.random.default_rng(seed)
        before, after = (replace(measured(rng), plane_from_pixel=fine) for _ in range(2))
        r = after.r.copy()
        r[wide] += moved
        (sheet,) = compare(before, replace(after, r=r)).regions
        assert sheet.area == pytest.approx(0.56, abs=2 * sheet.sigma_area)
        assert sheet.volume == pytest.approx(0.56 * moved, abs=2 * sheet.sigma_volume)
        assert sheet.sigma_volume < 0.25 * 0.56 * moved


def test_holes_of_a_region_count_and_its_measured_share_is_told():
    rng = np.random.default_rng(3)
    before, after = measured(rng), measured(rng, moved=0.03)
    quality = after.quality.copy()
    quality[28:33, 33:38] = Quality.INTERPOLATED
    whole, (bulge,) = 0.1936 * 0.03, compare(before, replace(after, quality=quality)).regions
    assert bulge.volume == pytest.approx(whole, abs=3 * bulge.sigma_volume)
    assert bulge.sigma_volume < 0.15 * whole
    assert bulge.measured == pytest.approx(1 - 25 / 121, abs=0.05)


def test_a_change_that_may_go_on_where_nothing_was_measured_is_told_so():
    rng = np.random.default_rng(3)
    before, after = measured(rng), measured(rng, moved=0.03)
    done = compare(before, after)
    assert done.regions[0].open_rim == 0
    assert not done.remarks
    quality = after.quality.copy()
    quality[20:, 36:60] = Quality.INTERPOLATED
    done = compare(before, replace(after, quality=quality))
    (half,) = done.regions
    # 6 of 11 columns are left: one of four sides is open, and corners.
    assert half.open_rim == pytest.approx(11 / 34, abs=0.1)
    assert half.volume == pytest.approx(66 * GRID.gsd**2 * 0.03, abs=3 * half.sigma_volume)
    # Five columns go on where nothing was measured: the whole lies within its sigmas as well.
    assert 0.1936 * 0.03 - half.volume == pytest.approx(0, abs=2 * half.sigma_volume)
    assert 0.1936 - half.area == pytest.approx(0, abs=2 * half.sigma_area)
    assert half.sigma_mean < 0.2 * half.mean
    assert "region 1: much of the rim" in done.remarks[-1]


def test_what_would_have_been_found_is_found_where_the_wall_is_as_sure_as_it_says():
    """Half of the wall is measured to 3 mm, half of it to 9: two changes that tell these apart."""
    rng = np.random.default_rng(6)
    before, after = measured(rng), measured(rng)
    coarse = np.where(np.arange(GRID.width) < 45, 3.0, 1.0)
    maps = [replace(one, r=one.r * coarse, sigma=one.sigma * coarse) for one in (before, after)]
    area, half, most = compare(*maps).patches[2]
    assert 2 * half < most < 4 * half
    assert workflow._least(half) == f"from {1000 * half:.1f} mm"
    assert workflow._least(np.inf) == "none"
    x, y = np.meshgrid(GRID.columns_x, GRID.rows_y)
    discs = [np.hypot(x - middle, y - 1.5) ** 2 < area / np.pi for middle in (0.9, 2.9)]
    moved = replace(maps[1], r=maps[1].r + 1.4 * half * np.any(discs, axis=0))
    (fine,) = compare(maps[0], moved).regions
    assert pytest.approx(2.9, abs=0.1) == fine.X


def test_a_few_places_that_err_by_far_more_than_most_raise_the_limit():
    """Two walls of one variance and much the same correlation, one of them with long tails."""
    z = noise(np.random.default_rng(2))
    patches = Patches(np.ones(GRID.shape, bool), (1.0, 2.0))
    limits = []
    for field in (z, z**3):
        field = field / field.std()
        limits.append(
            chance(field, field == field, patches, 1.0, np.random.default_rng(1)).limit(0.01)
        )
    assert limits[1] > 1.2 * limits[0]


def test_a_region_that_moves_the_photos_no_more_than_errors_elsewhere_is_none():
    labels = np.zeros((40, 60), np.int64)
    labels[5:15, 5:15], labels[5:15, 25:35] = 1, 2
    moved = np.where(labels == 1, 0.3, np.where(labels == 2, 0.7, 0.05))
    moved[25:35, 40:50] = -0.5
    wall = np.ones(labels.shape, bool)
    assert without_parallax(moved, wall, labels, Patches(wall, (1.0, 2.0))) == [1]


def test_two_surfaces_that_both_stand_there_are_no_change_and_what_was_taken_away_is_one():
    """A column 0.3 m wide and 2 m before the wall: one date shows its edge, the other the wall."""
    rng = np.random.default_rng(4)
    before, after = measured(rng), measured(rng)
    seen = [before.r.copy(), after.r.copy()]
    for r, left in zip(seen, (40, 43), strict=True):
        r[:, left : left + 8] += 2.0
    before, after = (replace(one, r=r) for one, r in zip((before, after), seen, strict=True))
    done = compare(before, after)
    assert done.regions == ()
    assert (done.region == -1).sum() >= 75 * 2  # beside a step a pixel may be of either side anyway
    assert "0.24 m2" in done.remarks[0]
    assert "another surface" in done.remarks[0]
    block = replace(
        after, r=np.where(np.isin(np.arange(100), range(10, 16)), after.r - 0.2, after.r)
    )
    (hole,) = compare(before, block).regions
    assert hole.volume == pytest.approx(-0.2 * 6 * 75 * 0.04**2, rel=0.05)


def test_a_change_that_the_photos_of_both_dates_do_not_show_is_none(tmp_path: Path):
    """A block of 0.4 m on a wall: photographed at the second date, or in its relief alone."""
    rng, dates, maps = np.random.default_rng(8), [], []
    for name, depth in (("before", 0.0), ("after", 0.4)):
        wall = Scene(wall=RICH.stone, texel=0.02, seed=3)
        if depth:
            wall.add(box((1.2, 2.0), (-0.4, 0.4), (-0.1, depth), RICH.stone))
        taken = render(wall, bifocal_cameras(size=(240, 160), pixel=0.03), rng=rng)
        for number, image in enumerate((taken.image1, taken.image2), start=1):
            write_image(tmp_path / f"{name}{number}.png", image)
        images = [replace(image, file=f"{name}{k}.png", folder=tmp_path) for k, image in
                  enumerate((taken.pair.image1, taken.pair.image2), start=1)]  # fmt: skip
        dates.append(replace(taken.pair, image1=images[0], image2=images[1], folder=tmp_path))
        r = taken.truth.r + rng.normal(0, 0.01, taken.truth.shape)
        flat = ReliefMap.from_relief(r, plane_from_pixel=taken.truth.plane_from_pixel)
        maps.append(replace(flat, sigma=np.full(flat.shape, 0.01)))
    (block,) = compare(*maps, dates=(dates[0], dates[1])).regions
    assert block.volume == pytest.approx(0.4 * 0.8**2, rel=0.1)
    done = compare(*maps, dates=(dates[0], dates[0]))
    assert done.regions == ()
    assert (done.region == -1).sum() * 0.03**2 == pytest.approx(0.8**2, rel=0.15)
    assert "1 regions" in done.remarks[-1]


def test_offset_and_tilt_come_off_by_stable_parts_and_are_told_without_them():
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(GRID.columns_x, GRID.rows_y)
    before, after = measured(rng), measured(rng, moved=0.02, offset=0.015)
    after = replace(after, r=after.r + 0.002 * (x - 2.0) - 0.001 * (y - 1.5))
    (remark,) = compare(before, after).remarks
    assert "+15." in remark or "+14." in remark
    still = [[(0, 0), (4, 0), (4, 1), (0, 1)], [(2.2, 1), (4, 1), (4, 3), (2.2, 3)]]
    for done in (compare(before, after, fit=True), compare(before, after, stable=still)):
        (bulge,) = done.regions
        assert bulge.mean == pytest.approx(0.02, abs=3 * bulge.sigma_mean)
        errors = np.subtract(done.trend, (0.015, 0.002, -0.001))
        assert (np.abs(errors) < 4 * np.array(done.sigma_trend)).all()
        assert done.remarks == ()
    with pytest.raises(InputError, match="too little"):
        compare(before, after, stable=[[(0, 0), (0.2, 0), (0.2, 0.2)]])


def test_only_what_both_dates_measured_is_compared_on_the_coarser_grid():
    rng = np.random.default_rng(9)
    before, after = measured(rng), measured(rng, moved=0.03)
    quality = np.array(after.quality)
    quality[PART] = Quality.INTERPOLATED
    done = compare(before, replace(after, quality=quality))
    assert done.regions == ()
    assert np.isnan(done.difference.r[PART]).all()
    finer = Grid.from_bounds(GRID.bounds, gsd=0.02)
    r, sigma = (np.repeat(np.repeat(part, 2, 0), 2, 1) for part in (after.r, after.sigma))
    fine = ReliefMap.from_relief(r, plane_from_pixel=finer.plane_from_pixel)
    fine = replace(fine, sigma=sigma)
    for pair, sign in (((before, fine), 1), ((fine, before), -1)):
        done = compare(*pair)
        assert done.difference.gsd == 0.04
        assert [round(sign * one.mean, 2) for one in done.regions] == [0.03]
    away = ReliefMap.from_relief(r, plane_from_pixel=finer.window(900, 0, 9, 9).plane_from_pixel)
    with pytest.raises(InputError, match="in common"):
        compare(before, away)


def test_maps_without_sigma_take_it_from_their_differences():
    rng = np.random.default_rng(3)
    before, after = (replace(measured(rng, moved=m), sigma=np.zeros(GRID.shape)) for m in (0, 0.02))
    done = compare(before, after)
    assert [round(one.mean, 2) for one in done.regions] == [0.02]
    assert "without standard deviations" in done.remarks[0]


@pytest.mark.parametrize(("values", "where"), [(-0.003, "sigma"), (3e38, "r"), (np.inf, "r")])
def test_a_map_that_cannot_be_a_relief_is_refused_without_a_warning(values: float, where: str):
    whole = measured(np.random.default_rng(1))
    spoilt = getattr(whole, where).copy()
    spoilt[3, 3] = values
    with pytest.raises(InputError, match="make it anew"):
        compare(replace(whole, **{where: spoilt}), whole)


def test_errors_that_hang_together_over_all_that_is_measured_are_no_reason_to_refuse():
    wide = np.random.default_rng(1).standard_normal((GRID.height + 200, GRID.width + 200))
    field = cv2.GaussianBlur(wide, (0, 0), 20)[100:-100, 100:-100]
    field[:, GRID.width // 4 :] = np.nan  # two such errors are all there is of it
    flat = ReliefMap.from_relief(0 * field, plane_from_pixel=GRID.plane_from_pixel)
    before = replace(flat, sigma=np.full(GRID.shape, SIGMA))
    after = replace(before, r=before.r + SIGMA * field / np.nanstd(field))
    assert compare(before, after).regions == ()


def test_a_patch_larger_than_the_wall_is_refused():
    whole = measured(np.random.default_rng(1))
    with pytest.raises(InputError, match="whole wall of 12 m2"):
        compare(whole, whole, smallest=1e9)


def test_stable_parts_and_a_fit_of_the_whole_are_not_both_taken(tmp_path: Path):
    with pytest.raises(InputError, match="give one of them"):
        compare_files(tmp_path / "a.tif", tmp_path / "b.tif", tmp_path, stable=tmp_path, fit=True)


@pytest.mark.acceptance
@pytest.mark.parametrize("language", ["en", "it", "de"])
def test_the_folder_tells_the_same_in_every_file(tmp_path: Path, language: str):
    rng = np.random.default_rng(2)
    measured(rng).write(tmp_path / "relief2019.tif")
    measured(rng, moved=-0.02).write(tmp_path / "relief2024.tif")
    names = [str(tmp_path / f"relief{year}.tif") for year in (2019, 2024)]
    out = tmp_path / "changed"
    line = ["compare", *names, "--out", str(out), "--language", language, "--json"]
    told = CliRunner().invoke(bifocal, line)
    assert told.exit_code == 0, told.stderr
    (region,) = json.loads(told.stdout)["regions"]
    assert region["mean"] == pytest.approx(-0.02, abs=3 * region["sigma_mean"])
    with rasterio.open(out / "difference.tif") as file:
        bands, cell = file.read(), file.res[0] ** 2
        assert file.descriptions[0] == "difference [m]"
    inside = bands[2] == 1
    assert inside.sum() * cell == pytest.approx(region["area"])
    # The volume holds what the outline cuts off of its rim, too.
    assert np.nansum(bands[0][inside]) * cell == pytest.approx(region["volume"], rel=0.02)
    (row,) = csv.DictReader((out / "regions.csv").read_text().splitlines())
    assert float(row["volume [m3]"]) == pytest.approx(region["volume"])
    sheet = load_workbook(out / "regions.xlsx")["Regions"]
    assert sheet.cell(2, 6).value == pytest.approx(region["volume"])
    lines = ezdxf.readfile(out / "regions.dxf").modelspace().query("LWPOLYLINE")
    layers = {line.dxf.layer for line in lines}
    assert layers == {"BIFOCAL_BACK", "BIFOCAL_CONTOURS_10MM"}
    page = (out / "report.html").read_text()
    words = {"en": "Changed regions: 1", "it": "Regioni cambiate: 1", "de": "Bereiche: 1"}
    assert words[language] in page
    assert (out / "report.pdf").read_bytes().startswith(b"%PDF")


def test_a_change_is_told_once_where_maps_differ_by_nothing_else():
    """Larger patches about a change show it as well."""
    before = measured(np.random.default_rng(3))
    r = np.array(before.r)
    r[PART] += 0.06
    (one,) = compare(before, replace(before, r=r)).regions
    assert one.volume == pytest.approx(0.06 * 121 * GRID.gsd**2, rel=0.01)


def test_photos_beside_the_maps_are_asked_and_their_absence_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The same photos at both dates, and a map with a block that none of them shows."""
    monkeypatch.setattr(workflow, "write_document", lambda *_: None)  # half of the time
    rng = np.random.default_rng(8)
    taken = render(
        Scene(wall=RICH.stone, texel=0.02, seed=3),
        bifocal_cameras(size=(240, 160), pixel=0.03),
        rng=rng,
    )
    paths = [tmp_path / date / "relief.tif" for date in ("before", "after")]
    for path, depth in zip(paths, (0.0, 0.4), strict=True):
        path.parent.mkdir()
        images = []
        for number, photo in enumerate((taken.pair.image1, taken.pair.image2), start=1):
            file = path.with_name(f"{number}.png")
            write_image(file, (taken.image1, taken.image2)[number - 1])
            images.append(replace(photo, file=file.name, folder=path.parent))
        pair = replace(taken.pair, image1=images[0], image2=images[1], folder=path.parent)
        pair.write(path.with_name("wall.pair.json"))
        r = taken.truth.r + rng.normal(0, 0.01, taken.truth.shape)
        r[40:70, 40:70] += depth
        flat = ReliefMap.from_relief(r, plane_from_pixel=taken.truth.plane_from_pixel)
        tags = {PAIR_TAG: "wall.pair.json", **MadeFrom.of(images).tags()}
        replace(flat, sigma=np.full(flat.shape, 0.01)).write(path, tags=tags)
    names = [path.with_name("wall.pair.json") for path in paths]
    for path, name in zip(paths, names, strict=True):
        digests = [[p.digest for p in photos_at_hand(of, path).photos] for of in (path, name)]
        assert digests[0] == digests[1]
    done = compare_files(*paths, tmp_path / "out").comparison
    assert done.regions == ()
    assert "1 regions" in done.remarks[-1]
    # Another orientation: the map named alone is taken by itself, the pair is refused.
    moved = replace(pair, image2=replace(pair.image2, distance=1.01 * pair.image2.distance))
    moved.write(names[1], overwrite=True)
    with pytest.raises(InputError, match=r"relief\.tif: was made from another pair"):
        photos_at_hand(names[1], paths[1])
    names[0].write_text("{")
    assert photos_at_hand(paths[0], paths[0]) is None
    done = compare_files(*paths, tmp_path / "out", overwrite=True).comparison
    assert len(done.regions) == 1
    assert "the maps alone" in done.remarks[-1]
