"""Boards in underwater photos: found, numbered, adjusted to the truth they were rendered with."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from multimedia import (
    Camera,
    FlatInterface,
    InputError,
    Layers,
    Project,
    Sensor,
    Unknowns,
    bundle_adjust,
    project,
    read_project,
)
from multimedia.boards import workflow as boards_workflow
from multimedia.boards.board_points import PosedView, with_boards
from multimedia.orientation.plate_poses import plate_pose
from multimedia.projects.photos import read_photo
from photocore.camera.boards import detect_board
from photocore.camera.charuco import BoardView
from tests.builders.commands import multimedia_command as main
from tests.cases import few_by_default
from tests.multimedia.rendered_boards import Housing, chessboard, dots, drawn, photo, poses

EYE = Housing(width=480, height=360, pitch=0.008, c=2.8, k1=-4e-3)
SQUARE = 24.0


def housing(eye: Housing = EYE, c: float = 2.9, index: float = 1.335, at: float = -44.0) -> str:
    """Return a project file whose values are roughly known, and no pose."""
    return (
        f'format = "multimedia-project/1"\nunit = "mm"\nsigma_image = 0.0004\n[media.port]\n'
        f"indices = [1.0, 1.5, {index}]\nthicknesses = [8.0]\npoint = [0.0, 0.0, {at}]\n"
        'normal = [0.0, 0.0, 1.0]\nmoves_with_camera = true\n[[camera]]\nname = "cam1"\n'
        f'media = "port"\nc = {c}\n'
        f"[camera.sensor]\nwidth = {eye.width}\nheight = {eye.height}\npitch = {eye.pitch}\n"
    )


def charuco(columns: int, rows: int) -> np.ndarray:
    """Return a ChArUco board, 96 px a square, 0 to 1."""
    board = cv2.aruco.CharucoBoard(
        (columns, rows), 1.0, 0.7, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    )
    return board.generateImage((96 * columns, 96 * rows)) / 255.0


BOARDS = {
    "chessboard": ("8x5", chessboard(8, 5, SQUARE), (7 * SQUARE, 4 * SQUARE)),
    "circles": ("8x5", dots(8, 5, SQUARE, 5.0), (7 * SQUARE, 4 * SQUARE)),
    "charuco": ("8x6", drawn(charuco(8, 6), SQUARE / 96), (8 * SQUARE, 6 * SQUARE)),
}


def render(folder: Path, pattern: str, count: int, **greys: float) -> None:
    """Write photos of a board."""
    _, grey, extent = BOARDS[pattern]
    for k, (turn, shift) in enumerate(poses(count, extent, near=260.0, far=560.0)):
        image = photo(EYE, grey, turn, shift, seed=k, **greys)
        cv2.imwrite(str(folder / f"b{k:02d}.png"), image)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "pattern",
    [pytest.param(p, marks=() if p == "charuco" else pytest.mark.long) for p in BOARDS],
)
def test_port_index_and_lens_come_back_within_their_sigmas(pattern, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    render(tmp_path, pattern, 12)
    Path("housing.toml").write_text(housing())
    photos = [path.name for path in sorted(tmp_path.glob("b*.png"))]
    words = ["boards", "housing.toml", *photos, "--pattern", pattern, "--board"]
    words += [BOARDS[pattern][0], "--square", str(SQUARE), "--out", "boards.toml", "--json"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["found"] >= 9
    words = ["adjust", "boards.toml", "--plate", "all", "--fix-camera", "cam1", "--interior"]
    words += ["c,xh,yh,k1", "--media", "offset,tilt1,tilt2,index3", "--out", "found.toml", "--json"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["sigma0_mm"] < 0.1 * EYE.pitch
    truth = {
        "cam1:c": EYE.c, "cam1:xh": EYE.centre[0], "cam1:yh": EYE.centre[1], "cam1:k1": EYE.k1,
        "index3": EYE.indices[2],
    }  # fmt: skip
    unknowns = said["unknowns"]
    pulls = {n: (unknowns[n]["value"] - v) / unknowns[n]["sigma"] for n, v in truth.items()}
    port = read_project("found.toml").media["port"]
    # Distance of the outer face along its normal; y and z of the rendering point the other way.
    normal = np.array([EYE.tilt[0], -EYE.tilt[1], -1.0])
    normal /= np.linalg.norm(normal)
    reached = float(port.point @ port.normal) * -1
    pulls["distance"] = (reached - EYE.distance - EYE.thickness) / unknowns["port:offset"]["sigma"]
    tilt = np.linalg.norm(np.cross(port.normal, normal))
    sigma = np.hypot(*(unknowns[f"port:tilt{k}"]["sigma"] for k in (1, 2)))
    pulls["tilt"] = tilt / sigma
    assert max(map(abs, pulls.values())) < 4.0, pulls
    assert unknowns["cam1:c"]["sigma"] < 0.02 * EYE.c


def test_photos_become_plates_and_those_without_a_board_are_named(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    render(tmp_path, "chessboard", 4, dark=100.0, bright=140.0, noise=1.0)  # turbid water
    Path("housing.toml").write_text(housing())
    cv2.imwrite("grey.png", np.full((360, 480), 90, np.uint8))
    cv2.imwrite("small.png", np.full((180, 240), 90, np.uint8))
    words = ["boards", "housing.toml", "--board", "8x5", "--square", "24", "--out", "out.toml"]
    result = CliRunner().invoke(main, [*words, *(f"b{k:02d}.png" for k in range(4)), "grey.png"])
    assert result.exit_code == 0, result.output
    assert "Left out: grey.png: is of one grey (90 of 255)" in result.stderr
    assert "adjust out.toml --plate all --fix-camera cam1" in result.stdout
    made = read_project("out.toml", posed=False)
    assert set(made.object_points.groups) == {f"b{k:02d}" for k in range(4)}
    assert len(made.image_points.ids) == 4 * 40
    place = dict(zip(made.object_points.ids, made.object_points.xyz.tolist(), strict=True))
    assert place["b01 7-4"] == [168.0, 96.0, 0.0]
    # Wrong size, wrong board, nothing: each with its reason, and nothing is written.
    words = ["boards", "housing.toml", "--square", "24", "--out", "none.toml"]
    words += ["--board", "9x6", "b00.png", "small.png", "grey.png"]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 1
    assert "camera cam1: the board was found in 0 photo(s), at least 3 are needed" in result.stderr
    assert "b00.png: shows 8x5 inner corners, not 9x6" in result.stderr
    assert "small.png: is 240 x 180 px, the sensor of camera cam1 480 x 360 px" in result.stderr
    assert not Path("none.toml").exists()


@pytest.mark.acceptance
@pytest.mark.parametrize("pattern", ["circles", "charuco"])
def test_points_are_found_where_rays_say(pattern: str) -> None:
    size, grey, extent = BOARDS[pattern]
    turn, shift = next(iter(poses(1, extent, near=300.0, far=300.0, seed=8)))
    image = photo(EYE, grey, turn * 0.5, np.add(shift, (10, 10, 0)))
    columns, rows = map(int, size.split("x"))
    view = detect_board(image, "x", pattern=pattern, size=(columns, rows))
    assert view is not None
    assert len(view.pixels) == 40 if pattern == "circles" else len(view.pixels) >= 28
    rotation, _ = cv2.Rodrigues(turn * 0.5)
    points = (view.board * SQUARE) @ rotation.T + np.add(shift, (10, 10, 0))
    if pattern == "circles" and np.linalg.norm(view.pixels[0] - view.pixels[-1]) > 0:
        first = np.array([columns - 1, rows - 1, 0]) - view.board  # numbered from either end
        other = (first * SQUARE) @ rotation.T + np.add(shift, (10, 10, 0))
        points = min(points, other, key=lambda p: np.abs(_image(p) - view.pixels).max())
    assert np.abs(_image(points) - view.pixels).max() < 0.4


def test_photos_of_more_than_eight_bits_keep_their_greys(tmp_path) -> None:
    grey = np.tile(np.arange(0, 250, 5, dtype=np.uint8), (40, 1))
    for bits in (10, 12, 16):
        whole = np.round(grey * ((2**bits - 1) / 255)).astype(np.uint16)
        whole[0, 0] = 2**bits - 1
        for ending in ("png", "tif"):
            cv2.imwrite(str(tmp_path / f"{bits}.{ending}"), whole)
            read = read_photo(tmp_path / f"{bits}.{ending}")[1:]
            assert np.abs(read.astype(int) - grey[1:]).max() <= 1
    Image.new("1", (14_000, 13_000)).save(tmp_path / "bomb.png")
    with pytest.raises(InputError, match=r"bomb\.png: has more pixels than any camera"):
        read_photo(tmp_path / "bomb.png")


def _image(points: np.ndarray) -> np.ndarray:
    """Return pixels of points in the rendering's frame, by the nearest rendered ray."""
    from scipy.interpolate import griddata

    from tests.multimedia.rendered_boards import rays_in_water

    origins, rays = rays_in_water(EYE)
    found = []
    for point in points:
        t = ((point - origins) * rays).sum(-1)
        miss = np.linalg.norm(origins + t[..., None] * rays - point, axis=-1)
        r, c = np.unravel_index(int(miss.argmin()), miss.shape)
        near = np.s_[r - 1 : r + 2, c - 1 : c + 2]
        reach = (point[2] - origins[near][..., 2]) / rays[near][..., 2]
        xy = (origins[near] + reach[..., None] * rays[near])[..., :2].reshape(-1, 2)
        row, column = np.mgrid[r - 1 : r + 2, c - 1 : c + 2]
        cells = np.column_stack([column.ravel(), row.ravel()]).astype(float)
        found.append(griddata(xy, cells, point[None, :2], "linear")[0])
    return np.array(found)


@pytest.mark.parametrize("size", [(6, 4), (5, 5)], ids=str)
@pytest.mark.parametrize("legacy", [False, True], ids=["new", "legacy"])
@pytest.mark.parametrize(
    ("dictionary", "side"),
    few_by_default([("7X7_50", 0.6), ("APRILTAG_36h11", 0.75), ("4X4_100", 0.5)], ("7X7_50", 0.6)),
)
def test_charuco_of_any_dictionary_and_layout_has_its_corners_in_place(
    dictionary, side, legacy, size
) -> None:
    family = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{dictionary}"))
    board = cv2.aruco.CharucoBoard(size, 1.0, side, family)
    board.setLegacyPattern(legacy)
    drawing = board.generateImage((60 * size[0], 60 * size[1]))
    image = cv2.copyMakeBorder(drawing, 30, 30, 30, 30, cv2.BORDER_CONSTANT, value=255)
    view = detect_board(image, "x", pattern="charuco", size=size)
    assert view is not None
    assert len(view.board) == (size[0] - 1) * (size[1] - 1)
    assert np.abs(view.pixels - (60.0 * view.board[:, :2] + 29.5)).max() < 0.3
    even = size[1] % 2 == 0
    assert view.layout.endswith("legacy layout") == (legacy and even)
    assert view.layout.startswith(dictionary.split("_")[0])


def test_markers_that_lie_otherwise_than_on_the_board_are_named(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("housing.toml").write_text(housing())
    for k in range(3):
        cv2.imwrite(f"b{k}.png", cv2.resize(np.round(255 * charuco(6, 4)), (480, 360)))
    words = ["--pattern", "charuco", "--square", "24", "--out", "out.toml", "--board"]
    result = CliRunner().invoke(main, ["boards", "housing.toml", "b0.png", *words, "7x4"])
    assert result.exit_code == 1
    assert "b0.png: shows 12 markers of 4X4_250, 0 to 11, but not as they lie" in result.stderr
    three, known = ["b0.png", "b1.png", "b2.png"], []
    monkeypatch.setattr(
        boards_workflow, "with_boards",
        lambda *given, numbered, **more: [
            known.append(numbered), with_boards(*given, numbered=numbered, **more)
        ][1],
    )  # fmt: skip
    result = CliRunner().invoke(main, ["boards", "housing.toml", *three, *words, "6x4"])
    assert "3 photos show ChArUco 4X4_250" in result.output
    assert known == [True]  # each of its points tells which it is


SENSOR = Sensor(width=1280, height=1024, pixel_size=np.array([0.006, 0.006]))
PORT = FlatInterface(
    layers=Layers(indices=(1.0, 1.5, 1.337), thicknesses=(8.0,)), point=(0.0, 0.0, -46.0),
    normal=(0.0, 0.0, 1.0), moves_with_camera=True,
)  # fmt: skip
GRID = np.mgrid[0:9, 0:6].T.reshape(-1, 2)
BOARD = np.column_stack([GRID, np.zeros(len(GRID))]).astype(float)


def rig(still: bool = False) -> Project:
    """Return two cameras side by side, each behind its port, or before a common pane."""
    pane = FlatInterface(layers=PORT.layers, point=(0.0, 0.0, -60.0), normal=(0.0, 0.0, 1.0))
    views = tuple(
        Camera.from_angles(
            (x, 0, 0), 0.0, tilt, 0.0, principal_distance=5.0, sensor=SENSOR, name=name
        )
        for name, x, tilt in (("left", -120.0, -0.15), ("right", 120.0, 0.15))
    )
    media = {"glass": pane if still else PORT}
    return Project(cameras=views, media=media, media_of=("glass", "glass"), unit="mm")


def placed(count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return poses of a board before the rig."""
    rng = np.random.default_rng(4)
    return [
        (cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))[0],
         rng.uniform((-180, -120, -800), (-60, -20, -500)))
        for _ in range(count)
    ]  # fmt: skip


@pytest.mark.parametrize("still", [False, True], ids=["ports", "pane"])
def test_a_plate_is_placed_by_one_camera(still: bool) -> None:
    given = rig(still)
    for turn, shift in placed(3):
        image = project(given.cameras[0], (BOARD * 30.0) @ turn.T + shift, given.interfaces[0])
        rotation, place = plate_pose(given.cameras[0], BOARD * 30.0, image, given.interfaces[0])
        assert np.abs(rotation - turn).max() < 1e-7
        assert np.abs(place - shift).max() < 1e-4


def seen_by(
    given: Project, numbers: dict[str, np.ndarray], board: np.ndarray = BOARD
) -> list[PosedView]:
    """Return exact views of three poses; the board of each camera as it numbers it."""
    views = []
    for pose, (turn, shift) in enumerate(placed(3)):
        for k, camera in enumerate(given.cameras):
            image = project(camera, (board * 30.0) @ turn.T + shift, given.interfaces[k])
            pixels = SENSOR.pixel_from_image(image)
            view = BoardView(
                name=f"{camera.name}_{pose}", board=numbers[camera.name], pixels=pixels
            )
            views.append(PosedView(camera.name, str(pose), view))
    return views


@pytest.mark.acceptance
def test_boards_of_two_cameras_get_one_numbering_and_adjust() -> None:
    given = rig()
    turned = BOARD.max(axis=0) - BOARD
    views = seen_by(given, {"left": BOARD, "right": turned})
    made = with_boards(given, views, square=30.0, numbered=False)
    assert len(made.object_points.ids) == 3 * 54
    moved = replace(made.cameras[1], centre=np.add(made.cameras[1].centre, (5.0, -4.0, 3.0)))
    moved = replace(moved, principal_distance=5.05)
    start = replace(made, cameras=(replace(made.cameras[0], principal_distance=5.05), moved))
    result = bundle_adjust(
        start,
        Unknowns(
            plates=("0", "1", "2"), fixed_cameras=("left",), interior=("c",), shared_interior=True
        ),
    )
    assert result.value("interior:c") == pytest.approx(5.0, abs=1e-6)
    assert result.value("right:X0") == pytest.approx(120.0, abs=1e-3)
    alone = [each for each in views if each.camera == "left"]
    one = with_boards(
        replace(given, cameras=given.cameras[:1], media_of=("glass",)), alone, square=30.0,
        numbered=False,
    )  # fmt: skip
    result = bundle_adjust(one, Unknowns(plates=("0", "1", "2"), fixed_cameras=("left",)))
    assert result.sigma0 < 1e-9


def test_square_boards_turned_by_quarters_get_one_numbering() -> None:
    grid = np.mgrid[0:7, 0:7].T.reshape(-1, 2)
    board = np.column_stack([grid, 0 * grid[:, 0]]) * 1.0
    quarter = np.column_stack([6.0 - board[:, 1], board[:, 0], board[:, 2]])
    given = rig()
    for right in (quarter, 6.0 * np.array([1, 1, 0]) - quarter):
        views = seen_by(given, {"left": board, "right": right}, board)[:2]
        made = with_boards(given, views, square=30.0, numbered=False)
        seen, _ = made.image_points.grid(("left", "right"), made.object_points.ids)
        apart = seen[0] - seen[1]
        assert np.ptp(apart[:, 0]) < 0.5 * np.ptp(seen[0, :, 0])
        assert np.ptp(apart[:, 1]) < 0.5 * np.ptp(seen[0, :, 1])


@pytest.mark.parametrize("rows", few_by_default([5, 8], 8))
def test_asymmetric_grids_of_two_cameras_get_one_numbering(rows: int) -> None:
    grid = np.mgrid[0:4, 0:rows].T.reshape(-1, 2)
    board = np.column_stack([2 * grid[:, 0] + grid[:, 1] % 2, grid[:, 1], 0 * grid[:, 0]]) * 1.0
    # Turned by half a turn it is the same grid only if its number of rows is even.
    right = board if rows % 2 else board.max(axis=0) - board
    given = rig()
    views = seen_by(given, {"left": board, "right": right}, board)[:2]
    made = with_boards(given, views, square=30.0, numbered=False)
    assert len(made.object_points.ids) == 4 * rows
    seen, _ = made.image_points.grid(("left", "right"), made.object_points.ids)
    apart = seen[0] - seen[1]
    # One numbering: disparities of neighbours are alike, those of two numberings cross over.
    assert np.ptp(apart[:, 0]) < 0.5 * np.ptp(seen[0, :, 0])
    with pytest.raises(InputError, match=r"board in 0 already; give the project without"):
        with_boards(made, views, square=30.0, numbered=False)


def test_photos_of_several_cameras_are_told_apart_by_name(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = housing()
    second = text[text.index("[[camera]]") :].replace("cam1", "cam10")
    Path("rig.toml").write_text(text + second)
    words = ["boards", "rig.toml", "--board", "8x5", "--square", "24", "--out", "o.toml"]
    for name in ("dive_01.png", "cam1_7.png", "cam10_7.png", "cam1-7.png"):
        cv2.imwrite(name, np.full((360, 480), 90, np.uint8))
    result = CliRunner().invoke(main, [*words, "dive_01.png"])
    assert "dive_01.png: which camera took it? Begin its name with that of the c" in result.stderr
    result = CliRunner().invoke(main, [*words, "cam1_7.png", "cam1-7.png"])
    assert "are both of camera cam1, pose 7" in result.stderr
    result = CliRunner().invoke(main, [*words, "cam1_7.png", "cam10_7.png"])
    assert result.exit_code == 1
    assert "camera cam1: the board was found in 0" in result.stderr


def test_a_plate_behind_a_pane_is_placed_from_any_height_over_it() -> None:
    camera = replace(rig().cameras[0], centre=np.array([-120.0, 35.0, 48.0]))
    pane = FlatInterface(layers=PORT.layers, point=(10.0, 20.0, -60.0), normal=(0.1, -0.05, 1.0))
    for turn, shift in placed(3):
        image = project(camera, (BOARD * 30.0) @ turn.T + shift, pane)
        rotation, place = plate_pose(camera, BOARD * 30.0, image, pane)
        assert np.abs(rotation - turn).max() < 1e-7
        assert np.abs(place - shift).max() < 1e-4
