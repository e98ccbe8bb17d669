"""Sheets and drawings of a delivery: to scale, with words, points, contours and sections."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import rasterio
from click.testing import Result
from ezdxf.document import Drawing
from PIL import Image

from bifocal import Grid, Pair, ReliefMap
from bifocal.model.geotiff import RasterReader
from bifocal.orthophotos.canvas import Pen, text_width
from bifocal.orthophotos.deliver_workflow import DeliverTask, _notes
from bifocal.orthophotos.dxf_canvas import DxfCanvas
from bifocal.orthophotos.ortho_workflow import OrthoTask
from bifocal.orthophotos.pdf_sheet import _PdfCanvas
from bifocal.remarks import remark
from bifocal.reports.accuracy import wall_in_words
from tests.bifocal.orthophotos.ortho_command import GSD, SIZE, page_of, run, write_wall

#: The pixel of the photos at 1:50, 10 mm: finer ones show no more, and cost four times as much.
COARSE = ("--scale", "1:50", "--dpi", "127")


@pytest.fixture(scope="module")
def sheets(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A delivery at 1:50 with pixels of 5 mm, three sections and contour lines every 2 cm."""
    folder = tmp_path_factory.mktemp("sheets")
    write_wall(folder)
    (folder / "c.csv").write_text("id,X,Y,Z\nK1,-1.5,-1,0\n")
    done = run(
        folder, "--relief", "relief.tif", "--deliver", "d", "--scale", "1:50", "--dpi", "254",
        "--control", "c.csv", "--contours", "0.02", "--section", "x=0.8",
        "--section=-1,0 0,0.5 1,0", "--section", "y=0.5", "--json",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    return folder / "d", done


@pytest.fixture(scope="module")
def drawing(sheets: tuple[Path, Result]) -> Drawing:
    return ezdxf.readfile(sheets[0] / "Torre_est.dxf")


def test_one_to_fifty_at_254_dpi_is_five_millimetres_in_every_file(sheets, drawing) -> None:
    (folder, done), name = sheets, "Torre_est"
    result = json.loads(done.stdout)
    assert set(result["files"]) == {item.name for item in folder.iterdir()}
    with rasterio.open(folder / f"{name}.tif") as file:
        assert file.res == pytest.approx((0.005, 0.005))
        assert file.compression.value == "DEFLATE"
        assert file.crs.to_wkt().startswith("LOCAL_CS")
    for ending in ("tif", "png"):
        with Image.open(folder / f"{name}.{ending}") as image:
            assert image.info["dpi"][0] == pytest.approx(254, abs=0.01)
            assert image.size == (840, 600)
    values = [float(v) for v in (folder / f"{name}.tfw").read_text().split()]
    assert values == pytest.approx([0.005, 0, 0, -0.005, -2.0975, 1.4975])
    assert drawing.dxfversion == "AC1024"  # R2010
    (picture,) = drawing.modelspace().query("IMAGE")
    assert tuple(picture.dxf.insert)[:2] == pytest.approx((-2.1, -1.5))
    assert picture.dxf.u_pixel.x == pytest.approx(0.005)
    assert picture.image_def.dxf.filename == f"{name}.png"
    layers = {entity.dxf.layer for entity in drawing.modelspace()}
    assert {"BIFOCAL_GRID", "BIFOCAL_SCALEBAR", "BIFOCAL_CONTROL"} <= layers
    # Crosses of the grid: 4 mm on paper either way.
    arms = [
        (line.dxf.end - line.dxf.start).xyz
        for line in drawing.modelspace().query('LINE[layer=="BIFOCAL_GRID"]')
    ]
    assert np.round(arms[0::2], 9).tolist() == [[0.2, 0, 0]] * (len(arms) // 2)
    assert np.round(arms[1::2], 9).tolist() == [[0, 0.2, 0]] * (len(arms) // 2)
    relief = ezdxf.readfile(folder / f"{name}_relief.dxf")
    levels = {line.dxf.elevation for line in relief.query('LWPOLYLINE[layer=="BIFOCAL_CONTOURS"]')}
    assert any(0.02 < level < 0.3 for level in levels)
    spots = [text.dxf.text for text in relief.query('TEXT[layer=="BIFOCAL_SPOT_HEIGHTS"]')]
    assert 2 <= len(spots) <= 12
    assert all(-0.05 < float(text) < 0.31 for text in spots)


def test_the_drawing_has_a_sheet_with_a_viewport_to_scale_and_the_contours(drawing) -> None:
    sheet = drawing.paperspace("A4 landscape")
    assert (sheet.dxf_layout.dxf.paper_width, sheet.dxf_layout.dxf.paper_height) == (297, 210)
    (window,) = sheet.query('VIEWPORT[layer=="BIFOCAL_VIEWPORT"]')
    # Millimetres of paper for metres of the model: 1:50.
    assert window.dxf.height / window.dxf.view_height == pytest.approx(1000 / 50)
    assert (window.dxf.width, window.dxf.height) == pytest.approx((84, 60))
    assert tuple(window.dxf.view_center_point)[:2] == pytest.approx((0, 0))
    words = {text.dxf.text for text in sheet.query("TEXT")}
    assert {text.dxf.rotation for text in sheet.query("TEXT")} <= {0.0, 90.0}
    assert {"Torre (est)", "Orthophoto 1:50", "A"} <= words
    assert any(text.startswith("sections A-A  x=0.8") for text in words)
    model = drawing.modelspace()
    levels = {line.dxf.elevation for line in model.query("LWPOLYLINE[elevation > 0.05]")}
    assert any(0.05 < level < 0.3 for level in levels)
    assert len(model.query('LWPOLYLINE[layer=="BIFOCAL_CONTOURS_INDEX"]')) > 0
    labels = {text.dxf.text for text in model.query('TEXT[layer=="BIFOCAL_CONTOUR_TEXT"]')}
    assert "+0.10" in labels
    assert all(round(float(label) / 0.02) % 5 == 0 for label in labels)
    letters = model.query('TEXT[layer=="BIFOCAL_SECTION_NAMES"]')
    heights = [text.dxf.align_point.y for text in letters if text.dxf.text == "A"]
    assert sorted(y > 0 for y in heights) == [False, True]
    assert min(map(abs, heights)) > 1.5 + 0.05


def test_dashes_are_seen_on_the_sheet_and_letters_once(drawing) -> None:
    # Else a viewport at 1:50 would make the dashes 50 times as short.
    assert drawing.header["$PSLTSCALE"] == 0
    model, sheet = drawing.modelspace(), drawing.paperspace("A4 landscape")
    for line in model.query('LWPOLYLINE[layer=="BIFOCAL_SECTION_LINES"]'):
        assert line.dxf.flags & 128  # the pattern runs on over corners
        pattern = drawing.linetypes.get(line.dxf.linetype).pattern_tags.tags.get_first_value(40)
        # As in print: 8.6 mm on paper.
        assert pattern * line.dxf.ltscale * 1000 / 50 == pytest.approx(8.6)
    (window,) = sheet.query('VIEWPORT[layer=="BIFOCAL_VIEWPORT"]')
    frozen = set(window.frozen_layers)
    seen = [text.dxf.text for text in model.query("TEXT") if text.dxf.layer not in frozen]
    seen += [text.dxf.text for text in sheet.query("TEXT")]
    assert [seen.count(letter) for letter in "ABC"] == [2, 2, 2]
    arrows = model.query('SOLID[layer=="BIFOCAL_SECTION_LINES"]')
    assert [max(v.y for v in arrow.vertices()) > 0.1 for arrow in arrows] == [True, True]
    # Labels of contour lines stand beside their lines.
    line = np.concatenate(
        [
            np.array(line.get_points("xy"))
            for line in model.query('LWPOLYLINE[layer=="BIFOCAL_CONTOURS_INDEX"]')
        ]
    )
    labels = model.query('TEXT[layer=="BIFOCAL_CONTOUR_TEXT"]')
    assert labels
    for text in labels:
        turn = np.radians(text.dxf.rotation)
        middle = np.array(text.dxf.align_point)[:2]
        middle += text.dxf.height / 2 * np.array([-np.sin(turn), np.cos(turn)])
        assert np.hypot(*(line - middle).T).min() > text.dxf.height / 2


def test_a_level_section_shows_the_relief_where_it_is(sheets) -> None:
    profile = ezdxf.readfile(sheets[0] / "Torre_est_section3.dxf")
    window = profile.paperspace("C-C").query("VIEWPORT")[-1]
    assert window.dxf.view_height / window.dxf.height == pytest.approx(0.05)  # 1:50 in mm
    points = np.concatenate(
        [
            np.array(line.get_points("xy"))
            for line in profile.query('LWPOLYLINE[layer=="BIFOCAL_SECTIONS"]')
        ]
    )
    inside = np.abs(points[:, 0] - 0.8) < 0.19
    np.testing.assert_allclose(points[inside, 1], 0.3, atol=1e-6)
    outside = points[:, 0] < 0.5
    np.testing.assert_allclose(points[outside, 1], 0.02 * points[outside, 0], atol=2e-4)
    texts = {text.dxf.text: text.dxf.insert for text in profile.query("TEXT")}
    assert {"Section C-C  y=0.5, 1:50", "X [m]", "r [m]", "-2", "2", "+0.2"} <= set(texts)
    assert max(place[1] for place in texts.values()) < 0.8  # none on the profile
    assert texts["+0.2"][0] < -2.1
    svg = (sheets[0] / "Torre_est_section3.svg").read_text()
    # 4.2 m at 1:50 is 84 mm, with 10 mm on either side.
    assert 'width="10' in svg


def test_out_may_lie_in_the_folder_that_a_delivery_makes(wall: Path) -> None:
    few = ("--plane", "--bounds", "0,0,0.5,0.5", *COARSE, "--deliver", "d")
    done = run(wall, *few, "--out", "d/own.tif")
    assert done.exit_code == 0, done.output
    whole = (wall / "d" / "own.tif").read_bytes()
    assert whole == (wall / "d" / "Torre_est.tif").read_bytes()
    again = run(wall, *few, "--title", "Other", "--out", "d/own.tif")
    assert again.exit_code == 1, again.output
    assert "own.tif: exists already" in again.stderr
    assert not (wall / "d" / "Other.tif").exists()
    same = run(wall, *few[:-1], "e", "--out", "e/Torre_est.tif")
    assert same.exit_code == 0, same.output
    assert sorted(p.suffix or p.name for p in (wall / "e").iterdir()) == [
        ".dxf", ".pdf", ".png", ".tfw", ".tif", "SHA256SUMS"
    ]  # fmt: skip


def test_points_beside_the_picture_are_not_drawn_over_the_title(wall: Path) -> None:
    (wall / "c.csv").write_text("id,X,Y,Z\nIN,0.2,0.2,0\nBELOW,0.2,-2.5,0\nAWAY,900,0,0\n")
    done = run(
        wall, "--plane", "--bounds", "0,0,0.5,0.5", *COARSE, "--deliver", "d",
        "--control", "c.csv",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    page = page_of(wall / "d" / "Torre_est.pdf")
    assert "(IN) Tj" in page
    assert "(BELOW) Tj" not in page
    assert "2 points lie outside the picture" in done.stderr
    texts = {text.dxf.text for text in ezdxf.readfile(wall / "d" / "Torre_est.dxf").query("TEXT")}
    assert {"IN", "BELOW", "AWAY"} <= texts


def test_a_title_in_any_script_is_on_the_sheet(wall: Path) -> None:
    pages = []
    for folder, title in (("d", "Łódź, Αθήνα"), ("e", "Łódź, Αθήνή"), ("f", "Torre")):
        done = run(
            wall, "--plane", "--bounds", "0,0,0.5,0.5", *COARSE, "--deliver", folder,
            "--title", title,
        )  # fmt: skip
        assert done.exit_code == 0, done.output
        (path,) = (wall / folder).glob("*.pdf")
        pages.append(page_of(path))
    assert not any("?" in page for page in pages)
    assert "(Torre) Tj" in pages[2]
    # The letters' outlines: other letters make other ones; none is wider than the title's room.
    drawn = [re.findall(r"q 1 0 0 1 \S+ \S+ cm (.*) f Q", page) for page in pages]
    assert [len(found) for found in drawn] == [1, 1, 0]
    assert drawn[0] != drawn[1]
    places = [float(x) for x in re.findall(r"(\S+) \S+ [mlc]\b", drawn[0][0])]
    assert 15 < max(places) <= len("Łódź, Αθήνα") * 0.556 * 5.0 + 0.01


def test_numbers_of_a_flat_wall_have_millimetres(wall: Path) -> None:
    grid = Grid.from_bounds((-2.1, -1.5, 2.1, 1.5), gsd=GSD)
    flat = np.broadcast_to(0.004 * grid.columns_x, grid.shape).astype(np.float32)
    relief = ReliefMap.from_relief(flat, plane_from_pixel=grid.plane_from_pixel)
    relief.write(wall / "relief.tif", overwrite=True)
    done = run(wall, "--relief", "relief.tif", "--deliver", "d", *COARSE)
    assert done.exit_code == 0, done.output
    page = page_of(wall / "d" / "Torre_est_relief.pdf")
    assert "(relief -0.008 to +0.008 m, contour lines every 0.001 m)" in page
    assert "+0.008 m)" in page.replace("relief", "")


def test_the_sheet_of_a_whole_picture_says_what_was_not_measured(wall: Path) -> None:
    relief = ReliefMap.read(wall / "relief.tif")
    r = relief.r.copy()
    r[100:200, 100:200] = np.nan
    replace(relief, r=r).write(wall / "relief.tif", overwrite=True)
    part = ("--relief", "relief.tif", "--scale", "1:50", "--bounds=-1.4,-1.3,0.2,0.8")
    done = run(wall, *part, "--deliver", "d", "--section", "y=-1.2")
    assert done.exit_code == 0, done.output
    page = page_of(wall / "d" / "Torre_est.pdf")
    bound = ", smoothed by up to half a photo pixel"
    (told,) = re.findall(rf"\((\S+ % on interpolated relief{bound})\)", page)
    assert told in done.stdout
    (own,) = re.findall(r"\(photo pixel (\S+) mm on the wall", page)
    assert own == "10"
    assert "(not measured" not in page
    plain = run(wall, *part, "--deliver", "e", "--no-hatch")
    (note,) = re.findall(r"\((of the picture .*)\)", page_of(wall / "e" / "Torre_est.pdf"))
    assert " % on measured relief, " in note
    assert told in note
    assert "finer than the photo's, 10 mm" in plain.stderr
    pictures = [np.asarray(Image.open(wall / name / "Torre_est.png")).astype(int) for name in "de"]
    lined = (pictures[0] != pictures[1]).any(axis=2)
    with rasterio.open(wall / "d" / "Torre_est.tif") as file:
        source, image = file.read(4), np.moveaxis(file.read([1, 2, 3]), 0, -1)
        basis, bound = json.loads(file.tags()["BIFOCAL_BASIS"]), file.tags()["BIFOCAL_BOUND"]
    # Terminal, sheet, file: on the base of what is shown or should be.
    assert told.startswith(f"{100 * basis['interpolated']:.1f} %")
    assert basis["interpolated"] == pytest.approx(
        (source == 5).sum() / (source > 0).sum(), abs=1e-4
    )
    assert sum(basis.values()) == pytest.approx(1, abs=1e-3)
    assert bound == "0.0050 m"  # half of the photo's 10 mm
    np.testing.assert_array_equal(image, pictures[1][..., :3])  # the GeoTIFF bears no lines
    assert 0.05 < lined[source == 5].mean() < 0.4
    assert not lined[np.isin(source, (1, 2, 3))].any()
    # All notes are there, the last too, though the relief has one more.
    assert "(sections A-A  y=-1.2)" in page_of(wall / "d" / "Torre_est_relief.pdf")


def test_a_picture_mostly_on_the_plane_says_that_it_is_a_rectified_photo(wall: Path) -> None:
    relief = ReliefMap.read(wall / "relief.tif")
    wide = relief.r.shape[1]
    titles = []
    for known in (wide // 8, wide - 5):
        r = relief.r.copy()
        r[:, known:] = np.nan
        replace(relief, r=r).write(wall / "part.tif", overwrite=True)
        done = run(wall, "--relief", "part.tif", "--deliver", f"d{known}", "--scale", "1:50")
        assert done.exit_code == 0, done.output
        assert ("this is a rectified photo, no orthophoto" in done.stderr) == (known < wide // 2)
        titles.append(page_of(wall / f"d{known}" / "Torre_est.pdf"))
    assert "Rectified photo" in titles[0]
    assert "Rectified photo" not in titles[1]


def test_the_sheet_is_true_to_scale(wall: Path) -> None:
    done = run(wall, "--relief", "relief.tif", "--deliver", "d", "--scale", "1:20", "--dpi", "51")
    assert done.exit_code == 0, done.output
    pdf = (wall / "d" / "Torre_est.pdf").read_bytes()
    # 4.2 m x 3 m at 1:20 is 210 x 150 mm: A3 across, 420 x 297 mm at 72 / 25.4 units per mm.
    box = pdf[pdf.index(b"/MediaBox [") :].split(b"]")[0].split(b"[")[1].split()
    assert [float(v) for v in box[2:]] == pytest.approx(
        [420 * 72 / 25.4, 297 * 72 / 25.4], abs=0.01
    )
    assert pdf.rstrip().endswith(b"%%EOF")
    start = int(pdf.split(b"startxref")[1].split()[0])
    assert pdf[start : start + 4] == b"xref"


def test_too_many_contour_lines_are_refused_before_the_work(wall: Path, monkeypatch) -> None:
    monkeypatch.setattr("bifocal.orthophotos.deliver_workflow.make_ortho", None)
    words = ("--relief", "relief.tif", "--deliver", "d", "--scale", "1:50")
    done = run(wall, *words, "--contours", "0.0001")
    assert done.exit_code == 1
    assert "choose a larger interval" in done.stderr


def test_a_drawing_that_fits_no_paper_is_refused_before_the_work(wall: Path) -> None:
    done = run(wall, "--plane", "--deliver", "d", "--scale", "1:1", "--any-size")
    assert done.exit_code == 1
    assert "does not fit A0" in done.stderr
    assert not (wall / "d").exists()


@pytest.mark.acceptance
def test_the_relief_sheet_hatches_what_was_not_measured_and_has_a_legend(wall: Path) -> None:
    relief = ReliefMap.read(wall / "relief.tif")
    quality = relief.quality.copy()
    quality[:, :84] = 2  # a fifth of the width
    replace(relief, quality=quality).write(wall / "relief.tif", overwrite=True)
    (wall / "c.csv").write_text("id,X,Y,Z\nA_VERY_LONG_NAME_AT_THE_EDGE,2.09,1.4,0\n")
    done = run(
        wall, "--relief", "relief.tif", "--deliver", "d", "--scale", "1:25", "--paper", "A4",
        "--control", "c.csv", "--section", "y=0.5", "--contours", "0.01",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert "80% measured, 20% interpolated or hidden" in done.stderr
    page = page_of(wall / "d" / "Torre_est_relief.pdf")
    assert "(not measured)" in page
    assert "; of what is coloured 80% measured, 20% interpolated or hidden; 0% of the sheet" in page
    assert "(+0.30 m)" in page
    for sheet in (page, page_of(wall / "d" / "Torre_est.pdf")):
        assert "(sections A-A  y=0.5)" in sheet
        # The letters stand beyond both ends of the line: 297 mm less 168 mm, and 20 mm for binding.
        places = [float(x) for x in re.findall(r"1 0 0 1 (\S+) \S+ Tm \(A\) Tj", sheet)]
        assert len(places) == 2
        assert min(places) < (20 + 287 - 168) / 2 - 4
        assert max(places) > (20 + 287 + 168) / 2 + 4
    assert "not measured" not in page_of(wall / "d" / "Torre_est.pdf")
    # The name begins where it still ends inside the frame, 10 mm from the edge of 297 mm.
    (start,) = set(re.findall(r"1 0 0 1 (\S+) \S+ Tm \(A_VERY_LONG", page))
    assert float(start) + 28 * 0.556 * 2.0 < 297 - 10
    with Image.open(wall / "d" / "Torre_est_relief.png") as picture:
        pixels = np.asarray(picture)[:, :, :3]
    edge = pixels.shape[1] // 5
    guessed, measured = pixels[2:-2, 2 : edge - 8], pixels[2:-2, edge + 8 :]
    # A sixth or so is lined; the rest is paler than its colour, dark blue, but blue.
    light = guessed.astype(int).sum(axis=-1)
    lined = light < 0.75 * np.median(light)
    assert 0.08 < lined.mean() < 0.25
    pale = guessed[~lined].astype(int)
    assert pale.min() > 0.45 * 255 - 1
    assert (pale[:, 2] > pale[:, 0] + 20).mean() > 0.9
    assert (np.ptp(measured.astype(int), axis=-1) > 0).any()
    model = ezdxf.readfile(wall / "d" / "Torre_est_relief.dxf").modelspace()
    lines = model.query('LWPOLYLINE[layer=="BIFOCAL_CONTOURS"]')
    assert len(lines) > 0
    assert min(x for line in lines for x, *_ in line.get_points()) > -1.3


@pytest.mark.acceptance
def test_many_marked_points_do_not_bury_the_sheet_under_their_names(wall: Path) -> None:
    rng = np.random.default_rng(3)
    lines = [
        f"P{i},{x:.4f},{y:.4f},0" for i, (x, y) in enumerate(rng.uniform(-1.4, 1.4, (3000, 2)))
    ]
    (wall / "m.csv").write_text("\n".join(["id,X,Y,Z", *lines]), encoding="utf-8")
    (wall / "c.csv").write_text("id,X,Y,Z\nCONTROL,0,0,0\n", encoding="utf-8")
    done = run(
        wall,
        "--plane",
        "--deliver",
        "d",
        "--scale",
        "1:50",
        "--mark",
        "m.csv",
        "--control",
        "c.csv",
    )
    assert done.exit_code == 0, done.output
    page = page_of(wall / "d" / "Torre_est.pdf")
    names = set(re.findall(r"\((P\d+|CONTROL)\) Tj", page))
    assert "CONTROL" in names
    assert 60 <= len(names) <= 200
    assert f"{3001 - len(names)} marked points stand on the sheet without name" in done.stderr
    # Names of 2 mm cover at most a sixth of the picture of 84 mm by 60 mm.
    assert sum(0.556 * 2.0 * len(name) * 2.0 for name in names) < 84 * 60 / 6
    model = ezdxf.readfile(wall / "d" / "Torre_est.dxf").modelspace()
    assert len(model.query('POINT[layer=="BIFOCAL_POINTS"]')) == 3000


@pytest.mark.parametrize("fits", [True, False])
def test_the_title_block_states_no_sigma_that_the_check_points_or_the_model_gainsay(
    wall: Path, fits: bool
) -> None:
    pair = Pair.read(wall / "wall.pair.json")
    far, near = (replace(photo, image_size=SIZE) for photo in (pair.image1, pair.image2))
    pair = replace(pair, image1=far, image2=near)
    if not fits:
        setup = {"doubts": [remark("pair.bent", bend=0.7, most=0.2)]}
        pair = replace(pair, extra={**pair.extra, "setup": setup})
    task = OrthoTask(relief=wall / "relief.tif")
    with RasterReader(wall / "relief.tif") as reader:
        in_words = partial(wall_in_words, language="en")
        grid, wish = reader.grid, DeliverTask(scale=50, expected=in_words)
        plain = "\n".join(_notes(pair, grid, wish, task, reader))
        checked = replace(wish, checked=(20, 0.0204, 0.0671), language="de")
        proven = "\n".join(_notes(pair, grid, checked, task, reader))
    # In the words of page, terminal and report.
    (expected,) = in_words(pair)
    assert "places to" in expected
    assert (expected in plain) == fits
    assert ("THE MODEL DOES NOT FIT" in plain) != fits
    assert "20 Kontrollpunkte weichen um 20 mm in der Lage, 67 mm im Relief ab" in proven
    assert expected not in proven


def test_words_in_the_middle_of_a_place_stay_there_when_they_are_turned() -> None:
    for angle, (x, y) in ((0.0, (-1, 0)), (90.0, (0, -1)), (180.0, (1, 0))):
        canvas = _PdfCanvas()
        canvas.text((30.0, 20.0), "ABC", Pen(layer="X"), size=2.0, middle=True, angle=angle)
        half = text_width("ABC", 2.0) / 2
        (place,) = re.findall(r"(\S+) (\S+) Tm", canvas.parts[-1])
        assert [float(v) for v in place] == pytest.approx([30 + x * half, 20 + y * half], abs=1e-4)


def test_letters_of_a_drawing_are_as_high_as_those_of_the_sheet_in_print() -> None:
    space = ezdxf.new().modelspace()
    DxfCanvas(space, unit=0.05).text((30.0, 20.0), "ABC", Pen(layer="X"), size=2.0)
    (text,) = space.query("TEXT")
    # A capital letter of Helvetica is 0.72 of its size high; 1 mm is 0.05 of the drawing's unit.
    assert text.dxf.height == pytest.approx(0.72 * 2.0 * 0.05)
    assert tuple(text.dxf.insert)[:2] == pytest.approx((1.5, 1.0))
