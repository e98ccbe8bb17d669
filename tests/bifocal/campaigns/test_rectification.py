"""One photo alone: rendered planes with exact truth, real walls, and the slips people make."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import ezdxf
import numpy as np
import pytest
import rasterio
from click.testing import CliRunner

from bifocal import (
    Control,
    GeometryError,
    InputError,
    Interior,
    Lens,
    Pinhole,
    RadialDivision,
    rectify,
)
from tests.bifocal.orientation.test_facade_lines import MATRIX, SIZE, drawn, view
from tests.bifocal.orthophotos.ortho_command import page_of
from tests.builders.commands import bifocal_command
from tests.builders.pinholes import project


def looking(*turn_deg: float) -> Pinhole:
    """Return a camera 14 m before the wall that looks at its middle from aside."""
    camera = view(*turn_deg)
    axis = camera.rotation[2]
    return camera._replace(centre=np.array([0.2, 0.4, 0.0]) + axis * 14.0 / axis[2])


CAMERA = looking(9.0, -16.0, 1.5)
DOTS = np.stack(np.meshgrid(np.arange(-2.5, 3.0), np.arange(-1.5, 3.0)), -1).reshape(-1, 2)
CORNERS = np.array([[-2.5, 2.5], [2.5, 2.5], [2.5, -1.5], [-2.5, -1.5]])
LENS = Interior.from_focal(1500.0, image_size=SIZE, sigma=0.01, source="test")


def seen(xy: np.ndarray, relief: float = 0.0, camera: Pinhole = CAMERA) -> np.ndarray:
    """Return the pixels of places on the wall."""
    return project(camera, np.column_stack([xy, np.full(len(xy), relief)]))


def rendered(camera: Pinhole = CAMERA) -> np.ndarray:
    """Return a photo of round dots on the wall, each pixel by where its ray meets the wall."""
    rows, columns = np.indices(SIZE[::-1])
    rays = np.stack([columns, rows, np.ones_like(rows)], -1) @ np.linalg.inv(camera.matrix).T
    rays = rays @ camera.rotation
    places = camera.centre[:2] - rays[..., :2] * (camera.centre[2] / rays[..., 2:])
    nearest = np.clip(np.rint(places - DOTS[0]), 0, [5, 4]) + DOTS[0]
    away = np.linalg.norm(places - nearest, axis=-1)
    return np.rint(30 + 200 * np.exp(-0.5 * (away / 0.06) ** 2)).astype(np.uint8)


def control(xy: np.ndarray = CORNERS, **more: np.ndarray) -> Control:
    """Return points of the wall with exact picks."""
    arrays = {
        "xyz": np.column_stack([xy, np.zeros(len(xy))]), "sigma": np.full((len(xy), 3), 0.001),
        "pixels1": seen(xy), "pixels2": np.full((len(xy), 2), np.nan),
    }  # fmt: skip
    return Control(ids=tuple("ABCDEFGHIJKLMNOPQRSTUVWXYZ"[: len(xy)]), **(arrays | more))


def misses(ortho) -> np.ndarray:
    """Return by how many pixels of the orthophoto its dots lie off their places."""
    out = []
    for place in DOTS:
        column, row = np.rint(ortho.grid.pixel_of(place)).astype(int)
        part = ortho.image[row - 30 : row + 31, column - 30 : column + 31].astype(float) - 30
        y, x = np.indices(part.shape)
        middle = np.array([(part * x).sum(), (part * y).sum()]) / part.sum() - 30 + [column, row]
        out.append(middle - ortho.grid.pixel_of(place))
    return np.linalg.norm(out, axis=1)


@pytest.mark.parametrize("interior", [LENS, None], ids=["EXIF", "unknown lens"])
@pytest.mark.parametrize("way", ["control", "rectangle"])
def test_a_rendered_plane_comes_back_to_a_tenth_of_a_pixel(way, interior) -> None:
    sides = {
        "control": control(sigma=np.full((4, 3), 1e-4)),
        "rectangle": ((5.0, 4.0), seen(CORNERS)),
    }
    exact = {"sigma_pick": 0.02, "sigma_control": 1e-4, "interior": interior, "gsd": 0.01}
    done = rectify(rendered(), **{way: sides[way]}, **exact)
    off = misses(done.ortho) if way == "control" else _moved(done.ortho)
    assert off.max() < 0.1
    assert done.photo.sigma0 == pytest.approx(1.0)


def _moved(ortho) -> np.ndarray:
    """Return `misses` of a picture that counts from the rectangle's lower left corner."""
    matrix = ortho.plane_from_pixel.copy()
    matrix[:2, 2] += CORNERS[3]
    return misses(type(ortho)(image=ortho.image, source=ortho.source, hidden=ortho.hidden,
                              plane_from_pixel=matrix))  # fmt: skip


def test_the_bound_is_what_a_point_before_the_wall_is_displaced_by() -> None:
    done = rectify(rendered(), control=control(DOTS[::3]), interior=LENS, gsd=0.02, stands_out=0.2)
    value, sigma = done.bound
    rim = np.array([[0, 0], [SIZE[0] - 1, 0], [SIZE[0] - 1, SIZE[1] - 1], [0, SIZE[1] - 1.0]])
    photo = done.photo.as_pair().image1
    places = photo.plane_from_pixels(rim)
    shown = photo.plane_from_pixels(seen(places, relief=0.2))  # on the true camera
    worst = np.linalg.norm(shown - places, axis=1).max()
    assert value == pytest.approx(worst, abs=3 * sigma + 0.03 * worst)
    assert done.words[0].startswith("What stands out by 20 cm is displaced by up to")


def test_an_unknown_lens_gives_a_range_and_says_so() -> None:
    square = Pinhole(MATRIX, np.diag([1.0, -1.0, -1.0]), np.array([0.3, -0.2, 14.0]))
    points = control(pixels1=seen(CORNERS, camera=square))
    image = rendered(square)
    rough = rectify(image, gsd=0.1, control=points)
    assert "no closer as the lens is not known well" in rough.words[0]
    known = rectify(image, gsd=0.1, control=points, interior=LENS)
    assert known.bound[1] < 0.1 * known.bound[0] < rough.bound[1]
    assert abs(rough.bound[0] - known.bound[0]) < 2 * rough.bound[1]


def test_errors_of_points_left_out_are_as_large_as_their_sigmas() -> None:
    rng, tests, ratios = np.random.default_rng(4), [], []
    for _ in range(10):
        noisy = control(
            DOTS[::4], pixels1=seen(DOTS[::4]) + rng.normal(0, 0.5, (len(DOTS[::4]), 2))
        )
        photo = rectify(np.zeros(SIZE[::-1], np.uint8), control=noisy, interior=LENS, gsd=0.1).photo
        tests.append(photo.test)
        ratios.append(photo.left_out / photo.sigma_left_out)
    # 0.1 with 25 draws, and sqrt(2.5) times that with 10.
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.16)
    assert np.mean(np.array(tests) > 3.0) < 0.02


def test_a_point_that_was_picked_wrongly_is_named() -> None:
    picks = seen(DOTS[::4])
    picks[2] += 6
    done = rectify(rendered(), control=control(DOTS[::4], pixels1=picks), interior=LENS, gsd=0.1)
    assert any(note.startswith("Point C lies ") for note in done.remarks)


@pytest.mark.parametrize("interior", [LENS, None], ids=["EXIF", "unknown lens"])
def test_slips_of_four_points_are_named(interior) -> None:
    image, picks = np.zeros(SIZE[::-1], np.uint8), seen(CORNERS)
    xyz = control().xyz
    done = rectify(image, gsd=0.1, control=control(pixels1=picks[[1, 0, 2, 3]]), interior=interior)
    assert "points A and B are exchanged" in done.remarks[0]
    assert done.photo.camera.centre[2] == pytest.approx(14.0, rel=0.02)
    for signs, word in (([1, -1, 1], "sign of Y"), ([-1, 1, 1], "sign of X")):
        with pytest.raises(GeometryError, match=word):
            rectify(image, gsd=0.1, control=control(xyz=xyz * signs), interior=interior)
    with pytest.raises(GeometryError, match="X and Y exchanged"):
        rectify(image, gsd=0.1, control=control(xyz=xyz[:, [1, 0, 2]]), interior=interior)


def test_sides_of_a_rectangle_the_wrong_way_round_are_named() -> None:
    image = np.zeros(SIZE[::-1], np.uint8)
    tall = np.array([[-1, 2.5], [1, 2.5], [1, -1.5], [-1, -1.5]])
    with pytest.raises(GeometryError, match="2 m wide and 4 m high"):
        rectify(image, gsd=0.1, rectangle=((4.0, 2.0), seen(tall)), interior=LENS)
    crossed = [[200, 150], [900, 160], [1400, 800], [190, 820]]
    with pytest.raises(GeometryError, match="those of no rectangle of 8 x 4"):
        rectify(image, gsd=0.1, rectangle=((8.0, 4.75), crossed), interior=LENS)
    with pytest.raises(InputError, match="a rectangle has four"):
        rectify(image, gsd=0.1, rectangle=((2.0, 4.0), seen(tall)[:3]), interior=LENS)


def test_points_on_one_line_are_refused_and_three_of_four_doubted() -> None:
    image, line = np.zeros(SIZE[::-1], np.uint8), np.array([[-2, -1], [-1, -0.5], [0, 0], [2, 1.0]])
    with pytest.raises(GeometryError, match="on one line"):
        rectify(image, gsd=0.1, control=control(line))
    line[3] = 2, -1
    done = rectify(image, gsd=0.1, control=control(line))
    assert any("no three of four on one line" in note for note in done.remarks)
    for count in (3, 1):
        with pytest.raises(GeometryError, match=rf"{count} control points .* a camera needs four"):
            rectify(image, gsd=0.1, control=control(CORNERS[:count]))
    with pytest.raises(InputError, match="one of control, rectangle and length"):
        rectify(image, gsd=0.1, control=control(), length=([[0, 0], [9, 9]], 1.0))
    with pytest.raises(InputError, match="its interior is of another size"):
        rectify(image[:-1], control=control(), interior=LENS)
    with pytest.raises(InputError, match="expected shape"):
        rectify(image[0], control=control())


def test_a_part_cut_out_of_a_photo_is_taken_as_one() -> None:
    points = np.concatenate([CORNERS, [[0.0, 0.0], [1.0, 1.5]]])
    whole = seen(points)
    cut = (700, 800)  # the right part: the middle of the photo is 250 px off
    lens = Interior.from_focal(1500, image_size=cut, sigma=0.01, source="test")
    part = control(points, pixels1=whole - [500, 0])
    done = rectify(np.zeros(cut[::-1], np.uint8), control=part, interior=lens)
    assert any("cut out of a larger one" in note for note in done.remarks)
    assert done.photo.camera.matrix[0, 2] == pytest.approx(MATRIX[0, 2] - 500, abs=20)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (12.0, -25.0, 1.0), (-6.0, 33.0, -2.0)])
def test_lines_and_one_length_set_a_photo_up(turn) -> None:
    camera = looking(*turn)
    image = drawn(camera, RadialDivision(0.0, MATRIX[:2, 2], 1500.0))
    ends = np.array([[-1.5, 0.0], [2.3, 1.0]])
    picks = seen(ends, camera=camera)
    taped = float(np.linalg.norm(ends[1] - ends[0]))
    photo = rectify(image, length=(picks, taped), interior=LENS).photo
    places = np.array([[-3.0, -1.6], [3.8, -1.6], [3.8, 1.6], [-3.0, 1.6], [0.0, 0.0]])
    found = photo.as_pair().image1.plane_from_pixels(seen(places, camera=camera)) + ends[0]
    error = np.linalg.norm(found - places, axis=1)
    assert error.max() < 0.05
    assert (error < 3 * photo.sigma_at(found - ends[0]) + 0.002).all()
    with pytest.raises(GeometryError, match="upright or level lines"):
        rectify(np.zeros(SIZE[::-1], np.uint8), length=(picks, taped), interior=LENS)
    with pytest.raises(GeometryError, match="two points are one"):
        rectify(image, length=(picks[[0, 0]], taped), interior=LENS)


@pytest.fixture
def church(tmp_path: Path, data_dir: Path) -> Path:
    """Return a table of twelve points of a real wall within 2 cm of its plane, spread over it."""
    with (data_dir / "facade_pairs" / "church_2" / "points.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if abs(float(row["relief_m"])) < 0.02
                and float(row["res_far_px"]) < 1 and int(row["n_images"]) > 5]  # fmt: skip
    xy = np.array([[float(row["X_m"]), float(row["Y_m"])] for row in rows])
    spread = [int(xy.sum(axis=1).argmin())]
    while len(spread) < 12:
        spread.append(int(np.linalg.norm(xy[:, None] - xy[spread], axis=2).min(axis=1).argmax()))
    keys = ("id", "X_m", "Y_m", "relief_m", "x_far_px", "y_far_px")
    lines = [",".join(rows[k][key] for key in keys) for k in spread]
    (tmp_path / "points.csv").write_text("\n".join(["id,X,Y,r,col,row", *lines]), encoding="utf-8")
    return tmp_path


def test_a_real_wall_is_rectified_within_its_sigmas(church: Path, data_dir: Path) -> None:
    folder = data_dir / "facade_pairs" / "church_2"
    line = f"rectify {folder / 'far.jpg'} --control points.csv --gsd 2cm --json"
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(church)
        done = CliRunner().invoke(bifocal_command, [*line.split(), "--out", "ortho.tif"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    truth = json.loads((folder / "geometry.json").read_text())["far"]
    assert told["distance"] == pytest.approx(truth["height_over_plane_m"], rel=0.06)
    errors = np.array([point["error"] for point in told["left_out"]])
    assert 0.001 < np.sqrt(np.mean(errors**2)) < 0.004
    assert all(point["test"] < 3 for point in told["left_out"])
    assert told["words"][0].startswith("What stands out by 20 cm is displaced by up to 2")


def test_a_drawing_says_what_relief_does(church: Path, data_dir: Path) -> None:
    photo = data_dir / "facade_pairs" / "church_2" / "far.jpg"
    line = (f"rectify {photo} --control points.csv --scale 1:50 --dpi 100 --language it --mark "
            "points.csv --deliver drawing")  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(church)
        done = CliRunner().invoke(bifocal_command, line.split())
    assert done.exit_code == 0, done.output
    names = {path.name for path in (church / "drawing").iterdir()}
    assert names == {
        "far.tif", "far.tfw", "far.png", "far.dxf", "far.pdf", "SHA256SUMS",
    }  # fmt: skip
    assert cv2.imread(str(church / "drawing" / "far.png")).shape[1] > 1000
    page = page_of(church / "drawing" / "far.pdf")
    assert "Ciò che sporge di 20 cm è spostato fino a 2" in page
    assert "foto lontana" not in page
    drawing = ezdxf.readfile(church / "drawing" / "far.dxf").modelspace()
    assert len(drawing.query('*[layer=="RIL_PUNTI_APPOGGIO"]')) >= 12
    with rasterio.open(church / "drawing" / "far.tif") as picture:
        assert picture.descriptions == ("red", "green", "blue", "source")
        assert set(np.unique(picture.read(4))) == {0, 1}
        assert "BIFOCAL_D2" not in picture.tags()


def test_a_known_lens_straightens_the_photo() -> None:
    lens = Lens(camera_matrix=MATRIX, coefficients=[-0.3, 0.05, 0, 0, 0], image_size=SIZE)
    picks = lens.distort(seen(DOTS[::2]))
    known = Interior.from_lens(lens, source="lens.json")
    image = np.zeros(SIZE[::-1], np.uint8)
    photo = rectify(image, control=control(DOTS[::2], pixels1=picks), interior=known, gsd=0.1).photo
    assert np.abs(photo.left_out).max() < 0.001
    assert photo.camera.centre == pytest.approx(CAMERA.centre, abs=0.005)
    points = control(DOTS[::2], pixels1=picks)
    bent = rectify(image, control=points, interior=LENS, sigma_pick=0.1, gsd=0.1)
    assert any("a lens that bends (--lens)" in note for note in bent.remarks)


def test_a_gross_point_is_left_out_and_moves_nothing() -> None:
    picks, image = seen(DOTS[::3]), np.zeros(SIZE[::-1], np.uint8)
    clean = rectify(image, control=control(DOTS[::3]), interior=LENS, gsd=0.1).photo
    picks[4] += [40, -25]
    done = rectify(image, control=control(DOTS[::3], pixels1=picks), interior=LENS, gsd=0.1)
    assert "E" not in done.photo.ids
    assert any(n.startswith("Point E lies ") and "was left out" in n for n in done.remarks)
    assert done.photo.camera.centre == pytest.approx(clean.camera.centre, abs=0.02)


def test_a_side_that_was_measured_wrongly_is_no_crop() -> None:
    """A rectangle 5 m wide taken for 5.5 m; the photo has the proportions of a camera."""
    image = np.zeros(SIZE[::-1], np.uint8)
    with pytest.raises(
        GeometryError, match=r"5.5 m wide and 4 m high; they fit one [45]\.\d* m wide"
    ):
        rectify(image, rectangle=((5.5, 4.0), seen(CORNERS)), interior=LENS)
    done = rectify(image, rectangle=((5.2, 4.0), seen(CORNERS)), interior=LENS)
    (words,) = [note for note in done.remarks if note.startswith("The corners do not fit")]
    width = float(words.partition("fit one ")[2].partition(" m")[0])
    assert width == pytest.approx(5.0, rel=0.02)
    assert not any("was taken so" in note for note in done.remarks)
    assert done.photo.sigma_at(CORNERS).max() > 0.03  # 0.2 m off in the width


def test_how_far_each_corner_would_be_off_stands_beside_what_else_would_fit() -> None:
    """The second corner is picked 25 px too far to the right; the photo is nearly square on."""
    picks = seen(CORNERS)
    picks[1, 0] += 25
    image, lens = np.zeros(SIZE[::-1], np.uint8), replace(LENS, sigma_focal=1e-4)
    words = " ".join(rectify(image, rectangle=((5.0, 4.0), picks), interior=lens).remarks)
    assert re.search(r"one corner alone is picked wrong.*\b2: 2[456] px, 3: ", words)


def test_a_focal_length_that_would_fit_stands_beside_the_sides_that_would() -> None:
    """The lens is said to be 1.25 times as long as it is; the photo looks up at the wall."""
    image = np.zeros(SIZE[::-1], np.uint8)
    lens = Interior.from_focal(1.25 * 1500.0, image_size=SIZE, sigma=0.01, source="test")
    try:
        remarks = rectify(image, rectangle=((5.0, 4.0), seen(CORNERS)), interior=lens).remarks
    except GeometryError as error:
        remarks = (str(error),)
    (words,) = [note for note in remarks if "fit a focal length" in note]
    times = float(words.partition("focal length ")[2].partition(" times")[0])
    assert times == pytest.approx(0.8, abs=0.02)


def test_points_at_one_pixel_were_not_seen() -> None:
    points = np.vstack([DOTS[::4], [[1.0, 1.0], [2.0, -1.0]]])
    picks = seen(points)
    picks[-2:] = 0.0
    done = rectify(
        np.zeros(SIZE[::-1], np.uint8),
        control=control(points, pixels1=picks),
        gsd=0.1,
        interior=LENS,
    )
    assert any("one and the same pixel" in note for note in done.remarks)
    assert done.photo.camera.centre == pytest.approx(CAMERA.centre, abs=0.05)
