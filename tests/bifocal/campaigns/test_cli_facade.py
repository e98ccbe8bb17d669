"""`bifocal facade`: two photos and a table in, everything out, and only what changed anew."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from bifocal.cli.main import main
from tests.bifocal.campaigns.sample_tables import FAR, NEAR, write_tables


def facade(out: Path, *options: object) -> dict:
    words = ["facade", str(FAR), str(NEAR), "--out", str(out), "--json", *map(str, options)]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


@pytest.mark.acceptance
def test_everything_is_delivered_and_a_second_run_makes_only_what_changed(tmp_path):
    control, check = write_tables(tmp_path)
    out = tmp_path / "wall"
    done = facade(out, "--control", control, "--check", check, "--scale", "1:50")
    assert done["done"] == ["align", "relief", "points", "drawing", "view", "report"]
    for name in (
        "align/wall.pair.json", "relief/wall_relief.tif", "points/wall_points.xlsx",
        "drawing/wall.tif", "drawing/wall.pdf", "drawing/wall.dxf", "drawing/wall_relief.pdf",
        "view/wall_view.html", "report/wall_report.html", "report/wall_report.pdf",
    ):  # fmt: skip
        assert (out / name).stat().st_size > 1000, name
    page = (out / "report/wall_report.html").read_text("utf-8")
    assert "16 independent check points" in page
    assert 'href="../view/wall_view.html"' in page
    view = (out / "view/wall_view.html").read_text("utf-8")
    assert "data:image/jpeg" in view  # the orthophoto's colours
    assert "http" not in view
    assert len(view) < 1e6
    # Nothing changed; then one check point: points and report only.
    again = facade(out, "--control", control, "--check", check, "--scale", "1:50")
    assert (again["done"], len(again["kept"])) == ([], 6)
    check.write_text(check.read_text().replace("T30", "T99"))
    again = facade(out, "--control", control, "--check", check, "--scale", "1:50")
    assert again["done"] == ["points", "report"]
    report = CliRunner().invoke(main, ["report", str(out), "--out", str(tmp_path / "r.html")])
    assert report.exit_code == 0, report.stderr
    page = (tmp_path / "r.html").read_text("utf-8")
    assert "independent check points" in page
    assert 'href="wall/view/wall_view.html"' in page


def test_what_is_at_fault_is_said_and_earlier_steps_stay(tmp_path):
    (tmp_path / "near.jpg").write_bytes(b"no photo")
    shutil.copy(FAR, tmp_path / "far.jpg")
    control, _ = write_tables(tmp_path)
    words = ["facade", "far.jpg", "near.jpg", "--control", str(control), "--out", "out"]
    words[1:3] = [str(tmp_path / name) for name in words[1:3]]
    words[-1] = str(tmp_path / "out")
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 1
    assert "near.jpg: is not an image" in result.stderr
    assert [p.name for p in (tmp_path / "out").iterdir() if p.name[0] != "."] == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--products", "poster"], "'poster' is none of relief"),
        ([], "say how the pair is to be set up"),
    ],
)
def test_impossible_wishes_are_refused(tmp_path, options, said):
    words = ["facade", str(FAR), str(NEAR), "--out", str(tmp_path / "out"), *options]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 1
    assert said in result.stderr
