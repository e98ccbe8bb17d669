"""What ``multimedia bathymetry`` refuses on files, in plain words, and what it remarks."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from pathlib import Path

import laspy
import numpy as np
import pytest
import rasterio

from tests.cases import few_by_default
from tests.multimedia.bathymetry.test_cli_bathymetry import (
    CENTRES,
    LEVEL,
    N,
    bathymetry,
    positions,
    read_band,
    run,
    write_cameras,
    write_cloud_csv,
    write_dem,
    write_las,
)


def refused(tmp_path: Path, source: Path, *options: object, target: str = "") -> str:
    """Return the message of a refusal; nothing may be left behind."""
    before = set(tmp_path.iterdir())
    code, out, err = bathymetry(source, tmp_path / (target or f"new{source.suffix}"), *options)
    assert (code, out) == (1, "")
    assert err.startswith("Error: ")
    assert set(tmp_path.iterdir()) == before
    return err


def test_bad_dems_are_refused_in_plain_words(tmp_path: Path) -> None:
    heights = np.random.default_rng(1).uniform(100, 102, (50, 50))
    write_dem(tmp_path / "degrees.tif", heights, crs="EPSG:4326")
    write_cameras(tmp_path / "cameras.csv", CENTRES)
    options = ("--cameras", tmp_path / "cameras.csv")
    assert "in degrees" in refused(tmp_path, tmp_path / "degrees.tif", *options)
    heights[:5, :5] = -9999
    write_dem(tmp_path / "unset.tif", heights, nodata=None)
    assert "declares no no-data value" in refused(tmp_path, tmp_path / "unset.tif")
    code, _, remarks = bathymetry(tmp_path / "unset.tif", tmp_path / "said.tif", "--nodata", -9999)
    assert (code, remarks) == (0, "")
    assert np.isnan(read_band(tmp_path / "said.tif")[:5, :5]).all()
    heights[:5, :5] = 0.0
    write_dem(tmp_path / "zero.tif", heights, nodata=None)
    assert "25 cells hold 0" in refused(tmp_path, tmp_path / "zero.tif")
    (tmp_path / "text.tif").write_text("no raster", encoding="utf-8")
    assert "not a raster file" in refused(tmp_path, tmp_path / "text.tif")
    assert "no such raster file" in refused(tmp_path, tmp_path / "absent.tif")
    write_dem(tmp_path / "nowhere.tif", heights, transform=None, crs=None)
    message = refused(tmp_path, tmp_path / "nowhere.tif", "--cameras", tmp_path / "cameras.csv")
    assert "no geotransform" in message


def test_a_dem_without_reference_system_is_taken_but_remarked(tmp_path: Path) -> None:
    heights = np.full((20, 20), 101.0)
    write_dem(tmp_path / "local.tif", heights, crs=None, nodata=None, transform=None)
    code, _, remarks = bathymetry(tmp_path / "local.tif", tmp_path / "out.tif")
    assert code == 0
    assert "no coordinate reference system" in remarks
    assert "no no-data value" in remarks
    assert "no position" in remarks


def test_bad_clouds_are_refused_in_plain_words(tmp_path: Path) -> None:
    header = laspy.LasHeader(point_format=3, version="1.2")
    laspy.LasData(header).write(tmp_path / "empty.las")
    assert "holds no points" in refused(tmp_path, tmp_path / "empty.las")
    write_las(tmp_path / "whole.las", positions())
    content = (tmp_path / "whole.las").read_bytes()
    (tmp_path / "cut.las").write_bytes(content[: len(content) // 2])
    assert "cut" in refused(tmp_path, tmp_path / "cut.las")
    (tmp_path / "text.las").write_text("no cloud", encoding="utf-8")
    assert "cannot be read as LAS" in refused(tmp_path, tmp_path / "text.las")
    (tmp_path / "head.csv").write_text("id,X,Y\n1,2,3\n", encoding="utf-8")
    assert "no column for Z" in refused(tmp_path, tmp_path / "head.csv")
    (tmp_path / "bad.csv").write_text("X,Y,Z\n1,2,-\n1,zwei,101\n", encoding="utf-8")
    message = refused(tmp_path, tmp_path / "bad.csv")
    assert "row 2 (Z): found '-'" in message
    assert "row 3 (Y): found 'zwei'" in message
    (tmp_path / "mm.csv").write_text("X [mm],Y [mm],Z [mm]\n1,2,101\n", encoding="utf-8")
    assert "is in mm" in refused(tmp_path, tmp_path / "mm.csv")
    (tmp_path / "none.csv").write_text("X,Y,Z\n", encoding="utf-8")
    assert "no points" in refused(tmp_path, tmp_path / "none.csv")
    (tmp_path / "half.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 2\n")
    assert "no end" in refused(tmp_path, tmp_path / "half.ply")
    assert "not known" in refused(tmp_path, _touch(tmp_path / "cloud.e57"))
    write_cloud_csv(tmp_path / "good.csv", positions())
    assert "same ending" in refused(tmp_path, tmp_path / "good.csv", target="new.las")


def _touch(path: Path) -> Path:
    path.write_bytes(b"x")
    return path


def test_units_levels_and_sides_that_cannot_be_are_refused(tmp_path: Path) -> None:
    xyz = positions()
    write_cloud_csv(tmp_path / "in.csv", xyz)
    call = ("bathymetry", tmp_path / "in.csv", "--out", tmp_path / "new.csv", "--index", N)
    for level, words in (
        (50.0, "no point lies under the water surface"),
        (102_500, "different units"),
        ("low.txt", "neither a height"),
        ("low.tif", "no such raster file"),
    ):
        code, _, err = run(*call, "--water-level", level)
        assert code == 1
        assert words in err
    write_cloud_csv(tmp_path / "mm.csv", 1000 * xyz)
    assert "look like millimetres" in refused(tmp_path, tmp_path / "mm.csv")
    code, out, _ = run(*call, "--water-level", 50, "--allow-dry")
    assert (code, "500 dry" in out) == (0, True)
    code, _, err = run(*call[:-1], 0.75, "--water-level", LEVEL, "--overwrite")
    assert "no refractive index of water" in err
    for centres, words in (
        (CENTRES - [0, 0, 60], "5 of 5 are not above the water surface"),
        (CENTRES * 1000, "different units"),
    ):
        write_cameras(tmp_path / "cameras.csv", centres)
        options = ("--cameras", tmp_path / "cameras.csv")
        assert words in refused(tmp_path, tmp_path / "in.csv", *options, target="x.csv")


def test_a_file_is_not_corrected_twice_nor_overwritten_unasked(tmp_path: Path) -> None:
    write_cloud_csv(tmp_path / "in.csv", positions())
    assert bathymetry(tmp_path / "in.csv", tmp_path / "out.csv")[0] == 0
    assert "exists already" in refused(tmp_path, tmp_path / "in.csv", target="out.csv")
    assert bathymetry(tmp_path / "in.csv", tmp_path / "out.csv", "--overwrite")[0] == 0
    assert "corrected already" in refused(tmp_path, tmp_path / "out.csv", target="twice.csv")
    message = refused(tmp_path, tmp_path / "in.csv", "--overwrite", target="in.csv")
    assert "is one of the files that are read; name another output, e.g. in-result.csv" in message
    write_dem(tmp_path / "in.tif", np.full((20, 20), 101.0))
    assert bathymetry(tmp_path / "in.tif", tmp_path / "out.tif")[0] == 0
    assert "already" in refused(tmp_path, tmp_path / "out.tif", target="twice.tif")


def test_tables_that_do_not_fit_each_other_are_named(tmp_path: Path) -> None:
    write_cloud_csv(tmp_path / "in.csv", positions())
    write_cameras(tmp_path / "cameras.csv", CENTRES)
    (tmp_path / "seen.csv").write_text("point,camera\nP1,c9\n", encoding="utf-8")
    cameras = ("--cameras", tmp_path / "cameras.csv")
    message = refused(
        tmp_path, tmp_path / "in.csv", *cameras, "--visibility", tmp_path / "seen.csv"
    )
    assert "camera 'c9' is not in" in message
    (tmp_path / "named.csv").write_text(
        "id,X,Y,Z\nIMG_0001,0,0,150\nc2,9,0,150\n", encoding="utf-8"
    )
    (tmp_path / "near.csv").write_text("point,camera\nP1,IMG_O001\n", encoding="utf-8")
    given = ("--cameras", tmp_path / "named.csv", "--visibility", tmp_path / "near.csv")
    message = refused(tmp_path, tmp_path / "in.csv", *given)
    assert "(did you mean IMG_0001?)" in message
    (tmp_path / "by.csv").write_text(
        "id,X,Y,Z,cameras\nP1,1,2,90,c1 c2\nP2,5,6,91,c1 c9\n", encoding="utf-8"
    )
    message = refused(tmp_path, tmp_path / "by.csv", *cameras)
    assert "the point at 5.000, 6.000, 91.000 names camera 'c9', which is not in" in message
    (tmp_path / "twice.csv").write_text("id,X,Y,Z\nc1,0,0,150\nc1,1,1,150\n", encoding="utf-8")
    message = refused(tmp_path, tmp_path / "in.csv", "--cameras", tmp_path / "twice.csv")
    assert "stands in" in message
    (tmp_path / "blank.csv").write_text("id,X,Y,Z\nc1,0,,150\n", encoding="utf-8")
    assert "blank" in refused(tmp_path, tmp_path / "in.csv", "--cameras", tmp_path / "blank.csv")
    assert "sensor position" in refused(tmp_path, tmp_path / "in.csv", "--beams")
    assert run("bathymetry", "a.csv", "--out", "b.csv", "--water-level", 1, "--index", N,
               "--rays", "--beams")[0] == 2  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are POSIX")
@pytest.mark.parametrize(
    ("width", "height", "limit"),
    few_by_default(
        [(30, 20, 0), (30, 20, 1_000), (500, 400, 5_000), (500, 400, 400_000)],
        (30, 20, 0),
        (500, 400, 400_000),
    ),
)
def test_a_full_disk_leaves_the_old_model_as_it_was(
    tmp_path: Path, width: int, height: int, limit: int
) -> None:
    # A file-size limit stands in for the full disk: GDAL's writes fail the same way. It writes a
    # small model when the file is closed, and then fails without a word.
    heights = np.random.default_rng(1).uniform(95, 102, (height, width)).astype("float32")
    source, target = tmp_path / "dem.tif", tmp_path / "bed.tif"
    profile = {"driver": "GTiff", "dtype": "float32", "count": 1, "width": width, "height": height,
               "transform": rasterio.Affine(2, 0, 0, 0, -2, 0), "nodata": -9999.0}  # fmt: skip
    with rasterio.open(source, "w", **profile) as file:
        file.write(heights, 1)
    old = source.read_bytes()
    target.write_bytes(old)
    command = ["bathymetry", source, "--out", target, "--water-level", LEVEL, "--index", N,
               "--overwrite"]  # fmt: skip
    script = f"""
        import resource, signal
        from tests.builders.commands import multimedia_command as main
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
        main({[str(word) for word in command]!r})
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1, done.stderr
    assert "bed.tif: could not be written" in done.stderr
    assert "Traceback" not in done.stderr
    assert target.read_bytes() == old
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bed.tif", "dem.tif"]


@pytest.mark.parametrize("index", ["1.0", "1.29", "1.41", "1.5"])
def test_an_index_that_is_no_waters_is_refused(tmp_path: Path, index: str) -> None:
    source = tmp_path / "c.csv"
    write_cloud_csv(source, positions(20))
    target = tmp_path / "o.csv"
    status, _, said = run(
        "bathymetry", source, "--water-level", LEVEL, "--index", index, "--out", target
    )
    assert status == 1
    assert f"--index: {float(index):g} is no water's" in said
    assert not target.exists()


def test_heights_of_points_that_mean_unknown_are_refused(tmp_path: Path) -> None:
    source, xyz = tmp_path / "c.csv", positions(20)
    xyz[7, 2] = -9999.0
    write_cloud_csv(source, xyz)
    assert "1 points have the height -9999" in refused(tmp_path, source)
    assert "--nodata is for the cells of a DEM" in refused(tmp_path, source, "--nodata", -9999)


def test_a_group_index_is_for_lidar(tmp_path: Path) -> None:
    source = tmp_path / "c.csv"
    write_cloud_csv(source, positions(20))
    status, _, said = bathymetry(source, tmp_path / "o.csv", "--group-index", 1.36)
    assert status == 2
    assert "--group-index needs --beams" in said


@pytest.mark.parametrize("kind", ["--beams", "--rays"])
def test_precisions_that_nothing_would_use_are_refused(tmp_path: Path, kind: str) -> None:
    source = tmp_path / "c.csv"
    write_cloud_csv(source, positions(20))
    status, _, said = bathymetry(source, tmp_path / "o.csv", kind, "--sigma-level", 0.01)
    assert status == 2
    assert "--sigma-level and --sigma-point are not for --beams and --rays" in said
    if kind == "--rays":
        message = refused(tmp_path, source, kind, "--nodata", -9999)
        assert "--nodata is for the cells of a DEM, these are rays" in message


def test_a_mark_that_the_numbers_of_a_dem_cannot_reach_becomes_nan(tmp_path: Path) -> None:
    heights = np.random.default_rng(1).uniform(95, 100, (20, 20)).astype(np.float32)
    write_dem(tmp_path / "in.tif", heights, nodata=None)
    status, _, said = bathymetry(tmp_path / "in.tif", tmp_path / "o.tif", "--nodata", -1e300)
    assert status == 0, said
    assert np.isfinite(read_band(tmp_path / "o.tif")).all()
    with rasterio.open(tmp_path / "o.tif") as dem:
        assert np.isnan(dem.nodata)


def test_a_las_header_of_junk_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "junk.laz"
    for seed in range(8):
        junk = bytearray(np.random.default_rng(seed).bytes(3000))
        junk[:4] = b"LASF"
        junk[100:104] = (2**32 - 1 - seed).to_bytes(4, "little")
        path.write_bytes(junk)
        assert "cannot be read as LAS" in refused(tmp_path, path)
    write_las(path, positions(20))
    whole = bytearray(path.read_bytes())
    whole[100:104] = (1).to_bytes(4, "little")
    start = int.from_bytes(whole[94:96], "little")
    whole[start : start + 54] = b"\xac" * 54
    path.write_bytes(whole)
    assert "cannot be read as LAS" in refused(tmp_path, path)


@pytest.mark.parametrize("direction", ["0,0,0", "0,0,1", "0,0,-1"])
def test_rays_that_meet_nowhere_are_told_so(tmp_path: Path, direction: str) -> None:
    source = tmp_path / "rays.csv"
    rows = [f"A,{x},0,105,{direction}" for x in (0, 1)]
    source.write_text("\n".join(["id,X0,Y0,Z0,DX,DY,DZ", *rows]) + "\n")
    assert "no point has a position" in refused(tmp_path, source, "--rays")
