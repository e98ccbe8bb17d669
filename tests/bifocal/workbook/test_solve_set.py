"""`solve` with a set of photos: picks of as many photos in, one point out, the wrong pick named."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from openpyxl import Workbook

from bifocal import InputError, Photo, PhotoSet, Taking, WorkbookError, solve
from bifocal.cli.main import main
from bifocal.files.point_tables import read_survey_points

METRES = np.array([[0.0037, 0, -5.68], [0, -0.0037, 3.79], [0, 0, 1.0]])
STATIONS = {"far": (17.5, 0.0), "mid": (14.0, 0.0), "near": (9.5, 0.0), "aside": (9.5, 1.5)}
TURN = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # E = X, N = -r, H = Y
HEAD = ["id", *(f"{axis}{k} [px]" for k in range(1, 5) for axis in ("col", "row"))]


def wall(**more):
    photos = [
        Photo(name=name, plane_from_pixel=METRES, nadir=[x, 0], distance=d, image_size=(3072, 2048))
        for name, (d, x) in STATIONS.items()
    ]
    return PhotoSet(photos=tuple(photos), **more)


def measured(photos, count=12, sigma=0.5):
    rng = np.random.default_rng(3)
    xyz = rng.uniform([-4, -3, -0.8], [4, 3, 1.0], (count, 3))
    picks = np.stack(photos.project(xyz), axis=1)
    return xyz, picks + rng.normal(0, sigma, picks.shape)


def rows_of(picks):
    return [
        [f"P{k}", *("" if np.isnan(value) else f"{value:.4f}" for value in row.ravel())]
        for k, row in enumerate(picks, start=1)
    ]


@pytest.fixture
def files(tmp_path):
    """Return the folder of a set, and picks: P3 wrong in mid, P4 and P5 not seen everywhere."""
    photos = wall(orientation=np.diag(np.full(48, 1e-8)))
    photos.write(tmp_path / "wall.photos.json")
    _, picks = measured(photos)
    picks[2, 1] += [5, -6]
    picks[3, 2] = picks[4, 0] = picks[4, 1] = np.nan
    with (tmp_path / "points.csv").open("w", newline="") as file:
        csv.writer(file).writerows([HEAD, *rows_of(picks)])
    return tmp_path, picks


def run(*line):
    return CliRunner().invoke(main, [str(part) for part in line], catch_exceptions=False)


def test_a_table_of_picks_is_solved_and_the_wrong_photo_stands_in_the_note(files):
    folder, picks = files
    line = (
        "solve",
        folder / "points.csv",
        "--pair",
        folder / "wall.photos.json",
        "--sigma-px",
        0.5,
    )
    result = run(*line, "--json")
    assert result.exit_code == 0
    points = json.loads(result.stdout)["points"]
    photos = PhotoSet.read(folder / "wall.photos.json")
    own = photos.intersect(list(np.round(picks, 4).transpose(1, 0, 2)), sigma_px=0.5)
    np.testing.assert_allclose([[p[k] for k in "XYZ"] for p in points], own.xyz, atol=1e-12)
    np.testing.assert_allclose([p["sigma_r"] for p in points], own.sigma[:, 2], rtol=1e-12)
    assert [p["flag"] for p in points] == list(own.flags)
    assert points[2]["flag"] == "OFF-RADIAL"
    assert points[2]["note"].startswith("wrong pick in mid (")
    assert "P3: its rays miss each other" in result.stderr
    assert {"e1", "e2", "e3", "e4"} <= points[0].keys()
    foot = photos.photos[0].project([[points[0]["X"], points[0]["Y"], 0.0]])[0]
    np.testing.assert_allclose([points[0]["x_c"], points[0]["y_c"]], foot, atol=1e-9)


def test_displacements_count_from_the_nadir_of_each_photo(files):
    folder, _ = files
    table = solve(folder / "points.csv", pair=folder / "wall.photos.json").table
    for number, (d, x) in enumerate(STATIONS.values(), start=1):
        radius = np.hypot(table["X"] - x, table["Y"])  # similar triangles: e / s = r / d
        np.testing.assert_allclose(table[f"e{number}"], radius * table["r"] / (d - table["r"]))


def test_a_workbook_with_these_columns_and_columns_in_memory_give_the_same(files):
    folder, picks = files
    book = Workbook()
    book.active.append(HEAD)
    for name, *values in rows_of(picks):
        book.active.append([name, *(float(value) if value else None for value in values)])
    book.save(folder / "points.xlsx")
    keys = [head.split(" ")[0] for head in HEAD[1:]]
    columns = dict(zip(keys, np.round(picks, 4).reshape(len(picks), -1).T, strict=True))
    columns["id"] = [f"P{k}" for k in range(1, len(picks) + 1)]
    photos = PhotoSet.read(folder / "wall.photos.json")
    own = solve(folder / "points.csv", pair=photos).table
    for source in (folder / "points.xlsx", columns):
        table = solve(source, pair=photos).table
        np.testing.assert_allclose(table.xyz, own.xyz, atol=1e-12)
        assert table.flags == own.flags


@pytest.mark.parametrize("ending", ["csv", "xlsx"])
def test_results_go_on_to_exports(files, ending):
    folder, _ = files
    out = folder / f"result.{ending}"
    line = ("solve", folder / "points.csv", "--pair", folder / "wall.photos.json", "--out", out)
    assert run(*line).exit_code == 0
    points, _ = read_survey_points(out)
    own = solve(folder / "points.csv", pair=folder / "wall.photos.json").table
    np.testing.assert_allclose(points.xyz, own.xyz)
    assert "wrong pick in mid" in points.notes[2]
    assert run("export", out, "--out", folder / "points.dxf").exit_code == 0


def test_a_set_of_two_is_solved_as_its_pair_also_the_near_photo_first(tmp_path):
    both = wall()
    _, picks = measured(both)
    two = PhotoSet(photos=(both.photos[2], both.photos[0]))
    two.write(tmp_path / "two.photos.json")
    keys = ("col1", "row1", "col2", "row2")
    columns = dict(zip(keys, np.hstack([picks[:, 2], picks[:, 0]]).T, strict=True))
    pair = both.pair("far", "near")
    own = pair.intersect(picks[:, 0], picks[:, 2])
    for given in (two, tmp_path / "two.photos.json"):
        table = solve(columns, pair=given).table
        np.testing.assert_allclose(table.xyz, own.xyz, atol=1e-9)
        assert table.flags == own.flags


def test_control_points_place_the_set_with_what_its_orientation_has_in_common(tmp_path):
    scale = np.full(48, 1e-8)
    photos = wall(orientation=np.diag(scale))
    xyz, picks = measured(photos, count=20, sigma=0.3)
    book = Workbook()
    points, control = book.active, book.create_sheet("Georeference")
    points.title = "Points"
    for row in [HEAD, *rows_of(picks)]:
        points.append(row)
    control.append(["id", "E", "N", "H"])
    for k in range(0, 20, 3):
        control.append([f"P{k + 1}", *(xyz[k] @ TURN + [100, 200, 50])])
    book.save(tmp_path / "points.xlsx")
    solution = solve(tmp_path / "points.xlsx", pair=photos)
    assert solution.georeference is not None
    expected = xyz @ TURN + [100, 200, 50]
    deviates = (solution.world - expected) / solution.world_sigma
    assert 0.5 < np.sqrt(np.mean(deviates**2)) < 1.5


def test_what_cannot_be_solved_is_refused_with_its_place(files):
    folder, picks = files
    photos = folder / "wall.photos.json"
    with (folder / "half.csv").open("w", newline="") as file:
        rows = rows_of(picks)
        rows[0][4] = ""  # row2 of P1
        rows[1][3:] = [""] * 6  # P2 in far alone
        csv.writer(file).writerows([HEAD, *rows])
    with pytest.raises(WorkbookError) as raised:
        solve(folder / "half.csv", pair=photos)
    assert "half.csv › E2 (row2): point P1 lacks row2; complete it" in str(raised.value)
    assert "P2 is measured only on image 1; measure it on two photos or more" in str(raised.value)
    (folder / "one.csv").write_text("id,col1,row1,col3\nA,1,2,3\n")
    with pytest.raises(InputError, match=r"no column row3. Points of a set of 4 photos need"):
        solve(folder / "one.csv", pair=photos)
    (folder / "mm.csv").write_text("id,x1,y1,x2,y2\nA,1,2,3,4\n")
    with pytest.raises(InputError, match="no column col1"):
        solve(folder / "mm.csv", pair=photos)
    with pytest.raises(InputError, match="d1: belongs to a pair"):
        solve(folder / "points.csv", pair=photos, taking=Taking(d1=17.5))
    with pytest.raises(InputError, match="adjust_setup: belongs to a pair"):
        solve(folder / "points.csv", pair=photos, adjust_setup=True)
    five = {f"{axis}{k}": [1.0] for k in range(1, 6) for axis in ("col", "row")}
    with pytest.raises(InputError, match="picks of 5 photos for a set of 4"):
        solve(five, pair=photos)
    with pytest.raises(InputError, match="are measured in raw pixels"):
        solve({"x1": [1.0], "y1": [1.0], "x2": [1.0], "y2": [1.0]}, pair=photos)


def test_without_a_stated_precision_it_is_taken_from_the_misfits_of_the_best_pair():
    photos = wall()
    _, picks = measured(photos, count=80, sigma=0.3)
    columns = {
        f"{axis}{k + 1}": picks[:, k, i] for k in range(4) for i, axis in enumerate(("col", "row"))
    }
    found = solve(columns, pair=photos).sigma_px
    assert found == pytest.approx(0.3, abs=0.08)
    stated = replace(photos, photos=tuple(replace(p, sigma_pixel=0.4) for p in photos.photos))
    assert solve(columns, pair=stated).sigma_px is None


def test_photos_without_a_pick_change_nothing_and_cost_nothing(monkeypatch):
    """Three of 60 photos have picks: all pairs of the set were judged, of 300 for minutes."""
    three = wall(orientation=np.diag(np.full(48, 1e-8))).only([0, 1, 2])
    more = [replace(three.photos[k % 3], name=f"more {k}") for k in range(57)]
    many = PhotoSet(
        photos=(more[0], *three.photos, *more[1:]), orientation=np.diag(np.full(720, 1e-8))
    )
    _, picks = measured(three)
    picks[2, 1] += [5, -6]
    pixels = np.full((len(picks), 60, 2), np.nan)
    pixels[:, 1:4] = picks
    judged = []
    pairs_of = PhotoSet.pairs
    monkeypatch.setattr(PhotoSet, "pairs", lambda own: judged.append(len(own)) or pairs_of(own))

    def columns(values):
        named = {
            f"{axis}{k}": values[:, k - 1, i]
            for k in range(1, values.shape[1] + 1)
            for i, axis in enumerate(("col", "row"))
        }
        return {"id": [f"P{k}" for k in range(1, len(values) + 1)], **named}

    few, solved = (
        solve(columns(values), pair=photos) for values, photos in ((picks, three), (pixels, many))
    )
    assert max(judged) == 3
    np.testing.assert_allclose(solved.table.xyz, few.table.xyz, atol=1e-12)
    np.testing.assert_allclose(solved.table["sigma_r"], few.table["sigma_r"], rtol=1e-9)
    assert solved.table.flags == few.table.flags
    assert solved.points.note == few.points.note
    np.testing.assert_allclose(solved.table["e2"], few.table["e1"], atol=1e-9)
    apart = many.intersect(list(pixels.transpose(1, 0, 2)))
    assert apart.suspects.shape == (len(picks), 60)
    assert np.flatnonzero(apart.suspects[2]).tolist() == [2]
    assert np.isnan(apart.residuals[:, 4:]).all()
