"""How precisely the wall is known: one figure on the page, in the terminal and in the report."""

from __future__ import annotations

import re

from bifocal import Pair
from bifocal.reports.content import ReportTask
from bifocal.reports.workflow import report_of
from bifocal.survey.wall_precision import wall_precision
from tests.page_session import client_of, opened, sample_folder


def test_page_and_report_say_the_same(tmp_path):
    folder = sample_folder(tmp_path)
    path = folder / "facade.pair.json"
    with opened(folder) as session:
        sentence = client_of(session).get("/api/state").json()["good"]
        sizes = [info.size for info in session.pictures.infos]
    pair = Pair.read(path)
    precision = wall_precision(pair, sizes)
    assert f"places to {1000 * precision.place:.0f} mm: 1:{precision.scale} holds" in sentence
    figures = re.findall(r"\d+ mm", sentence)
    report_of(path, tmp_path / "r.html", ReportTask(language="it"))
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert all(figure in text for figure in figures)


def test_photos_that_show_nothing_together_have_no_precision(tmp_path):
    pair = Pair.read(sample_folder(tmp_path) / "facade.pair.json")
    assert wall_precision(pair, ((1536, 1024), (1, 1))) is None
