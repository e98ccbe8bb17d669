"""Lens files, distortion both ways, calibration from boards and lines, the lens database."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from bifocal import InputError, Interior, Lens, calibrate, read_image, write_image
from bifocal.calibration import board_photos
from bifocal.calibration.board_calibration import Calibration, _verdict, lens_of_views
from bifocal.calibration.lens_database import lens_from_database
from bifocal.calibration.plumb_line import calibrate_from_lines, find_straight_edges
from bifocal.calibration.workflow import undistorted
from bifocal.cli.calibrate import _board_text
from bifocal.model.interior_orientation import lens_of_photo
from photocore.camera.boards import detect_board, find_board_size
from photocore.camera.charuco import BoardView
from tests.bifocal.calibration.known_lens import BROWN, GRID, MATRIX, brown_by_hand
from tests.builders.commands import bifocal_command as main


def test_a_calibration_is_told_with_the_sigma_of_each_value_that_was_estimated():
    result = Calibration(
        lens=replace(BROWN, sigma0=0.25, source="8 photos"), dropped=("c.jpg",),
        standard_deviations={"fx": 0.5, "cy": 0.25, "k1": 0.002}, photo_rms={"a.jpg": 0.21},
        suspicious=("b.jpg",), coverage=np.arange(48).reshape(6, 8), tried=(("k1", 0.25),),
        verdict="good",
    )  # fmt: skip
    text = "\n".join(_board_text(result))
    rows = [line.split() for line in text.splitlines()]
    (fx, _), (_, cy) = MATRIX[0, [0, 2]], MATRIX[1, [1, 2]]
    assert ["fx", f"{fx:.3f}", "0.500"] in rows
    assert ["cy", f"{cy:.3f}", "0.250"] in rows
    assert ["k1", f"{BROWN.coefficients[0]:.6f}", "0.002000"] in rows
    assert not {row[0] for row in rows if row} & {"fy", "cx", "k2", "p1", "p2", "k3"}
    for words in ("RMS 0.250 px; 8 photos", "k1 0.250 px", "a.jpg  0.210", "fit the others: c.jpg",
                  "than the others: b.jpg", "  40   41", "Verdict: good"):  # fmt: skip
        assert words in text


def judged(*, sigma: float = 1.0, rms: float = 0.3, photos: int = 12, empty: int = 0) -> str:
    """Return the verdict on a fit of focal length 3000 px in 4000 px, so many of 48 cells empty."""
    lens = SimpleNamespace(camera_matrix=np.diag([3000.0, 3000.0, 1.0]), image_size=(4000, 3000))
    coverage = np.ones(48, dtype=np.int64)
    coverage[:empty] = 0
    best = SimpleNamespace(deviations={"fx": sigma}, lens=lens, rms=rms)
    return _verdict(best, coverage.reshape(6, 8), photos)


def test_the_verdict_on_a_calibration_names_each_weakness_with_its_number():
    assert judged() == judged(sigma=5.9, rms=0.99, photos=8) == "good"
    # 9 of 3000 px are 0.3 %.
    assert "usable: the principal distance is known to 0.3% only" in judged(sigma=9.0)
    assert judged(photos=7) == "usable: only 7 photos: take ten or more"
    assert judged(rms=1.5).startswith("poor: residuals of 1.50 px")
    assert "reaches only 58% of the photo and 2 of 4 corners" in judged(empty=20)
    assert judged(empty=36).startswith("poor: the board reaches only 25%")


def test_distortion_is_browns_and_its_inverse_exact():
    seen = BROWN.distort(GRID)
    np.testing.assert_allclose(seen, brown_by_hand(GRID, BROWN), atol=1e-9)
    np.testing.assert_allclose(BROWN.undistort(seen), GRID, atol=1e-8)


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [("opencv", [-0.2, 0.06, 1e-3, -5e-4, 0.01]), ("fisheye", [-0.01, 0.002, 1e-3, 0.0])],
)
def test_a_photo_of_points_is_distorted_as_each_of_them(model, coefficients):
    lens = replace(BROWN, model=model, coefficients=np.array(coefficients))
    rng = np.random.default_rng(5)
    points = rng.uniform(0, 700, (130, 151, 2))  # more than are projected at once, no multiple
    seen, slopes = lens.distort(points), lens.distorted_by_ideal(points)
    for place in ((0, 0), (54, 37), (54, 38), (54, 39), (108, 76), (129, 150)):
        np.testing.assert_allclose(lens.distort(points[place]), seen[place], rtol=1e-13)
        np.testing.assert_allclose(
            lens.distorted_by_ideal(points[place]), slopes[place], rtol=1e-12, atol=1e-15
        )
    assert lens.distort(np.zeros((0, 2))).shape == (0, 2)
    assert lens.distorted_by_ideal(np.zeros((0, 2))).shape == (0, 2, 2)


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("opencv", [-0.2, 0.06, 1e-3, -5e-4, 0.01]),
        ("fisheye", [-0.01, 0.002, 1e-3, 0.0]),
        ("radial", [v for r in range(0, 761, 95) for v in (r, 1 - 8e-8 * r**2)]),
    ],
)
def test_distortion_changes_as_its_derivative_says(model, coefficients):
    lens = replace(BROWN, model=model, coefficients=coefficients)
    for axis, step in enumerate(1e-3 * np.eye(2)):
        slope = (lens.distort(GRID + step) - lens.distort(GRID - step)) / 2e-3
        np.testing.assert_allclose(lens.distorted_by_ideal(GRID)[..., axis], slope, atol=2e-7)


def test_a_radial_profile_goes_both_ways():
    radius = np.linspace(0, 760, 40)
    lens = Lens(
        camera_matrix=MATRIX, model="radial", image_size=(1024, 768),
        coefficients=np.column_stack([radius, 1 - 8e-8 * radius**2]).ravel(),
    )  # fmt: skip
    seen = lens.distort(GRID)
    expected = np.array([511.5, 383.5]) * (1 - (1 - 8e-8 * (511.5**2 + 383.5**2)))
    np.testing.assert_allclose(seen[0, 0], expected, atol=1e-6)
    np.testing.assert_allclose(lens.undistort(seen), GRID, atol=1e-9)
    middle = np.array([[511.5, 383.5]])
    np.testing.assert_allclose(lens.undistort(middle), middle, atol=1e-12)


def test_a_fisheye_goes_both_ways():
    lens = Lens(
        camera_matrix=MATRIX, coefficients=[0.05, -0.01, 0.002, 0.0], model="fisheye",
        image_size=(1024, 768),
    )  # fmt: skip
    np.testing.assert_allclose(lens.undistort(lens.distort(GRID)), GRID, atol=1e-6)


def board_views(count=12, noise=0.1, lens=BROWN, seed=5):
    """Return views of a 9 x 6 board through a known lens."""
    rng = np.random.default_rng(seed)
    board = np.column_stack([np.mgrid[0:9, 0:6].T.reshape(-1, 2), np.zeros(54)]).astype(float)
    views = []
    while len(views) < count:
        turn, _ = cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))
        shift = [rng.uniform(-9, 2), rng.uniform(-7, 1), rng.uniform(10, 16)]
        points = board @ turn.T + shift
        ideal = points[:, :2] / points[:, 2:] * [900, 905] + [511.5, 383.5]
        pixels = lens.distort(ideal) + rng.normal(0, noise, (54, 2))
        if (pixels > 0).all() and (pixels < [1024, 768]).all():
            views.append(BoardView(name=f"v{len(views)}", board=board, pixels=pixels))
    return views


def test_a_known_lens_is_found_within_its_standard_deviations():
    result = lens_of_views(board_views(), (1024, 768))
    sigma = result.standard_deviations
    matrix = result.lens.camera_matrix
    for value, truth, name in (
        (matrix[0, 0], 900, "fx"), (matrix[1, 1], 905, "fy"),
        (matrix[0, 2], 511.5, "cx"), (matrix[1, 2], 383.5, "cy"),
        (result.lens.coefficients[0], -0.2, "k1"), (result.lens.coefficients[2], 1e-3, "p1"),
    ):  # fmt: skip
        assert abs(value - truth) < 4 * sigma[name]
    assert result.lens.sigma0 == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    assert dict(result.tried).keys() == {"k1", "k1k2", "k1k2p", "k1k2pk3"}


def test_terms_that_are_not_there_are_not_taken_in():
    plain = Lens(camera_matrix=MATRIX, coefficients=[-0.1, 0, 0, 0], image_size=(1024, 768))
    result = lens_of_views(board_views(lens=plain), (1024, 768))
    assert set(result.standard_deviations) == {"fx", "fy", "cx", "cy", "k1"}


def test_a_photo_that_does_not_fit_is_left_out_and_named():
    views = board_views()
    rng = np.random.default_rng(1)
    bad = views[3]
    views[3] = BoardView(
        name="blurred", board=bad.board, pixels=bad.pixels + rng.normal(0, 8, (54, 2))
    )
    result = lens_of_views(views, (1024, 768))
    assert result.dropped == ("blurred",)


def test_the_work_on_photos_of_a_board_is_told_photo_by_photo_and_never_beyond_the_whole(
    monkeypatch,
):
    monkeypatch.setattr(board_photos, "detect_board", lambda *_, **__: object())
    monkeypatch.setattr(board_photos, "lens_of_views", lambda views, *_, **__: Calibration(
        lens=BROWN, dropped=(), standard_deviations={}, photo_rms={}, suspicious=(),
        coverage=np.zeros((6, 8)), tried=(), verdict=f"{len(views)} views",
    ))  # fmt: skip
    steps: list[tuple[float, float, str]] = []
    photos = [np.zeros((20, 30), np.uint8)] * 4
    done = calibrate(
        photos, board=(7, 6), names=tuple("abcd"), progress=lambda *step: steps.append(step)
    )
    assert done.verdict == "4 views"
    assert steps == [*((k, 4, f"searching {'abcd'[k]}") for k in range(4)), (1, 1, "adjusting")]


def test_few_photos_are_refused():
    with pytest.raises(InputError, match="at least 3"):
        lens_of_views(board_views(2), (1024, 768))


@pytest.mark.parametrize(
    ("images", "names", "message"),
    [
        ([40, 40, 8], ["a.jpg", "b.jpg", "c.jpg"], "c.jpg: 8 x 8 px is too small"),
        ([40, 40, 50], ["a.jpg", "b.jpg", "c.jpg"], "c.jpg: is of another size"),
        ([40, 40, 40], ["a.jpg", "b.jpg"], "names: 2 names for 3 or more photos"),
    ],
)
def test_photos_that_cannot_be_used_are_named_as_asked(images, names, message):
    photos = [np.full((side, side), 99, np.uint8) for side in images]
    with pytest.raises(InputError, match=message):
        calibrate(photos, board=(9, 6), names=names)


def drawn_board(squares=(10, 7), pixel=60):
    rows, columns = np.indices((squares[1] * pixel, squares[0] * pixel)) // pixel
    board = ((rows + columns) % 2 * 220 + 20).astype(np.uint8)
    return cv2.copyMakeBorder(board, 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=240)


def test_the_board_size_is_recognised_and_corners_found():
    image = cv2.GaussianBlur(drawn_board(), (0, 0), 1.2)
    assert find_board_size([image, image]) == (9, 6)
    view = detect_board(image, "x", pattern="chessboard", size=(9, 6))
    spacing = np.diff(view.pixels.reshape(6, 9, 2), axis=1)
    np.testing.assert_allclose(np.linalg.norm(spacing, axis=2), 60, atol=0.1)


def test_charuco_corners_are_found():
    board = cv2.aruco.CharucoBoard(
        (7, 5), 1.0, 0.7, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    )
    image = board.generateImage((700, 500), marginSize=20)
    view = detect_board(image, "x", pattern="charuco", size=(7, 5))
    assert len(view.pixels) == 24
    assert (
        detect_board(np.full((200, 200), 99, np.uint8), "x", pattern="charuco", size=(7, 5)) is None
    )


@pytest.mark.parametrize("pattern", ["circles", "asymmetric-circles"])
def test_circle_grids_are_found(pattern):
    image = np.full((500, 700), 230, np.uint8)
    asymmetric = pattern == "asymmetric-circles"
    size = (4, 7) if asymmetric else (7, 5)
    for row in range(size[1]):
        for column in range(size[0]):
            x = 2 * column + row % 2 if asymmetric else column
            cv2.circle(image, (100 + 60 * x, 70 + 60 * row), 14, 20, -1, cv2.LINE_AA)
    view = detect_board(cv2.GaussianBlur(image, (0, 0), 1), "x", pattern=pattern, size=size)
    first, second = view.pixels[:2]
    assert np.linalg.norm(second - first) == pytest.approx(120 if asymmetric else 60, abs=0.3)


def test_the_reference_photos_give_the_reference_values(data_dir, tmp_path):
    photos = sorted(str(p) for p in (data_dir / "calibration_left").glob("*.jpg"))
    out = tmp_path / "lens.json"
    result = CliRunner().invoke(main, ["calibrate", *photos, "--out", str(out), "--json"])
    assert result.exit_code == 0, result.stderr
    lens = Lens.read(out)
    np.testing.assert_allclose(
        lens.camera_matrix[[0, 1, 0, 1], [0, 1, 2, 2]], [536.07, 536.02, 342.37, 235.54], atol=0.5
    )
    assert lens.sigma0 == pytest.approx(0.409, abs=0.005)
    data = json.loads(result.stdout)
    assert data["suspicious"] == ["left02.jpg"]


def bent_lines(lens):
    lines = []
    for offset in np.linspace(20, 740, 9):
        lines.append(np.column_stack([np.linspace(10, 1010, 40), np.full(40, offset)]))
    for offset in np.linspace(20, 1000, 9):
        lines.append(np.column_stack([np.full(40, offset), np.linspace(10, 750, 40)]))
    return [lens.distort(line) for line in lines]


def test_straight_lines_give_the_radial_terms():
    lens = Lens(
        camera_matrix=[[900, 0, 511.5], [0, 900, 383.5], [0, 0, 1]],
        coefficients=[-0.15, 0.04, 0, 0], image_size=(1024, 768),
    )  # fmt: skip
    rng = np.random.default_rng(2)
    lines = [line + rng.normal(0, 0.1, line.shape) for line in bent_lines(lens)]
    found = calibrate_from_lines(lines, (1024, 768), focal_px=900.0)
    assert abs(found.lens.coefficients[0] + 0.15) < 4 * found.sigma_k1
    assert np.abs(found.lens.undistort(GRID) - lens.undistort(GRID)).max() < 0.3
    assert found.rms_before > 2
    assert found.rms_after == pytest.approx(0.1, abs=0.02)


def test_edges_of_a_picture_are_enough():
    lens = Lens(
        camera_matrix=[[900, 0, 511.5], [0, 900, 383.5], [0, 0, 1]],
        coefficients=[-0.1, 0.0, 0, 0], image_size=(1024, 768),
    )  # fmt: skip
    rows, columns = np.indices((768, 1024))
    wall = (((rows // 96) + (columns // 128)) % 2 * 120 + 60).astype(np.uint8)
    grid = np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float)
    ideal = lens.undistort(grid).astype(np.float32).reshape(768, 1024, 2)
    photo = cv2.remap(wall, ideal[..., 0], ideal[..., 1], cv2.INTER_LINEAR)
    lines = find_straight_edges(cv2.GaussianBlur(photo, (0, 0), 0.8))
    found = calibrate_from_lines(lines, (1024, 768), focal_px=900.0)
    assert found.lines >= 6
    assert np.abs(found.lens.undistort(GRID) - lens.undistort(GRID)).max() < 1.5


@pytest.mark.parametrize(("given", "sigma"), [(["--focal-px", "900"], 0.02), ([], 0.5)])
def test_lines_that_ask_for_no_correction_give_a_lens_without_distortion(tmp_path, given, sigma):
    # Edges that are not straight themselves: smooth bends of half a pixel, each its own.
    rng = np.random.default_rng(3)
    rows = ["line,col [px],row [px]"]
    along = np.linspace(20, 1000, 30)
    for number, at in enumerate(np.linspace(30, 740, 8)):
        row = at + 0.5 * np.sin(along / rng.uniform(60, 160) + rng.uniform(0, 6))
        rows += [f"L{number},{x:.3f},{y:.3f}" for x, y in zip(along, row, strict=True)]
    (tmp_path / "lines.csv").write_text("\n".join(rows))
    write_image(tmp_path / "wall.png", np.full((768, 1024), 128, np.uint8))
    out = tmp_path / "lens.json"
    words = [str(tmp_path / "wall.png"), "--lines", str(tmp_path / "lines.csv"), *given]
    done = CliRunner().invoke(main, ["calibrate", *words, "--out", str(out)])
    assert done.exit_code == 0, done.stderr
    assert "hardly straightens" in done.stderr
    assert "use a board" in done.stderr
    assert "no distortion: k1 = k2 = 0" in done.stdout
    lens = Lens.read(out)
    assert not lens.coefficients.any()
    # Nothing calibrated the principal distance: `align` takes it as what it is, also resized.
    for one in (lens, lens_of_photo(lens, (512, 384))):
        assert Interior.from_lens(one, source="lens.json").sigma_focal == sigma


def test_too_few_lines_are_refused():
    with pytest.raises(InputError, match="at least 3"):
        calibrate_from_lines([GRID[0], GRID[1]], (1024, 768), focal_px=900.0)


def test_an_undistorted_photo_shows_straight_what_was_straight():
    rows, columns = np.indices((768, 1024))
    wall = (127 + 100 * np.sin(columns / 20) * np.sin(rows / 25)).astype(np.uint8)
    grid = np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float)
    ideal = BROWN.undistort(grid).astype(np.float32).reshape(768, 1024, 2)
    seen = cv2.remap(wall, ideal[..., 0], ideal[..., 1], cv2.INTER_CUBIC)
    back = undistorted(seen, BROWN)[80:-80, 80:-80]
    assert np.abs(back.astype(int) - wall[80:-80, 80:-80]).mean() < 1.0


def canon(path, focal=19.0, lens="Canon EF-S 18-55mm f/3.5-5.6", model="Canon EOS 300D DIGITAL"):
    exif = Image.Exif()
    exif[271], exif[272] = "Canon", model
    exif.get_ifd(34665).update({37386: focal, **({42036: lens} if lens else {})})
    Image.new("RGB", (3072, 2048), (120, 110, 100)).save(path, exif=exif)
    return path


def test_the_database_scale_on_the_axis_is_taken_out(tmp_path):
    pytest.importorskip("lensfunpy")
    for focal, axis in ((19.0, 1.035), (35.0, 1.007)):
        found = lens_from_database(canon(tmp_path / f"{focal}.jpg", focal))
        assert found.axis_scale == pytest.approx(axis, abs=0.001)
        centre = found.lens.principal_point
        near = np.array([[1.0, 0.0], [0.0, 1.0]])
        stretch = np.linalg.norm(found.lens.distort(centre + near) - centre, axis=1)
        np.testing.assert_allclose(stretch, 1.0, atol=2e-4)
        assert found.corner_shift > 15


def test_an_ambiguous_or_unknown_lens_is_offered_as_a_choice(tmp_path):
    pytest.importorskip("lensfunpy")
    with pytest.raises(InputError, match=r"Choose one[\s\S]*EF-S 18-55mm f/3.5-5.6"):
        lens_from_database(canon(tmp_path / "a.jpg", lens=""))
    with pytest.raises(InputError, match="not in the lens database"):
        lens_from_database(canon(tmp_path / "b.jpg", model="iPhone 12", lens=""))
    Image.new("RGB", (30, 20)).save(tmp_path / "c.jpg")
    with pytest.raises(InputError, match="--focal"):
        lens_from_database(tmp_path / "c.jpg")


def test_the_commands_write_lens_file_and_photo(tmp_path):
    pytest.importorskip("lensfunpy")
    photo = canon(tmp_path / "far.jpg")
    run = CliRunner().invoke
    done = run(main, ["calibrate", str(photo), "--database", "--out", str(tmp_path / "l.json")])
    assert done.exit_code == 0, done.stderr
    assert "taken out" in done.stderr
    done = run(main, ["undistort", str(photo), "--lens", str(tmp_path / "l.json")])
    assert done.exit_code == 0, done.stderr
    assert read_image(tmp_path / "far_undistorted.jpg").shape == (2048, 3072, 3)
    again = run(main, ["undistort", str(photo), "--lens", str(tmp_path / "l.json")])
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr


def test_mistakes_with_lenses_are_named(tmp_path):
    run = CliRunner().invoke
    write_image(tmp_path / "grey.png", np.full((300, 400), 128, np.uint8))
    write_image(tmp_path / "other.png", np.full((400, 300), 128, np.uint8))
    BROWN.write(tmp_path / "l.json")
    cases = [
        (["calibrate", "grey.png", "--out", "o.json"], "no chessboard was recognised"),
        (["calibrate", "grey.png", "other.png", "--out", "o.json"], "one camera"),
        (["calibrate", "none.png", "--out", "o.json"], "no such image"),
        (["undistort", "grey.png", "--lens", "l.json"], "400 x 300"),
        (["undistort", "grey.png", "--lens", "none.json"], "no such lens file"),
    ]
    for arguments, message in cases:
        full = [str(tmp_path / a) if "." in a else a for a in arguments]
        result = run(main, full)
        assert result.exit_code == 1, arguments
        assert message in result.stderr
    assert not (tmp_path / "o.json").exists()


@pytest.mark.parametrize(
    ("model", "terms"),
    [
        ("opencv", [-0.12, 0.03, 2e-4, -1e-4]),
        ("opencv", [-0.12, 0.03, 2e-4, -1e-4, 0.01, 0.001, 0.02, 0.003]),
        ("fisheye", [-0.02, 0.01, 0.003, 0.001]),
        ("radial", [0, 1, 150, 0.99, 300, 0.97, 500, 0.95]),
    ],
)
def test_a_photo_is_undistorted_by_the_formulas_that_points_are(model, terms):
    """A photo whose grey is its column, then its row, in strips beyond the first."""
    width, height = 240, 1100
    matrix = np.array([[900.0, 0, 118.3], [0, 905.0, 560.2], [0, 0, 1]])
    lens = Lens(camera_matrix=matrix, coefficients=terms, model=model, image_size=(width, height))
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    seen = lens.distort(np.stack([columns, rows], axis=-1))
    inside = (seen >= 3).all(axis=-1) & (seen < (width - 4, height - 4)).all(axis=-1)
    assert inside.mean() > 0.9
    for axis, ramp in enumerate((columns, rows)):
        found = undistorted(ramp.astype(np.float32), lens)
        # OpenCV's remap counts in 32nds of a pixel, and its cubic bends a ramp by as much.
        assert np.abs(found - seen[..., axis])[inside].max() < 1 / 16


def test_photos_are_undistorted_all_or_none(tmp_path):
    rng = np.random.default_rng(2)
    lens = Lens(
        camera_matrix=[[300, 0, 20], [0, 300, 15], [0, 0, 1]],
        image_size=(40, 30),
        coefficients=[0.01, 0, 0, 0, 0],
    )
    for name, size in (("a.png", (30, 40, 3)), ("b.png", (30, 50, 3))):
        write_image(tmp_path / name, rng.integers(0, 255, size).astype(np.uint8))
    lens.write(tmp_path / "l.json")
    before = sorted(tmp_path.iterdir())
    photos = [str(tmp_path / name) for name in ("a.png", "b.png")]
    done = CliRunner().invoke(main, ["undistort", *photos, "--lens", str(tmp_path / "l.json")])
    assert done.exit_code == 1
    assert "b.png" in done.stderr
    assert sorted(tmp_path.iterdir()) == before


def test_a_table_in_place_of_a_lens_is_told_what_is_read(tmp_path):
    (tmp_path / "points.csv").write_text("id,X\n")
    with pytest.raises(InputError, match="is no lens file"):
        Lens.read(tmp_path / "points.csv")
