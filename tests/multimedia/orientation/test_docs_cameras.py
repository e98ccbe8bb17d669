"""The page on cameras is a contract: its files are read and its commands are run."""

from __future__ import annotations

import doctest
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.builders.commands import multimedia_command as main

PAGE = Path(__file__).parents[3] / "docs" / "underwater-cameras.md"
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files the page shows, the working folder of the commands."""
    blocks = re.findall(r"```(toml|csv)\n(.*?)```", TEXT, flags=re.DOTALL)
    for name, (kind, text) in zip(("tank.toml", "control.csv", "images.csv"), blocks, strict=False):
        assert name.endswith(kind)
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "dome.toml").write_text(blocks[3][1], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_command_of_the_page_runs(folder):
    lines = [line.strip() for line in TEXT.splitlines() if line.startswith("    multimedia ")]
    assert len(lines) >= 14
    for line in lines:
        words = shlex.split(line)[1:]
        if "experiment" in words:
            words[words.index("experiment")] = "folder"
        if words[0] == "openptv":
            continue  # needs OpenPTV's folder; run in test_openptv and test_cli_cameras
        result = CliRunner().invoke(main, words)
        assert result.exit_code == 0, f"{line}\n{result.output}"
    assert (folder / "curve.png").exists()


def test_the_figures_of_the_example_are_the_pages(folder):
    result = CliRunner().invoke(main, ["resect", str(folder / "tank.toml")])
    sigma0 = float(re.search(r"left: sigma0 ([\d.]+) um", result.output)[1])
    stated = float(re.search(r"sigma0 = ([\d.]+) um for the left camera", TEXT)[1])
    assert sigma0 == pytest.approx(stated, abs=0.05)


def test_the_dome_of_the_page_is_read(folder):
    text = (folder / "tank.toml").read_text() + (folder / "dome.toml").read_text()
    (folder / "both.toml").write_text(text.replace('media = "wall"', 'media = "dome"', 1))
    result = CliRunner().invoke(main, ["project", str(folder / "both.toml"), "--json"])
    assert result.exit_code == 0, result.output


def test_the_python_of_the_page_gives_what_it_says(folder):
    failed, tried = doctest.testfile(str(PAGE), module_relative=False)
    assert (folder / "board.svg").read_text().count("<rect") == 35
    assert tried >= 10
    assert failed == 0
