"""Points leave as tables, GeoJSON and drawings, whatever measured them."""

import json

import numpy as np
import pytest

import bifocal
from bifocal import Pair, Points, Taking
from bifocal.matching.matches import Matches
from photocore.errors import InputError

PICKS = {
    "id": ["P1", "P2"], "s1": [35 * 2 / 16.5, 35 * 3 / 17.5], "s2": [19 * 2 / 8.5, 19 * 3 / 9.5],
    "theta": [90.0, 0.0],
}  # fmt: skip


@pytest.fixture(scope="module")
def points() -> Points:
    return bifocal.solve(PICKS, taking=Taking(d1=17.5, d2=9.5, c1=35, c2=19)).to_points()


def test_solved_points_are_a_table_by_name(points):
    pytest.importorskip("pandas")
    table = points.to_dataframe()
    assert list(table.index) == ["P1", "P2"]
    assert table.loc["P1", ["X", "Y", "r"]].tolist() == pytest.approx([2, 0, 1], abs=1e-9)
    assert table.loc["P2", ["X", "Y", "r"]].tolist() == pytest.approx([0, 3, 0], abs=1e-9)
    assert table.loc["P1", "sigma_r"] == points.sigma_r[0]
    assert "E" not in table
    assert "sigma_E" not in table


def test_points_are_geojson_in_metres(points):
    features = points.to_geojson()["features"]
    assert features[0]["geometry"] == {"type": "Point", "coordinates": [2.0, 0.0, 1.0]}
    assert features[1]["properties"]["relief"] == pytest.approx(0, abs=1e-9)
    json.dumps(features, allow_nan=False)
    with pytest.raises(InputError, match="no world coordinates; leave out world=True"):
        points.to_geojson(world=True)


def test_a_point_without_a_place_has_no_geometry_in_geojson():
    lost = Points(
        ids=("A",), xyz=np.full((1, 3), np.nan), sigma_r=np.array([np.nan]), flags=("NADIR",),
        notes=("",),
    )  # fmt: skip
    assert lost.to_geojson()["features"][0]["geometry"] is None


def test_points_relief_maps_and_orthophotos_draw_themselves(points):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    axes = points.plot()
    assert axes.collections[0].get_offsets().tolist() == points.xyz[:, :2].tolist()
    assert axes.collections[0].get_array().tolist() == points.xyz[:, 2].tolist()
    relief = bifocal.ReliefMap.from_relief(
        [[0.0, 1.0]], plane_from_pixel=[[0.5, 0, 10], [0, -0.5, 20], [0, 0, 1]]
    )
    image = relief.plot().images[0]
    assert image.get_extent() == [9.75, 10.75, 19.75, 20.25]
    assert image.get_array().tolist() == [[0.0, 1.0]]
    picture = bifocal.Orthophoto(
        image=np.uint8([[[255, 0, 51], [0, 0, 0]]]), source=np.uint8([[1, 0]]),
        hidden=np.zeros((1, 2), bool), plane_from_pixel=relief.plane_from_pixel,
    )  # fmt: skip
    image = picture.plot().images[0]
    assert image.get_extent() == [9.75, 10.75, 19.75, 20.25]
    assert image.get_array().tolist() == [[[1.0, 0.0, 0.2, 1.0], [0.0, 0.0, 0.0, 0.0]]]
    pyplot.close("all")


def test_what_match_gives_is_solved_as_it_is():
    pair = Pair.ideal(
        d1=17.5, d2=9.5, c1=35, c2=19, pixel_size=0.0074, nadir1=(1536, 1024), nadir2=(1536, 1024)
    )
    pixels = pair.project([[1.0, 0.5, 0.3], [-1.0, 0.2, -0.1]])
    one = np.ones(2)
    matches = Matches(
        pixels1=pixels[0], pixels2=pixels[1], sigma=one, misfit=one, agreement=one,
        ids=("M1", "M2"), kinds=("feature", "feature"),
    )  # fmt: skip
    solved = bifocal.solve(matches, pair=pair).to_points()
    assert solved.ids == ("M1", "M2")
    assert solved.xyz == pytest.approx(np.array([[1.0, 0.5, 0.3], [-1.0, 0.2, -0.1]]), abs=1e-6)
    crossed = pair.intersect(*pixels).to_points(["M1", "M2"])
    assert crossed.xyz == pytest.approx(solved.xyz, abs=1e-6)
    assert crossed.sigma_r == pytest.approx(solved.sigma_r, rel=1e-6)


def test_control_is_read_with_the_precision_that_the_command_takes(tmp_path):
    table = tmp_path / "control.csv"
    table.write_text("id,X,Y,r,col1,row1,col2,row2\nA,0,0,,10,20,11,21\nB,1,0,0.2,30,20,31,21\n")
    control = bifocal.read_control(table)
    assert control.sigma[0].tolist() == pytest.approx([0.003, 0.003, 0.005])
    assert control.sigma[1].tolist() == pytest.approx([0.003] * 3)
