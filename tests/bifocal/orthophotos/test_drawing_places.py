"""Drawings open on what is drawn, far from 0, 0 too, and lines that close are closed."""

from __future__ import annotations

import ezdxf
import pytest
from click.testing import CliRunner

from bifocal import SAMPLE
from bifocal.files.dxf import add_line, new_drawing, save_drawing
from tests.builders.commands import bifocal_command

FAR = (652345.0, 6862123.0)


@pytest.mark.parametrize("corner", [(0.0, 0.0), FAR])
def test_a_drawing_says_where_it_lies_and_opens_there(tmp_path, corner):
    drawing, model = new_drawing({"A": 7}, point_style=3, point_size=0.1)
    for dx, dy in ((0, 0), (8, 0), (8, 4), (0, 4)):
        model.add_point((corner[0] + dx, corner[1] + dy, 0.5))
    save_drawing(drawing, tmp_path / "d.dxf")
    back = ezdxf.readfile(tmp_path / "d.dxf")
    assert back.header["$EXTMIN"][:2] == pytest.approx(corner)
    assert back.header["$EXTMAX"][:2] == pytest.approx((corner[0] + 8, corner[1] + 4))
    view = back.viewports.get("*Active")[0]
    assert tuple(view.dxf.center)[:2] == pytest.approx((corner[0] + 4, corner[1] + 2))
    assert 4 < view.dxf.height < 8


def test_a_line_that_ends_where_it_begins_is_closed_and_holds_each_corner_once():
    _, model = new_drawing({"A": 7}, point_style=3, point_size=0.1)
    add_line(model, [(0, 0), (1, 0), (1, 1), (0, 0)], {"layer": "A"})
    add_line(model, [(0, 0), (1, 0), (1, 1)], {"layer": "A"})
    closed, opened = model.query("LWPOLYLINE")
    assert (closed.closed, len(closed)) == (True, 3)
    assert (opened.closed, len(opened)) == (False, 3)


@pytest.mark.parametrize("place", ["o.tif", "drawing/o.tif"])
def test_a_world_file_that_is_wanted_beside_the_picture_is_there_with_a_drawing_too(
    tmp_path, place
):
    words = [
        "ortho", str(SAMPLE / "facade.pair.json"), "--plane", "--gsd", "0.1", "--scale", "1:200",
        "--out", str(tmp_path / place), "--tfw", "--deliver", str(tmp_path / "drawing"),
    ]  # fmt: skip
    done = CliRunner().invoke(bifocal_command, words)
    assert done.exit_code == 0, done.stderr
    beside = (tmp_path / place).with_suffix(".tfw").read_text()
    delivered = [path for path in (tmp_path / "drawing").glob("*.tfw") if path.stem != "o"]
    assert [path.read_text() for path in delivered] == [beside]
    assert float(beside.split()[0]) == 0.1
