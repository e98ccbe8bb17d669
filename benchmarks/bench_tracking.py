"""Particles to tracks: 1000 particles, 4 cameras, 100 frames; beside optv's tracker.

Run: python benchmarks/bench_tracking.py [PARTICLES FRAMES [MISSING FALSE [NOISE]]]

A flow of displacements up to half the mean distance between particles, targets to 0.1 px in any
order; what leaves the volume enters elsewhere. Of the targets of a camera a share MISSING is left
out and a share FALSE added anywhere; two nearer than 2 px are then one. Both trackers get the same
particles of every frame, ours; optv's searches within the same displacement. CPU time; links are
held against truth.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = "1"

import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from bench_cameras import CAMERAS, SENSOR, WALL, Optv
from scipy.spatial import cKDTree

from multimedia import project
from multimedia.projects.model import Project
from multimedia.projects.project_file import write_project
from multimedia.tracking.workflow import find_tracks

#: Of five digits: optv puts zeros before shorter ones.
FIRST = 10001
LOW, HIGH = np.array([-60.0, -60.0, 100.0]), np.array([60.0, 60.0, 220.0])


def flows(spacing: float) -> dict[str, object]:
    """Return displacements per frame as functions of places, half the spacing at most."""
    size = HIGH - LOW

    def vortex(xyz: np.ndarray) -> np.ndarray:
        x, y, z = 2.0 * np.pi * ((xyz - LOW) / size).T
        parts = [np.sin(y) * np.cos(z), np.sin(z) * np.cos(x), np.sin(x) * np.cos(y)]
        return 0.5 * spacing / np.sqrt(3.0) * np.column_stack(parts)

    def turning(xyz: np.ndarray) -> np.ndarray:
        x, y, _ = ((xyz - 0.5 * (LOW + HIGH)) / (0.5 * size)).T
        return 0.5 * spacing / np.sqrt(2.0) * np.column_stack([-y, x, np.zeros_like(x)])

    return {"vortices": vortex, "rotation": turning}


def simulated(flow, count: int, frames: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return places and names of the particles of every frame."""
    rng = np.random.default_rng(7)
    xyz, names, new = rng.uniform(LOW, HIGH, (count, 3)), np.arange(count), count
    places, whose = [], []
    for _ in range(frames):
        places.append(xyz)
        whose.append(names)
        for _ in range(8):
            xyz = xyz + flow(xyz) / 8.0
        gone = np.flatnonzero(((xyz < LOW) | (xyz > HIGH)).any(axis=1))
        xyz, names = xyz.copy(), names.copy()
        xyz[gone] = rng.uniform(LOW, HIGH, (len(gone), 3))
        names[gone] = new + np.arange(len(gone))
        new += len(gone)
    return places, whose


def spoiled(rng, pixels: np.ndarray, names: np.ndarray, missing: float, false: float):
    """Return targets and whose they are with some left out, some added, and near ones as one."""
    low, high, count = pixels.min(axis=0), pixels.max(axis=0), int(false * len(pixels))
    kept = rng.uniform(size=len(pixels)) >= missing
    pixels = np.vstack([pixels[kept], rng.uniform(low, high, (count, 2))])
    names = np.append(names[kept], -1 - rng.permutation(10**6)[:count])
    gone: set[int] = set()
    for one, two in cKDTree(pixels).query_pairs(2.0) if missing or false else ():
        if not {one, two} & gone:
            pixels[one] = 0.5 * (pixels[one] + pixels[two])
            gone.add(two)
    rest = np.setdiff1d(np.arange(len(pixels)), list(gone))
    return pixels[rest], names[rest]


def written(folder: Path, places, whose, missing=0.0, false=0.0, noise=0.1):
    """Write the targets of every camera and frame; return whose each is."""
    rng, owners = np.random.default_rng(8), []
    for t, xyz in enumerate(places):
        owners.append([])
        for k, camera in enumerate(CAMERAS):
            pixels = SENSOR.pixel_from_image(project(camera, xyz, WALL))
            pixels += noise * rng.standard_normal(pixels.shape)
            pixels, names = spoiled(rng, pixels, whose[t], missing, false)
            order = np.argsort(pixels[:, 1])  # optv wants them by rows
            owners[-1].append(names[order])
            lines = [f"{n} {x:.4f} {y:.4f} 9 3 3 99 -1\n" for n, (x, y) in enumerate(pixels[order])]
            (folder / f"c{k}.{FIRST + t}_targets").write_text(f"{len(lines)}\n" + "".join(lines))
    return owners


def judged(owner: np.ndarray, frame: np.ndarray, link: np.ndarray, whose) -> str:
    """Return shares of wrong links and of true tracks of four frames or more that are whole."""
    has = link >= 0
    truth: dict[int, set[tuple[int, int]]] = {}
    wrong = float(((owner[has] != owner[link[has]]) | (owner[has] < 0)).mean())
    for t in range(len(whose) - 1):
        for name in np.intersect1d(whose[t], whose[t + 1]).tolist():
            truth.setdefault(name, set()).add((t, t + 1))
    mine: dict[int, set[tuple[int, int]]] = {}
    for k in np.flatnonzero(has).tolist():
        if owner[k] == owner[link[k]]:
            steps = range(frame[link[k]], frame[k])
            mine.setdefault(int(owner[k]), set()).update((t, t + 1) for t in steps)
    long = [name for name, steps in truth.items() if len(steps) >= 3]
    whole = np.mean([mine.get(name, set()) >= truth[name] for name in long])
    links = sum(len(mine.get(name, set())) for name in truth) / sum(map(len, truth.values()))
    return (f"{100 * whole:5.1f} % of {len(long)} tracks whole, {100 * links:5.1f} % of links, "
            f"{100 * wrong:.2f} % of links wrong")  # fmt: skip


def read_links(folder: Path, frames: int) -> list[np.ndarray]:
    """Return the column `prev` of every ptv_is file."""
    return [np.loadtxt(folder / f"ptv_is.{FIRST + t}", skiprows=1, ndmin=2)[:, 0].astype(int)
            for t in range(frames)]  # fmt: skip


def majority(folder: Path, owners, frames: int) -> list[np.ndarray]:
    """Return whose each particle of every rt_is file is: of most of its targets."""
    found = []
    for t in range(frames):
        rows = np.loadtxt(folder / f"rt_is.{FIRST + t}", skiprows=1, ndmin=2)[:, 4:8].astype(int)
        names = np.stack([np.where(rows[:, k] >= 0, owners[t][k][rows[:, k]], -1 - k)
                          for k in range(4)], axis=1)  # fmt: skip
        votes = (names[:, :, None] == names[:, None]).sum(axis=2)
        best = names[np.arange(len(names)), votes.argmax(axis=1)]
        found.append(np.where(votes.max(axis=1) > 1, best, -1))
    return found


def by_files(folder: Path, owners, whose, frames: int) -> str:
    """Judge what stands in ptv_is files."""
    names, links = majority(folder, owners, frames), read_links(folder, frames)
    first = np.cumsum([0, *map(len, names)])
    link = np.concatenate([np.where(prev >= 0, prev + first[max(t - 1, 0)], -1)
                           for t, prev in enumerate(links)])  # fmt: skip
    frame = np.repeat(np.arange(frames), list(map(len, names)))
    return judged(np.concatenate(names), frame, link, whose)


def optv_tracks(folder: Path, frames: int, reach: float) -> float:
    """Run optv's tracker on the files of a folder; return its CPU time. [s]"""
    for t in range(FIRST, FIRST + frames):
        rows = np.loadtxt(folder / f"rt_is.{t}", skiprows=1, ndmin=2)[:, 4:8].astype(int)
        for k in range(4):  # targets have to tell of which particle they are
            path = folder / f"c{k}.{t}_targets"
            count, *lines = path.read_text().splitlines()
            particle = np.full(len(lines), -1)
            particle[rows[rows[:, k] >= 0, k]] = np.flatnonzero(rows[:, k] >= 0)
            lines = [
                f"{line.rsplit(' ', 1)[0]} {n}" for line, n in zip(lines, particle, strict=True)
            ]
            path.write_text("\n".join([count, *lines]) + "\n")
    from optv.parameters import SequenceParams, TrackingParams, VolumeParams
    from optv.tracker import Tracker

    with tempfile.TemporaryDirectory() as place:
        optv = Optv(Path(place) / "experiment")
    volume = VolumeParams()
    volume.set_Zmin_lay([LOW[2]] * 2)
    volume.set_Zmax_lay([HIGH[2]] * 2)
    volume.set_X_lay([LOW[0], HIGH[0]])
    limits = {"dvxmin": -reach, "dvxmax": reach, "dvymin": -reach, "dvymax": reach,
              "dvzmin": -reach, "dvzmax": reach, "dangle": 120.0, "dacc": reach,
              "add": 0}  # fmt: skip
    rules = TrackingParams()
    for name, value in limits.items():
        getattr(rules, f"set_{name}")(value)
    bases = [f"{folder}/c{k}." for k in range(4)]
    sequence = SequenceParams(image_base=bases, frame_range=(FIRST, FIRST + frames - 1))
    names = {part: f"{folder}/{word}" for part, word in
             (("corres", "rt_is"), ("linkage", "ptv_is"), ("prio", "added"))}  # fmt: skip
    start = time.process_time()
    tracker = Tracker(optv.control, volume, rules, sequence, optv.cameras, naming=names)
    sys.stdout.flush()
    said, nothing = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)  # it tells of every step
    try:
        tracker.full_forward()
    finally:
        os.dup2(said, 1)
    return time.process_time() - start


def main() -> None:
    """Print what both find."""
    count, frames = (int(word) for word in (sys.argv[1:3] or ("1000", "100")))
    spoiling = [float(word) for word in sys.argv[3:]]
    spacing = float(np.cbrt(np.prod(HIGH - LOW) / count))
    for name, flow in flows(spacing).items():
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            places, whose = simulated(flow, count, frames)
            owners = written(folder, places, whose, *spoiling)
            tank = Project(
                cameras=tuple(CAMERAS), media={"w": WALL}, media_of=("w",) * 4, unit="mm"
            )
            write_project(folder / "tank.toml", tank)
            bases = [folder / f"c{k}." for k in range(4)]
            start, wall = time.process_time(), time.perf_counter()
            found = find_tracks(folder / "tank.toml", bases, folder=folder / "ours")
            spent = time.process_time() - start, time.perf_counter() - wall
            tracks = found.tracks
            print(
                f"{name}: {count} particles, {frames} frames, displacement to {spacing / 2:.2f} mm"
            )
            print(f"  ours   {by_files(folder / 'ours', owners, whose, frames)}; targets to tracks "
                  f"{spent[0]:.1f} s CPU, {spent[1]:.1f} s")  # fmt: skip
            true = {t: dict(zip(whose[t].tolist(), flow(places[t]), strict=True))
                    for t in range(frames)}  # fmt: skip
            names = majority(folder / "ours", owners, frames)
            own = [names[t][n] for t, n in zip(tracks.frame - FIRST, tracks.number, strict=True)]
            seen = enumerate(zip(tracks.frame - FIRST, own, strict=True))
            pairs = [(k, true[t][o]) for k, (t, o) in seen if o in true[t]]
            rows = np.array([k for k, _ in pairs])
            error = tracks.velocity[rows] - np.array([v for _, v in pairs])
            ratio = np.sqrt(np.median((error / tracks.velocity_sigma[rows]) ** 2, axis=0) / 0.455)
            print(f"         velocity error over sigma {ratio.round(2).tolist()}, "
                  f"{int(tracks.outlier.sum())} vectors differ from those around")  # fmt: skip
            if find_spec("optv"):
                for path in (folder / "ours").glob("rt_is.*"):
                    (folder / path.name).write_bytes(path.read_bytes())
                seconds = optv_tracks(folder, frames, spacing / 2)
                print(f"  optv   {by_files(folder, owners, whose, frames)}; from particles to "
                      f"tracks {seconds:.1f} s CPU")  # fmt: skip


if __name__ == "__main__":
    main()
