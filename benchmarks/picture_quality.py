"""What a client sees in an orthophoto: features off, islands, seams, holes, tears, bent lines.

    python benchmarks/picture_quality.py [SCENE | PAIR.pair.json RELIEF.tif POINTS.csv] ...

Rendered scenes of `relief_ablation` have exact truth: what is painted and wrong is put more than
2 px aside, or is not seen by the photo it was taken from; what is filled or empty counts beside it.
Of real pairs the points of the façade data (X, Y, relief) are looked for in the picture, each by
the patch of photo 1 that shows it. Beauty is no excuse: a change must hold both.
"""

from __future__ import annotations

import csv
import sys
import time
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np

from benchmarks.relief_ablation import SCENES, shots
from bifocal import Orthophoto, Pair, ReliefMap, dense_relief, orthophoto
from bifocal.model.grid import Grid
from bifocal.orthophotos.compose import as_surface, completed
from bifocal.orthophotos.ortho_image import OrthoOptions, Source
from bifocal.orthophotos.rectify import SourcePhoto
from bifocal.orthophotos.whole_picture import CompletedSurface
from photocore.images import read_image

#: Pixel of the pictures of real pairs. [m]
GSD = 0.005
#: Half a patch, and how far it is sought. [px]
PATCH, REACH = 17, 22
#: Smaller parts are islands; larger fills are seen. [m2]
ISLAND, LARGE = 0.1, 0.05


def drawn(pair: Pair, images, relief: ReliefMap, grid: Grid):
    """Return the picture, its photo per pixel (1, 2; 0 empty), places in photos 1 and 2, CPU s."""

    def no_marks(_, window: Grid):
        return np.zeros(window.shape, np.uint8)

    start = time.process_time()
    # Without marks of what is interpolated the source names the photo of every pixel.
    with patch.object(CompletedSurface, "source", no_marks):
        picture = orthophoto(pair, images, relief, gsd=grid.gsd, bounds=grid.bounds)
    took = time.process_time() - start
    # Where both are blended, the one of the larger share.
    second = (picture.source == Source.IMAGE_2).astype(np.uint8)
    away = cv2.distanceTransform(1 - second, cv2.DIST_L2, 3)
    first = (picture.source == Source.IMAGE_1) | (picture.source == Source.BOTH)
    photo = np.where(first, np.uint8(1), np.uint8(0))
    nearer = (picture.source == Source.BOTH) & (away < OrthoOptions().feather / 2)
    photo[(second > 0) | nearer] = 2
    pixel = pair.image1.gsd(images[0].shape[1::-1])
    surface = completed(as_surface(relief), picture.grid, pair.image1, pixel)
    if isinstance(surface, CompletedSurface):
        mark = surface.source(picture.grid)
        source = np.where((mark > 0) & (photo > 0), mark, picture.source)
        picture = replace(picture, source=source)
    r = surface.window(picture.grid)
    places = []
    for number, image in enumerate(images, start=1):
        view = SourcePhoto.prepare(pair.photo(number), image, number=number, gsd=picture.gsd)
        places.append((*view.pixel_map(picture.grid, r), r))
    return picture, photo, places, took


def looks(picture: Orthophoto, photo) -> dict[str, float]:
    """Return islands, metres of seams, large fills and the shares of what is not measured."""
    area = picture.gsd**2
    islands = sum(int((_areas(photo == k) * area < ISLAND).sum()) for k in (1, 2))
    fills = _areas(picture.source == Source.FILLED) * area
    pairs = ((photo[:, 1:], photo[:, :-1]), (photo[1:], photo[:-1]))
    seams = sum(int(((a != b) & (a > 0) & (b > 0)).sum()) for a, b in pairs) * picture.gsd
    source = picture.source
    shares = {f"{one.name.lower()} %": 100 * float((source == one).mean()) for one in Source}
    return {"islands": islands, "seams m": seams, "fills": int((fills > LARGE).sum())} | shares


def _areas(mask) -> np.ndarray:
    return cv2.connectedComponentsWithStats(mask.astype(np.uint8))[2][1:, cv2.CC_STAT_AREA]


def tears(photo, places, measured, gsd: float) -> float:
    """Return the metres along which neighbours lie 2 px further apart, off measured steps. [m]

    Of whichever photo is drawn: a picture mostly of photo 2 has hardly any of photo 1. castle_B has
    214 m, 33 of them in photo 1 and the rest where photo 2 shows what a machine stands before; when
    three quarters of it were of photo 2 it had 245 m, 5 of them in photo 1.
    """
    count = 0
    for number, (column, row, _) in enumerate(places, start=1):
        shown = photo == number
        for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
            dc, dr = column[a] - column[b], row[a] - row[b]
            jump = np.hypot(dc - np.nanmedian(dc), dr - np.nanmedian(dr)) > 2
            count += int((jump & shown[a] & shown[b] & ~(measured[a] & measured[b])).sum())
    return count * gsd


def features(pair: Pair, far, picture: Orthophoto, points: Path) -> dict[str, float]:
    """Return the share of reference points seen again, and how far off they are. [mm]"""
    with points.open(newline="") as file:
        table = list(csv.DictReader(file))
    rows = [[float(row[key]) for key in ("X_m", "Y_m", "relief_m")] for row in table]
    grey = cv2.cvtColor(picture.image, cv2.COLOR_RGB2GRAY)
    offsets = np.arange(-PATCH, PATCH + 1) * picture.gsd
    found, off = [], []
    for k in np.random.default_rng(1).permutation(len(rows))[:400]:
        x, y, r = rows[k]
        column, row = picture.grid.pixel_of(np.array([x, y]))
        c, w, edge = round(column), round(row), PATCH + REACH + 1
        if not (edge < c < grey.shape[1] - edge and edge < w < grey.shape[0] - edge):
            continue
        sides = np.meshgrid(x + offsets, y - offsets)
        xyz = np.stack([*sides, np.full_like(sides[0], r)], axis=-1)
        pixels = pair.image1.project(xyz.reshape(-1, 3)).reshape(*xyz.shape[:2], 2)
        maps = (np.ascontiguousarray(pixels[..., k], np.float32) for k in (0, 1))
        patch = cv2.remap(far, *maps, cv2.INTER_CUBIC)
        if patch.std() < 6:
            continue
        window = grey[w - edge + 1 : w + edge, c - edge + 1 : c + edge]
        score = cv2.matchTemplate(window, patch, cv2.TM_CCOEFF_NORMED)
        _, top, _, (right, down) = cv2.minMaxLoc(score)
        found.append(top > 0.8)
        off.append(np.hypot(right - REACH - column + c, down - REACH - row + w) * picture.gsd)
    off_mm = 1000 * np.array(off)[np.array(found)]
    return {
        "found %": 100 * float(np.mean(found)), "median mm": float(np.median(off_mm)),
        "99 % mm": float(np.percentile(off_mm, 99)), ">20 mm %": 100 * float((off_mm > 20).mean()),
    }  # fmt: skip


def bent_lines(pair: Pair, far, picture: Orthophoto, photo, places) -> float:
    """Return the share of points of upright and level lines of photo 1 off by a far pixel. [%]"""
    segments = cv2.createLineSegmentDetector(0).detect(far)[0].reshape(-1, 2, 2)
    plane = pair.image1.plane_from_pixels(segments.astype(float))
    along = plane[:, 1] - plane[:, 0]
    length = np.hypot(*along.T)
    angle = np.degrees(np.arctan2(*np.abs(along.T)))
    keep = (length > 0.45) & ((angle < 6) | (angle > 84))
    size, foot, r = pair.image1.gsd(far.shape[1::-1]), pair.image1, places[2]
    grid = picture.grid
    heights = np.linspace(np.nanquantile(r, 0.9999), np.nanquantile(r, 1e-4), 160)
    off = total = 0
    for (start, end), metres in zip(plane[keep], length[keep], strict=True):
        q = start + np.linspace(0.03, 0.97, max(20, int(metres / 0.02)))[:, None] * (end - start)
        # Down each ray until the relief is met.
        shrunk = (1 - heights / foot.distance)[:, None, None]
        pixel = grid.pixel_of(foot.nadir + (q - foot.nadir) * shrunk).astype(np.float32)
        relief = cv2.remap(r, pixel[..., 0], pixel[..., 1], cv2.INTER_LINEAR, borderValue=np.nan)
        over = relief - heights[:, None]
        first, k = (over >= 0).argmax(axis=0), np.arange(len(q))
        before = np.maximum(first - 1, 0)
        part = over[first, k] / np.maximum(over[first, k] - over[before, k], 1e-9)
        part = np.clip(np.nan_to_num(part), 0, 1)
        height = heights[first] + (heights[before] - heights[first]) * part
        place = foot.nadir + (q - foot.nadir) * (1 - height / foot.distance)[:, None]
        pixel = np.rint(grid.pixel_of(place)).astype(int)
        c, w = np.clip(pixel, 0, np.subtract(r.shape, 1)[::-1]).T
        use = (over >= 0).any(axis=0) & (photo[w, c] == 1)
        if use.sum() < 12:
            continue
        unit = (end - start) / metres
        s, e = (place - start) @ unit, (place - start) @ np.array([-unit[1], unit[0]])
        fit = use
        for _ in range(3):
            residual = np.abs(e - np.polyval(np.polyfit(s[fit], e[fit], 1), s))
            fit = use & (residual <= max(4 * float(np.median(residual[use])), 1e-4))
        off, total = off + int((residual[use] > size).sum()), total + int(use.sum())
    return 100 * off / max(total, 1)


def wrong(shot, picture: Orthophoto, photo, places) -> dict[str, float]:
    """Return what is painted and wrong of what the photos show, and what is filled or empty. [%]"""
    truth, gsd = shot.truth.r, shot.truth.gsd
    bad = {2: np.zeros(truth.shape, bool), 4: np.zeros(truth.shape, bool)}
    for number, seen in ((1, shot.visible1), (2, shot.visible2)):
        image = (shot.image1, shot.image2)[number - 1]
        view = SourcePhoto.prepare(shot.pair.photo(number), image, number=number, gsd=gsd)
        column, row = view.pixel_map(picture.grid, truth)
        away = np.hypot(column - places[number - 1][0], row - places[number - 1][1])
        for px, mask in bad.items():
            mask |= (photo == number) & (~seen | ~(away < px))
    known = np.isfinite(truth) & (shot.visible1 | shot.visible2)
    rest = known & (photo == 0)
    return {"wrong 2 px %": 100 * float(bad[2][known].mean()),
            "wrong 4 px %": 100 * float(bad[4][known].mean()),
            "filled, empty %": 100 * float(rest.sum() / known.sum())}  # fmt: skip


def rendered(shot, relief: ReliefMap) -> dict[str, float]:
    """Return the figures of a rendered scene."""
    images = (shot.image1, shot.image2)
    picture, photo, places, took = drawn(shot.pair, images, relief, shot.truth.grid)
    measured = relief.quality == 1
    figures = wrong(shot, picture, photo, places) | looks(picture, photo)
    figures["tears m"] = tears(photo, places, measured, picture.gsd)
    far = cv2.cvtColor(shot.image1, cv2.COLOR_RGB2GRAY)
    figures["bent %"] = bent_lines(shot.pair, far, picture, photo, places[0])
    return figures | {"CPU s": took}


def real(pair_file: Path, relief_file: Path, points: Path) -> dict[str, float]:
    """Return the figures of a pair whose cameras and points are known."""
    pair, relief = Pair.read(pair_file), ReliefMap.read(relief_file)
    images = tuple(read_image(pair_file.parent / pair.photo(k).file) for k in (1, 2))
    grid = Grid.from_bounds(relief.bounds, gsd=GSD)
    picture, photo, places, took = drawn(pair, images, relief, grid)
    far = cv2.cvtColor(images[0], cv2.COLOR_RGB2GRAY)
    measured = as_surface(relief).measured(grid)
    figures = features(pair, far, picture, points) | looks(picture, photo)
    figures["tears m"] = tears(photo, places, measured, picture.gsd)
    figures["bent %"] = bent_lines(pair, far, picture, photo, places[0])
    return figures | {"CPU s": took}


def show(name: str, figures: dict[str, float]) -> None:
    """Print the figures of one picture."""
    words = "  ".join(f"{key} {value:.4g}" for key, value in figures.items())
    print(f"{name:22s}{words}", flush=True)


if __name__ == "__main__":
    cv2.setNumThreads(1)
    given = sys.argv[1:] or list(SCENES)
    while given:
        if given[0].endswith(".json"):
            files, given = [Path(name) for name in given[:3]], given[3:]
            show(files[0].name, real(*files))
        else:
            shot = shots(given[0])
            grid = shot.truth.grid
            show(
                given[0],
                rendered(
                    shot,
                    dense_relief(
                        shot.pair, shot.image1, shot.image2, gsd=grid.gsd, bounds=grid.bounds
                    ),
                ),
            )
            given = given[1:]
