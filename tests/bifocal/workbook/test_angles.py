"""Angles of a survey: degrees, gon, degrees with minutes and seconds, and what is none of them."""

from __future__ import annotations

import pytest

from bifocal.workbook.reading.reader import read_survey
from photocore.errors import WorkbookError


def theta(folder, heading, cell):
    path = folder / "survey.csv"
    path.write_text(f"id,s1,s2,{heading}\nP1,10.5,11,{cell}\nP2,12.5,13,10\n", encoding="utf-8")
    return read_survey(path).points.polar[0, 2]


@pytest.mark.parametrize(
    ("heading", "cell", "degrees"),
    [("theta", "50", 50.0), ("theta [gon]", "50", 45.0), ("theta [deg]", "12°30'36''", 12.51)],
)
def test_the_unit_of_an_angle_is_that_of_its_heading(tmp_path, heading, cell, degrees):
    assert theta(tmp_path, heading, cell) == pytest.approx(degrees)


@pytest.mark.parametrize(
    ("heading", "cell", "message"),
    [
        ("theta", "390", "more than a full circle of 360"),
        ("theta [gon]", "401", "more than a full circle of 400"),
        ("theta", "50 g", "Write deg or gon"),
        ("theta [grad]", "50", "Write deg or gon"),
    ],
)
def test_an_angle_that_may_be_gon_is_asked_for(tmp_path, heading, cell, message):
    with pytest.raises(WorkbookError, match=message):
        theta(tmp_path, heading, cell)
