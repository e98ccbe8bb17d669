"""Every kind of output says which program made it, when, by which command and from which files."""

from __future__ import annotations

import hashlib
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner
from PIL import Image

import bifocal
from bifocal import SAMPLE
from photocore.provenance import note, provenance, recording
from tests.builders.commands import bifocal_command as main
from tests.builders.commands import multimedia_command as multimedia

PAIR = SAMPLE / "facade.pair.json"
DAY = "2019-03-04"


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def run(*words: object, group=main) -> None:
    result = CliRunner().invoke(group, [*map(str, words), "--date", DAY])
    assert result.exit_code == 0, result.stderr


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A folder with one output of each kind, from the sample's targets."""
    out = tmp_path_factory.mktemp("made")
    targets = SAMPLE / "targets.csv"
    run("solve", targets, "--pair", PAIR, "--out", out / "r.xlsx")
    for ending in ("dxf", "ply", "xlsx"):
        run("export", out / "r.xlsx", "--out", out / f"points.{ending}")
    run("ortho", PAIR, "--plane", "--scale", "1:100", "--dpi", "60",
        "--bounds=-1,-1,1,1", "--deliver", out / "sheet")  # fmt: skip
    run("report", PAIR, "--control", targets, "--out", out / "report.html")
    run("align", SAMPLE / "far.jpg", SAMPLE / "near.jpg", "--as-set-up",
        "--distance1", 17.5, "--distance2", 9.5,
        "--focal1", 35, "--focal2", 19, "--sensor-width", 22.7,
        "--out", out / "p.pair.json")  # fmt: skip
    run("view", SAMPLE / "truth.tif", "--out", out / "view.html")
    return out


def told(path: Path) -> str:
    """Return everything a file says about itself, as text."""
    if path.suffix == ".tif":
        with rasterio.open(path) as file:
            return json.dumps(file.tags())
    if path.suffix == ".xlsx":
        with zipfile.ZipFile(path) as package:
            return package.read("docProps/core.xml").decode()
    if path.suffix == ".png":
        with Image.open(path) as picture:
            return picture.text["Comment"]
    data = path.read_bytes()
    if path.suffix == ".html":  # without the report's own section
        return data.decode().partition('<meta name="provenance" content="')[2].partition('"')[0]
    if path.suffix == ".pdf":
        texts = [data.decode("latin-1")]
        for part in data.split(b"<feff")[1:]:
            texts.append(bytes.fromhex(part.split(b">")[0].decode()).decode("utf-16-be"))
        return "\n".join(texts)
    return data.decode("utf-8", "replace")


INPUTS = {
    "r.xlsx": ("targets.csv", "facade.pair.json"),
    "points.dxf": ("r.xlsx",),
    "points.ply": ("r.xlsx",),
    "points.xlsx": ("r.xlsx",),
    "p.pair.json": ("far.jpg", "near.jpg"),
    "report.html": ("targets.csv", "facade.pair.json", "far.jpg"),
    "sheet/*.png": ("facade.pair.json", "far.jpg"),
    "p.pair.png": ("far.jpg", "near.jpg"),
    "view.html": ("truth.tif",),
    "sheet/*.tif": ("facade.pair.json", "far.jpg"),
    "sheet/*.pdf": ("facade.pair.json", "far.jpg"),
    "sheet/*.dxf": ("facade.pair.json", "far.jpg"),
}
COMMANDS = {"r": "solve", "points": "export", "p": "align", "report": "report", "sheet": "ortho",
            "view": "view"}  # fmt: skip


@pytest.mark.parametrize("name", INPUTS)
def test_an_output_says_program_date_command_and_inputs_with_their_hashes(made, name):
    (path,) = list(made.glob(name))[:1]
    holds_what_made_it(path, name, made)


@pytest.mark.acceptance
def test_a_report_on_paper_says_what_one_for_the_screen_does(tmp_path):
    path = tmp_path / "report.pdf"
    run("report", PAIR, "--control", SAMPLE / "targets.csv", "--out", path)
    holds_what_made_it(path, "report.html", tmp_path)


def holds_what_made_it(path: Path, name: str, made: Path) -> None:
    text = told(path)
    assert f"bifocal {bifocal.__version__}" in text
    assert DAY in text
    assert f"bifocal {COMMANDS[name.split('/')[0].split('.')[0]]} " in text
    for source in INPUTS[name]:
        place = made / source if (made / source).exists() else SAMPLE / source
        assert source in text
        assert digest(place) in text, source


def test_a_map_of_the_other_program_says_so_too(tmp_path):
    with rasterio.open(
        tmp_path / "dem.tif", "w", driver="GTiff", width=4, height=4, count=1, dtype="float32",
        transform=rasterio.Affine(1, 0, 0, 0, -1, 4),
    ) as file:  # fmt: skip
        file.write(np.full((1, 4, 4), -1.5, np.float32))
    cameras = tmp_path / "cameras.csv"
    cameras.write_text("id,X,Y,Z\n1,0,0,50\n2,4,4,50\n")
    run("bathymetry", tmp_path / "dem.tif", "--water-level", 0, "--index", 1.34, "--cameras",
        cameras, "--out", tmp_path / "out.tif", group=multimedia)  # fmt: skip
    text = told(tmp_path / "out.tif")
    assert "multimedia bathymetry" in text
    assert digest(tmp_path / "dem.tif") in text
    assert digest(cameras) in text


def test_what_is_read_counts_once_as_it_was_and_own_outputs_do_not(tmp_path):
    source = tmp_path / "a.txt"
    source.write_text("before")
    before = digest(source)
    with recording("script", day="2020-02-29"):
        note(source)
        note(tmp_path / "gone")
        assert provenance().inputs == (("a.txt", before),)
        source.write_text("after")
        assert provenance().to_dict() == {
            "program": f"bifocal {bifocal.__version__}", "date": "2020-02-29",
            "command": "script", "inputs": [{"file": "a.txt", "sha256": before}],
        }  # fmt: skip
        bifocal.Pair.read(PAIR).write(tmp_path / "mine.pair.json")
        bifocal.Pair.read(tmp_path / "mine.pair.json").write(tmp_path / "next.pair.json")
    said = json.loads((tmp_path / "next.pair.json").read_text())["provenance"]
    assert [item["file"] for item in said["inputs"]] == ["a.txt", "facade.pair.json"]
    assert provenance().command == ""


@pytest.mark.parametrize("stamp", ["99999999999999999", "²", "today"])
def test_a_time_of_the_environment_that_is_none_is_refused_by_name(monkeypatch, stamp):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", stamp)
    result = CliRunner().invoke(multimedia, ["index"])
    assert result.exit_code == 1
    assert result.stderr.startswith("Error: SOURCE_DATE_EPOCH: ")


@pytest.mark.parametrize("place", ["before", "behind"])
def test_a_date_that_is_none_is_refused_and_a_date_holds_wherever_it_is_given(tmp_path, place):
    words = ["template", str(tmp_path / f"{place}.xlsx"), "--rows", "2"]
    for day, status in (("yesterday", 2), (DAY, 0)):
        given = ["--date", day]
        line = [*given, *words] if place == "before" else [*words, *given]
        result = CliRunner().invoke(main, line)
        assert result.exit_code == status, result.stderr
    assert "year-month-day" in CliRunner().invoke(main, ["--date", "1.2.2020", "doctor"]).stderr
    assert DAY in told(tmp_path / f"{place}.xlsx")
