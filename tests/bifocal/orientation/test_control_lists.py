"""Control as a total station and other programs give it: E, N, H of walls, a row for each photo."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal.model.world_frame import WorldFrame
from bifocal.orientation.control_points import read_control
from photocore.errors import InputError, WorkbookError

#: X along the wall, Y = height, r outwards; the wall's own points and a cornice. [m]
WALL = np.array(
    [[0, 251, 0], [8, 251.5, 0], [8, 258, 0], [0.5, 257, 0], [3, 254, 0], [5, 256, 0],
     [2, 256, 0.3]]
)  # fmt: skip
PHOTOS = ("far.JPG", "near.JPG")


def in_world(azimuth_deg):
    """E, N, H of the wall by its own definition: X in this azimuth, r to its right."""
    a = np.deg2rad(azimuth_deg)
    east = 652345.0 + WALL[:, 0] * np.sin(a) + WALL[:, 2] * np.cos(a)
    north = 6862123.0 + WALL[:, 0] * np.cos(a) - WALL[:, 2] * np.sin(a)
    return np.column_stack([east, north, WALL[:, 1]])


def picks(scale, turned=0):
    """Pixels of the wall from its front, the photo turned by so many quarters."""
    flat = (WALL[:, :2] - [0, 260]) * [scale, -scale] + 50
    for _ in range(turned):
        flat = np.column_stack([1000 - flat[:, 1], flat[:, 0]])
    return flat


def written(folder, coordinates, headings="id,E,N,H", turned=0):
    pixels = np.hstack([picks(40.0, turned), picks(41.0, turned)])
    rows = [
        ",".join([f"P{k}", *(f"{v:.4f}" for v in (*place, *at))])
        for k, (place, at) in enumerate(zip(coordinates, pixels, strict=False))
    ]
    path = folder / "control.csv"
    path.write_text(f"{headings},col1,row1,col2,row2\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("azimuth", [0.0, 37.3, 90.0, 181.0, 300.0])
@pytest.mark.parametrize("turned", [0, 1])
def test_an_upright_wall_in_e_n_h_becomes_x_along_it_y_height_and_r_outwards(
    tmp_path, azimuth, turned
):
    control = read_control(written(tmp_path, in_world(azimuth), turned=turned))
    np.testing.assert_allclose(control.xyz, WALL, atol=2e-4)
    frame = control.frame
    assert np.rad2deg(frame.azimuth) % 360 == pytest.approx(azimuth, abs=2e-3)
    np.testing.assert_allclose(frame.to_world(control.xyz), in_world(azimuth), atol=1e-4)
    assert any("E, N, H of an upright wall" in text for text in control.remarks)


def test_a_frame_of_a_pair_reads_other_points_into_itself(tmp_path):
    frame = WorldFrame(east=652345.0, north=6862123.0, height=0.0, azimuth=np.deg2rad(37.3))
    read_back = WorldFrame.of({"world": frame.to_json()})
    control = read_control(written(tmp_path, in_world(37.3)[:3]), frame=read_back)
    np.testing.assert_allclose(control.xyz, WALL[:3], atol=1e-4)
    assert WorldFrame.of({}) is None
    with pytest.raises(InputError, match='entry "world" is damaged'):
        WorldFrame.of({"world": {"E": 1}})


def test_geodetic_order_and_x_y_z_of_an_upright_wall_are_understood(tmp_path):
    world = in_world(37.3)
    for headings in ("Punkt,Y,X,H", "Punkt,Y,X,Z"):
        control = read_control(written(tmp_path, world, headings))
        np.testing.assert_allclose(control.xyz, WALL, atol=2e-4)
        assert any("Y is taken as east" in text for text in control.remarks)
    control = read_control(written(tmp_path, world, "id,X,Y,Z"))
    np.testing.assert_allclose(control.xyz, WALL, atol=2e-4)
    for headings in ("id,N,E,H", "Pkt,X (North),Y (East),Hoogte"):
        places = read_control(written(tmp_path, world[:, [1, 0, 2]], headings))
        np.testing.assert_allclose(places.xyz, WALL, atol=2e-4)
    with pytest.raises(InputError, match='"Hoogtemaat" is not understood'):
        read_control(written(tmp_path, world, "id,X,Y,Hoogtemaat"))


def test_x_y_r_and_e_n_alone_are_read_as_they_stand(tmp_path):
    for headings in ("id,X,Y,r", "id,X,Y,Z", "id,E,N,r"):
        control = read_control(written(tmp_path, WALL, headings))
        np.testing.assert_allclose(control.xyz, WALL, atol=1e-4)
        assert control.frame is None
        assert control.remarks == ()


def test_a_line_a_slope_and_a_wall_nobody_saw_are_refused(tmp_path):
    world = in_world(37.3)
    with pytest.raises(InputError, match="lie on one line"):
        read_control(written(tmp_path, np.linspace(world[0], world[2], 5)))
    sloping = world @ np.array([[1, 0, 0], [0, 0.7, 0.7], [0, -0.7, 0.7]])
    with pytest.raises(InputError, match="neither upright nor level"):
        read_control(written(tmp_path, sloping))
    path = tmp_path / "unseen.csv"
    rows = [f"P{k},{e},{n},{h},,,," for k, (e, n, h) in enumerate(world)]
    path.write_text("id,E,N,H,col1,row1,col2,row2\n" + "\n".join(rows))
    with pytest.raises(InputError, match="the front of the wall is not known"):
        read_control(path)


def listed(folder, names=PHOTOS, head="EPSG:2154", change=lambda text: text):
    lines = [
        f"{e:.4f} {n:.4f} {h:.4f} {at[0]:.3f} {at[1]:.3f} {photo} P{k}"
        for k, (e, n, h) in enumerate(in_world(37.3))
        for photo, at in zip(names, (picks(40.0)[k], picks(41.0)[k]), strict=True)
    ]
    path = folder / "gcp_list.txt"
    path.write_text(change("\n".join([head, *lines]) + "\n"), encoding="utf-8")
    return path


def test_a_row_for_each_photo_is_taken_wherever_columns_for_each_are(tmp_path):
    control = read_control(listed(tmp_path), names=("x/far.jpg", "x/near.jpg"))
    np.testing.assert_allclose(control.xyz, WALL, atol=2e-4)
    np.testing.assert_allclose(control.pixels1, picks(40.0), atol=1e-3)
    np.testing.assert_allclose(control.pixels2, picks(41.0), atol=1e-3)
    alone = read_control(listed(tmp_path), names=("near.JPG",), photos=1)
    np.testing.assert_allclose(alone.pixels1, picks(41.0), atol=1e-3)
    assert any("1 other photos are not used here: far.JPG" in text for text in alone.remarks)


def test_rows_of_no_such_photo_and_of_one_photo_twice_are_named(tmp_path):
    with pytest.raises(InputError, match=r"no row is of the photo .*nearest name is far\.JPG"):
        read_control(listed(tmp_path), names=("fare.jpg", "nahe.jpg"))
    with pytest.raises(WorkbookError, match="is picked in this photo in"):
        read_control(listed(tmp_path, names=("far.JPG", "far.JPG")), names=PHOTOS)
    path = listed(tmp_path, change=lambda text: text.replace("652345.0", "652346.0", 1))
    with pytest.raises(WorkbookError, match="already, with other coordinates"):
        read_control(path, names=PHOTOS)


@pytest.mark.parametrize("place", [(0.0, 0.0), (-1.0, -1.0)])
def test_one_pixel_of_several_points_stands_for_not_seen(tmp_path, place):
    path = written(tmp_path, WALL, "id,X,Y,r")
    lines = path.read_text().splitlines()
    for row in (2, 4):
        fields = lines[row].split(",")
        lines[row] = ",".join([*fields[:4], *map(str, place), *fields[6:]])
    path.write_text("\n".join(lines))
    control = read_control(path)
    assert np.isnan(control.pixels1[[1, 3]]).all()
    assert np.isfinite(control.pixels1).sum() == 2 * (len(WALL) - 2)
    assert np.isfinite(control.pixels2).all()
    assert any("not seen: P1, P3" in text for text in control.remarks)


def test_photos_called_alike_are_told_by_their_folders(tmp_path):
    path, names = tmp_path / "long.csv", ("/x/a/1.JPG", "/x/b/1.JPG")
    rows = [f"P{k},{k},{k % 3},0,{c}/1.jpg,{k * n},{k}" for n, c in ((5, "b"), (7, "A"))
            for k in range(4)]  # fmt: skip
    path.write_text("\n".join(["id,X,Y,r,photo,col,row", *rows]))
    control = read_control(path, names=names)
    assert (control.pixels1[1, 0], control.pixels2[1, 0]) == (7, 5)
    path.write_text(path.read_text().replace("A/", ""))
    with pytest.raises(WorkbookError, match=r"may be /x/a/1\.JPG or /x/b/1\.JPG"):
        read_control(path, names=names)


@pytest.mark.parametrize("plan", ["Ost,Nord", "X,Y"])
@pytest.mark.parametrize(
    "heading",
    ["Z-Wert", "Quota s.l.m.", "Elev.", "H ortho", "Cota", "Höhe NHN", "Höhe m ü. NN", "RL",
     "Z [m ü. NN]", "Elevation (m) ASL", "Alt. NGF", "Höhe DHHN2016", "Orthometric height"],
)  # fmt: skip
def test_heights_above_some_datum_are_heights(tmp_path, heading, plan) -> None:
    control = read_control(written(tmp_path, in_world(70.0), headings=f"id,{plan},{heading}"))
    np.testing.assert_allclose(control.xyz, WALL, atol=2e-4)


def test_what_stands_beside_e_and_n_is_asked_about_or_named_unless_it_is_of_a_tool(tmp_path):
    for heading in ("Ellipsoidal height", "Quota ass.", "Kote Sockel"):
        with pytest.raises(InputError, match=f'"{heading}" is not understood'):
            read_control(written(tmp_path, in_world(70.0), headings=f"id,E,N,{heading}"))
    control = read_control(written(tmp_path, in_world(70.0), headings="id,E,N,Niveau"))
    assert any("left out: Niveau. If one holds heights, call it H" in t for t in control.remarks)
    control = read_control(written(tmp_path, in_world(70.0), headings="id,E,N,Antenna height"))
    assert not control.remarks


def test_x_and_y_in_pixels_beside_x_and_y_in_metres_are_where_the_point_is_seen(tmp_path):
    path = tmp_path / "c.csv"
    path.write_text("Point,Image,x [px],y [px],X [m],Y [m]\nA,f.jpg,10,20,1,2\n")
    control = read_control(path, photos=1, names=("f.jpg",))
    assert control.pixels1.tolist() == [[10, 20]]
    assert control.xyz[:, :2].tolist() == [[1, 2]]


def test_pixels_alone_are_control_only_where_a_rectangle_gives_the_places(tmp_path):
    path = tmp_path / "c.csv"
    path.write_text("id,X Ort,Y Ort,col,row\nA,1,2,10,20\n")
    assert read_control(path, photos=1).pixels1.tolist() == [[10, 20]]
    with pytest.raises(InputError, match=r'X, Y is missing.*not understood: "X Ort", "Y Ort"'):
        read_control(path, photos=1, with_places=True)


def test_heights_without_x_and_y_name_the_headings_that_are_not_understood(tmp_path):
    with pytest.raises(InputError, match=r'X, Y is missing.*not understood: "Droite", "Haut"'):
        read_control(written(tmp_path, in_world(70.0), headings="id,Droite,Haut,H"))


@pytest.mark.parametrize("heading", ["Hxhe", "Hˆhe", "Quta"])  # mistyped, or in another encoding
def test_a_third_heading_that_is_nearly_a_height_is_asked_about(tmp_path, heading) -> None:
    path = written(tmp_path, in_world(70.0), headings=f"id,Ost,Nord,{heading}")
    with pytest.raises(InputError, match=f'"{heading}" is not understood; near it is'):
        read_control(path)
    columns = f"H={heading}"
    np.testing.assert_allclose(np.ptp(read_control(path, columns=columns).xyz[:, 1]), 7, atol=1e-3)
    # Beside X and Y of the wall the third may be the user's own; a word beside E, N is no height.
    (words,) = read_control(written(tmp_path, WALL, headings=f"id,X,Y,{heading}")).remarks
    assert "counts as one on the wall" in words
