"""The report and the deliverables of a pair that looks through glass and water."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from bifocal import Pair
from bifocal.reports.content import ReportTask, read_content
from bifocal.reports.refraction import plane_errors
from tests.bifocal.model.test_pair_through_media import PAIRS, POINTS, content
from tests.builders.commands import bifocal_command as main
from tests.scenes.refracted import pixels_of


@pytest.fixture
def tank(tmp_path):
    """Return the pair file of the tank with photos, and a table of shot points beside it."""
    data, rng = content("tank"), np.random.default_rng(2)
    for number in (1, 2):
        picture = rng.integers(40, 220, (1200, 1600), dtype=np.uint8)
        Image.fromarray(picture).save(tmp_path / f"{number}.png")
        data[f"image{number}"] = data[f"image{number}"] | {"file": f"{number}.png"}
    (tmp_path / "tank.pair.json").write_text(json.dumps(data))
    layers, *photos = PAIRS["tank"]
    seen = [pixels_of(photo, POINTS, layers) for photo in photos]
    lines = ["id,X [m],Y [m],r [m],col_far,row_far,col_near,row_near"]
    for i, (xyz, one, two) in enumerate(zip(POINTS, *seen, strict=True)):
        lines.append(",".join(map(str, [f"P{i}", *xyz, *one, *two])))
    (tmp_path / "check.csv").write_text("\n".join(lines) + "\n")
    return tmp_path / "tank.pair.json"


def run(*words):
    done = CliRunner().invoke(main, [*map(str, words)])
    assert done.exit_code == 0, done.output
    return done.output


#: What the report says in each language of the shot points, taken for points in air.
COSTS = {
    "en": r"At the 5 measured points: relief by up to (\S+) mm \(median (\S+) mm\)",
    "it": r"Nei 5 punti misurati: il rilievo fino a (\S+) mm \(mediana (\S+) mm\)",
    "de": r"An den 5 gemessenen Punkten: Relief um bis zu (\S+) mm \(Median (\S+) mm\)",
}


@pytest.mark.parametrize(
    "language", ["en", *(pytest.param(n, marks=pytest.mark.acceptance) for n in ("it", "de"))]
)
def test_the_report_says_what_neglecting_refraction_would_cost(tank, tmp_path, language):
    out = tmp_path / "report.html"
    run("report", tank, "--check", tmp_path / "check.csv", "--out", out, "--language", language)
    page = out.read_text(encoding="utf-8")
    dry = {key: value for key, value in content("tank").items() if key != "layers"}
    seen = [pixels_of(photo, POINTS, PAIRS["tank"][0]) for photo in PAIRS["tank"][1:]]
    off = 1000 * np.abs(Pair.from_dict(dry).intersect(*seen).xyz - POINTS)[:, 2]
    found = re.search(COSTS[language], page)
    assert float(found[1]) == pytest.approx(off.max(), rel=6e-3)
    assert float(found[2]) == pytest.approx(np.median(off), rel=6e-3)
    assert "n = 1, 1.49 (10 mm), 1.337" in page
    assert "2.600 m" in page  # z0
    # The worked point ends at the relief that is true of it, 0.35 m.
    assert re.search(r"r = \S+ / \S+ = 0\.3500 m", page) or re.search(r"= -0\.4000 m", page)


def test_the_cost_over_the_wall_is_that_of_shot_rays(tank):
    """Both photos of places of the wall, by rays shot there, intersected as in air."""
    errors = plane_errors(read_content(tank, ReportTask()))
    layers, *photos = PAIRS["tank"]
    place = np.array([[0.9, 0.6, 0.0], [0.1, -0.5, 0.0]])
    seen = [pixels_of(photo, place, layers) for photo in photos]
    dry = Pair.from_dict({k: v for k, v in content("tank").items() if k != "layers"})
    single = np.abs(dry.intersect(*seen).xyz - place)
    assert len(errors) > 100
    assert errors[:, 2].min() < single[:, 2].min() < single[:, 2].max() < errors[:, 2].max()


@pytest.mark.acceptance
def test_a_set_of_deliverables_is_made_through_media(tank, tmp_path):
    """The sheet says the media; the picture is the orthophoto, its pixels where shot rays lead."""
    folder = tmp_path / "set"
    run("ortho", tank, "--plane", "0", "--deliver", folder, "--scale", "1:20", "--dpi", "100",
        "--bounds", "-0.4,-0.3,0.4,0.3", "--image", "1")  # fmt: skip
    names = {path.name for path in folder.iterdir()}
    assert {"tank.tif", "tank.pdf", "tank.dxf", "tank.png"} <= names
    assert "1.337" in (folder / "tank.dxf").read_text(errors="replace")
    with Image.open(folder / "tank.png") as shown:
        picture = np.asarray(shown.convert("L"), float)
    height, width = picture.shape
    # Mean grey of a patch does not tell; the correlation with the photo sampled by shot rays does.
    photo = np.asarray(Image.open(tmp_path / "1.png"), float)
    rows, columns = np.meshgrid(np.arange(20, 32), np.arange(20, 32), indexing="ij")
    x = -0.4 + (columns.ravel() + 0.5) * 0.8 / width
    y = 0.3 - (rows.ravel() + 0.5) * 0.6 / height
    xyz = np.column_stack([x, y, 0 * x])
    pixels = pixels_of(PAIRS["tank"][1], xyz, PAIRS["tank"][0])
    sampled = [photo[round(r) - 2 : round(r) + 3, round(c) - 2 : round(c) + 3].mean()
               for c, r in pixels]  # fmt: skip
    shown = [picture[r, c] for r, c in zip(rows.ravel(), columns.ravel(), strict=True)]
    assert np.corrcoef(sampled, shown)[0, 1] > 0.5


def test_only_what_was_compared_is_drawn_and_nothing_is_told_twice(tank, tmp_path):
    """Known relief alone: no empty histogram of X and Y, no arrows, refraction said once."""
    lines = [line.split(",") for line in (tmp_path / "check.csv").read_text().splitlines()]
    lines[1:] = [[name, "", "", *rest] for name, _, _, *rest in lines[1:]]
    (tmp_path / "relief.csv").write_text("\n".join(map(",".join, lines)) + "\n")
    out = tmp_path / "report.html"
    run("report", tank, "--check", tmp_path / "relief.csv", "--out", out, "--language", "de")
    page = out.read_text(encoding="utf-8")
    assert "Fehler an den verglichenen Punkten: r." in page
    assert "Pfeile in X und Y" not in page
    assert "An den 5 gemessenen Punkten" in page
    assert "neglected" not in page
