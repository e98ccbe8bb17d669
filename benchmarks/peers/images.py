"""Relief, orthophotos, undistortion and calibration, beside OpenCV and orthority."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import rasterio

from benchmarks.peers.comparison import Comparison, Task, Tool
from bifocal import Pair, Photo, calibrate, dense_relief
from bifocal.calibration.workflow import undistorted
from bifocal.model.geotiff import create_raster
from bifocal.model.grid import Grid
from bifocal.model.lens import Lens
from photocore.images import read_image, write_image
from tests.scenes import bifocal_cameras, facade, render

D1, D2 = 17.5, 9.5
#: What a wrong relief is, for the tail that is told. [m]
WRONG = 0.03


def width_of(pixels: int) -> int:
    """Return the width of a photo of 3 : 2."""
    return round((pixels * 1.5) ** 0.5 / 6) * 6


# ---- relief


def prepare_pair(pixels: int, folder: Path) -> None:
    width = width_of(pixels)
    pixel = 0.00369 * 3072 / width
    cameras = bifocal_cameras(size=(width, width * 2 // 3), pixel=pixel)
    rng = np.random.default_rng(61)
    shot = render(facade(seed=61, texel=pixel / 1.5), cameras, rng=rng)
    np.savez(
        folder / "pair.npz", image1=shot.image1, image2=shot.image2, r=shot.truth.r,
        both=shot.visible1 & shot.visible2,
    )  # fmt: skip
    shot.pair.write(folder / "wall.pair.json")


class Shot:
    """A rendered pair, the same in all tools, and where its true points are seen."""

    def __init__(self, folder: Path) -> None:
        with np.load(folder / "pair.npz") as data:
            self.image1, self.image2 = data["image1"], data["image2"]
            self.truth, self.both = data["r"], data["both"]
        self.pair = Pair.read(folder / "wall.pair.json")
        height, width = self.truth.shape
        self.middle = np.array([(width - 1) / 2, (height - 1) / 2])
        rows, columns = np.nonzero(self.both & np.isfinite(self.truth))
        self.r = self.truth[rows, columns].astype(float)
        self.away = np.stack([columns, rows], axis=-1) - self.middle

    def seen(self, distance: float) -> np.ndarray:
        """Return the pixels of all true points in the photo from a distance."""
        return self.middle + self.away * (distance / (distance - self.r))[:, None]

    def wrong(self, found: np.ndarray) -> float:
        """Return which share of the true points is wrong by 3 cm or more, or missing. [%]"""
        return float(100 * np.mean(~(np.abs(found - self.r) < WRONG)))


def _relief(_pixels: int, folder: Path, quality: str) -> Task:
    shot = Shot(folder)
    at = (shot.away + shot.middle).astype(int)
    return Task(
        lambda: dense_relief(shot.pair, shot.image1, shot.image2, quality=quality),
        lambda found: shot.wrong(found.r[at[:, 1], at[:, 0]]),
    )


def _relief_of(ratio: np.ndarray) -> np.ndarray:
    """Return relief from s2 / s1: Midulla Eqs. (1) to (3) solved for r."""
    with np.errstate(all="ignore"):
        return np.asarray(D1 * D2 * (ratio - 1) / (ratio * D1 - D2))


def _sampled(image: np.ndarray, places: np.ndarray) -> np.ndarray:
    at = np.round(places).astype(int)
    inside = (at >= 0).all(axis=1) & (at < image.shape[::-1]).all(axis=1)
    return np.where(inside, image[tuple(np.where(inside[:, None], at, 0).T[::-1])], np.nan)


def _flow(_pixels: int, folder: Path) -> Task:
    shot = Shot(folder)

    def work() -> np.ndarray:
        flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        flow.setFinestScale(0)
        grey = [cv2.cvtColor(one, cv2.COLOR_RGB2GRAY) for one in (shot.image1, shot.image2)]
        moved = flow.calc(*grey, None)
        rows, columns = np.indices(shot.truth.shape, dtype=np.float32)
        x, y = columns - shot.middle[0], rows - shot.middle[1]
        s1 = np.maximum(np.hypot(x, y), 1e-3)
        return _relief_of(1 + (moved[..., 0] * x + moved[..., 1] * y) / s1**2)

    return Task(work, lambda found: shot.wrong(_sampled(found, shot.seen(D1))))


def _semi_global(_pixels: int, folder: Path) -> Task:
    """Run SGBM where radial lines are rows: both photos about the common nadir, in polar form."""
    shot = Shot(folder)
    height, width = shot.truth.shape
    reach = float(np.hypot(width, height) / 2)
    size = (int(reach), int(2 * np.pi * reach / 2))

    def polar(image: np.ndarray) -> np.ndarray:
        middle = tuple(shot.middle.tolist())
        return cv2.warpPolar(image, size, middle, reach, cv2.INTER_CUBIC | cv2.WARP_POLAR_LINEAR)

    def work() -> np.ndarray:
        far, near = polar(shot.image1), polar(shot.image2)
        least, count = -16 * (width // 768), 16 * (width // 192)
        matcher = cv2.StereoSGBM.create(
            minDisparity=least, numDisparities=count, blockSize=5, P1=8 * 3 * 25, P2=32 * 3 * 25,
            disp12MaxDiff=2, uniquenessRatio=5, speckleWindowSize=100, speckleRange=2,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        )  # fmt: skip
        shift = matcher.compute(near, far) / 16.0
        shift[shift < least] = np.nan
        s2 = np.arange(size[0])
        return _relief_of(s2 / np.maximum(s2 - shift, 1e-3))

    def error(found: np.ndarray) -> float:
        away = shot.seen(D2) - shot.middle
        angle = np.arctan2(away[:, 1], away[:, 0]) % (2 * np.pi) / (2 * np.pi) * size[1]
        return shot.wrong(_sampled(found, np.stack([np.hypot(*away.T), angle], axis=-1)))

    return Task(work, error)


# ---- orthophoto


def _gsd(pixels: int) -> float:
    return 0.00197 * 6000 / width_of(pixels)


def _wall_grid(pixels: int) -> Grid:
    width, gsd = width_of(pixels), _gsd(pixels)
    height = width * 2 // 3
    return Grid(
        x0=-gsd * (width - 1) / 2, y0=gsd * (height - 1) / 2, gsd=gsd, width=width, height=height
    )


def relief_at(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Pilasters, windows, and a cornice that ramps out to 0.8 m."""
    r = np.zeros(np.broadcast(x, y).shape, np.float32)
    r[np.abs((x + 0.98) % 1.96 - 0.98) < 0.2] = 0.3
    r[(np.abs(x % 1.96 - 0.98) < 0.4) & (np.abs(y % 2.6 - 1.3) < 0.7)] = -0.4
    return np.where(y > 3.2, np.minimum((y - 3.2) * 1.2, 0.8).astype(np.float32), r)


def relief_of(grid: Grid) -> np.ndarray:
    return relief_at(*np.meshgrid(grid.columns_x, grid.rows_y))


def prepare_wall(pixels: int, folder: Path) -> None:
    grid, gsd = _wall_grid(pixels), _gsd(pixels)
    size = (grid.width, grid.height)
    rng = np.random.default_rng(1)
    rough = rng.integers(0, 255, (grid.height // 4, grid.width // 4, 3), dtype=np.uint8)
    photo = cv2.GaussianBlur(cv2.resize(rough, size), (0, 0), 2)
    write_image(folder / "far.tif", cv2.add(photo, rng.integers(0, 4, photo.shape, dtype=np.uint8)))
    matrix = [[gsd, 0, grid.x0], [0, -gsd, grid.y0], [0, 0, 1]]
    photos = [
        Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=d, file="far.tif") for d in (D1, D2)
    ]
    Pair(image1=photos[0], image2=photos[1]).write(folder / "wall.pair.json")
    with create_raster(folder / "relief.tif", grid, bands=1, dtype=np.float32) as writer:
        writer.write(relief_of(grid))
    _write_orthority_inputs(folder, grid)


def _write_orthority_inputs(folder: Path, grid: Grid) -> None:
    """Declare the wall a map in a projected system, on which orthority insists."""
    gsd, pitch = grid.gsd, 0.001
    (folder / "int.yaml").write_text(
        f"cam:\n  type: pinhole\n  im_size: [{grid.width}, {grid.height}]\n"
        f"  focal_len: {D1 / gsd * pitch}\n"
        f"  sensor_size: [{grid.width * pitch}, {grid.height * pitch}]\n"
    )
    (folder / "ext.csv").write_text(
        "filename,x,y,z,omega,phi,kappa\nfar.tif,500000,5000000,17.5,0,0,0\n"
    )
    with rasterio.open(folder / "relief.tif") as file:
        profile, values = file.profile, file.read()
    west, north = 500000 - grid.width * gsd / 2, 5000000 + grid.height * gsd / 2
    profile |= {"crs": "EPSG:32632", "transform": rasterio.Affine(gsd, 0, west, 0, -gsd, north)}
    with rasterio.open(folder / "dem.tif", "w", **profile) as file:
        file.write(values)


def _ortho_error(pixels: int, folder: Path, name: str) -> float:
    """Return the RMS difference in grey levels at places taken one by one, off steps of relief."""
    grid, step = _wall_grid(pixels), 3 * _gsd(pixels)
    with rasterio.open(folder / name) as file:
        found, to_plane = file.read([1, 2, 3]).transpose(1, 2, 0), file.transform
    origin = np.array([500000, 5000000]) if to_plane.c > 1000 else np.zeros(2)
    rng = np.random.default_rng(2)
    rows = rng.integers(20, found.shape[0] - 20, 20_000)
    columns = rng.integers(20, found.shape[1] - 20, 20_000)
    x = to_plane.c + to_plane.a * (columns + 0.5) - origin[0]
    y = to_plane.f + to_plane.e * (rows + 0.5) - origin[1]
    r = relief_at(x, y)
    around = [relief_at(x + i * step, y + j * step) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    level = np.ptp(around, axis=0) < 0.03
    u = (x * D1 / (D1 - r) - grid.x0) / grid.gsd
    v = (grid.y0 - y * D1 / (D1 - r)) / grid.gsd
    photo = read_image(folder / "far.tif")
    seen = cv2.remap(
        photo, u[:, None].astype(np.float32), v[:, None].astype(np.float32), cv2.INTER_CUBIC
    )[:, 0]
    inside = (u > 4) & (v > 4) & (u < grid.width - 5) & (v < grid.height - 5)
    # What is black is masked as hidden.
    shown = inside & level & (found[rows, columns] > 0).any(axis=1)
    away = found[rows, columns].astype(float) - seen
    return float(np.sqrt((away[shown] ** 2).mean()))


def _ortho(pixels: int, folder: Path, *extra: str) -> Task:
    command = [sys.executable, "-m", "bifocal", "-q", "ortho", "wall.pair.json", "--out"]
    command += ["ortho.tif", "--relief", "relief.tif", "--overwrite", "--no-overviews", *extra]
    work = functools.partial(subprocess.run, command, cwd=folder, check=True)
    return Task(work, lambda _: _ortho_error(pixels, folder, "ortho.tif"))


def _orthority(pixels: int, folder: Path) -> Task:
    oty = Path(sys.executable).with_name("oty")
    command = [str(oty), "-q", "frame", "-ip", "int.yaml", "-ep", "ext.csv", "-d", "dem.tif"]
    command += ["-r", str(_gsd(pixels)), "-i", "cubic", "-nbo", "-cm", "deflate", "-o"]
    command += ["-c", "EPSG:32632", "far.tif"]
    work = functools.partial(
        subprocess.run, command, cwd=folder, check=True, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    return Task(work, lambda _: _ortho_error(pixels, folder, "far_ORTHO.tif"))


def _ortho_by_hand(pixels: int, folder: Path) -> Task:
    """Read, compute the maps whole, remap, write: what a script of thirty lines does."""
    grid = _wall_grid(pixels)

    def work() -> None:
        photo = cv2.imread(str(folder / "far.tif"))
        with rasterio.open(folder / "relief.tif") as file:
            r, transform = file.read(1), file.transform
        x, y = np.meshgrid(grid.columns_x.astype(np.float32), grid.rows_y.astype(np.float32))
        factor = np.float32(D1) / (np.float32(D1) - r)
        u = (x * factor - np.float32(grid.x0)) / np.float32(grid.gsd)
        v = (np.float32(grid.y0) - y * factor) / np.float32(grid.gsd)
        flat = cv2.remap(photo, u, v, cv2.INTER_CUBIC)[:, :, ::-1]
        with rasterio.open(
            folder / "hand.tif", "w", driver="GTiff", width=grid.width, height=grid.height, count=3,
            dtype="uint8", compress="deflate", tiled=True, transform=transform,
        ) as file:  # fmt: skip
            file.write(flat.transpose(2, 0, 1))

    return Task(work, lambda _: _ortho_error(pixels, folder, "hand.tif"))


# ---- lenses

#: k1, k2, p1, p2.
COEFFICIENTS = np.array([-0.12, 0.03, 2e-4, -1e-4])


def _camera(pixels: int) -> tuple[np.ndarray, tuple[int, int]]:
    width = width_of(pixels)
    height = width * 2 // 3
    focal = width * 28 / 36
    return np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]]), (
        width,
        height,
    )


def _pattern(places: np.ndarray, width: int) -> np.ndarray:
    """Return grey values that vary smoothly with the place."""
    u, v = (places / width * 6000).reshape(-1, 2).T
    return np.asarray(127 + 60 * np.sin(u / 17) + 60 * np.sin(v / 23))


def _undistortion(pixels: int, _folder: Path, *, ours: bool) -> Task:
    matrix, (width, height) = _camera(pixels)
    coefficients = COEFFICIENTS
    photo = np.empty((height, width), np.uint8)
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 40, 1e-10)
    for top in range(0, height, 200):
        rows = np.arange(top, min(top + 200, height))
        seen = np.stack(np.meshgrid(np.arange(width), rows), axis=-1).reshape(-1, 1, 2)
        ideal = cv2.undistortPointsIter(
            seen.astype(float), matrix, coefficients, None, matrix, stop
        )
        photo[rows] = np.round(_pattern(ideal, width)).reshape(len(rows), width)
    photo = np.ascontiguousarray(np.repeat(photo[..., None], 3, axis=2))
    lens = Lens(camera_matrix=matrix, coefficients=coefficients, image_size=(width, height))

    def error(found: np.ndarray) -> float:
        rng = np.random.default_rng(5)
        places = rng.integers(20, (width - 20, height - 20), (50_000, 2))
        value = found[places[:, 1], places[:, 0], 0].astype(float)
        away = value - _pattern(places, width)
        return float(np.sqrt((away[value > 0] ** 2).mean()))

    if ours:
        return Task(functools.partial(undistorted, photo, lens), error)
    return Task(functools.partial(cv2.undistort, photo, matrix, coefficients), error)


def _boards() -> list[Path]:
    folder = Path(os.environ.get("BIFOCAL_DATA", "")) / "calibration_left"
    return sorted(folder.glob("left*.jpg"))


def _calibration(_count: int, _folder: Path, *, ours: bool) -> Task:
    photos = [cv2.imread(str(path)) for path in _boards()]
    if ours:
        return Task(
            lambda: calibrate(photos, board=(9, 6)),
            lambda found: np.sqrt(np.mean(np.square(list(found.photo_rms.values())))),
        )

    def work() -> float:
        board = np.zeros((54, 3), np.float32)
        board[:, :2] = np.mgrid[0:9, 0:6].T.reshape(-1, 2)
        stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 30, 1e-3)
        corners = []
        for photo in photos:
            grey = cv2.cvtColor(photo, cv2.COLOR_BGR2GRAY)
            is_there, found = cv2.findChessboardCorners(grey, (9, 6))
            if is_there:
                corners.append(cv2.cornerSubPix(grey, found, (11, 11), (-1, -1), stop))
        size = photos[0].shape[1::-1]
        return float(cv2.calibrateCamera([board] * len(corners), corners, size, None, None)[0])

    return Task(work, float)


MEGA = 1_000_000
OURS = "bifocal-relief"
CV2 = "opencv-python-headless"
COMPARISONS = {
    "relief": Comparison(
        title="Dense relief of a pair",
        data="A rendered façade (seed 61), 35/19, ideal set-up, exact relief known. "
        "OpenCV's flow and disparity are turned into relief by the paper's "
        "equations.",
        item="pixel", error="wrong by 3 cm or missing, of what both photos see [%]",
        sizes=(1_500_000, 6 * MEGA),
        tools={
            "bifocal, standard": Tool(functools.partial(_relief, quality="standard"), OURS),
            "bifocal, fast": Tool(functools.partial(_relief, quality="fast"), OURS),
            "OpenCV DIS, medium, full resolution": Tool(_flow, CV2),
            "OpenCV SGBM on radial lines": Tool(_semi_global, CV2),
        },
        prepare=prepare_pair,
    ),
    "orthophoto": Comparison(
        title="Orthophoto, file to file",
        data="A photo and a relief map of the same size; cubic, deflate. Truth: the "
        "photo at 20 000 places off the steps, computed one by one.",
        item="pixel", error="RMS difference [grey levels]",
        sizes=(1_500_000, 6 * MEGA, 24 * MEGA),
        tools={
            "bifocal ortho, no mask": Tool(lambda n, f: _ortho(n, f, "--no-mask"), OURS),
            "bifocal ortho, hidden pixels masked": Tool(
                lambda n, f: _ortho(n, f, "--mask"), OURS
            ),
            "orthority, no mask": Tool(_orthority, "orthority"),
            "OpenCV by hand, no mask": Tool(_ortho_by_hand, CV2),
        },
        prepare=prepare_wall,
    ),
    "undistortion": Comparison(
        title="A photo freed of lens distortion",
        data="28 mm on 36 mm, k1 = -0.12, k2 = 0.03, p1 = 0.0002, p2 = -0.0001; the "
        "photo is a smooth pattern, distorted exactly.",
        item="pixel", error="RMS difference [grey levels]", sizes=(6 * MEGA, 24 * MEGA),
        tools={
            "bifocal, cubic": Tool(functools.partial(_undistortion, ours=True), OURS),
            "OpenCV undistort, linear": Tool(functools.partial(_undistortion, ours=False), CV2),
        },
    ),
    "calibration": Comparison(
        title="Lens calibration from photos of a chessboard",
        data="OpenCV's thirteen sample photos of 640 x 480 px.",
        item="photo", error="RMS residual [px]", sizes=(len(_boards()),) if _boards() else (),
        tools={
            "bifocal, model chosen, precision told": Tool(
                functools.partial(_calibration, ours=True), OURS
            ),
            "OpenCV calibrateCamera": Tool(functools.partial(_calibration, ours=False), CV2),
        },
    ),
}  # fmt: skip
