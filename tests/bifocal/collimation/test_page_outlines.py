"""Outlines drawn on the orthophoto stand in the workbook: sheet, widths, heights, areas."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import openpyxl
import pytest

import bifocal
from bifocal.collimation.wording import say
from tests.browser import true_pixel
from tests.page_session import opened, pick_both, sample_folder, sample_picks


def outline(session: Any, name: str, corners: list[tuple[float, float]]) -> None:
    pixels = [[*true_pixel(1, (x, y, 0.0)), 0.0] for x, y in corners]
    session.command({"op": "shape.set", "name": name, "kind": "outline", "corners": pixels})


def rows_of(book: Path) -> dict[str, list[Any]]:
    sheet = openpyxl.load_workbook(book)["Outlines"]
    rows = [[cell.value for cell in row] for row in sheet[sheet.tables["tblOutlines"].ref]]
    assert rows[0] == ["id", "layer", "width", "height", "area", "length", "relief"]
    return {row[0]: row[1:] for row in rows[1:] if row[0]}


@pytest.mark.acceptance
def test_outlines_are_a_table_of_the_workbook_and_follow_what_is_drawn(tmp_path: Path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        pick_both(session, "T01", sample_picks()["T01"])
        session.sync.step()
        book = session.files.workbook
        before = bifocal.solve(book).table["r"].tolist()
        outline(session, "W1", [(-1.0, 1.0), (1.0, 1.0), (1.0, 2.5), (-1.0, 2.5)])
        session.sync.step()
        assert rows_of(book)["W1"][1:4] == pytest.approx([2.0, 1.5, 3.0], abs=0.01)
        outline(session, "W2", [(2.0, 0.0), (3.0, 0.0), (3.0, 2.0)])
        outline(session, "W1", [(-1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (-1.0, 2.0)])
        session.sync.step()
        rows = rows_of(book)
        assert rows["W1"][1:4] == pytest.approx([3.0, 1.0, 3.0], abs=0.01)
        assert rows["W2"][3] == pytest.approx(1.0, abs=0.01)
        session.command({"op": "shape.delete", "name": "W1"})
        session.sync.step()
        assert list(rows_of(book)) == ["W2"]
        assert bifocal.solve(book).table["r"].tolist() == before
        assert session.sync.waiting is None


def test_outlines_alone_make_a_workbook(tmp_path: Path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        outline(session, "W1", [(-1.0, 1.0), (1.0, 1.0), (1.0, 2.5), (-1.0, 2.5)])
        session.sync.step()
        assert session.sync.waiting is None
        assert list(rows_of(session.files.workbook)) == ["W1"]
        sheet = openpyxl.load_workbook(session.files.workbook)["Outlines"]
        assert sheet["A1"].value == say("outline", "note", "en")
        assert [sheet["A3"].value, sheet["A4"].value] == [say("outline", "id", "en"), "id"]
