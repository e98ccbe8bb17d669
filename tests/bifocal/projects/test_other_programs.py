"""Finished projects of other programs, read as their documents say, and made sets of photos."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from bifocal import (
    InputError,
    Lens,
    PhotoSet,
    ProjectOptions,
    orthophoto,
    photos_from_project,
    read_image,
    write_colmap,
)
from bifocal.model.basis import rests_on
from bifocal.model.doubts import unit_of
from bifocal.model.geotiff import RasterReader
from photocore.programs.model import ForeignProject
from photocore.programs.photos import PhotoFinder
from photocore.programs.projects import read_foreign_project
from tests.builders import foreign_projects as made
from tests.builders.commands import bifocal_command as main

BROWN = {"terms": (-0.06, 0.02, 0.0015, -0.002, 0.004), "offset": (6.5, -4.25)}
RADIAL = {"terms": (-0.06, 0.02, 0, 0, 0)}
#: Each program's project: name of file or folder, what writes it, what its lens model can say.
PROJECTS = {
    "colmap text": ("model", made.write_colmap_text, BROWN | {"squash": 1.01}),
    "colmap binary": ("model", made.write_colmap_binary, BROWN | {"squash": 1.01}),
    "metashape": ("cameras.xml", lambda p, s, _: made.write_metashape(p, s),
                  BROWN | {"squash": 1.01}),
    "opensfm": ("reconstruction.json", made.write_opensfm, BROWN | {"squash": 1.01}),
    "openmvg": ("sfm_data.json", lambda *a: made.write_openmvg(*a, nested=False), BROWN),
    "openmvg nested": ("sfm_data.json", lambda *a: made.write_openmvg(*a, nested=True), BROWN),
    "bundler": ("bundle.out", made.write_bundler, RADIAL),
    "nerf": ("transforms.json", made.write_nerf, BROWN | {"squash": 1.01}),
    "realitycapture xmp": ("", made.write_reality_xmp, BROWN | {"squash": 1.01}),
    "realitycapture table": ("cameras.csv", made.write_reality_table, BROWN),
    "visualsfm": ("model.nvm", made.write_visualsfm, {"terms": (0, 0, 0, 0, 0)}),
    **{
        f"alicevision {'.'.join(map(str, version))}": (
            "cameras.sfm", lambda *a, v=version: made.write_alicevision(*a, v),
            BROWN | ({"squash": 1.01} if version >= (1, 2, 0) else {}),
        )
        for version in ((1, 1, 0), (1, 2, 0), (1, 2, 1), (1, 2, 3), (1, 2, 6), (1, 2, 11))
    },
}  # fmt: skip


def project_of(folder: Path, kind: str) -> tuple[Path, list[made.Shot], np.ndarray]:
    """Write the photos and one program's project of the scene."""
    name, write, lens = PROJECTS[kind]
    shots, xyz = made.make_shots(**lens), made.to_world(made.wall_points())
    made.render(shots, folder)
    return write(folder / name, shots, xyz), shots, xyz


@pytest.mark.parametrize("kind", PROJECTS)
def test_a_project_is_seen_as_its_program_sees_it(tmp_path: Path, kind: str) -> None:
    path, shots, xyz = project_of(tmp_path, kind)
    read = read_foreign_project(path, PhotoFinder(path))
    assert len(read.views) == len(shots)
    for view, shot in zip(read.views, shots, strict=True):
        before = xyz[((xyz - shot.place) @ shot.rotation[2]) > 1]
        seen = shot.pixels(before)
        near = (np.abs(seen - shot.centre) < shot.size[0]).all(axis=1)
        lens = Lens(**view.lens._asdict())
        rays = (before[near] - view.centre) @ view.rotation.T @ lens.camera_matrix.T
        found = lens.distort(rays[:, :2] / rays[:, 2:])
        np.testing.assert_allclose(found, seen[near], atol=1e-7)
    if kind not in ("metashape", "nerf", "realitycapture xmp", "realitycapture table"):
        np.testing.assert_allclose(read.points, xyz, atol=1e-12)


def picks(folder: Path, shots: list[made.Shot], named: dict[str, tuple[float, ...]]) -> Path:
    """Write where points of the wall are seen in the three photos of its front."""
    rows = ["id,photo,col [px],row [px]"]
    for name, place in named.items():
        for shot in shots[:3]:
            column, row = shot.pixels(made.to_world(np.array([place], dtype=float)))[0]
            rows.append(f"{name},{shot.file},{column:.6f},{row:.6f}")
    path = folder / "picks.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


CORNERS = {"A": (-1.5, -1, 0), "B": (1.5, -1, 0), "C": (1.4, 1.1, 0), "D": (-1.4, 1, 0.1)}


@pytest.mark.parametrize("kind", ["colmap text", "metashape", "opensfm"])
def test_each_project_gives_the_wall_itself_as_its_orthophoto(tmp_path: Path, kind: str) -> None:
    path, shots, xyz = project_of(tmp_path, kind)
    cloud, points = tmp_path / "sparse.csv", picks(tmp_path, shots, CORNERS)
    rows = "\n".join(",".join(f"{v:.9f}" for v in row) for row in xyz)
    cloud.write_text(f"X,Y,Z\n{rows}\n")
    if kind == "metashape":  # and the points by RealityCapture
        points.write_text(
            points.read_text().replace("id,photo,col [px],row [px]", "name,#image,x,y")
        )
    options = ProjectOptions(cloud=cloud, points=points, length=("A", "B", "3.0"))
    result = photos_from_project(path, tmp_path / "wall.photos.json", options)
    found = PhotoSet.read(tmp_path / "wall.photos.json")
    # The wall is found, not the ground before it; the photo of its back is left out.
    assert found.names == ("DSC_0", "DSC_1", "DSC_2")
    assert "DSC_3" in "".join(result.remarks)
    np.testing.assert_allclose([p.distance for p in found.photos], [12, 7, 7.5], atol=3e-3)
    image = read_image(found.photos[1].path)
    picture = orthophoto(found.pair(0, 1), image, gsd=0.02, bounds=(-1, -0.8, 1, 0.8), source=2)
    # Where is the found frame's origin on the wall, and how is it turned?
    feet = np.array([p.nadir for p in found.photos])
    true = np.array([[0.4, -0.3], [0.2, -0.5], [1.7, -0.4]])
    turn, move = _rigid(feet, true)
    assert np.rad2deg(abs(np.arctan2(turn[1, 0], turn[0, 0]))) < 0.1
    rows, columns = picture.image.shape[:2]
    x = -1 + 0.02 * (np.arange(columns) + 0.5)
    y = 0.8 - 0.02 * (np.arange(rows) + 0.5)
    xy = np.stack(np.meshgrid(x, y), axis=-1) @ turn.T + move
    away = picture.image[..., 0].astype(float) - made.texture(xy)
    # The texture rises by up to 290 grey values a metre: 0.1 px of 2 cm is 0.6 of them.
    assert np.abs(np.median(away)) < 0.3
    assert np.sqrt(np.mean(away**2)) < 1.2


def _rigid(source: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    p, q = source - source.mean(0), target - target.mean(0)
    u, _, v = np.linalg.svd(q.T @ p)
    turn = u @ np.diag([1, np.linalg.det(u @ v)]) @ v
    return turn, target.mean(0) - turn @ source.mean(0)


def test_three_programs_give_one_orthophoto(tmp_path: Path) -> None:
    pictures = []
    for kind in ("colmap text", "metashape", "opensfm"):
        folder = tmp_path / kind
        path, shots, _ = project_of(folder, kind)
        control = folder / "control.csv"
        lines = [f"{name},{x},{y},{r}" for name, (x, y, r) in CORNERS.items()]
        control.write_text("id,X [m],Y [m],r [m]\n" + "\n".join(lines) + "\n")
        options = ProjectOptions(points=picks(folder, shots, CORNERS), control=control)
        made_set = photos_from_project(path, folder / "wall.photos.json", options).photos
        np.testing.assert_allclose(made_set.photos[0].nadir, (0.4, -0.3), atol=1e-5)
        pair = PhotoSet.read(folder / "wall.photos.json").pair(0, 2)
        picture = orthophoto(pair, pair.photo1.image, gsd=0.02, bounds=(-1, -0.8, 1, 0.8))
        pictures.append(picture.image.astype(int))
    assert np.abs(pictures[1] - pictures[0]).max() <= 1
    assert np.abs(pictures[2] - pictures[0]).max() <= 1


def test_what_gives_the_scale_is_said_and_none_is_invented(tmp_path: Path) -> None:
    path, shots, xyz = project_of(tmp_path, "opensfm")
    out = tmp_path / "wall.photos.json"
    result = photos_from_project(path, out)
    assert result.scale.startswith("no scale: unit of the model")
    # The set itself says so, and whatever is made of it.
    assert any("no scale" in text for text in PhotoSet.read(out).pair(0, 1).remarks)
    assert result.photos.photos[0].distance == pytest.approx(12 * made.UNIT, rel=1e-3)
    data = json.loads(out.read_text())
    assert data["unit"] == "none"
    pair = out.with_name("w.pair.json")
    PhotoSet.read(out).pair(0, 1).write(pair)
    plain = ["ortho", pair, "--plane", "0", "--any-size", "--gsd", "0.05"]
    for words in ([*plain, "--scale", "1:50", "--out", tmp_path / "o.tif"],
                  [*plain, "--scale", "1:50", "--deliver", tmp_path / "sheet"],
                  ["report", pair, "--scale", "1:50", "--out", tmp_path / "r.html"]):  # fmt: skip
        done = CliRunner().invoke(main, [*map(str, words)])
        assert (done.exit_code, "no drawing is to scale" in done.stderr) == (1, True), done.output
        assert not words[-1].exists()
    del data["unit"]  # as older versions wrote it
    assert unit_of(data) == "none"
    done = CliRunner().invoke(main, [*map(str, plain), "--out", str(tmp_path / "o.tif")])
    assert done.exit_code == 0, done.output
    with RasterReader(tmp_path / "o.tif") as reader:
        assert reader.tags["BIFOCAL_UNIT"] == "none"
    options = ProjectOptions(unit="cm")
    result = photos_from_project(path, out, options, overwrite=True)
    assert result.photos.photos[0].distance == pytest.approx(0.12 * made.UNIT, rel=1e-3)
    made.write_opensfm(path, shots, xyz, gps=True)
    result = photos_from_project(path, out, overwrite=True)
    assert "positions of the photos" in result.scale
    assert not any("no scale" in text for text in result.remarks)


def test_the_walls_of_a_house_are_listed_and_run_on_about_their_corner(tmp_path: Path) -> None:
    front, flank = made.make_shots()[:3], made.make_flank_shots()
    made.render(front, tmp_path)
    made.render(flank, tmp_path, made.FLANK)
    xyz = made.to_world(np.vstack([made.wall_points(), made.flank_points()]))
    path = made.write_colmap_text(tmp_path / "model", [*front, *flank], xyz)
    sets = []
    for number in ("1", "2"):
        out = tmp_path / f"w{number}.photos.json"
        done = CliRunner().invoke(
            main, ["photos", str(path), "--wall", number, "--unit", "m", "--out", str(out)]
        )
        assert done.exit_code == 0, done.output
        assert "wall 1 of 2: 2.4 x 1.6 m, 36 % of the points" in done.output
        assert "wall 2 of 2: " in done.output
        sets.append(PhotoSet.read(out))
    assert [list(photos.names) for photos in sets] == [
        [f"{name}_{k}" for k in range(3)] for name in ("DSC", "SIDE")
    ]
    np.testing.assert_allclose(
        [p.distance for p in sets[1].photos], made.UNIT * np.r_[10, 7, 7.5], rtol=1e-4
    )
    # Where both meet, X and Y are one: at X = 3 of the front.
    corner = made.to_world(np.array([[3.0, -1, 0], [3, 0, 0], [3, 1, 0]]))
    places = [
        photos.intersect([shot.pixels(corner) for shot in shots]).xyz / made.UNIT
        for photos, shots in zip(sets, (front, flank), strict=True)
    ]
    np.testing.assert_allclose(places[0], places[1], atol=0.05)
    assert places[0][1, 0] - sets[0].photos[0].nadir[0] / made.UNIT == pytest.approx(2.6, abs=0.05)
    # Both walls stand in the picture as their photos show them.
    picture = read_image(tmp_path / "w1.walls.jpg")
    assert picture.shape[1] == 800
    halves = picture[60:500, 20:780], picture[700:1300, 20:780]
    assert all(half.std() > 20 for half in halves)
    with pytest.raises(InputError, match="2 walls are found"):
        photos_from_project(path, tmp_path / "w.photos.json", ProjectOptions(wall=("3",)))


def test_a_scaled_metashape_chunk_is_metric(tmp_path: Path) -> None:
    _, shots, xyz = project_of(tmp_path, "metashape")
    path = made.write_metashape(tmp_path / "chunk.xml", shots, scale=2.5)
    points = tmp_path / "points.csv"
    rows = [f"{k},{x},{y},{z}" for k, (x, y, z) in enumerate(xyz[:3].tolist())]
    points.write_text("id,x,y,z\n" + "\n".join(rows) + "\n")
    options = ProjectOptions(points=points, wall=("0", "1", "2"))
    result = photos_from_project(path, tmp_path / "wall.photos.json", options)
    assert "chunk's transform" in result.scale
    assert result.photos.photos[0].distance == pytest.approx(12 * made.UNIT, rel=2e-3)
    assert any("lost" in text for text in result.remarks)


def metashape(path: Path) -> ElementTree.ElementTree:
    """Return a chunk of five aligned cameras of the scene, to be changed."""
    made.write_metashape(path, made.make_shots(**PROJECTS["metashape"][2]))
    return ElementTree.parse(path)


def read_again(
    path: Path, tree: ElementTree.ElementTree, part: str | None = None
) -> ForeignProject:
    tree.write(path)
    return read_foreign_project(path, PhotoFinder(path), part)


def test_components_of_metashape_share_no_frame_the_largest_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "cameras.xml"
    tree = metashape(path)
    whole = read_foreign_project(path, PhotoFinder(path))
    chunk = tree.getroot().find("chunk")
    cameras = chunk.findall("./cameras/camera")[:-1]  # the last is not aligned
    for k, camera in enumerate(cameras):
        camera.set("component_id", "0" if k < 1 else "1")
    chunk.append(ElementTree.fromstring(
        '<components><component id="0"><transform><rotation>1 0 0 0 1 0 0 0 1</rotation>'
        "<translation>5 0 0</translation><scale>2</scale></transform></component>"
        '<component id="1"><transform><rotation>0 -1 0 1 0 0 0 0 1</rotation><translation>0 0 7'
        "</translation><scale>3</scale></transform></component></components>"))  # fmt: skip
    read = read_again(path, tree)
    assert [view.name for view in read.views] == [view.name for view in whole.views[1:]]
    assert "chunk 1/0 (1)" in " ".join(read.remarks)
    # x' = -3 y, y' = 3 x, z' = 3 z + 7, by hand.
    x, y, z = whole.views[1].centre
    np.testing.assert_allclose(read.views[0].centre, [-3 * y, 3 * x, 3 * z + 7], atol=1e-9)
    other = read_again(path, tree, "chunk 1/0")
    np.testing.assert_allclose(other.views[0].centre, 2 * whole.views[0].centre + [5, 0, 0])
    with pytest.raises(InputError, match=r"no part middle; it has chunk 1/0 \(1\), chunk 1/1"):
        read_again(path, tree, "middle")


def test_of_two_chunks_the_one_with_more_photos_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "cameras.xml"
    tree = metashape(path)
    root = tree.getroot()
    small = copy.deepcopy(root.find("chunk"))
    small.set("label", "trial")
    for camera in small.findall("./cameras/camera")[1:]:
        small.find("cameras").remove(camera)
    root.insert(0, small)
    read = read_again(path, tree)
    assert len(read.views) > 1
    assert "trial (1)" in " ".join(read.remarks)
    assert len(read_again(path, tree, "trial").views) == 1


def test_cameras_switched_off_stay_out_and_a_rolling_shutter_is_said(tmp_path: Path) -> None:
    path = tmp_path / "cameras.xml"
    tree = metashape(path)
    cameras = tree.getroot().findall(".//camera")
    names = [camera.get("label") for camera in cameras]
    cameras[0].set("enabled", "false")
    cameras[1].set("enabled", "0")
    ElementTree.SubElement(cameras[2], "rolling_shutter").text = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"
    read = read_again(path, tree)
    assert [view.name for view in read.views] == names[2:-1]
    said = " ".join(read.remarks)
    assert f"2 cameras are switched off in the project and left out: {names[0]}, {names[1]}" in said
    assert "1 cameras were adjusted with a rolling shutter" in said


@pytest.mark.parametrize("write", [made.write_colmap_text, made.write_colmap_binary])
def test_of_two_models_of_colmap_the_larger_is_taken(tmp_path: Path, write: Callable) -> None:
    shots, xyz = made.make_shots(**BROWN), made.to_world(made.wall_points())
    (tmp_path / "sparse").mkdir()
    write(tmp_path / "sparse" / "0", shots[:2], xyz)
    write(tmp_path / "sparse" / "1", shots, xyz)
    read = read_foreign_project(tmp_path, PhotoFinder(tmp_path))
    assert len(read.views) == len(shots)
    assert "sparse/0 (2)" in " ".join(read.remarks)
    assert len(read_foreign_project(tmp_path, PhotoFinder(tmp_path), "sparse/0").views) == 2


def test_sigmas_hold_what_the_length_and_the_control_are_worth(tmp_path: Path) -> None:
    path, shots, _ = project_of(tmp_path, "colmap text")
    table, out = picks(tmp_path, shots, CORNERS), tmp_path / "wall.photos.json"
    options = ProjectOptions(points=table, length=("A", "B", "3"), sigma_length=0.03)
    found = photos_from_project(path, out, options).photos
    place = np.array([[0.5, 0.4, 0.2]])
    # 1 % of the scale is 1 % of the place: shared by all, exact in its size.
    pair = PhotoSet.read(out).pair(0, 1)
    np.testing.assert_allclose(
        pair.covariance_of_orientation(place)[0], 1e-4 * place.T @ place, atol=1e-9
    )
    said = rests_on(pair, setup="the pair as given", picks="picks")
    assert said.endswith("the pair as given, with the covariance of its frame and scale alone.")
    control = tmp_path / "control.csv"
    lines = [f"{name},{x},{y},{r}" for name, (x, y, r) in CORNERS.items()]
    control.write_text("id,X [m],Y [m],r [m]\n" + "\n".join(lines) + "\n")
    options = ProjectOptions(points=table, control=control, sigma_control=0.01)
    found = photos_from_project(path, out, options, overwrite=True).photos
    # By chance: control moved by 1 cm moves the frame, and points with it.
    rng, sums, xyz = np.random.default_rng(2), [], np.array(list(CORNERS.values()), dtype=float)
    for _ in range(3000):
        scale, turn, shift = _similarity(xyz, xyz + rng.normal(0, 0.01, xyz.shape))
        sums.append(scale * turn @ place[0] + shift)
    stated = found.pair(0, 2).covariance_of_orientation(place)[0]
    np.testing.assert_allclose(np.sqrt(np.diag(stated)), np.std(np.array(sums), axis=0), rtol=0.05)


def _similarity(source: np.ndarray, target: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    p, q = source - source.mean(0), target - target.mean(0)
    u, size, v = np.linalg.svd(q.T @ p)
    signs = np.array([1, 1, np.linalg.det(u @ v)])
    turn, scale = u @ np.diag(signs) @ v, (size * signs).sum() / (p**2).sum()
    return scale, turn, target.mean(0) - scale * turn @ source.mean(0)


def test_a_length_between_two_names_of_one_place_is_refused(tmp_path: Path) -> None:
    path, shots, _ = project_of(tmp_path, "colmap text")
    table = picks(tmp_path, shots, {"A": CORNERS["A"], "B": CORNERS["A"]})
    with pytest.raises(InputError, match="A and B are one place"):
        photos_from_project(
            path, tmp_path / "o.photos.json", ProjectOptions(points=table, length=("A", "B", "3"))
        )


def test_a_set_goes_out_as_colmap_and_comes_back(tmp_path: Path) -> None:
    path, shots, _ = project_of(tmp_path, "opensfm")
    options = ProjectOptions(points=picks(tmp_path, shots, CORNERS), length=("A", "B", "3"))
    found = photos_from_project(path, tmp_path / "wall.photos.json", options).photos
    write_colmap(found, tmp_path / "out")
    read = read_foreign_project(tmp_path / "out", PhotoFinder(tmp_path))
    xyz = np.array([[0.3, 0.2, 0.1], [-0.8, 0.5, -0.4], [0.1, -0.6, 0.3]])
    for view, photo in zip(read.views, found.photos, strict=True):
        lens = Lens(**view.lens._asdict())
        rays = (xyz - view.centre) @ view.rotation.T @ lens.camera_matrix.T
        seen = lens.distort(rays[:, :2] / rays[:, 2:])
        np.testing.assert_allclose(seen, photo.project(xyz), atol=1e-6)


def test_photos_called_alike_in_two_folders_stay_apart(tmp_path: Path) -> None:
    path, shots, _ = project_of(tmp_path, "colmap text")
    alike = [shots[0]._replace(file="a/DSC.png"), shots[1]._replace(file="b/DSC.png")]
    for shot, one in zip(shots, alike, strict=False):
        (tmp_path / one.file).parent.mkdir()
        shutil.move(tmp_path / shot.file, tmp_path / one.file)
    made.write_colmap_text(path, alike, made.to_world(made.wall_points()))
    out = tmp_path / "st.anna.photos.json"
    write_colmap(photos_from_project(path, out).photos, tmp_path / "out")
    words = (tmp_path / "out" / "images.txt").read_text().split()
    assert {"a/DSC.png", "b/DSC.png"} <= set(words)
    assert (tmp_path / "st.anna.lens1.json").is_file()
    for name in "ab":
        (tmp_path / name / "DSC.png").replace(tmp_path / "DSC.png")
    with pytest.raises(InputError, match=r"two photos, a/DSC\.png and b/DSC\.png; .* --images"):
        photos_from_project(path, tmp_path / "flat.photos.json")


def test_a_photo_that_its_exif_data_turn_is_taken_upright(tmp_path: Path) -> None:
    path, shots, _ = project_of(tmp_path, "colmap text")
    out, table = tmp_path / "wall.photos.json", picks(tmp_path, shots[:1] + shots[2:], CORNERS)
    xyz = np.array([[0.3, 0.2, 0.1], [-0.8, 0.5, -0.4]])
    options = ProjectOptions(points=table, wall=("A", "B", "C"), horizontal=("A", "B"))
    straight = photos_from_project(path, out, options).photos.project(xyz)[1]
    for orientation in (6, 8):
        data = Image.Exif()
        data[274] = orientation
        stored = tmp_path / shots[1].file
        with Image.open(stored) as image:
            image.save(stored, exif=data)
        turned = photos_from_project(path, out, options, overwrite=True).photos
        width, height = shots[1].size
        assert turned.photos[1].image_size == (height, width)
        assert read_image(turned.photos[1].path).shape[:2] == (width, height)
        column, row = straight.T
        upright = [height - 1 - row, column] if orientation == 6 else [row, width - 1 - column]
        np.testing.assert_allclose(turned.project(xyz)[1], np.transpose(upright), atol=1e-6)


@pytest.mark.parametrize("orientation", [6, 8])
def test_a_square_photo_that_its_exif_data_turn_is_refused(
    tmp_path: Path, orientation: int
) -> None:
    path, shots, _ = project_of(tmp_path, "colmap text")
    xyz = made.to_world(made.wall_points())
    made.write_colmap_text(path, [shots[0]._replace(size=(200, 200)), *shots[1:]], xyz)
    data = Image.Exif()
    data[274] = orientation
    Image.new("L", (200, 200), 90).save(tmp_path / shots[0].file, exif=data)
    with pytest.raises(InputError, match=rf"turned by its EXIF data \({orientation}\)"):
        photos_from_project(path, tmp_path / "wall.photos.json")


def test_photos_are_found_where_programs_keep_them(tmp_path: Path) -> None:
    path, _, _ = project_of(tmp_path / "shots", "opensfm")
    project = tmp_path / "odm"
    (project / "opensfm").mkdir(parents=True)
    shutil.move(path, project / "opensfm")
    shutil.move(tmp_path / "shots", project / "images")
    photos_from_project(project, tmp_path / "wall.photos.json")
    files = [p["file"] for p in json.loads((tmp_path / "wall.photos.json").read_text())["photos"]]
    assert files == [f"odm/images/DSC_{k}.png" for k in range(3)]


def test_what_only_its_program_can_read_is_refused_with_the_way_out(tmp_path: Path) -> None:
    for name, told in (("sfm.abc", "ConvertSfMFormat"), ("wall.psx", "Export Cameras")):
        (tmp_path / name).write_bytes(b"\0")
        with pytest.raises(InputError, match=told):
            photos_from_project(tmp_path / name, tmp_path / "wall.photos.json")
