"""Dense relief against OpenCV's flow and its semi-global matching, on photographs as delivered.

    python benchmarks/relief_unseen.py [--kept] [--second] [--large] [--alone] [SCENE ...]

Scenes of `tests.scenes.unseen`, of the first seed numbers are tuned on; ``--kept`` takes one that
they never are, ``--second`` the other of the two, ``--large`` photos of 6 MP, ``--alone`` leaves
the peers out. Counted is every pixel that both cameras see; what is missing counts as beyond. DIS
("medium", to full resolution) is projected on the radius; StereoSGBM runs once in log-polar rings
and is told the range; what either leaves open takes its nearest neighbour. Renderings are kept in
the folder ``$RELIEF_SCENES``, if that is set.
"""

from __future__ import annotations

import os
import pickle
import sys
import time
from pathlib import Path

import cv2
import numpy as np

from bifocal import Quality, dense_relief
from bifocal.rays import zoom_factor
from bifocal.relief_maps import flow
from bifocal.relief_maps.frame import make_frame, working_grid
from tests.scenes.unseen import KEPT, TAKINGS, TUNED, unseen

HEADINGS = ("median", ">3cm", ">10cm", "RMSEoff", "rails", "meas", ">3cm", ">3s", "z99", "CPU s")


def rendered(name: str, seed: int, large: bool):
    """Return a rendering, kept from an earlier run where there is one."""
    kept = os.environ.get("RELIEF_SCENES")
    path = Path(kept or ".") / f"{name.replace('/', '-')}-{seed}{'-large' if large else ''}.pickle"
    if kept and path.exists():
        return pickle.loads(path.read_bytes())
    size, pixel = ((3072, 2048), 0.00369) if large else ((1536, 1024), 0.00738)
    shot = unseen(name, seed, size=size, pixel=pixel)
    if kept:
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_bytes(pickle.dumps(shot))
    return shot


def bars(truth: np.ndarray, gsd: float) -> np.ndarray:
    """Return what stands out by 25 cm on all sides and is narrower than 9 cm: rails."""
    wide, narrow = (np.ones((int(side / gsd) | 1,) * 2, np.uint8) for side in (0.2, 0.09))
    level = cv2.morphologyEx(truth, cv2.MORPH_OPEN, narrow)
    return (truth - cv2.erode(truth, wide) > 0.25) & (level < truth - 0.25)


def figures(shot, r, seconds, sigma=None, quality=None) -> tuple[float, ...]:
    """Return the columns of the table for a relief on the grid of the truth."""
    truth = shot.truth.r.astype(np.float32)
    both = shot.visible1 & shot.visible2
    error = np.abs(r - truth)
    square = np.ones((7, 7), np.uint8)
    off = both & (cv2.dilate(truth, square) - cv2.erode(truth, square) < 0.03) & np.isfinite(r)
    thin = both & bars(truth, shot.truth.gsd)

    def share(of: np.ndarray, limit: float) -> float:
        return 100 * float(np.mean(~(of <= limit))) if of.size else np.nan

    found = [
        1e3 * float(np.nanmedian(error[both])), share(error[both], 0.03), share(error[both], 0.1),
        1e3 * float(np.sqrt(np.mean(error[off] ** 2))),
        100 - share(error[thin], 0.05) if thin.sum() > 200 else np.nan,
    ]  # fmt: skip
    if quality is not None:
        good = both & (quality == Quality.MEASURED)
        ratio = (error / sigma)[good]
        found += [100 * good.sum() / both.sum(), share(error[good], 0.03), share(ratio, 3.0),
                  float(np.percentile(ratio, 99)) if ratio.size else np.nan]  # fmt: skip
    else:
        found += [np.nan] * 4
    return (*found, seconds)


def on_truth(shot, frame, relief: np.ndarray) -> np.ndarray:
    """Return relief of the pixels of photo 1 on the grid of the truth, highest first."""
    shape, grid = shot.truth.shape, frame.grid
    d1, nadir = frame.distances[0], frame.foot(1).nadir
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    share = 1 - relief / d1
    place = np.stack([nadir[0] + (x - nadir[0]) * share, nadir[1] + (y - nadir[1]) * share], -1)
    matrix = np.linalg.inv(shot.truth.plane_from_pixel)
    pixel = np.rint(place @ matrix[:2, :2].T + matrix[:2, 2])
    ok = np.isfinite(pixel).all(-1) & (pixel >= 0).all(-1) & (pixel < shape[::-1]).all(-1)
    out = np.full(shape, np.nan, np.float32)
    where = pixel[ok].astype(int)
    np.fmax.at(out, (where[:, 1], where[:, 0]), relief[ok].astype(np.float32))
    return nearest(out)


def nearest(values: np.ndarray) -> np.ndarray:
    """Return values whose gaps take their nearest neighbour."""
    gap = ~np.isfinite(values)
    label = cv2.distanceTransformWithLabels(
        gap.astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    source = np.zeros(label.max() + 1, np.int64)
    source[label[~gap]] = np.flatnonzero(~gap)
    return values.ravel()[source[label]]


def by_flow(frame) -> np.ndarray:
    """Return relief by OpenCV's DIS alone."""
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    dis.setFinestScale(0)
    return flow.split(frame, dis.calc(frame.image1, frame.image2, None))[0]


def by_semi_global(frame, span: tuple[float, float]) -> np.ndarray:
    """Return relief by one StereoSGBM in rings of log-polar photos, within a known range."""
    d1, d2 = frame.distances
    height, width = frame.grid.shape
    x, y = np.broadcast_arrays(*frame.from_centre())
    reach, angle = np.hypot(x, y), np.mod(np.arctan2(y, x), 2 * np.pi)
    relief = np.full((height, width), np.nan, np.float32)
    outer = float(reach.max()) + 1
    log_zoom = np.log(zoom_factor(np.array(span), d1=d1, d2=d2))
    while outer > 40:
        inner, step = max(outer / 2.2, 40.0), 1 / outer
        count = int(2 * np.pi / (1.4 * step))
        low = int(np.floor(-log_zoom[1] / step))
        many = -(-(int(np.ceil(-log_zoom[0] / step)) - low + 1) // 16) * 16
        start = np.log(inner) - (max(low + many, 0) + 4) * step
        length = int((np.log(outer) + (max(-low, 0) + 4) * step - start) / step)
        turn = np.arange(-12, count + 12)[:, None] * (2 * np.pi / count)
        radius = np.exp(start + np.arange(length) * step)[None]
        maps = [(f(turn) * radius + c).astype(np.float32)
                for f, c in zip((np.cos, np.sin), frame.centre, strict=True)]  # fmt: skip
        far, near = (cv2.remap(image, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
                     for image in (frame.image1, frame.image2))  # fmt: skip
        stereo = cv2.StereoSGBM_create(
            low, many, 5, 200, 800, preFilterCap=63, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY
        )
        disparity = stereo.compute(far, near).astype(np.float32) / 16
        disparity[disparity < low] = np.nan
        ring = (reach >= inner) & (reach < outer)
        column = np.rint((np.log(reach[ring]) - start) / step).astype(int).clip(0, length - 1)
        row = np.rint(angle[ring] / (2 * np.pi) * count).astype(int) + 12
        k = np.exp(-disparity[row, column] * step)
        relief[ring] = d1 * d2 * (k - 1) / (k * d1 - d2)
        outer = inner
    return nearest(relief)


def cpu(job):
    """Return what a job returns and the CPU seconds it takes."""
    start = time.process_time()
    return job(), time.process_time() - start


def bench(name: str, seed: int, *, large: bool, peers: bool) -> None:
    """Print the table of a scene."""
    shot = rendered(name, seed, large)
    grid = shot.truth.grid

    def line(who: str, values: tuple[float, ...]) -> None:
        numbers = " ".join(f"{value:8.2f}" for value in values)
        print(f"{name + ' ' + str(seed):16s} {who:8s} {numbers}", flush=True)

    found, seconds = cpu(
        lambda: dense_relief(shot.pair, shot.image1, shot.image2, gsd=grid.gsd, bounds=grid.bounds)
    )
    line("bifocal", figures(shot, found.r, seconds, found.sigma, found.quality))
    if not peers:
        return
    grey = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in (shot.image1, shot.image2)]
    work = working_grid(shot.pair, grey[0].shape, grid.bounds, grid.gsd)
    frame = make_frame(shot.pair, *grey, work, None)
    relief, seconds = cpu(lambda: by_flow(frame))
    line("DIS", figures(shot, on_truth(shot, frame, relief), seconds))
    span = (float(np.nanmin(shot.truth.r)) - 0.1, float(np.nanmax(shot.truth.r)) + 0.1)
    relief, seconds = cpu(lambda: by_semi_global(frame, span))
    line("SGBM", figures(shot, on_truth(shot, frame, relief), seconds))


if __name__ == "__main__":
    cv2.setNumThreads(1)
    chosen = [word for word in sys.argv[1:] if not word.startswith("--")]
    seeds = KEPT if "--kept" in sys.argv else TUNED
    print(" " * 26 + " ".join(f"{heading:>8s}" for heading in HEADINGS))
    for scene in chosen or TAKINGS:
        bench(
            scene, seeds["--second" in sys.argv], large="--large" in sys.argv,
            peers="--alone" not in sys.argv,
        )  # fmt: skip
