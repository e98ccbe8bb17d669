"""A photo of another size than its pair was made from is refused by every reader."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from bifocal import SAMPLE, Pair, dense_relief, match, orthophoto, read_image
from bifocal.collimation.pictures import Pictures
from bifocal.workbook.pair_workflow import read_pair
from multimedia import InputError
from tests.builders.commands import bifocal_command as main

CHANGES = {
    "reduced": (lambda image: image.resize((768, 512)), "768 x 512", "a copy reduced to 0.5"),
    "enlarged": (lambda image: image.resize((2304, 1536)), "2304 x 1536", "enlarged to 1.5"),
    "cropped": (lambda image: image.crop((0, 0, 1500, 1024)), "1500 x 1024", "a part of it"),
    "turned": (lambda image: image.transpose(Image.Transpose.ROTATE_90), "1024 x 1536", "turned"),
}


def sample_folder(folder, change=None):
    """Return a copy of the sample pair, its near photo changed."""
    for file in SAMPLE.iterdir():
        shutil.copyfile(file, folder / file.name)
    if change is not None:
        CHANGES[change][0](Image.open(SAMPLE / "near.jpg")).save(folder / "near.jpg", quality=95)
    return folder / "facade.pair.json"


def run(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


@pytest.mark.parametrize(
    ("command", "change"),
    [*(("relief", change) for change in CHANGES), ("ortho", "reduced"), ("match", "cropped"),
     ("adjust", "enlarged"), ("report", "reduced")],
)  # fmt: skip
def test_every_command_refuses_it_with_both_sizes(tmp_path, command, change):
    pair = sample_folder(tmp_path, change)
    more = {
        "relief": ["--out", "r.tif"],
        "ortho": ["--image", "2", "--out", "o.tif"],
        "match": ["--out", "m.csv"],
        "adjust": [pair, "--out", "joint"],
        "report": ["--out", "report.html"],
    }[command]
    first = pair
    if command == "report":
        first = tmp_path / "result.xlsx"
        solved = run("solve", tmp_path / "targets.csv", "--pair", pair, "--out", first)
        assert solved.exit_code == 0, solved.output
    if command == "adjust":
        more[0] = tmp_path / "second.pair.json"
        shutil.copyfile(pair, more[0])
    more[-1] = tmp_path / more[-1]
    done = run(command, first, *more)
    _, size, what = CHANGES[change]
    assert done.exit_code == 1, done.output
    assert f"near.jpg: {size} px, the pair was made from 1536 x 1024 px" in done.stderr
    assert what in done.stderr
    assert not more[-1].exists()


@pytest.mark.parametrize("change", CHANGES)
def test_arrays_of_another_size_are_refused_in_python_too(change):
    pair = Pair.read(SAMPLE / "facade.pair.json")
    far = read_image(SAMPLE / "far.jpg")
    near = np.asarray(CHANGES[change][0](Image.open(SAMPLE / "near.jpg")))
    for use in (
        lambda: dense_relief(pair, far, near), lambda: match(pair, far, near),
        lambda: orthophoto(pair, (far, near)), lambda: orthophoto(pair, near, source=2),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"image ?2: {CHANGES[change][1]} px"):
            use()


def test_the_page_refuses_it(tmp_path):
    pair = Pair.read(sample_folder(tmp_path, "reduced"))
    with pytest.raises(InputError, match=r"near\.jpg: 768 x 512 px"):
        Pictures(tmp_path / "tiles", [tmp_path / "far.jpg", tmp_path / "near.jpg"], pair)


def test_pair_files_from_before_sizes_were_noted_work_on(tmp_path):
    path = sample_folder(tmp_path)
    data = json.loads(path.read_text())
    for key in ("image1", "image2"):
        del data[key]["image_size"]
    path.write_text(json.dumps(data))
    done = run("ortho", path, "--gsd", "0.02", "--out", tmp_path / "o.tif")
    assert done.exit_code == 0, done.output
    assert "image_size" not in Pair.read(path).to_dict()["image1"]


@pytest.mark.parametrize("size", [[1536], [0, 5], [1.5, 2], "wide", [float("nan"), 1]])
def test_an_impossible_size_is_named(tmp_path, size):
    path = sample_folder(tmp_path)
    data = json.loads(path.read_text())
    data["image1"]["image_size"] = size
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"image1.*image_size"):
        Pair.read(path)


def test_every_pair_file_that_is_written_states_the_sizes(tmp_path):
    path = sample_folder(tmp_path)
    size = [1536, 1024]
    site = "--distance1 17.5 --distance2 9.5 --focal1 35 --focal2 19 --sensor-width 11.4"
    photos = tmp_path / "far.jpg", tmp_path / "near.jpg"
    done = run(
        "align", *photos, *site.split(), "--as-set-up", "--out", tmp_path / "typed.pair.json"
    )
    assert done.exit_code == 0, done.output
    book = tmp_path / "s.xlsx"
    assert run("solve", tmp_path / "targets.csv", "--pair", path, "--out", book).exit_code == 0
    assert read_pair(book).image1.image_size == tuple(size)
    data = json.loads((tmp_path / "typed.pair.json").read_text())
    assert [data[key]["image_size"] for key in ("image1", "image2")] == [size, size]
