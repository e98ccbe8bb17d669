"""The file to hand over: whole in itself, no larger than what goes by mail, its relief exact."""

import base64
import json
import re

import cv2
import numpy as np
import pytest

from bifocal import SAMPLE, InputError, ReliefMap
from bifocal.model.grid import Grid
from bifocal.reports import handover
from bifocal.reports.handover import HandoverTask, write_handover

PAIR = SAMPLE / "facade.pair.json"


@pytest.fixture(scope="module")
def relief(tmp_path_factory):
    """A relief map that rises to the right, with a hole."""
    grid = Grid.from_bounds((-4.0, -2.0, 4.0, 2.0), gsd=0.02)
    r = np.tile(np.linspace(-1, 1, grid.width, dtype=np.float32), (grid.height, 1))
    r[50:60, 100:120] = np.nan
    path = tmp_path_factory.mktemp("relief") / "relief.tif"
    ReliefMap.from_relief(r, plane_from_pixel=grid.plane_from_pixel).write(path)
    return path, r


def data_of(path):
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=[\"']?http", text)
    return json.loads(re.search(r"const DATA = (.*);\n", text).group(1)), text


def test_what_it_holds_is_what_it_was_given(tmp_path, relief) -> None:
    path, r = relief
    points = tmp_path / "points.csv"
    points.write_text("id,X,Y,Z,sigma_r\nA,0.5,0.25,0.1,0.01\n<b>,1,1,0,0.01\n", encoding="utf-8")
    out = tmp_path / "wall.html"
    task = HandoverTask(relief=path, points=points, title="Wall & <door>", language="it")
    told = write_handover(PAIR, out, task)
    assert told["bytes"] == out.stat().st_size
    data, text = data_of(out)
    assert "Wall &amp; &lt;door&gt;" in text
    assert "<b>" not in text
    assert "Misura" in text
    assert [layer["name"] for layer in data["layers"]] == [
        "Rilievo", "Foto 1 · far.jpg", "Foto 2 · near.jpg",
    ]  # fmt: skip
    packed = base64.b64decode(data["relief"]["image"].partition(",")[2])
    blue, green, red = cv2.split(cv2.imdecode(np.frombuffer(packed, np.uint8), cv2.IMREAD_COLOR))
    level = red.astype(int) * 256 + green
    assert not blue.any()
    np.testing.assert_array_equal(level > 0, np.isfinite(r))
    found = data["relief"]["least"] + (level - 1) * data["relief"]["unit"]
    np.testing.assert_allclose(found[level > 0], r[np.isfinite(r)], atol=0.00026)
    # By Eqs. (1) and (7) on paper: 7.38 mm a pixel on the plane. (tests/scenes/make_sample)
    stretched = 17.5 / 17.4 / 0.00738
    assert data["points"][0]["photos"][0] == pytest.approx(
        [767.5 + 0.5 * stretched, 511.5 - 0.25 * stretched], abs=1e-3
    )


def test_it_shrinks_its_pictures_and_refuses_to_show_nothing(tmp_path, relief, monkeypatch) -> None:
    whole = write_handover(PAIR, tmp_path / "a.html", HandoverTask(relief=relief[0]))["bytes"]
    monkeypatch.setattr(handover, "MOST", whole // 2)
    write_handover(PAIR, tmp_path / "b.html", HandoverTask(relief=relief[0]))
    assert (tmp_path / "b.html").stat().st_size <= whole // 2
    data, _ = data_of(tmp_path / "b.html")
    assert data["layers"][1]["scale"] == pytest.approx(data["layers"][1]["width"] / 1536)
    empty = tmp_path / "empty.csv"
    empty.write_text("id,X,Y,Z,sigma_r\nA,0.5,,0.1,0.01\n", encoding="utf-8")
    task = HandoverTask(relief=relief[0], points=empty)
    told = write_handover(PAIR, tmp_path / "b.html", task, overwrite=True)["remarks"]
    assert any("no point with X, Y and r" in text for text in told)
    with pytest.raises(InputError, match="nothing to hand over"):
        write_handover(PAIR, tmp_path / "c.html", HandoverTask())
    assert not (tmp_path / "c.html").exists()
