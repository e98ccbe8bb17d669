"""`bifocal align` and `bifocal match` from the command line."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from bifocal import Interior, Matches, Pair
from bifocal.cli import match as match_command
from bifocal.orientation.validation import check_distortion
from bifocal.workbook.match_workflow import match_summary
from bifocal.workbook.template_workflow import write_template
from multimedia import GeometryError
from tests.bifocal.orientation.layered_wall import camera, relief_at, take
from tests.builders.commands import bifocal_command as main
from tests.builders.pinholes import project

FAR = camera(16.0, turn_deg=(0.3, -0.2, 0.15))
NEAR = camera(9.0, offset=(0.05, -0.04), turn_deg=(-0.2, 0.25, -0.2))
SENSOR = 22.7
#: Focal lengths of a sensor 22.7 mm wide. [mm]
FOCAL = [str(cam.matrix[0, 0] * SENSOR / 960) for cam in (FAR, NEAR)]
POINTS = {
    "a": (-4.5, 2.9, 0), "b": (4.6, 3.0, 0), "c": (-0.9, -3.5, 0), "d": (1.2, 2.8, 0),
    "e": (-4.6, -1, 0.35), "f": (4.5, 1, 0.35),
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("photos")
    views = take(FAR, NEAR)
    cv2.imwrite(str(path / "far.png"), views.far)
    cv2.imwrite(str(path / "near.png"), views.near)
    write_control(path / "control.csv")
    result = align(path, "--control", "control.csv", *lens(), out="wall.pair.json")
    assert result.exit_code == 0, result.output
    return path


def write_control(path: Path, *, unit: float = 1.0, heading: str = "") -> None:
    rows = [f"id,X{heading},Y{heading},r{heading},col1,row1,col2,row2"]
    for name, xyz in POINTS.items():
        pixels = [*project(FAR, np.array([xyz]))[0], *project(NEAR, np.array([xyz]))[0]]
        x, y, r = (str(v * unit) for v in xyz)
        rows.append(",".join([name, x, y, r if xyz[2] else "", *(f"{v:.3f}" for v in pixels)]))
    path.write_text("\n".join(rows), encoding="utf-8")


def lens() -> list[str]:
    return ["--focal1", FOCAL[0], "--focal2", FOCAL[1], "--sensor-width", str(SENSOR)]


def align(folder: Path, *options: str, out: str, photos=("far.png", "near.png")):
    paths = [str(folder / name) for name in photos]
    given = [str(folder / o) if o.endswith(".csv") else o for o in options]
    return CliRunner().invoke(main, ["align", *paths, *given, "--out", str(folder / out)])


def test_control_points_give_a_pair_file_with_picture_and_diagnostics(folder) -> None:
    pair = Pair.read(folder / "wall.pair.json")
    for photo, cam in ((pair.image1, FAR), (pair.image2, NEAR)):
        assert photo.distance == pytest.approx(cam.centre[2], rel=0.005)
        np.testing.assert_allclose(photo.nadir, cam.centre[:2], atol=0.06)
    assert pair.image1.file == "far.png"
    assert pair.extra["setup"]["way"] == "control"
    assert pair.extra["setup"]["standard_deviations"]["distance1"] < 0.5
    assert pair.image1.principal_distance == pytest.approx(float(FOCAL[0]), rel=0.01)
    assert cv2.imread(str(folder / "wall.pair.png")).shape[1] > 1000


@pytest.mark.acceptance
def test_json_goes_to_stdout_alone(folder) -> None:
    result = align(
        folder, "--control", "control.csv", *lens(), "--json", "--no-picture", out="j.pair.json"
    )
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)
    assert data["way"] == "control"
    assert data["distance2"] == pytest.approx(9.0, rel=0.02)
    assert not (folder / "j.pair.png").exists()


@pytest.mark.acceptance
@pytest.mark.long
def test_a_photo_turned_by_exif_gives_the_same_pair(folder) -> None:
    from PIL import Image

    upright = Image.open(folder / "near.png").convert("L")
    exif = Image.Exif()
    exif[274] = 6  # shown turned clockwise by 90 degrees
    upright.transpose(Image.Transpose.ROTATE_90).save(folder / "near.jpg", exif=exif, quality=97)
    result = align(
        folder, "--control", "control.csv", *lens(), "--no-picture", out="turned.pair.json",
        photos=("far.png", "near.jpg"),
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    pair = Pair.read(folder / "turned.pair.json")
    np.testing.assert_allclose(pair.image2.nadir, NEAR.centre[:2], atol=0.06)


@pytest.mark.acceptance
@pytest.mark.long
def test_a_lens_file_with_distortion_is_carried_into_the_pair(folder) -> None:
    for name, cam in (("lens1.json", FAR), ("lens2.json", NEAR)):
        data = {
            "format": "bifocal-lens/1",
            "camera_matrix": cam.matrix.tolist(),
            "model": "opencv",
            "coefficients": [1e-6, 0.0, 0.0, 0.0],
            "image_size": [960, 640],
        }
        (folder / name).write_text(json.dumps(data), encoding="utf-8")
    lenses = ["--lens1", str(folder / "lens1.json"), "--lens2", str(folder / "lens2.json")]
    result = align(
        folder, "--auto", "--distance1", "16", *lenses, "--no-picture", out="lens.pair.json"
    )
    assert result.exit_code == 0, result.output
    pair = Pair.read(folder / "lens.pair.json")
    assert pair.image1.lens is not None
    assert pair.image2.distance == pytest.approx(9.0, rel=0.005)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("unit", "heading"), [(1000.0, " [mm]"), pytest.param(100.0, " [cm]", marks=pytest.mark.long)]
)
def test_units_in_the_headings_are_taken(folder, unit, heading) -> None:
    write_control(folder / "unit.csv", unit=unit, heading=heading)
    result = align(
        folder, "--control", "unit.csv", *lens(), "--no-picture", "--overwrite", out="u.pair.json"
    )
    assert result.exit_code == 0, result.output
    assert Pair.read(folder / "u.pair.json").image1.distance == pytest.approx(16.0, rel=0.005)


@pytest.mark.acceptance
def test_millimetres_without_saying_so_are_refused(folder) -> None:
    write_control(folder / "mm.csv", unit=1000.0)
    result = align(folder, "--control", "mm.csv", *lens(), out="mm.pair.json")
    assert result.exit_code == 1
    assert "in mm or cm" in result.stderr
    assert not (folder / "mm.pair.json").exists()


@pytest.mark.acceptance
def test_picks_of_the_other_photo_are_exchanged_and_said(folder) -> None:
    text = (folder / "control.csv").read_text(encoding="utf-8")
    swapped = text.replace("col1,row1,col2,row2", "col2,row2,col1,row1")
    (folder / "swapped.csv").write_text(swapped, encoding="utf-8")
    result = align(folder, "--control", "swapped.csv", *lens(), "--no-picture", out="s.pair.json")
    assert result.exit_code == 0, result.output
    assert "the picks were exchanged" in result.stderr
    assert Pair.read(folder / "s.pair.json").image1.distance == pytest.approx(16.0, rel=0.01)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "say how the pair is to be set up"),
        (["--distance1", "16"], "say how the pair is to be set up"),
        (["--auto"], "--auto needs one measure for the scale"),
        (["--auto", "--distance1", "16"], "focal lengths are unknown"),
        (["--control", "nowhere.csv"], "nowhere.csv"),
        (["--distance1", "16", "--distance2", "9", "--delta-d", "7"], "give two of"),
        (["--auto", "--lens", "absent.json", "--distance1", "16"], "absent.json"),
        (["--distance1", "16000", "--distance2", "9000"], "is it in mm?"),
        (["--auto", "--length", "10,10,90,10,4215"], "--length 4215 m is too far"),
        (
            ["--auto", "--length", "10,10,9000,10,4"],
            "--length ends at 9000,10, outside the far photo",
        ),
        (["--auto", *["--length", "1,1,9,1,4"] * 2, "--length", "1,1,9,1,0"], "--length"),
        (["--distance1", "16", "--distance2", "9", "--focal1", "35"], "Give --sensor-width"),
    ],
)
def test_wrong_options_are_explained(folder, options, message) -> None:
    result = align(folder, *options, out="wrong.pair.json")
    assert result.exit_code == 1
    assert message in result.stderr
    assert "Traceback" not in result.stderr


def length(start, end, metres: float) -> list[str]:
    """A length between two pixels, as an option."""
    return ["--length", ",".join(f"{value:.4f}" for value in (*start, *end, metres))]


#: Taped at 16 m and focal length f: 600 px level, 400 px upright, 500 px aslant.
def taped(*factors: float) -> list[str]:
    ends = [((100, 300), (700, 300)), ((100, 100), (100, 500)), ((200, 100), (500, 500))]
    metres = [np.hypot(*np.subtract(b, a)) * 16 / FAR.matrix[0, 0] for a, b in ends]
    parts = zip(ends, metres, factors, strict=False)
    return [word for (a, b), true, factor in parts for word in length(a, b, factor * true)]


@pytest.mark.parametrize(
    ("factors", "agree", "said"),
    [
        ((1, 1, 1), 3, "3 of 3 taped lengths agree, the largest difference is 0 mm."),
        ((1, 1.05, 1), 2, "CHECK THE LENGTHS: 1 of 3 that check disagree; length 2 was taped as"),
        ((0.98, 0.98, 0.98), 0, "CHECK THE SCALE: all 3 lengths that check disagree, and by one"),
    ],
)
def test_lengths_check_a_pair_that_has_its_scale(folder, factors, agree, said) -> None:
    site = ["--as-set-up", "--distance1", "16", "--distance2", "9", *lens(), "--overwrite"]
    result = align(folder, *site, *taped(*factors), "--no-picture", out="taped.pair.json")
    assert result.exit_code == 0, result.output
    assert result.stderr.startswith(said) if said[0] == "C" else said in result.stdout
    checks = Pair.read(folder / "taped.pair.json").extra["setup"]["length_checks"]
    assert sum(check["agrees"] for check in checks) == agree
    # Two ends of a pixel and the tape's 3 mm; scales on the wall as typed count as exact.
    sigma = np.hypot(np.sqrt(2) * 16 / FAR.matrix[0, 0], 0.003)
    assert checks[0]["sigma"] == pytest.approx(sigma, rel=0.01)


@pytest.mark.acceptance
@pytest.mark.parametrize("exchanged", [False, True])
def test_the_first_length_gives_the_scale_and_the_others_check(folder, exchanged) -> None:
    places = np.array([(-4.5, 2.9, 0), (4.6, 3.0, 0), (-0.9, -3.5, 0)])
    cam, names = (NEAR, ("near.png", "far.png")) if exchanged else (FAR, ("far.png", "near.png"))
    picks = project(cam, places)
    options = [
        word
        for a, b in ((0, 1), (0, 2), (1, 2))
        for word in length(picks[a], picks[b], float(np.linalg.norm(places[a] - places[b])))
    ]
    for camera_, number in ((FAR, 1), (NEAR, 2)):
        data = {"format": "bifocal-lens/1", "camera_matrix": camera_.matrix.tolist(),
                "model": "opencv", "coefficients": [0.0] * 4, "image_size": [960, 640]}  # fmt: skip
        (folder / f"l{number}.json").write_text(json.dumps(data), encoding="utf-8")
    lenses = [f"--lens{k}={folder / f'l{3 - k if exchanged else k}.json'}" for k in (1, 2)]
    result = align(
        folder, "--auto", *options, *lenses, "--no-picture", "--json",
        out=f"first{exchanged}.pair.json", photos=names,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    checks = json.loads(result.stdout)["lengths"]
    assert [check["name"] for check in checks] == ["2", "3"]
    for check in checks:
        assert check["agrees"]
        assert check["photo"] == (2 if exchanged else 1)
        assert check["measured"] == pytest.approx(check["taped"], abs=0.02)


@pytest.mark.acceptance
def test_photos_cropped_off_their_middle_are_named_and_set_up(folder) -> None:
    """Cut to 85 % towards opposite corners, which nothing in the files tells."""
    corners = {"far": (96, 144), "near": (0, 0)}
    for name, (row, column) in corners.items():
        part = cv2.imread(str(folder / f"{name}.png"))[row : row + 544, column : column + 816]
        cv2.imwrite(str(folder / f"{name}_part.png"), part)
    size = ["--focal1", FOCAL[0], "--focal2", FOCAL[1], "--pixel-size", str(SENSOR / 960)]
    result = align(
        folder, "--auto", "--distance1", "16", *size, "--no-picture", out="part.pair.json",
        photos=("far_part.png", "near_part.png"),
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert result.stderr.startswith("BOTH PHOTOS WERE CROPPED")
    pair = Pair.read(folder / "part.pair.json")
    assert pair.image2.distance == pytest.approx(9.0, rel=0.01)
    assert pair.remarks[0].startswith("BOTH PHOTOS WERE CROPPED")


@pytest.mark.parametrize(("column", "photo"), [(4, "far"), (6, "near")])
def test_a_pick_outside_its_photo_is_refused(folder, column, photo) -> None:
    lines = (folder / "control.csv").read_text(encoding="utf-8").splitlines()
    fields = lines[2].split(",")
    fields[column] = "1200.5"
    (folder / "out.csv").write_text("\n".join([*lines[:2], ",".join(fields), *lines[3:]]))
    result = align(folder, "--control", "out.csv", *lens(), out="outside.pair.json")
    assert result.exit_code == 1
    assert f'"b" lies outside the {photo} photo (960 x 640 px)' in result.stderr


def test_a_pair_file_ends_in_json(folder) -> None:
    result = align(folder, "--control", "control.csv", *lens(), out="wallb.txt")
    assert result.exit_code == 1
    assert "a pair file ends in .json; write --out wallb.pair.json" in result.stderr
    assert not (folder / "wallb.txt").exists()


def test_distortion_no_lens_has_is_refused() -> None:
    interior = Interior.from_focal(1500.0, image_size=(960, 640), sigma=0.02, source="test")
    check_distortion((0.1, 0.0), interior)
    # A compact camera moves its corners by 11 % of the half diagonal; that is no wrong sensor.
    compact = Interior.from_focal(900.0, image_size=(960, 640), sigma=0.04, source="test")
    check_distortion((-0.24, 0.29), compact)
    for k in (3.2, -3.2, -40.0):
        with pytest.raises(GeometryError, match="sensor width or the focal length is probably"):
            check_distortion((k, 0.0), interior)


def test_an_existing_pair_is_kept(folder) -> None:
    result = align(folder, "--auto", "--distance1", "16", *lens(), out="wall.pair.json")
    assert result.exit_code == 1
    assert "exists already" in result.stderr


def test_half_a_pixel_and_a_double_name_are_named_by_cell(folder) -> None:
    text = (folder / "control.csv").read_text(encoding="utf-8").splitlines()
    fields = text[1].split(",")
    text[1] = ",".join([*fields[:5], "", *fields[6:]])
    text[2] = "a" + text[2][1:]
    (folder / "bad.csv").write_text("\n".join(text), encoding="utf-8")
    result = align(folder, "--control", "bad.csv", out="bad.pair.json")
    assert result.exit_code == 1
    assert "is blank although its partner is given" in result.stderr
    assert "stands in A2 already" in result.stderr


def test_matched_points_solve_to_the_boards(folder) -> None:
    pair, out = str(folder / "wall.pair.json"), str(folder / "points.csv")
    result = CliRunner().invoke(main, ["match", pair, "--out", out, "--count", "200", "--json"])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["count"] > 100
    assert said["rests_on"].startswith("Sigmas rest on: matches of 0.")
    assert "the pair as given, with the covariance of its orientation" in said["rests_on"]
    solved = CliRunner().invoke(main, ["solve", out, "--pair", pair, "--json"])
    assert solved.exit_code == 0, solved.output
    points = json.loads(solved.stdout)["points"]
    xyz = np.array([[p["X"], p["Y"], p["r"]] for p in points], dtype=float)
    error = xyz[:, 2] - relief_at(xyz)
    assert np.median(np.abs(error)) < 0.012


@pytest.mark.parametrize(
    ("kind", "count", "said"),
    [
        ("disc", 18, "No target in "),
        ("feature", 18, "NOTHING FOUND in "),
        ("feature", 400, "FEWER THAN 3 POINTS in "),
    ],
)
def test_parts_without_points_are_named_for_what_they_are(folder, kind, count, said) -> None:
    rng, ones = np.random.default_rng(5), np.ones(count)
    xyz = np.column_stack([rng.uniform(-4.5, -0.5, count), rng.uniform(-3, 3, count), 0 * ones])
    found = Matches(
        pixels1=project(FAR, xyz), pixels2=project(NEAR, xyz), sigma=0.1 * ones, misfit=0.1 * ones,
        agreement=ones, ids=tuple(map(str, range(count))), kinds=(kind,) * count,
    )  # fmt: skip
    summary = match_summary(Pair.read(folder / "wall.pair.json"), found)
    words = list(match_command._lines(summary))[-1]
    assert words.startswith(f"{said}{len(summary['empty'])} of 24 parts")
    # No part with a target or, of few points, a point is called empty.
    held = [
        (part["columns"][0] <= found.pixels1[:, 0] + 0.5)
        & (found.pixels1[:, 0] + 0.5 <= part["columns"][1] + 1)
        & (part["rows"][0] <= found.pixels1[:, 1] + 0.5)
        & (found.pixels1[:, 1] + 0.5 <= part["rows"][1] + 1)
        for part in summary["empty"]
    ]
    assert held
    assert max(int(inside.sum()) for inside in held) < summary["fewest_in_part"]


@pytest.mark.acceptance
def test_a_survey_workbook_is_written_and_solved(folder) -> None:
    pair, out = str(folder / "wall.pair.json"), str(folder / "points.xlsx")
    result = CliRunner().invoke(main, ["match", pair, "--out", out, "--count", "60"])
    assert result.exit_code == 0, result.output
    assert "points" in result.stdout
    solved = CliRunner().invoke(main, ["solve", out, "--json"])
    assert solved.exit_code == 0, solved.output
    assert len(json.loads(solved.stdout)["points"]) >= 50


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--out", "points.txt"], "written as .xlsx"),
        (["--out", "points.csv", "--relief-min", "0.8", "--relief-max", "0.9"], "points match"),
    ],
)
def test_match_explains_what_it_cannot_do(folder, options, message, tmp_path) -> None:
    options = [str(tmp_path / o) if o.startswith("points") else o for o in options]
    result = CliRunner().invoke(main, ["match", str(folder / "wall.pair.json"), *options])
    assert result.exit_code == 1
    assert message in result.stderr


@pytest.mark.acceptance
@pytest.mark.long
def test_a_spot_on_a_board_makes_the_board_the_wall(folder) -> None:
    spot = project(FAR, np.array([[4.6, -1.0, 0.35]]))[0]
    result = align(
        folder, "--distance1", "15.65", "--distance2", "8.65", *lens(), "--no-picture",
        "--wall", f"{spot[0]:.0f},{spot[1]:.0f}", out="board.pair.json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    planes = Pair.read(folder / "board.pair.json").extra["setup"]["planes"]
    assert planes[0]["offset"] == pytest.approx(0.0, abs=0.01)
    assert min(abs(plane["offset"] + 0.35) for plane in planes) < 0.03


def test_photos_of_a_pixel_are_refused_in_words(tmp_path):
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(tmp_path / name), np.zeros((1, 1, 3), np.uint8))
    out = tmp_path / "w.pair.json"
    words = [str(tmp_path / "a.png"), str(tmp_path / "b.png"), "--auto", "--out", str(out)]
    done = CliRunner().invoke(main, ["align", *words])
    assert done.exit_code == 1
    assert done.stderr.startswith("Error: ")
    assert not out.exists()


def test_a_set_up_is_taken_exactly_as_typed(folder) -> None:
    site = ["--distance1", "16", "--distance2", "9", "--sigma-distance", "0.01"]
    result = align(folder, "--as-set-up", *site, *lens(), out="typed.pair.json")
    assert result.exit_code == 0, result.output
    assert "exactly as typed" in result.stdout
    pair = Pair.read(folder / "typed.pair.json")
    assert (pair.d1, pair.d2) == (16.0, 9.0)
    for photo, cam in ((pair.image1, FAR), (pair.image2, NEAR)):
        metres = photo.distance / cam.matrix[0, 0]
        wanted = [[metres, 0, -metres * 479.5], [0, -metres, metres * 319.5], [0, 0, 1]]
        np.testing.assert_allclose(photo.plane_from_pixel, wanted, rtol=1e-9, atol=1e-12)
        assert photo.nadir.tolist() == [0.0, 0.0]
    # By hand, of 1 m of relief: 9 / (16 * 7) * 10 mm (1 - 1/9) and 16 / (9 * 7) * 10 mm (1 - 1/16).
    added = pair.covariance_of_orientation(np.array([[2.0, 1.0, 1.0]]))[0, 2, 2]
    assert 1000 * np.sqrt(added) == pytest.approx(
        np.hypot(0.8036 * 8 / 9, 2.5397 * 15 / 16), rel=0.01
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--as-set-up", "--distance1", "16"], "give --distance1 and --distance2"),
        (["--as-set-up", "--distance1", "9", "--distance2", "16"], "the far photo comes first"),
        (["--as-set-up", "--auto", "--distance1", "16"], "leave out --control and --auto"),
        (["--auto"], "--auto needs one measure for the scale"),
    ],
)
def test_what_a_set_up_lacks_is_said_at_once(folder, options, said) -> None:
    result = align(folder, *options, out="none.pair.json")
    assert result.exit_code == 1
    assert said in " ".join(result.stderr.split())


@pytest.mark.acceptance
@pytest.mark.long
def test_a_control_table_without_headings_is_read_by_columns(folder) -> None:
    lines = (folder / "control.csv").read_text(encoding="utf-8").splitlines()
    (folder / "bare.csv").write_text("\n".join(lines[1:]), encoding="utf-8")
    result = align(folder, "--control", "bare.csv", out="bare.pair.json")
    assert result.exit_code == 1
    columns = "id,X,Y,r,col1,row1,col2,row2"
    given = ["--control", "bare.csv", "--columns", columns, *lens()]
    result = align(folder, *given, out="bare.pair.json")
    assert result.exit_code == 0, result.output
    assert Pair.read(folder / "bare.pair.json").d1 == pytest.approx(16.0, rel=0.005)


def test_an_option_beside_a_workbook_that_states_the_set_up_is_named(tmp_path) -> None:
    book = tmp_path / "book.xlsx"
    write_template(book, rows=2)
    line = ["align", str(book), "--out", str(tmp_path / "o.json")]
    for more, named in ((["--focal1", "35"], "--focal1"), (["--auto"], "--auto")):
        done = CliRunner().invoke(main, [*line, "--sigma-distance", "0.01", *more])
        assert done.exit_code == 2
        assert f"{named}: book.xlsx states the set-up" in done.stderr
    # What a workbook leaves room for is not complained of: the empty form is.
    done = CliRunner().invoke(main, [*line, "--sigma-distance", "0.01", "--as-set-up"])
    assert "states the set-up" not in done.stderr
    assert done.exit_code == 1
