"""``multimedia bathymetry`` and ``waterlevel`` on files: formats kept, results true."""

from __future__ import annotations

import json
import tracemalloc
import warnings
from pathlib import Path

import laspy
import numpy as np
import pytest
import rasterio
from click.testing import CliRunner
from rasterio.errors import NotGeoreferencedWarning

import multimedia as mm
from tests.builders.commands import multimedia_command as main

N = 1.34
LEVEL = 102.5


def run(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


def bathymetry(source: Path, target: Path, *options: object) -> tuple[int, str, str]:
    return run(
        "bathymetry", source, "--out", target, "--water-level", LEVEL, "--index", N, *options
    )


def positions(count: int = 500, seed: int = 1) -> np.ndarray:
    """Return points in whole millimetres, every fifth of them dry."""
    rng = np.random.default_rng(seed)
    z = np.where(np.arange(count) % 5 == 0, 103.0, 102.0 - rng.uniform(0, 4, count))
    return np.round(np.column_stack([rng.uniform(0, 40, (count, 2)), z]), 3)


def nadir(xyz: np.ndarray) -> np.ndarray:
    out = xyz.copy()
    wet = out[:, 2] < LEVEL
    out[wet, 2] = LEVEL - N * (LEVEL - out[wet, 2])
    return out


def write_cloud_csv(path: Path, xyz: np.ndarray, head: str = "id,X,Y,Z,code") -> None:
    rows = [f"P{k},{x:.3f},{y:.3f},{z:.3f},=kept {k}" for k, (x, y, z) in enumerate(xyz)]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")


def write_cameras(path: Path, centres: np.ndarray) -> None:
    rows = [f"c{k},{x!r},{y!r},{z!r}" for k, (x, y, z) in enumerate(centres.tolist())]
    path.write_text("\n".join(["id,X,Y,Z", *rows]) + "\n", encoding="utf-8")


CENTRES = np.array([[0.0, 0, 160], [40, 0, 158], [0, 40, 162], [40, 40, 161], [20, 20, 160]])


def apparent_of(true: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Return where straight rays in air meet best, equal precision in the images."""
    water = mm.Interfaces.flat_water(LEVEL, refractive_index=N)
    out = true.copy()
    wet = true[:, 2] < LEVEL
    u = mm.aim_rays(centres, true[wet, None], water).directions[..., 0, :]
    across = np.eye(3) - u[..., :, None] * u[..., None, :]
    for _ in range(15):
        weight = 1 / ((out[wet, None] - centres) ** 2).sum(-1)
        normal = np.einsum("nm,nmij->nij", weight, across)
        right = np.einsum("nm,nmij,mj->ni", weight, across, centres)
        out[wet] = np.linalg.solve(normal, right[..., None])[..., 0]
    return out


def write_las(path: Path, xyz: np.ndarray, *, crs: bool = False) -> None:
    rng = np.random.default_rng(7)
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = [0.001] * 3, [0.0, 0.0, 100.0]
    header.add_extra_dim(laspy.ExtraBytesParams("confidence", np.float32))
    if crs:
        header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "wkt", b"LOCAL_CS[]"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    for name in ("intensity", "red", "green", "blue"):
        las[name] = rng.integers(0, 60_000, len(xyz))
    las.classification = rng.integers(0, 20, len(xyz))
    las.return_number = rng.integers(1, 5, len(xyz))
    las.gps_time = np.linspace(100, 110, len(xyz))
    las.confidence = rng.uniform(size=len(xyz))
    las.write(path)


def write_ply(path: Path, xyz: np.ndarray, form: str) -> None:
    order = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}[form]
    rows = np.zeros(
        len(xyz), [("x", order + "f8"), ("y", order + "f8"), ("z", order + "f8"), ("q", "u1")]
    )
    rows["x"], rows["y"], rows["z"] = xyz.T
    rows["q"] = np.arange(len(xyz)) % 251
    head = (
        f"ply\nformat {form} 1.0\ncomment by hand\nelement vertex {len(xyz)}\nproperty double x\n"
        "property double y\nproperty double z\nproperty uchar q\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode()
    if form == "ascii":
        body = "".join(f"{x} {y} {z} {q}\n" for x, y, z, q in rows.tolist()).encode() + b"3 0 1 2\n"
    else:
        body = rows.tobytes() + b"\x03" + np.array([0, 1, 2], order + "i4").tobytes()
    path.write_bytes(head + body)


def write_dem(path: Path, heights: np.ndarray, *, cell: float = 0.5, **profile: object) -> None:
    options = {
        "driver": "GTiff", "dtype": "float32", "count": 1, "crs": "EPSG:32632", "nodata": -9999,
        "height": heights.shape[0], "width": heights.shape[1],
        "transform": rasterio.Affine(cell, 0, 500_000, 0, -cell, 5_200_000),
    }  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        file = rasterio.open(path, "w", **(options | profile))
    with file:
        file.write(heights.astype(options["dtype"]), 1)
        file.update_tags(survey="lake")


def read_band(path: Path, band: int = 1) -> np.ndarray:
    with rasterio.open(path) as file:
        return file.read(band, masked=True).astype(float).filled(np.nan)


def test_a_csv_cloud_is_corrected_and_all_other_cells_stay(tmp_path: Path) -> None:
    xyz = positions()
    write_cloud_csv(tmp_path / "in.csv", xyz)
    code, out, _ = bathymetry(tmp_path / "in.csv", tmp_path / "out.csv")
    assert code == 0
    assert "100 dry, 400 nadir" in out
    before = (tmp_path / "in.csv").read_text(encoding="utf-8").splitlines()
    after = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert after[0] == "id,X,Y,Z,code,refraction,water_depth"
    values = [line.split(",") for line in after[1:]]
    np.testing.assert_allclose(
        [[float(v) for v in row[1:4]] for row in values], nadir(xyz), atol=1e-9
    )
    for old, row in zip(before[1:], values, strict=True):
        if row[5] == "dry":
            assert ",".join(row[:5]) == old
        assert row[4] == old.split(",")[4]


def test_semicolons_decimal_commas_and_german_headings_are_kept(tmp_path: Path) -> None:
    text = "Punkt;Ost [m];Nord [m];Höhe [m]\nA;1,5;2,5;101,5\nB;3,25;4;103,0\n"
    (tmp_path / "in.csv").write_text(text, encoding="utf-8")
    assert bathymetry(tmp_path / "in.csv", tmp_path / "out.csv")[0] == 0
    lines = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert lines[1] == "A;1,5;2,5;101,16;nadir;1,34"
    assert lines[2] == "B;3,25;4;103,0;dry;0,0"


def test_bare_columns_without_headings_are_x_y_z(tmp_path: Path) -> None:
    (tmp_path / "in.xyz").write_text("1 2 101.5 7\n3 4 103 8\n", encoding="utf-8")
    assert bathymetry(tmp_path / "in.xyz", tmp_path / "out.xyz")[0] == 0
    assert (tmp_path / "out.xyz").read_text(encoding="utf-8").splitlines() == [
        "1 2 101.16 7 nadir 1.34",
        "3 4 103 8 dry 0.0",
    ]


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_a_las_cloud_keeps_every_attribute(tmp_path: Path, suffix: str) -> None:
    xyz = positions()
    write_las(tmp_path / f"in.{suffix}", xyz, crs=True)
    code, _, remarks = bathymetry(tmp_path / f"in.{suffix}", tmp_path / f"out.{suffix}")
    assert (code, remarks) == (0, "")
    before, after = laspy.read(tmp_path / f"in.{suffix}"), laspy.read(tmp_path / f"out.{suffix}")
    for name in before.point_format.dimension_names:
        if name != "Z":
            np.testing.assert_array_equal(before[name], after[name], err_msg=name)
    dry = xyz[:, 2] > LEVEL
    np.testing.assert_array_equal(np.asarray(before.Z)[dry], np.asarray(after.Z)[dry])
    np.testing.assert_allclose(after.z, nadir(xyz)[:, 2], atol=0.000_51)
    assert [v.user_id for v in after.header.vlrs][:1] == ["LASF_Projection"]
    assert (after.header.scales == before.header.scales).all()
    assert set(np.asarray(after["refraction"])) == {0, 1}


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_ply_cloud_keeps_properties_faces_and_byte_order(tmp_path: Path, form: str) -> None:
    from photocore.cloud.ply import PlyCloud, read_ply_mesh

    xyz = positions()
    write_ply(tmp_path / "in.ply", xyz, form)
    assert bathymetry(tmp_path / "in.ply", tmp_path / "out.ply")[0] == 0
    cloud = PlyCloud(tmp_path / "out.ply")
    chunk = next(cloud.pieces(numbers=["q", "water_depth"]))
    np.testing.assert_allclose(chunk.xyz, nadir(xyz), atol=1e-12)
    np.testing.assert_array_equal(chunk.numbers["q"], np.arange(len(xyz)) % 251)
    content = (tmp_path / "out.ply").read_bytes()
    assert f"format {form} 1.0\ncomment by hand\n".encode() in content
    assert read_ply_mesh(tmp_path / "out.ply")[1].tolist() == [[0, 1, 2]]


def test_a_dem_keeps_grid_reference_system_nodata_and_tags(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    heights = np.round(100 + 4 * rng.uniform(size=(300, 400)), 3)
    heights[:10, :10] = -9999
    write_dem(tmp_path / "in.tif", heights)
    code, out, remarks = bathymetry(tmp_path / "in.tif", tmp_path / "out.tif")
    assert (code, remarks) == (0, "")
    with rasterio.open(tmp_path / "in.tif") as a, rasterio.open(tmp_path / "out.tif") as b:
        assert (a.crs, a.transform, a.nodata, a.shape) == (b.crs, b.transform, b.nodata, b.shape)
        assert b.dtypes == ("float32",)
        assert b.tags()["survey"] == "lake"
        assert (b.read(1)[:10, :10] == -9999).all()
        before = a.read(1)
    after = read_band(tmp_path / "out.tif")
    known = before != -9999
    expected = np.where(before < LEVEL, LEVEL - N * (LEVEL - before.astype(float)), before)
    np.testing.assert_allclose(after[known], expected[known], atol=1e-4)
    dry = known & (before > LEVEL)
    np.testing.assert_array_equal(after[dry], before[dry])
    assert "dry" in out


def bed(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the height of a smooth lake bed."""
    return 99.5 + 1.2 * np.sin((x - 500_000) / 9) * np.cos((y - 5_200_000) / 11)


def test_a_dem_seen_by_cameras_returns_to_the_true_bed(tmp_path: Path) -> None:
    # The apparent DEM is made by projecting the true bed, cell by cell, and gridding it.
    from scipy.interpolate import griddata

    rows, columns, cell = 80, 100, 0.5
    shift = np.array([500_000.0, 5_200_000, 0])
    centres = shift + np.array([[5, -10, 130], [45, -10, 131], [25, -30, 129]])
    x, y = np.meshgrid(
        500_000 + cell * (np.arange(-10, columns + 10) + 0.5),
        5_200_000 - cell * (np.arange(-10, rows + 10) + 0.5),
    )
    true = np.stack([x, y, bed(x, y)], axis=-1).reshape(-1, 3)
    apparent = apparent_of(true - shift, centres - shift)
    inner = (slice(10, -10), slice(10, -10))
    grid = np.stack([x, y], axis=-1)[inner] - shift[:2]
    heights = griddata(apparent[:, :2], apparent[:, 2], grid, method="cubic")
    write_dem(tmp_path / "in.tif", heights, cell=cell, dtype="float64")
    with rasterio.open(tmp_path / "in.tif", "r+") as file:
        file.write(heights, 1)
    write_cameras(tmp_path / "cameras.csv", centres)
    options = ("--cameras", tmp_path / "cameras.csv", "--sigma-index", 0.001)
    code, out, _ = bathymetry(tmp_path / "in.tif", tmp_path / "out.tif", *options)
    assert code == 0
    assert f"{rows * columns} rays" in out
    error = read_band(tmp_path / "out.tif") - bed(x, y)[inner]
    depth = LEVEL - bed(x, y)[inner]
    core = (slice(3, -3), slice(3, -3))
    assert np.sqrt((error[core] ** 2).mean()) < 1e-3 * np.sqrt((depth**2).mean())
    # Without moving cells sideways some 8 % of the depth times the slope of the bed would be left.
    sigma = read_band(tmp_path / "out.tif", 2)
    assert 0.001 < sigma.mean() / 0.003 * 0.001 < 0.01


def test_windows_leave_no_seams_in_the_dem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from multimedia.bathymetry import dem_correction

    x, y = np.meshgrid(
        500_000 + 0.5 * (np.arange(150) + 0.5), 5_200_000 - 0.5 * (np.arange(130) + 0.5)
    )
    heights = bed(x, y)
    heights[40:44, 70:90] = -9999
    write_dem(tmp_path / "in.tif", heights, dtype="float64")
    write_cameras(tmp_path / "cameras.csv", CENTRES + np.array([500_000.0, 5_199_950, 0]))
    options = ("--cameras", tmp_path / "cameras.csv", "--max-angle", 80)
    assert bathymetry(tmp_path / "in.tif", tmp_path / "whole.tif", *options)[0] == 0
    monkeypatch.setattr(dem_correction, "WINDOW", 40)
    assert bathymetry(tmp_path / "in.tif", tmp_path / "parts.tif", *options)[0] == 0
    whole, parts = read_band(tmp_path / "whole.tif"), read_band(tmp_path / "parts.tif")
    np.testing.assert_allclose(parts, whole, atol=1e-9)
    assert np.isnan(whole[41, 75])


def test_cameras_correct_a_cloud_in_all_three_coordinates(tmp_path: Path) -> None:
    true = positions(60)
    apparent = apparent_of(true, CENTRES)
    rows = [f"P{k},{x!r},{y!r},{z!r}" for k, (x, y, z) in enumerate(apparent.tolist())]
    (tmp_path / "in.csv").write_text("\n".join(["id,X,Y,Z", *rows]), encoding="utf-8")
    write_cameras(tmp_path / "cameras.csv", CENTRES)
    code, out, remarks = bathymetry(
        tmp_path / "in.csv", tmp_path / "out.csv", "--cameras", tmp_path / "cameras.csv",
        "--sigma-index", 0.001, "--sigma-level", 0.005,
    )  # fmt: skip
    assert code == 0
    assert "48 rays" in out
    assert "every camera is taken to see every point" in remarks
    table = np.genfromtxt(tmp_path / "out.csv", delimiter=",", names=True, encoding="utf-8")
    found = np.column_stack([table[axis] for axis in "XYZ"])
    np.testing.assert_allclose(found, true, atol=2e-9)
    assert (table["sigma_Z"][true[:, 2] < LEVEL] > 1e-3).all()


def test_cameras_may_come_from_a_project_file(tmp_path: Path) -> None:
    from multimedia import write_project
    from multimedia.bathymetry.survey_tables import read_camera_positions

    cameras = tuple(
        mm.Camera.from_angles(centre, 0.0, 0.0, 0.0, principal_distance=35.0, name=f"c{k}")
        for k, centre in enumerate(CENTRES)
    )
    write_project(tmp_path / "rig.toml", mm.Project(cameras=cameras))
    found = read_camera_positions(tmp_path / "rig.toml")
    assert found.ids == ("c0", "c1", "c2", "c3", "c4")
    np.testing.assert_array_equal(found.centres, CENTRES)


@pytest.mark.parametrize("road", ["column", "table", "angle"])
def test_only_the_cameras_that_saw_a_point_are_used(tmp_path: Path, road: str) -> None:
    true = positions(30)
    far = np.vstack([CENTRES, [[4000.0, 20, 160]]])
    apparent = apparent_of(true, CENTRES)
    head = "id,X,Y,Z" + (",cameras" if road == "column" else "")
    names = " ".join(f"c{k}" for k in range(len(CENTRES)))
    rows = [
        f"P{k},{x!r},{y!r},{z!r}" + (f",{names}" if road == "column" else "")
        for k, (x, y, z) in enumerate(apparent.tolist())
    ]
    (tmp_path / "in.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    write_cameras(tmp_path / "cameras.csv", far)
    options: list[object] = ["--cameras", tmp_path / "cameras.csv"]
    if road == "table":
        pairs = [f"P{k},c{c}" for k in range(30) for c in range(len(CENTRES))]
        (tmp_path / "seen.csv").write_text("\n".join(["point,camera", *pairs]), encoding="utf-8")
        options += ["--visibility", tmp_path / "seen.csv"]
    if road == "angle":
        options += ["--max-angle", 60]
    code, _, remarks = bathymetry(tmp_path / "in.csv", tmp_path / "out.csv", *options)
    assert (code, remarks) == (0, "")
    table = np.genfromtxt(
        tmp_path / "out.csv", delimiter=",", skip_header=1, usecols=(1, 2, 3), encoding="utf-8"
    )
    np.testing.assert_allclose(table, true, atol=2e-9)


def test_measured_rays_give_points_with_precision(tmp_path: Path) -> None:
    true = positions(40)[1:5]
    water = mm.Interfaces.flat_water(LEVEL, refractive_index=N)
    rows = ["id,X0,Y0,Z0,DX,DY,DZ"]
    for number, point in enumerate(true):
        centres = CENTRES[: 2 + number % 3]
        rays = mm.aim_rays(centres, point, water).directions[:, 0]
        rows += [
            ",".join([f"B{9 - number}", *map(repr, [*c, *u])])
            for c, u in zip(centres.tolist(), rays.tolist(), strict=True)
        ]
    (tmp_path / "rays.csv").write_text("\n".join(rows), encoding="utf-8")
    code, out, _ = bathymetry(tmp_path / "rays.csv", tmp_path / "out.csv", "--rays")
    assert code == 0
    assert "4 rays" in out
    table = np.genfromtxt(
        tmp_path / "out.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    assert table["id"].tolist() == ["B9", "B8", "B7", "B6"]
    found = np.column_stack([table[axis] for axis in "XYZ"])
    np.testing.assert_allclose(found, true, atol=1e-9)
    assert table["rays"].tolist() == [2, 3, 4, 2]
    assert (table["sigma_Z"] > 0).all()


def test_lidar_echoes_use_the_trajectory(tmp_path: Path) -> None:
    xyz = positions(50)
    write_las(tmp_path / "in.las", xyz, crs=True)
    (tmp_path / "flight.csv").write_text(
        "time,X,Y,Z\n99,0,20,400\n111,40,20,400\n", encoding="utf-8"
    )
    code, out, _ = bathymetry(
        tmp_path / "in.las", tmp_path / "out.las", "--trajectory", tmp_path / "flight.csv",
        "--group-index", 1.36,
    )  # fmt: skip
    assert code == 0
    assert "10 dry, 40 rays" in out
    when = np.linspace(100, 110, 50)
    sensor = np.column_stack([(when - 99) / 12 * 40, np.full(50, 20.0), np.full(50, 400.0)])
    expected = mm.correct_lidar_beams(
        sensor, xyz, water_level=LEVEL, refractive_index=N, group_index=1.36
    ).xyz
    after = laspy.read(tmp_path / "out.las")
    np.testing.assert_allclose(after.xyz, expected, atol=0.000_51)


@pytest.mark.parametrize("rows", ["99,0,20,400", "111,40,20,400\n99,0,20,400"])
def test_a_trajectory_needs_times_that_increase(tmp_path: Path, rows: str) -> None:
    write_las(tmp_path / "in.las", positions(5), crs=True)
    (tmp_path / "flight.csv").write_text(f"time,X,Y,Z\n{rows}\n", encoding="utf-8")
    code, _, said = bathymetry(
        tmp_path / "in.las", tmp_path / "out.las", "--trajectory", tmp_path / "flight.csv"
    )
    assert code == 1
    assert "flight.csv: needs at least two rows whose times increase" in said


def test_a_raster_or_mesh_as_water_surface_gives_the_same_as_the_plane_it_samples(
    tmp_path: Path,
) -> None:
    write_cloud_csv(tmp_path / "in.csv", positions(40))
    write_dem(
        tmp_path / "water.tif",
        np.full((60, 60), LEVEL),
        cell=1.0,
        transform=rasterio.Affine(1, 0, -10, 0, -1, 50),
    )
    (tmp_path / "water.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
        "-10 -10 102.5\n60 -10 102.5\n60 60 102.5\n-10 60 102.5\n3 0 1 2\n3 0 2 3\n",
        encoding="utf-8",
    )
    write_cameras(tmp_path / "cameras.csv", CENTRES)
    results = []
    for number, water in enumerate((LEVEL, tmp_path / "water.tif", tmp_path / "water.ply")):
        target = tmp_path / f"out{number}.csv"
        code, out, _ = run(
            "bathymetry", tmp_path / "in.csv", "--out", target, "--water-level", water,
            "--index", N, "--cameras", tmp_path / "cameras.csv", "--max-angle", 50,
        )  # fmt: skip
        assert code == 0
        assert "32 rays" in out
        results.append(
            np.genfromtxt(target, delimiter=",", skip_header=1, usecols=(1, 2, 3), encoding="utf-8")
        )
    np.testing.assert_allclose(results[1], results[0], atol=2e-9)
    np.testing.assert_allclose(results[2], results[0], atol=2e-9)


def test_json_says_what_was_done_and_nothing_else(tmp_path: Path) -> None:
    write_cloud_csv(tmp_path / "in.csv", positions())
    code, out, _ = bathymetry(tmp_path / "in.csv", tmp_path / "out.csv", "--json")
    assert code == 0
    told = json.loads(out)
    assert told["counts"] == {"dry": 100, "nadir": 400}
    assert told["max_depth"] > 5


@pytest.mark.acceptance
def test_memory_stays_bounded_while_the_dem_grows(tmp_path: Path) -> None:
    peaks = []
    for rows in (1100, 3300):
        path = tmp_path / f"{rows}.tif"
        write_dem(path, np.full((rows, 500), 101.0))
        tracemalloc.start()
        assert bathymetry(path, tmp_path / f"{rows}_out.tif")[0] == 0
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


def test_waterlevel_feeds_bathymetry(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    surface = np.column_stack([rng.uniform(0, 40, (80, 2)), rng.normal(LEVEL, 0.01, 80)])
    bottom = np.column_stack([rng.uniform(0, 40, (200, 2)), rng.uniform(98, 101, 200)])
    write_cloud_csv(tmp_path / "ties.csv", np.vstack([surface, bottom]))
    code, out, _ = run("waterlevel", tmp_path / "ties.csv", "--json", "--out", tmp_path / "w.json")
    assert code == 0
    told = json.loads(out)
    assert told["level"] == pytest.approx(LEVEL, abs=0.005)
    assert told["rejected_below"] >= 200
    write_cloud_csv(tmp_path / "in.csv", positions())
    code, _, _ = run(
        "bathymetry", tmp_path / "in.csv", "--water-level", tmp_path / "w.json", "--index", N,
        "--out", tmp_path / "out.csv",
    )  # fmt: skip
    assert code == 0
    code, out, _ = run("waterlevel", tmp_path / "ties.csv", "--tilted")
    assert code == 0
    assert "rejected" in out
    assert "mm/m in X" in out
