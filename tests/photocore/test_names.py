"""Names of files, photos and points are found as people write them, or the nearest is named."""

import unicodedata
from pathlib import Path

import pytest
from click.testing import CliRunner

from bifocal.model.photo import Photo
from photocore.errors import InputError
from photocore.images import image_info
from photocore.names import meant, on_disk
from photocore.programs.photos import PhotoFinder
from photocore.tables.read import open_tables
from tests.builders.commands import bifocal_command

COMPOSED = "façade.jpg"
APART = unicodedata.normalize("NFD", COMPOSED)


def test_letters_composed_or_apart_are_one_name(tmp_path):
    (tmp_path / "été").mkdir()
    file = tmp_path / "été" / APART
    file.write_bytes(b"")
    wanted = tmp_path / unicodedata.normalize("NFD", "été") / COMPOSED
    assert on_disk(wanted).samefile(file)
    assert on_disk(wanted, any_case=False).samefile(file)


def test_of_two_files_that_differ_in_case_none_is_guessed(tmp_path):
    for name in ("Far.JPG", "FAR.jpg"):
        (tmp_path / name).write_bytes(b"")
    if len(list(tmp_path.iterdir())) == 2:
        assert on_disk(tmp_path / "far.jpg") == tmp_path / "far.jpg"
    (tmp_path / "Near.JPG").write_bytes(b"")
    assert on_disk(tmp_path / "near.jpg").name in ("Near.JPG", "near.jpg")
    assert not on_disk(tmp_path / "near.png").exists()


@pytest.mark.parametrize(
    ("name", "near"), [("IMG_1.png", '"IMG_1.JPG"?'), ("IMG_01.tif", '"IMG_1.JPG"?'),
                       ("IMG_2.JPG", "no such image.")],
)  # fmt: skip
def test_a_missing_photo_names_the_nearest_of_its_number(tmp_path, name, near):
    (tmp_path / "IMG_1.JPG").write_bytes(b"x")
    with pytest.raises(InputError) as error:
        image_info(tmp_path / name)
    assert str(error.value).endswith(near)


def test_a_missing_table_names_the_nearest(tmp_path):
    (tmp_path / "Survey.xlsx").write_bytes(b"x")
    with pytest.raises(InputError, match=r'Did you mean "Survey\.xlsx"'):
        open_tables(tmp_path / "survey.ods")


def test_a_pair_of_windows_finds_its_photos_of_other_case(tmp_path):
    (tmp_path / "IMG_1.JPG").write_bytes(b"x")
    (tmp_path / APART).write_bytes(b"x")
    plane = [[0.01, 0, 0], [0, -0.01, 0], [0, 0, 1]]
    entry = {"plane_from_pixel": plane, "nadir": [0, 0], "distance": 9.0}
    for file in ("img_1.jpg", COMPOSED):
        assert Photo.from_dict({**entry, "file": file}, "image1", tmp_path).path.is_file()


def test_a_command_takes_the_name_as_seen(tmp_path):
    (tmp_path / unicodedata.normalize("NFD", "relevé.csv")).write_text("id,x1\n")
    result = CliRunner().invoke(bifocal_command, ["solve", str(tmp_path / "relevé.csv")])
    assert "no such file" not in result.output


def test_points_are_called_as_the_others_call_them():
    assert meant(["t1", "7", "1.05"], ("T01", "007", "1.5")) == ["T01", "007", "1.05"]
    assert meant(["p2"], ("P2", "P02")) == ["p2"]


def test_photos_of_a_project_are_found_in_other_case(tmp_path):
    (tmp_path / "IMG_1.JPG").write_bytes(b"x")
    file = PhotoFinder(tmp_path / "a.xml", tmp_path).find("img_1.jpg")
    assert isinstance(file, Path)
    assert file.is_file()
