"""Photos and maps are held against what a pair and its products were made from."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

import bifocal
from bifocal import Pair, ReliefMap
from bifocal.files.made_from import MadeFrom
from bifocal.model.photo_set import PhotoSet
from photocore.provenance import known_hash
from tests.builders.commands import bifocal_command as main

SIZE = (60, 40)


def photo(d, name, nadir=(0.0, 0.0)):
    metres = 4.0 / SIZE[0]
    return bifocal.Photo(
        plane_from_pixel=[[metres, 0, -2], [0, -metres, 1.3], [0, 0, 1]], nadir=nadir, distance=d,
        file=name, image_size=SIZE,
    )  # fmt: skip


def flat(folder, name, *photos, **causes):
    """Write a flat relief map that says it was made from photos."""
    grid = bifocal.Grid.from_bounds((-1.5, -1.0, 1.5, 1.0), gsd=0.1)
    tags = MadeFrom.of(photos, **causes).tags() if photos else None
    relief = ReliefMap.from_relief(
        np.zeros((grid.height, grid.width)), plane_from_pixel=grid.plane_from_pixel
    )
    relief.write(folder / name, tags=tags)
    return folder / name


@pytest.fixture
def wall(tmp_path):
    """The file of a pair beside its two photos."""
    for number, name in enumerate(("far.png", "near.png")):
        pixels = np.random.default_rng(number).integers(0, 256, (*SIZE[::-1], 3), np.uint8)
        Image.fromarray(pixels).save(tmp_path / name)
    pair = Pair(image1=photo(17.5, "far.png"), image2=photo(9.5, "near.png"))
    pair.write(tmp_path / "w.pair.json")
    return tmp_path / "w.pair.json"


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def ortho(pair, *more, out="o.tif"):
    return run("ortho", pair, *more, "--any-size", "--out", pair.parent / out, "--overwrite")


def retouch(path):
    pixels = np.asarray(Image.open(path)).copy()
    pixels[0, 0] ^= 1
    Image.fromarray(pixels).save(path)


def test_a_pair_file_says_of_which_files_its_photos_are(wall):
    data = json.loads(wall.read_text())
    for key, name in (("image1", "far.png"), ("image2", "near.png")):
        assert data[key]["sha256"] == known_hash(wall.parent / name)


@pytest.mark.parametrize(
    "words",
    [("relief", "--out", "r.tif"), ("ortho", "--plane", "0", "--image", "2", "--out", "o.tif"),
     ("match", "--out", "m.csv"), ("report", "--out", "r.html"),
     ("handover", "--relief", "flat.tif", "--out", "h.html")],
)  # fmt: skip
def test_a_photo_that_was_saved_again_is_refused_and_nothing_is_written(wall, words, monkeypatch):
    monkeypatch.chdir(wall.parent)
    flat(wall.parent, "flat.tif")
    retouch(wall.parent / "near.png")
    before = sorted(wall.parent.iterdir())
    done = run(words[0], wall.name, *words[1:])
    assert done.exit_code == 1, done.output
    assert "near.png: is not the file that the pair was made from" in done.stderr
    assert sorted(wall.parent.iterdir()) == before


def test_photos_exchanged_under_their_names_are_called_so(wall):
    far, near = wall.parent / "far.png", wall.parent / "near.png"
    far.rename(wall.parent / "x.png")
    near.rename(far)
    (wall.parent / "x.png").rename(near)
    done = ortho(wall, "--plane", "0")
    assert done.exit_code == 1
    assert "far.png: is the file that was near.png" in done.stderr


def test_who_must_goes_on_and_the_environment_is_as_before(wall):
    retouch(wall.parent / "near.png")
    before = dict(os.environ)
    assert ortho(wall, "--plane", "0", "--changed-photos").exit_code == 0
    assert dict(os.environ) == before
    with pytest.raises(bifocal.InputError, match=r"near\.png"):
        _ = Pair.read(wall).image2.image
    with bifocal.changed_photos():
        assert Pair.read(wall).image2.image.shape == (*SIZE[::-1], 3)


def test_a_folder_that_was_moved_and_files_of_another_time_are_fine(wall, tmp_path):
    copy = tmp_path / "elsewhere"
    shutil.copytree(wall.parent, copy, ignore=shutil.ignore_patterns("elsewhere"))
    for path in copy.iterdir():
        os.utime(path, (1, 1))
    assert ortho(copy / wall.name, "--plane", "0").exit_code == 0


def test_a_pair_without_digests_goes_on_and_one_that_recorded_its_inputs_is_held_to_them(wall):
    data = json.loads(wall.read_text())
    digests = {data[key].pop("sha256"): data[key]["file"] for key in ("image1", "image2")}
    wall.write_text(json.dumps(data))
    retouch(wall.parent / "near.png")
    assert ortho(wall, "--plane", "0").exit_code == 0
    inputs = [{"file": name, "sha256": digest} for digest, name in digests.items()]
    wall.write_text(json.dumps(data | {"provenance": {"inputs": inputs}}))
    assert "near.png: is not the file" in ortho(wall, "--plane", "0").stderr


@pytest.mark.parametrize("way", ["ortho", "handover", "report"])
def test_the_relief_of_another_pair_is_refused(wall, way, monkeypatch):
    monkeypatch.chdir(wall.parent)
    flat(wall.parent, "r.tif", photo(30.0, "far.png"), photo(12.0, "near.png"))
    out = {"ortho": "o.tif", "handover": "h.html", "report": "r.html"}[way]
    done = run(way, wall.name, "--relief", "r.tif", "--out", out)
    assert done.exit_code == 1, done.output
    assert "r.tif: was made from another pair" in done.stderr
    assert not (wall.parent / out).exists()


def test_the_same_distances_before_another_homography_are_another_pair(wall):
    moved = flat(wall.parent, "r.tif", photo(17.5, "", (0.2, 0.0)), photo(9.5, "", (0.2, 0.0)))
    assert "made from another pair" in ortho(wall, "--relief", moved).stderr


def test_one_camera_in_common_does_not_make_it_the_same_pair(wall):
    relief = flat(wall.parent, "r.tif", photo(18.0, "far.png"), photo(9.5, "near.png"))
    assert "made from another pair" in ortho(wall, "--relief", relief).stderr


def test_maps_of_older_versions_are_judged_by_their_distances(wall):
    grid = bifocal.Grid.from_bounds((-1.5, -1.0, 1.5, 1.0), gsd=0.1)
    relief = ReliefMap.from_relief(
        np.zeros((grid.height, grid.width)), plane_from_pixel=grid.plane_from_pixel
    )
    for name, d1, d2 in (("same.tif", "17.5", "9.5"), ("other.tif", "30", "12")):
        relief.write(wall.parent / name, tags={"BIFOCAL_D1": d1, "BIFOCAL_D2": d2})
    assert ortho(wall, "--relief", wall.parent / "same.tif").exit_code == 0
    assert ortho(wall, "--relief", wall.parent / "other.tif").exit_code == 1
    assert ortho(wall, "--relief", flat(wall.parent, "laser.tif")).exit_code == 0


def test_a_map_of_a_set_serves_every_pair_of_its_photos(wall):
    pair = Pair.read(wall)
    third = replace(photo(13.0, "near.png", (0.5, 0.0)), name="third")
    photos = PhotoSet(photos=(pair.image1, pair.image2, third), folder=wall.parent)
    relief = flat(wall.parent, "set.tif", *photos.photos)
    assert ortho(wall, "--relief", relief).exit_code == 0


def test_other_faces_and_another_relief_are_said_not_refused(wall):
    pair = Pair.read(wall)
    photos = pair.image1, pair.image2
    relief = flat(wall.parent, "r.tif", *photos, faces="0123456789abcdef")
    assert "with other drawn faces" in ortho(wall, "--relief", relief).stderr
    again = flat(wall.parent, "again.tif", *photos)
    shown = ("--relief", again, "--ortho", wall.parent / "o.tif")
    done = run("handover", wall, *shown, "--out", wall.parent / "h.html")
    assert done.exit_code == 0, done.output
    assert "o.tif: was made with another relief map" in done.stderr


def test_a_hash_is_taken_once_while_size_and_time_stay(wall, monkeypatch):
    path = wall.parent / "far.png"
    os.utime(path, (1, 1))
    known_hash(path)
    monkeypatch.setattr("photocore.provenance.file_hash", lambda _: "read again")
    assert known_hash(path) != "read again"
    os.utime(path, (2, 2))
    assert known_hash(path) == "read again"


def face(folder, r, x=0.0):
    ring = [[x, 0.0], [x + 0.5, 0.0], [x + 0.5, 0.5], [x, 0.0]]
    one = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [ring]},
           "properties": {"kind": "face", "name": "door", "relief": r}}  # fmt: skip
    path = folder / "f.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [one]}))
    return path


@pytest.mark.parametrize("r", [-240.0, 9.6])
@pytest.mark.parametrize("command", ["relief", "ortho"])
def test_a_face_where_no_wall_can_be_is_refused_and_not_kept(wall, r, command, monkeypatch):
    monkeypatch.chdir(wall.parent)
    words = {"relief": (), "ortho": ("--plane", "0")}[command]
    done = run(command, wall.name, *words, "--faces", face(wall.parent, r), "--out", "x.tif")
    assert done.exit_code == 1, done.output
    assert "face door" in done.stderr
    assert "in metres" in done.stderr
    assert not (wall.parent / "x.tif").exists()
    assert not (wall.parent / "w.faces.geojson").exists()


def test_a_face_that_no_photo_shows_is_named_and_one_in_the_picture_is_not(wall):
    def said(x):
        return ortho(wall, "--plane", "0", "--faces", face(wall.parent, -0.2, x)).stderr

    assert "no photo shows it" in said(600.0)
    assert "no photo shows it" not in said(0.2)
