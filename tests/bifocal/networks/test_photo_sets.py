"""Photos of one wall set up together: as precise as said, in any order, refused with a reason."""

from __future__ import annotations

import csv
import json
from contextlib import chdir
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from bifocal import (
    SAMPLE,
    Control,
    InputError,
    Interior,
    Lens,
    Pair,
    PhotoSet,
    Pinhole,
    SetAlignment,
    align,
    align_set,
    read_control,
    read_image,
)
from bifocal.model.orientation_precision import CAMERA
from bifocal.networks.camera_knowledge import CameraKnowledge
from bifocal.networks.joint_adjustment import JointUnknowns, adjust_jointly
from bifocal.networks.joint_observations import JointObservations
from bifocal.networks.photo_influence import dragging_photo
from bifocal.networks.set_orientation import turned_set
from bifocal.networks.set_start import promise_of
from bifocal.orientation.adjustment.frame_turn import line_equations
from bifocal.orientation.facade_lines import FacadeDirection
from tests.bifocal.campaigns.sample_tables import write_tables
from tests.builders.commands import bifocal_command as main
from tests.builders.pinholes import camera_matrix, project, rotation_from_vector
from tests.cases import few_by_default
from tests.scenes.make_sample import PIXEL

SIZE = (3072, 2048)
#: 35, 28 and 19 mm at one scale, and 19 mm from a step aside.
STANDS = ((35, 0.0, 17.5), (28, 0.0, 14.0), (19, 0.0, 9.5), (19, 1.5, 9.5))


def test_a_set_begins_with_two_distances_and_not_with_the_widest_base():
    """Two photos 4 m apart at one distance meet at wider angles than far and near, and are none."""
    rng = np.random.default_rng(4)
    xyz = rng.uniform((-3, -2, -0.4), (3, 2, 0.4), (200, 3))
    rays = []
    for x, z, mm in ((0.0, 17.5, 35), (-2.0, 9.5, 19), (2.05, 9.6, 19)):
        interior = Interior.from_focal(226.0 * mm, image_size=SIZE, sigma=0.005, source=f"{mm} mm")
        turn = np.diag([1.0, -1, -1]) @ rotation_from_vector([0, -np.arctan(x / z), 0])
        camera = Pinhole(interior.matrix, turn, np.array([x, 0.0, z]))
        rays.append((interior, project(camera, xyz) + rng.normal(0, 0.3, (200, 2))))
    (far, f), (near, n), (beside, b) = rays
    assert promise_of(far, near, f, n) > 2 * abs(promise_of(near, beside, n, b)) > 0
    assert promise_of(near, far, n, f) < 0


def simulated(rng: np.random.Generator, *, by_wall: bool):
    """Return observations of four photos, a start, true cameras, and true points."""
    lens = (0, 1, 2, 2)
    focals = np.array([5.0 / 0.0221 * mm for mm in (35, 28, 19)]) * np.exp(rng.normal(0, 0.005, 3))
    bent = rng.normal(0, 0.01, 3)
    xyz = np.column_stack([rng.uniform(-3.3, 3.3, 300), rng.uniform(-2.2, 2.2, 300), np.zeros(300)])
    xyz[100:, 2] = rng.uniform(-0.6, 0.8, 200)
    interiors, cameras, raw = [], [], []
    for (mm, x, z), own in zip(STANDS, lens, strict=True):
        nominal = Interior.from_focal(
            5.0 / 0.0221 * mm, image_size=SIZE, sigma=0.005, source=f"{mm} mm"
        )
        interiors.append(replace(nominal, sigma_radial=0.01, sigma_centre=3.0))
        middle = nominal.centre + rng.normal(0, 3.0, 2)
        turn = np.diag([1.0, -1, -1]) @ rotation_from_vector([0, -np.arctan(x / z), 0])
        turn = turn @ rotation_from_vector(rng.normal(0, 0.003, 3))
        matrix = camera_matrix(focals[own], np.exp(rng.normal(0, 0.001)) if own < 2 else 1.0,
                               *middle)  # fmt: skip
        cameras.append(Pinhole(matrix, turn, np.array([x, 0.0, z]) + rng.normal(0, 0.05, 3)))
        raw.append(interiors[-1].radial(bent[own]).distort(project(cameras[-1], xyz)))
    rays = [(k, p) for k, pixels in enumerate(raw) for p, (c, r) in enumerate(pixels)
            if 0 < c < SIZE[0] and 0 < r < SIZE[1]]  # fmt: skip
    camera, point = np.array(rays).T
    pixels = np.array([raw[k][p] for k, p in rays]) + rng.normal(0, 0.3, (len(rays), 2))
    known, sigma = np.full((300, 3), np.nan), np.full((300, 3), 0.003)
    if by_wall:
        known[:100, 2] = rng.normal(0, 0.003, 100)
    else:
        known[90:110] = xyz[90:110] + rng.normal(0, 0.003, (20, 3))
    return (
        JointObservations(
            names=tuple("abcd"), camera=camera, point=point, pixels=pixels,
            sigma=np.full(len(rays), 0.3), ids=tuple(f"P{k}" for k in range(300)), known=known,
            sigma_known=sigma, sigma_focal=np.zeros(4),
            cameras=CameraKnowledge(
                interiors=tuple(interiors), lens=lens, by_wall=by_wall,
                held={0: ("X", "Y", "turn Z")} if by_wall else {},
                distances=(({0: 1.0}, cameras[0].centre[2] + rng.normal(0, 0.005), 0.005),),
                lengths=((2, 97, np.linalg.norm(xyz[2] - xyz[97]) + rng.normal(0, 0.002), 0.002),),
            ),
        ),
        JointUnknowns(
            cameras=tuple(
                c._replace(matrix=camera_matrix(i.focal, 1.0, *i.centre))
                for c, i in zip(cameras, interiors, strict=True)
            ),
            xyz=xyz + rng.normal(0, 0.02, xyz.shape), radial=np.zeros((4, 2)),
        ),
        cameras, xyz,
    )  # fmt: skip


@pytest.mark.parametrize("by_wall", few_by_default([False, True], True))
def test_cameras_and_points_of_a_set_are_as_precise_as_their_sigmas_say(by_wall):
    centres, focals, points = [], [], []
    for seed in range(8):
        seen, start, cameras, xyz = simulated(np.random.default_rng(seed), by_wall=by_wall)
        got = adjust_jointly(seen, start)
        sigma = np.sqrt(np.diag(got.of_cameras)).reshape(4, -1)
        spread = np.sqrt(np.diagonal(got.covariance, axis1=1, axis2=2))
        off = (got.xyz - xyz) / spread
        points.append(np.nanmean(off**2))
        for k, (one, true) in enumerate(zip(got.cameras, cameras, strict=True)):
            focals.append(np.log(one.matrix[0, 0] / true.matrix[0, 0]) / sigma[k, 0])
            free = sigma[k, 7:10] > 0
            centres += ((one.centre - true.centre)[free] / sigma[k, 7:10][free]).tolist()
        # One lens is one unknown; each photo has a principal point of its own.
        place = 2 * len(CAMERA), 3 * len(CAMERA)
        assert got.of_cameras[place] == pytest.approx(got.of_cameras[place[0], place[0]])
        assert got.of_cameras[place[0] + 2, place[1] + 2] < 0.9 * sigma[2, 2] * sigma[3, 2]
    for ratio in (np.sqrt(np.mean(np.square(centres))), np.sqrt(np.mean(np.square(focals)))):
        assert 0.75 < ratio < 1.25
    assert 0.85 < np.sqrt(np.mean(points)) < 1.15


def test_a_photo_that_drags_the_others_is_named_and_no_honest_one():
    """The sensor of the far photo is bent by 2 px, as by another photo's lens file."""
    seen, start, _, _ = simulated(np.random.default_rng(1), by_wall=False)
    assert dragging_photo(adjust_jointly(seen, start)) is None
    pixels, rays = seen.pixels.copy(), seen.camera == 0
    along = (pixels[rays] - [1536, 1024]) / 1536
    pixels[rays] += 2 * along[:, :1] * along[:, ::-1]
    photo = dragging_photo(adjust_jointly(replace(seen, pixels=pixels), start))
    assert photo is not None
    assert photo.name == "a"
    assert photo.test > 4
    assert photo.moved > 0.005


def test_lines_turn_the_frame_of_a_set_and_neither_its_lenses_nor_its_relative_orientation():
    seen, start, *_ = simulated(np.random.default_rng(1), by_wall=True)
    before = adjust_jointly(seen, start)
    leaning = np.array([0.0, 1.0, np.tan(0.02)])
    lines = [
        FacadeDirection(
            camera=k + 1, name="upright", direction=before.cameras[k].rotation @ leaning,
            sigma=1e-6, count=50,
        )
        for k in (0, 2)
    ]  # fmt: skip
    after = turned_set(before, lines)
    assert abs(line_equations(lines, before.cameras)[0]).min() > 1e4
    assert abs(line_equations(lines, after.cameras)[0]).max() < 10
    first, *others = (a.rotation for a in after.cameras)
    was, *were = (b.rotation for b in before.cameras)
    for turned, old in zip(others, were, strict=True):
        assert turned @ first.T == pytest.approx(old @ was.T, abs=1e-12)
    bases = [np.array([c.centre - one.cameras[0].centre for c in one.cameras[1:]])
             for one in (before, after)]  # fmt: skip
    lengths = [np.linalg.norm(base, axis=1) for base in bases]
    assert lengths[1] / lengths[0] == pytest.approx(lengths[1][0] / lengths[0][0])
    for a, b in zip(after.cameras, before.cameras, strict=True):
        assert (a.matrix == b.matrix).all()
        used = np.isfinite(before.xyz).all(axis=1)
        assert project(a, after.xyz[used]) == pytest.approx(project(b, before.xyz[used]), abs=1e-6)
    turn = CAMERA.index("turn X")
    spread = [np.sqrt(one.of_cameras[turn, turn]) for one in (before, after)]
    assert spread[1] < 0.5 * spread[0]  # what is left is between the photos


def test_a_length_between_two_points_of_one_photo_is_the_scale_of_a_set():
    """Nothing checks its ends: points off the wall must not call them gross, nor take it along."""
    seen, start, cameras, xyz = simulated(np.random.default_rng(2), by_wall=True)
    rays = [int(np.flatnonzero((seen.camera == 0) & (seen.point == k))[0]) for k in range(100)]
    across = xyz[:100, 0]
    rays = [rays[int(across.argmin())], rays[int(across.argmax())]]
    ends, pixels = xyz[seen.point[rays]], seen.pixels[rays]
    length = float(np.linalg.norm(ends[1] - ends[0]))
    with_ends = replace(
        seen, camera=np.r_[seen.camera, 0, 0], point=np.r_[seen.point, 300, 301],
        pixels=np.vstack([seen.pixels, pixels]), sigma=np.r_[seen.sigma, 0.3, 0.3],
        ids=(*seen.ids, "one end", "other end"),
        known=np.vstack([seen.known, [[np.nan, np.nan, 0.0]] * 2]),
        sigma_known=np.vstack([seen.sigma_known, np.full((2, 3), 0.003)]),
        cameras=replace(seen.cameras, distances=(), lengths=((300, 301, length, 0.002),)),
    )  # fmt: skip
    got = adjust_jointly(with_ends, replace(start, xyz=np.vstack([start.xyz, ends])))
    assert not any(blunder.point in ("one end", "other end") for blunder in got.blunders)
    sigma = np.sqrt(np.diag(got.of_cameras)).reshape(4, -1)
    for k, (one, true) in enumerate(zip(got.cameras, cameras, strict=True)):
        assert sigma[k, 9] < 0.01 * true.centre[2]
        assert abs(one.centre[2] - true.centre[2]) < 4 * sigma[k, 9]


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    """Far and near photo of the sample at half size, and the far one turned where it stood."""
    folder = tmp_path_factory.mktemp("set")
    far, near = (read_image(SAMPLE / f"{name}.jpg") for name in ("far", "near"))
    half = [cv2.resize(p, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for p in (far, near)]
    size = (half[0].shape[1], half[0].shape[0])
    matrix = camera_matrix(17.5 / (2 * PIXEL), 1.0, (size[0] - 1) / 2, (size[1] - 1) / 2)
    turn = rotation_from_vector([0.01, -0.02, 0.05])
    carried = matrix @ turn @ np.linalg.inv(matrix)
    half.insert(1, cv2.warpPerspective(half[0], carried, size, flags=cv2.INTER_CUBIC))
    for name, photo in zip(("near", "turned", "far"), half[::-1], strict=True):
        cv2.imwrite(str(folder / f"{name}.png"), photo[..., ::-1])
    control, _ = write_tables(folder)
    with control.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with (folder / "set.csv").open("w", encoding="utf-8") as file:
        file.write("id,X [m],Y [m],r [m],col1,row1,col2,row2,col3,row3\n")
        for row in rows:
            picks = [(float(row[f"{a}{k} [px]"]) - 0.5) / 2 for k in (2, 1) for a in ("col", "row")]
            place = (row[name] for name in ("id", "X [m]", "Y [m]", "r [m]"))
            near_far = (*map(str, picks[:2]), "", "", *map(str, picks[2:]))
            file.write(",".join((*place, *near_far)) + "\n")
    return folder, half[::-1]


@pytest.mark.acceptance
def test_three_photos_in_any_order_become_a_set_its_points_and_report(three, monkeypatch):
    folder, _ = three
    monkeypatch.chdir(folder)
    focal = {place: f"{place / (2 * PIXEL) / 100:.6g}" for place in (9.5, 17.5)}
    line = ["facade", "near.png", "turned.png", "far.png", "--control", "set.csv", "--focal1",
            focal[9.5], "--focal", focal[17.5], "--pixel-size", "0.01", "--distance1", "9.5",
            "--products", "points,report", "--out", "porch"]  # fmt: skip
    result = CliRunner().invoke(main, line)
    assert result.exit_code == 0, result.output
    near, turned, far = PhotoSet.read("porch/align/porch.photos.json").photos
    assert far.distance == pytest.approx(17.5, abs=0.1)
    assert near.distance == pytest.approx(9.5, abs=0.03)
    assert turned.distance == pytest.approx(far.distance, abs=0.02)
    control = read_control("set.csv", sigma=0.003, sigma_plane=0.005, photos=3)
    page = Path("porch/report/porch_report.html").read_text(encoding="utf-8")
    assert f"{len(control.ids)} control points" in page
    again = CliRunner().invoke(main, line)
    assert "porch/align (kept)" in again.stdout
    assert "porch/report (kept)" in again.stdout


def same_cameras(photos: PhotoSet, pair: Pair) -> None:
    """Check that photos, the near one first, are those of a pair within a tenth of their sigma."""
    sigma = np.sqrt(np.diag(pair.orientation)).reshape(2, -1)
    its = pair.image2, pair.image1
    for got, true, spread in zip(photos.photos, its, sigma[::-1, 7:10], strict=True):
        off = np.array([*got.nadir - true.nadir, got.distance - true.distance])
        assert (abs(off) < 0.1 * spread).all()
    turned = np.sqrt(np.diag(photos.orientation)).reshape(2, -1)[::-1]
    assert turned == pytest.approx(sigma, rel=0.01)


def test_two_photos_are_the_set_that_their_pair_is():
    """Near photo first: the set keeps that order, the pair has its far one first."""
    rng = np.random.default_rng(3)
    wall = rng.uniform((-2, -1.5, -0.4), (2, 1.5, 0.4), (12, 3))
    square_on = np.diag([1.0, -1, -1])
    cameras = [
        Pinhole(camera_matrix(100 * z, 1.0, 200.0, 150.0), square_on, np.array([0.1, 0.0, z]))
        for z in (17.5, 9.5)
    ]
    far, near = (project(one, wall) + rng.normal(0, 0.1, (12, 2)) for one in cameras)
    lenses = [
        Interior.from_focal(one.matrix[0, 0], image_size=(401, 301), sigma=5e-4, source="board")
        for one in cameras
    ]
    control = Control(ids=tuple("ABCDEFGHIJKL"), xyz=wall, sigma=np.full((12, 3), 0.001),
                      pixels1=far, pixels2=near)  # fmt: skip
    pair = align(None, None, interiors=(lenses[0], lenses[1]), control=control).pair
    given = align(None, None, interiors=(lenses[1], lenses[0]), control=control.exchanged())
    made = SetAlignment.of_pair(given)
    same_cameras(made.photos, pair)
    for one, photo in zip(made.deviations, (2, 1), strict=True):
        assert one["distance"] == given.setup["standard_deviations"][f"distance{photo}"]


@pytest.mark.acceptance
def test_two_photos_set_up_as_a_set_are_their_pair_file_and_report_it(three):
    folder, _ = three
    line = ["--control", "two.csv", "--pixel-size", "0.01", "--overwrite", "--out"]
    with (folder / "set.csv").open(encoding="utf-8") as file:
        rows = [(*row[:6], *row[8:]) for row in csv.reader(file)]
    rows[0] = ("id", "X [m]", "Y [m]", "r [m]", "col1", "row1", "col2", "row2")
    text = "\n".join(map(",".join, rows))
    (folder / "two.csv").write_text(text.replace(",,", ","), encoding="utf-8")
    focal = [f"{place / (2 * PIXEL) / 100:.6g}" for place in (9.5, 17.5)]
    with chdir(folder):
        for out in ("two.pair.json", "two.photos.json"):
            photos = ["near.png", "far.png", "--focal1", focal[0], "--focal2", focal[1]]
            result = CliRunner().invoke(main, ["align", *photos, *line, out])
            assert result.exit_code == 0, result.output
        result = CliRunner().invoke(main, ["report", "two.photos.json", "--out", "two.html"])
        assert result.exit_code == 0, result.output
    made, pair = PhotoSet.read(folder / "two.photos.json"), Pair.read(folder / "two.pair.json")
    assert made.names == ("near", "far")
    same_cameras(made, pair)
    assert (made.pair().orientation == pair.orientation).all()
    assert made.extra["setup"] == pair.extra["setup"]


def test_a_set_is_refused_with_the_reason(three):
    folder, images = three
    with pytest.raises(InputError, match="one for each"):
        align_set(images, interiors=[])
    with pytest.raises(InputError, match="col4, row4 are missing"):
        read_control(folder / "set.csv", sigma=0.003, sigma_plane=None, photos=4)
    assert Control().of(0, 3).pixels2.shape == (0, 2)
    ends = np.full((2, 2), 5.0)
    length = Control(ids=("start", "end"), xyz=np.full((2, 3), np.nan), sigma=np.ones((2, 3)),
                     pixels1=ends, pixels2=np.full((2, 2), np.nan))  # fmt: skip
    assert (length.of(0, 3).pixels1 == ends).all()
    assert np.isnan(length.of(0, 3).pixels2).all()


def church(data_dir: Path, folder: Path) -> tuple[list[Path], list[dict], dict]:
    """Write four photos of one church, a third as large, and their lens; where points are seen.

    Both pairs show it in one frame. Returned are the photos, the picks of each by point, in pixels
    of the whole photos, and the rows of the last pair's table of points by name.
    """
    folders = [data_dir / "facade_pairs" / f"church_{k}" for k in (2, 1)]
    whole = json.loads((folders[0] / "geometry.json").read_text())["far"]["K"]
    small = np.diag([1 / 3, 1 / 3, 1]) @ whole + [[0, 0, -1 / 3], [0, 0, -1 / 3], [0, 0, 0]]
    Lens(camera_matrix=small, coefficients=np.zeros(5), image_size=(1024, 683)).write(
        folder / "k.lens.json"
    )
    photos, seen = [], []
    for source in folders:
        with (source / "points.csv").open(encoding="utf-8") as file:
            rows = {row["id"]: row for row in csv.DictReader(file)}
        for side in ("far", "near"):
            photos.append(folder / source.name / f"{side}.png")
            photos[-1].parent.mkdir(exist_ok=True)
            image = cv2.imread(str(source / f"{side}.jpg"))
            cv2.imwrite(
                str(photos[-1]), cv2.resize(image, (1024, 683), interpolation=cv2.INTER_AREA)
            )
            seen.append({k: (float(row[f"x_{side}_px"]), float(row[f"y_{side}_px"]))
                         for k, row in rows.items()})  # fmt: skip
    return photos, seen, rows


@pytest.mark.acceptance
def test_three_photos_of_a_church_and_one_length_are_a_set(data_dir, tmp_path):
    """Seen aslant: principal points turn the wall by 9 cm before its points are known."""
    photos, _, rows = church(data_dir, tmp_path)
    flat = [row for row in rows.values() if abs(float(row["relief_m"])) < 0.01]
    ends = [choose(flat, key=lambda row: float(row["x_far_px"])) for choose in (min, max)]
    picks = [(float(row[f"{axis}_far_px"]) - 1) / 3 for row in ends for axis in "xy"]
    places = np.array([[float(row[key]) for key in ("X_m", "Y_m", "relief_m")] for row in ends])
    length = ",".join(f"{value:.3f}" for value in (*picks, np.linalg.norm(places[1] - places[0])))
    line = ["align", *(str(photos[k]) for k in (2, 3, 0)), "--auto", "--length", length, "--lens",
            str(tmp_path / "k.lens.json"), "--out", str(tmp_path / "c.photos.json")]  # fmt: skip
    result = CliRunner().invoke(main, line)
    assert result.exit_code == 0, result.output
    made = PhotoSet.read(tmp_path / "c.photos.json").photos
    for photo, (pair, side) in zip(made, ((1, "far"), (1, "near"), (2, "far")), strict=True):
        geometry = data_dir / "facade_pairs" / f"church_{pair}" / "geometry.json"
        true = json.loads(geometry.read_text())[side]["height_over_plane_m"]
        assert photo.distance == pytest.approx(true, rel=0.01)


@pytest.mark.acceptance
def test_four_photos_of_a_church_are_no_worse_than_its_best_pair(data_dir, tmp_path):
    photos, seen, rows = church(data_dir, tmp_path)
    names = sorted(set.intersection(*map(set, seen)) & rows.keys())
    xyz = np.array([[float(rows[k][key]) for key in ("X_m", "Y_m", "relief_m")] for k in names])
    picks = [(np.array([own[k] for k in names]) - 1) / 3 for own in seen]
    control = np.random.default_rng(1).choice(len(names), 16, replace=False)
    heads = [f"{axis}{k}" for k in (1, 2, 3, 4) for axis in ("col", "row")]
    table = [",".join(["id,X [m],Y [m],r [m]", *heads])]
    for k in control:
        numbers = [*xyz[k], *(value for own in picks for value in own[k])]
        table.append(",".join([names[k], *(f"{value:.4f}" for value in numbers)]))
    (tmp_path / "control.csv").write_text("\n".join(table))
    line = ["align", *map(str, photos), "--control", str(tmp_path / "control.csv"), "--sigma-pick",
            "0.2", "--lens", str(tmp_path / "k.lens.json"), "--out",
            str(tmp_path / "church.photos.json")]  # fmt: skip
    result = CliRunner().invoke(main, line)
    assert result.exit_code == 0, result.output
    made = PhotoSet.read(tmp_path / "church.photos.json")
    assert made.names == ("church_2/far.png", "church_2/near.png", "church_1/far.png",
                          "church_1/near.png")  # fmt: skip
    left = np.setdiff1d(np.arange(len(names)), control)

    def errors(*used: int) -> tuple[np.ndarray, np.ndarray]:
        own = [np.where(k in used, pixels[left], np.nan) for k, pixels in enumerate(picks)]
        got = made.intersect(own, sigma_px=0.2)
        good = np.array([flag != "OFF-RADIAL" for flag in got.flags])
        return (got.xyz - xyz[left])[good], got.sigma[good]

    off, sigma = errors(0, 1, 2, 3)
    best = min(np.sqrt(np.nanmean(errors(p.far, p.near)[0][:, 2] ** 2)) for p in made.pairs())
    assert np.sqrt(np.mean(off[:, 2] ** 2)) < best
    held = (np.abs(off) < 2 * sigma).mean(axis=0)
    assert (held > 0.88).all(), held
