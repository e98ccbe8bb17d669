"""The report: accuracy first, numbers a pocket calculator confirms, one file that stands alone."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from bifocal import SAMPLE, Grid, Pair, ReliefMap
from bifocal.model.geotiff import create_raster
from bifocal.orientation.walls.wall_shape import WallShape, shape_in_words
from bifocal.remarks import in_language, remark
from bifocal.reports import content as content_module
from bifocal.reports.accuracy import accuracy_blocks, verdict_in_words
from bifocal.reports.content import _basis, read_content
from bifocal.reports.pair_report import _provenance, pair_blocks, report_document
from bifocal.reports.workflow import ReportTask, find_pairs
from bifocal.survey.results import summary
from photocore.reports.document import Banner, Document, Paragraph
from photocore.reports.words import LANGUAGES, texts_of, words_of
from photocore.reports.writing import write_document
from tests.bifocal.campaigns.sample_tables import CONTROL, FAR, NEAR, write_tables
from tests.builders.commands import bifocal_command as main
from tests.web_page import Page

PAIR = SAMPLE / "facade.pair.json"


@pytest.fixture(scope="module")
def tables(tmp_path_factory) -> tuple[Path, Path]:
    return write_tables(tmp_path_factory.mktemp("tables"))


def report(out: Path, *options: object) -> str:
    result = CliRunner().invoke(main, ["report", str(PAIR), "--out", str(out), *map(str, options)])
    assert result.exit_code == 0, result.stderr
    return out.read_text(encoding="utf-8") if out.suffix == ".html" else ""


@pytest.fixture(scope="module")
def page(tables, tmp_path_factory) -> str:
    control, check = tables
    out = tmp_path_factory.mktemp("report") / "report.html"
    return report(out, "--control", control, "--check", check, "--scale", "1:50")


def test_the_page_is_whole_and_needs_no_network(page):
    parsed = Page(page)
    assert parsed.sources
    assert all(source.startswith("data:") for source in parsed.sources)
    assert "http:" not in page
    assert "https:" not in page
    assert len(page) < 15e6
    # No two figures share an id: each is an image of its own.
    assert len(re.findall(r' id="', page)) == 0


def test_accuracy_stands_first_with_a_verdict_per_scale(page):
    text = Page(page).text
    first = text.index("independent check points")
    assert first < 250
    assert "16 independent check points" in text
    # RMSE of the worst axis, from the table of the page itself.
    rows = re.findall(r"<td>(T\d\d)</td>(.*?)</tr>", page)
    errors = [re.findall(r"<td>(-?\d+\.\d)</td>", rest) for _, rest in rows]
    compared = [line for line in errors if len(line) >= 4][:16]
    assert len(compared) == 16
    rmse = [math.sqrt(sum(float(line[axis]) ** 2 for line in compared) / 16) for axis in range(3)]
    said = float(re.search(r"(\d+\.\d*) mm at 16", text)[1])
    assert said == pytest.approx(max(rmse), abs=0.06)
    # Drawing and relief, each by itself. 0.18 mm at 1:100 is 18 mm on the wall, at 1:20 3.6 mm.
    parts = {"Drawing (X, Y)": max(rmse[:2]), "Relief (r)": rmse[2]}
    limits = {scale: 0.18 * scale for scale in (10, 20, 50, 100, 200, 500)}
    for scale, limit in limits.items():
        words = " / ".join("yes" if worst <= limit else "NO" for worst in parts.values())
        assert re.search(rf"<td>1:{scale}</td><td>{limit:.3g} mm: {words}</td>", page), scale
    for part, worst in parts.items():
        finest = min(scale for scale, limit in limits.items() if worst <= limit)
        asked = "is held" if worst <= limits[50] else "is NOT held"
        line = f"mm: Good for 1:{finest} and smaller. The scale asked for, 1:50, {asked}."
        found = re.search(rf"{re.escape(part)}, (\d+\.\d*) {re.escape(line)}", text)
        assert float(found[1]) == pytest.approx(worst, abs=0.06)


def test_a_good_drawing_is_not_thrown_away_for_its_relief(tables):
    control, check = tables
    solution = read_content(PAIR, ReportTask(control=control, check=check)).solution

    def verdict(**rmse: float) -> Banner:
        known = {axis: replace(solution.check.axes[axis], rmse=v) for axis, v in rmse.items()}
        axes = {**solution.check.axes, **known}
        content = read_content(PAIR, ReportTask(control=control, check=check, scale=50.0))
        content = replace(
            content, solution=replace(solution, check=replace(solution.check, axes=axes))
        )
        return next(accuracy_blocks(content, words_of("bifocal.reports", "en")))

    banner = verdict(X=0.0089, Y=0.0049, Z=0.0156)
    assert banner.details[:2] == (
        "Drawing (X, Y), 8.90 mm: Good for 1:50 and smaller. The scale asked for, 1:50, is held.",
        "Relief (r), 15.6 mm: Good for 1:100 and smaller. The scale asked for, 1:50, is NOT held.",
    )
    assert banner.good is None
    assert verdict(X=0.002, Y=0.002, Z=0.002).good is True
    assert verdict(X=0.02, Y=0.002, Z=0.02).good is False


def verdict_of(control: Path, check: Path | None, **known: object) -> tuple[str, ...]:
    task = ReportTask(control=control, check=check, scale=50.0)
    content = replace(read_content(PAIR, task), **known)
    return next(accuracy_blocks(content, words_of("bifocal.reports", "en"))).details


def test_the_verdict_says_what_it_rests_on(tables, page):
    control, check = tables
    _, _, axes, foundation = verdict_of(control, check)
    shown = re.findall(r"<td>T\d\d</td><td>check</td>(.*?)</tr>", page)
    rows = [[float(v) for v in re.findall(r"<td>(-?\d+\.\d+)</td>", rest)] for rest in shown]
    errors, sigma = [row[3:6] for row in rows], [row[6] for row in rows]

    def rms(values):
        return math.sqrt(sum(v * v for v in values) / len(values))

    by_axis = [rms([line[axis] for line in errors]) for axis in range(3)]
    assert numbers(axes) == pytest.approx(by_axis, abs=0.03)
    assert max(by_axis) == by_axis[2]
    expected, ratio = numbers(foundation)
    assert expected == pytest.approx(rms(sigma), abs=0.03)
    # Both come with a digit behind the point: so do errors and sigmas in the table.
    assert ratio == pytest.approx(
        rms([e[2] / s for e, s in zip(errors, sigma, strict=True)]), rel=0.1
    )
    assert "within chance" in foundation
    # Of points that the orientation was fitted to nothing is expected.
    fitted = {"control": [{"id": name, "used": True} for name in CONTROL]}
    assert len(verdict_of(control, None, setup=fitted)) == 3


def test_a_verdict_on_wrong_points_names_them(tables, tmp_path):
    control, check = tables
    head, first, *others = check.read_text().splitlines()
    cells = first.split(",")
    cells[3] = str(float(cells[3]) + 0.5)
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("\n".join([head, ",".join(cells), *others]))
    _, asked, _, foundation, off = verdict_of(control, wrong)
    assert "more than chance explains" in foundation
    assert off.startswith(
        f"More than 3 standard deviations off, to be measured again: {cells[0]} ("
    )
    assert "is NOT held" in asked


def test_errors_far_below_what_was_expected_are_told_as_such(tables):
    control, check = tables
    solution = read_content(PAIR, ReportTask(control=control, check=check)).solution
    small = replace(solution.check, errors=solution.check.errors * 0.01)
    *_, foundation = verdict_of(control, check, solution=replace(solution, check=small))
    assert "better than was assumed" in foundation


def test_a_model_that_does_not_fit_heads_the_report_and_is_told_once(tables):
    control, check = tables
    bent = str(remark("pair.bent", bend=0.7, most=0.2))
    content = read_content(PAIR, ReportTask(control=control, check=check, language="it"))
    pair = replace(content.pair, extra={"setup": {"doubts": [bent]}})
    told = replace(content.solution, remarks=(f"w.pair.json: {bent}", "It leans.", "It leans."))
    content = replace(content, pair=pair, solution=told)
    blocks = list(pair_blocks(content, words_of("bifocal.reports", "it")))
    assert blocks[1].text.startswith("Il modello di questa coppia non si adatta")
    assert blocks[1].details == (in_language(bent, "it"),)
    assert blocks[1].good is False
    said = [block.text for block in blocks if isinstance(block, Paragraph)]
    assert said.count("It leans.") == 1
    assert not any(in_language(bent, "it") in text for text in said)
    assert verdict_in_words(content)[-1].startswith("The model of this pair does not fit")


def test_points_where_the_map_is_off_are_named_beside_the_verdict(tables):
    control, check = tables
    content = read_content(PAIR, ReportTask(control=control, check=check))
    known = content.solution.survey.known
    xyz = known.xyz[known.used]
    grid = Grid.from_bounds((-6, -6, 6, 6), gsd=0.05)
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    # Each pixel as its nearest point has it; one point's is half a metre off.
    nearest = ((x[..., None] - xyz[:, 0]) ** 2 + (y[..., None] - xyz[:, 1]) ** 2).argmin(axis=-1)
    r = (xyz[:, 2] + np.where(np.arange(len(xyz)) == 3, 0.5, 0.0))[nearest]
    relief = ReliefMap.from_relief(r, plane_from_pixel=grid.plane_from_pixel)
    relief = replace(relief, sigma=np.full(r.shape, 0.01, np.float32))
    details = next(
        accuracy_blocks(replace(content, relief=relief), words_of("bifocal.reports", "en"))
    ).details
    assert details[-2].startswith("This is of points picked in both photos. The relief map itself")
    name = np.array(known.ids)[known.used][3]
    assert f"standard deviations off at {name} (500 mm): look" in details[-1]


def test_few_points_prove_no_drawing_scale(tables, tmp_path):
    few = tmp_path / "few.csv"
    few.write_text("\n".join(tables[1].read_text().splitlines()[:3]))
    solution = read_content(PAIR, ReportTask(check=few)).solution
    (line, *_) = [one for one in summary(solution) if one.startswith("Drawing scale")]
    assert line.endswith("; of only 2 points")
    whole = read_content(PAIR, ReportTask(check=tables[1])).solution
    assert "of only" not in " ".join(summary(whole))


def test_the_tilt_is_that_of_the_angles_beside_it(page):
    text = Page(page).text
    angles = re.findall(r"(-?[0-9.]+)°, (-?[0-9.]+)°, -?[0-9.]+°", text)[:2]
    tilts = re.search(r"Tilt against the wall's normal\s*([0-9.]+)°\s*([0-9.]+)°", text)
    for (omega, phi), tilt in zip(angles, tilts.groups(), strict=True):
        cosine = math.cos(math.radians(float(omega))) * math.cos(math.radians(float(phi)))
        assert float(tilt) == pytest.approx(math.degrees(math.acos(cosine)), abs=0.02)


def test_the_report_leads_to_the_view_where_it_lies(tmp_path):
    view = tmp_path / "a wall" / "view" / "wall & 1_view.html"
    task = ReportTask(relief=SAMPLE / "truth.tif", view=view, language="de")
    blocks = report_document([read_content(PAIR, task)], "de").blocks
    (block,) = (block for block in blocks if getattr(block, "link", None))
    assert block.text == "Das Relief in drei Dimensionen, im Browser zu drehen: wall & 1_view.html"
    (tmp_path / "out").mkdir()
    out = tmp_path / "out" / "r.html"
    write_document(out, Document(title="", language="de", subject="", blocks=(block,)))
    assert Page(out.read_text("utf-8")).sources == ["../a%20wall/view/wall%20%26%201_view.html"]


def test_photos_of_one_name_in_two_folders_have_a_hash_each(tmp_path):
    files = (tmp_path / "far" / "1.jpg", tmp_path / "near" / "1.jpg")
    for path in files:
        path.parent.mkdir()
        path.write_text(path.parent.name)
    task = SimpleNamespace(control=None, check=None, relief=None, ortho=files[0])
    cameras = [SimpleNamespace(file=path.name, path=path) for path in files]
    content = SimpleNamespace(source=PAIR, cameras=cameras, task=task)
    *_, table = _provenance(content, words_of("bifocal.reports", "en"))
    named = [[path.name, sha256(path.read_bytes()).hexdigest()] for path in files]
    assert table.rows[1:] == named


def test_the_report_says_what_an_orthophoto_rests_on_as_its_file_does(tmp_path):
    parts = {"measured": 0.5, "interpolated": 0.25, "plane": 0.2, "neither": 0.05}
    grid = Grid.from_bounds((0, 0, 2, 2), gsd=1.0)
    with create_raster(tmp_path / "o.tif", grid, bands=1, dtype=np.uint8) as writer:
        writer.write(np.zeros((2, 2), np.uint8))
        writer.tag(BIFOCAL_BASIS=json.dumps(parts))
    assert _basis(tmp_path / "o.tif") == parts
    words = words_of("bifocal.reports", "de")("overview_basis", **parts)
    assert "50.0% auf gemessenem Relief" in words.replace("\xa0", "")


def test_a_pair_in_the_frame_of_all_pairs_is_told_by_that_pair_file(tmp_path):
    for name, inputs in (("a", {"pair": ["a.pair.json", "1"]}), ("b", {"far": ["far.jpg", "2"]})):
        for path in (f"{name}/align/{name}.pair.json", f"joint/{name}.pair.json"):
            (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / path).touch()
        (tmp_path / name / "relief").mkdir()
        (tmp_path / name / "relief" / ".made.json").write_text(json.dumps({"inputs": inputs}))
    sources, _ = find_pairs(tmp_path, ReportTask())
    own = tmp_path / "b" / "align" / "b.pair.json"  # made before the frame of all was dropped
    assert sources == [tmp_path / "joint" / "a.pair.json", own]


def numbers(text: str) -> list[float]:
    return [float(value) for value in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?", text)]


def test_every_line_of_the_worked_point_follows_from_the_digits_above_it(page):
    text = Page(page).text
    text = text[text.index("Method, worked through") :]
    pixels = re.findall(r"\((-?\d+\.\d+), (-?\d+\.\d+)\)_\d", text)
    q, v, s, d = [], [], [], []
    for k, pixel in enumerate(pixels, start=1):
        rows = re.findall(r"\|(.*?)\|", text[text.index(f"H{k} |") :])[:3]
        matrix = np.array([numbers(row) for row in rows])
        x, y, w = matrix @ [*map(float, pixel), 1.0]
        q.append(numbers(re.search(rf"q{k} = (\(.*?\)) m", text)[1]))
        assert q[-1] == pytest.approx([x / w, y / w], abs=0.6e-6)
        line = re.search(rf"N{k} = (\(.*?\)) m, d{k} = (.*?) m .*?v{k} = (\(.*?\))", text)
        nadir, (distance,), slope = map(numbers, line.groups())
        v.append(slope)
        assert slope == pytest.approx(np.subtract(q[-1], nadir) / distance, abs=0.6e-8)
        line = re.search(
            rf"\|det H{k}\| = (\S+) .*? = (\S+) mm +s{k} = (\S+) p{k} = (\S+) mm", text
        )
        det, place, sigma_px, sigma = map(float, line.groups())
        assert det == pytest.approx(abs(np.linalg.det(matrix)), rel=1e-5)
        assert place == pytest.approx(1000 * math.sqrt(det / abs(w) ** 3), rel=1e-4)
        assert sigma == pytest.approx(sigma_px * place, abs=0.6e-3)
        s.append(sigma)
        d.append(distance)
    shift, slope = np.subtract(*q), np.subtract(*v)
    over, under, r = numbers(re.search(r"\nr = (.*?) m", text)[1])
    assert [over, under] == pytest.approx([shift @ slope, slope @ slope], rel=1e-8)
    assert r == pytest.approx(over / under, abs=0.51e-4)
    place = numbers(re.search(r"X = \S+ m    Y = \S+ m", text)[0])
    assert place == pytest.approx(np.mean(np.subtract(q, np.multiply(v, r)), axis=0), abs=1e-4)
    sigma = math.hypot(*((1 - r / far) * one for far, one in zip(d, s, strict=True)))
    said = float(re.search(r"sigma_r = (\d+\.\d+) mm", text)[1])
    assert said == pytest.approx(sigma / math.sqrt(under), abs=0.6e-2)
    program = float(re.search(r"finds r = (-?\d\.\d+) m", text)[1])
    assert abs(program - r) < said / 1000


@pytest.mark.acceptance
def test_without_check_points_the_figure_is_called_optimistic(tables, tmp_path):
    text = Page(report(tmp_path / "r.html", "--control", tables[0], "--language", "de")).text
    # The pair file of the sample rests on no control: what is compared is then independent.
    assert "12 unabhängigen Kontrollpunkten" in text
    text = Page(report(tmp_path / "bare.html", "--language", "it")).text
    assert "l'accuratezza non è provata" in text


@pytest.mark.acceptance
@pytest.mark.parametrize("language", ["it", "de"])
def test_no_english_is_left_in_a_report_full_of_remarks(tables, tmp_path, language):
    pair = json.loads(PAIR.read_text(encoding="utf-8"))
    bent = WallShape(px=0.8, sigma=0.1)
    values = {"share": 2.0, "size": 20.0, "number": 1, "count": 6, "name": "C7", "sigmas": 5.0}
    keys = ("no_tape", "few_control", "gross_control", "lines_off_wall", "no_wall")
    doubts = [shape_in_words(bent, with_lens=True)]
    doubts += [remark(f"orientation.{key}", **values) for key in keys]
    lens = remark("orientation.normal_lens")
    assumed = [remark("orientation.assumed_focal", number=1, source=lens)]
    pair["setup"] = {"doubts": doubts, "assumed": assumed}
    for number in (1, 2):
        pair[f"image{number}"]["file"] = str(SAMPLE / pair[f"image{number}"]["file"])
    path = tmp_path / "sample.pair.json"
    path.write_text(json.dumps(pair), encoding="utf-8")
    check = tmp_path / "check.csv"
    lines = tables[1].read_text(encoding="utf-8").splitlines()
    check.write_text("\n".join([*lines, "nowhere" + lines[-1][lines[-1].index(",") :]]))
    out = tmp_path / "r.html"
    asked = ["--control", str(tables[0]), "--check", str(check), "--language", language]
    result = CliRunner().invoke(main, ["report", str(path), "--out", str(out), *asked])
    assert result.exit_code == 0, result.stderr
    text = Page(out.read_text(encoding="utf-8")).text.replace(str(tmp_path), "")
    assert in_language(doubts[0], language) in text
    assert not re.findall(r".{0,40}\b(?:the|is|are|and|with|give)\b.{0,40}", text)


@pytest.mark.acceptance
def test_the_pdf_has_the_same_pages_and_names_its_program(tables, tmp_path):
    control, check = tables
    out = tmp_path / "report.pdf"
    report(out, "--control", control, "--check", check)
    data = out.read_bytes()
    assert data.startswith(b"%PDF")
    assert b"bifocal 0." in data
    assert 3 <= data.count(b"/Type /Page ") <= 12


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--out", "r.docx"], "written as .html or .pdf"),
        (["--out", "r.html", "--control", "absent.csv"], "absent.csv"),
        (["--out", "r.html", "--relief", str(SAMPLE / "far.jpg")], "far.jpg"),
    ],
)
def test_what_cannot_be_reported_is_refused(tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(main, ["report", str(PAIR), *options])
    assert result.exit_code == 1
    assert said in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("value", "said"), [(np.nan, "is empty"), (np.inf, "infinite values")])
def test_a_relief_map_without_relief_is_not_reported(tmp_path, monkeypatch, value, said):
    monkeypatch.chdir(tmp_path)
    grid = Grid.from_bounds((0, 0, 1, 1), gsd=0.05)
    with create_raster(tmp_path / "r.tif", grid, bands=1, dtype=np.float32) as writer:
        writer.write(np.full(grid.shape, value, np.float32))
    result = CliRunner().invoke(main, ["report", str(PAIR), "--out", "r.html", "--relief", "r.tif"])
    assert result.exit_code == 1
    assert "r.tif: the relief map" in result.stderr
    assert said in result.stderr
    assert not (tmp_path / "r.html").exists()


@pytest.mark.parametrize("package", ["bifocal.reports", "multimedia.adjustment"])
def test_every_text_is_there_in_three_languages_with_the_same_blanks(package):
    for key, texts in texts_of(package).items():
        assert set(texts) == set(LANGUAGES), key
        blanks = {tuple(sorted(re.findall(r"\{\w+\}", text))) for text in texts.values()}
        assert len(blanks) == 1, key


def test_a_text_is_given_in_the_language_asked_for():
    assert (
        words_of("bifocal.reports", "it")("good_for", scale=50)
        == "Adatto alla scala 1:50 e minori."
    )


def test_tables_that_name_the_photos_the_other_way_round_give_the_same_points(tables, tmp_path):
    with tables[1].open(encoding="utf-8") as file:
        rows = [line.rstrip("\n").split(",") for line in file]
    turned = tmp_path / "turned.csv"
    lines = [",".join(r[:4] + r[6:] + r[4:6]) for r in rows[1:]]
    turned.write_text("\n".join([",".join(rows[0]), *lines]), encoding="utf-8")
    found = [
        read_content(PAIR, ReportTask(check=check, far=far)).solution.table.columns["r"]
        for check, far in ((tables[1], FAR), (turned, NEAR), (tables[1], None))
    ]
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_array_equal(found[1], found[2])


def test_photos_are_shown_small_and_never_enlarged(monkeypatch):
    """Photos of 1536 x 1024 px in pictures of at most 100 px, and of at most 2000 px."""
    pair = Pair.read(SAMPLE / "facade.pair.json")
    for most, shape, reduction in ((100, (67, 100), 15.36), (2000, (1024, 1536), 1.0)):
        monkeypatch.setattr(content_module, "SIDE", most)
        for photo in content_module._photos(pair):
            assert photo.picture.shape[:2] == shape
            assert (photo.size, photo.reduction) == ((1536, 1024), reduction)
