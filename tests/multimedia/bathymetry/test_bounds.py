"""A correction bounded by the shore on a map, and by the classes of points."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
import pytest
import rasterio

from tests.multimedia.bathymetry.test_cli_bathymetry import (
    LEVEL,
    N,
    bathymetry,
    positions,
    write_cloud_csv,
)

#: A lake of a national grid with an island, and a second one.
EAST, NORTH = 500_000.0, 4_500_000.0
LAKE = [[0, 0], [30, 0], [30, 40], [0, 40], [0, 0]]
ISLAND = [[10, 10], [20, 10], [20, 20], [10, 20], [10, 10]]
POND = [[33, 5], [38, 5], [38, 12], [33, 12], [33, 5]]


def wet(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return which places are water, by their inequalities."""
    lake = (x < 30) & ~((x > 10) & (x < 20) & (y > 10) & (y < 20))
    return lake | ((x > 33) & (x < 38) & (y > 5) & (y < 12))


def corrected(z: np.ndarray, inside: np.ndarray) -> np.ndarray:
    return np.where(inside & (z < LEVEL), LEVEL - N * (LEVEL - z), z)


def geojson(path: Path, polygons) -> Path:
    moved = [[[[x + EAST, y + NORTH] for x, y in ring] for ring in one] for one in polygons]
    feature = {"type": "Feature", "properties": {}}
    feature["geometry"] = {"type": "MultiPolygon", "coordinates": moved}
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    return path


def las(path: Path, xyz: np.ndarray, classes: np.ndarray) -> None:
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [EAST, NORTH, 0.0]
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz.T
    cloud.classification = classes
    cloud.write(path)


@pytest.mark.parametrize("kind", ["geojson", "shp"])
def test_points_outside_the_area_and_on_islands_stay_to_the_last_digit(tmp_path, kind):
    xyz = positions() + np.array([EAST, NORTH, 0.0])
    las(tmp_path / "cloud.las", xyz, np.full(len(xyz), 2))
    area = tmp_path / f"lake.{kind}"
    if kind == "geojson":
        geojson(area, [[LAKE, ISLAND], [POND]])
    else:
        shapefile = pytest.importorskip("shapefile")
        with shapefile.Writer(str(area), shapeType=shapefile.POLYGON) as out:
            out.field("name", "C")
            # Of a shapefile boundaries run clockwise and holes the other way.
            rings = [LAKE[::-1], ISLAND, POND[::-1]]
            out.poly([[[x + EAST, y + NORTH] for x, y in ring] for ring in rings])
            out.record("lake")
    code, out, err = bathymetry(
        tmp_path / "cloud.las", tmp_path / "bed.las", "--area", area, "--sigma-level", 0.01
    )
    assert code == 0, err
    got = laspy.read(tmp_path / "bed.las")
    inside = wet(xyz[:, 0] - EAST, xyz[:, 1] - NORTH)
    assert 100 < inside.sum() < 400
    assert np.array_equal(got.Z[~inside], laspy.read(tmp_path / "cloud.las").Z[~inside])
    assert np.asarray(got.z) == pytest.approx(corrected(xyz[:, 2], inside), abs=6e-4)
    assert (np.asarray(got.refraction)[~inside] == 5).all()
    assert (np.asarray(got.refraction)[inside] != 5).all()
    assert (np.asarray(got.sigma_Z)[~inside] == 0).all()
    assert f"{(~inside).sum()} outside the area" in out


def test_only_the_classes_named_are_corrected(tmp_path):
    xyz = positions() + np.array([EAST, NORTH, 0.0])
    classes = np.resize([2, 40, 9, 45], len(xyz))
    las(tmp_path / "cloud.las", xyz, classes)
    words = ("--class", 40, "--class", 45)
    code, _, err = bathymetry(tmp_path / "cloud.las", tmp_path / "bed.las", *words)
    assert code == 0, err
    got = np.asarray(laspy.read(tmp_path / "bed.las").z)
    assert got == pytest.approx(corrected(xyz[:, 2], np.isin(classes, (40, 45))), abs=6e-4)
    write_cloud_csv(tmp_path / "cloud.csv", xyz)
    code, _, err = bathymetry(tmp_path / "cloud.csv", tmp_path / "bed.csv", *words)
    assert (code, (tmp_path / "bed.csv").exists()) == (1, False)
    assert "no attribute classification" in err


def test_cells_of_a_dem_outside_the_area_stay(tmp_path):
    z = np.full((40, 40), 100.0, np.float32)
    kind = {"driver": "GTiff", "width": 40, "height": 40, "count": 1, "dtype": "float32"}
    place = rasterio.Affine(1, 0, EAST, 0, -1, NORTH + 40)
    with rasterio.open(tmp_path / "dem.tif", "w", crs="EPSG:32632", transform=place, nodata=-9,
                       **kind) as out:  # fmt: skip
        out.write(z, 1)
    area = geojson(tmp_path / "lake.geojson", [[LAKE, ISLAND], [POND]])
    code, _, err = bathymetry(tmp_path / "dem.tif", tmp_path / "bed.tif", "--area", area)
    assert code == 0, err
    with rasterio.open(tmp_path / "bed.tif") as file:
        got = file.read(1)
    x, y = np.meshgrid(np.arange(40) + 0.5, 39.5 - np.arange(40))
    assert got == pytest.approx(corrected(z, wet(x, y)), abs=1e-5)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"type": "Point", "coordinates": [1, 2]}', "holds no polygon"),
        ('{"type": "Polygon", "coordinates": [[[1, 2], [3, 4]]]}', "fewer than three corners"),
        ('{"type": "Polygon", "coordinates": [[[1, 2], [3, 4], [5, "x"]]]}', "fewer than three"),
        ('{"type": "Polygon", "coordinates": [[[9, 45], [10, 45], [10, 46], [9, 45]]]}',
         "all points lie outside --area"),
        ('{"type": "Polygon", "coordinates"', "not valid JSON"),
    ],
)  # fmt: skip
def test_areas_that_are_none_are_refused_by_name(tmp_path, text, says):
    write_cloud_csv(tmp_path / "cloud.csv", positions() + np.array([EAST, NORTH, 0.0]))
    area = tmp_path / "a.geojson"
    area.write_text(text)
    code, _, err = bathymetry(tmp_path / "cloud.csv", tmp_path / "bed.csv", "--area", area)
    assert (code, (tmp_path / "bed.csv").exists()) == (1, False)
    assert says in err
    area.rename(tmp_path / "a.kml")
    args = (tmp_path / "cloud.csv", tmp_path / "bed.csv", "--area", tmp_path / "a.kml")
    assert "read from .geojson, .json or .shp" in bathymetry(*args)[2]
    (tmp_path / "a.shp").write_bytes(b"nothing of a shapefile")
    if not says.startswith("not"):
        return
    pytest.importorskip("shapefile")
    args = (*args[:3], tmp_path / "a.shp")
    assert "is no shapefile that can be read" in bathymetry(*args)[2]
