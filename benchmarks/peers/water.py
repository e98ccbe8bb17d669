"""Points seen through glass into water, beside OpenPTV's library."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import bench_cameras as tank
from benchmarks import bench_shift
from benchmarks.peers.comparison import Comparison, Task, Tool
from multimedia import epipolar_curve, intersect, intersect_pairs, project, radial_shift, resect
from multimedia.refraction.compiled import compiled_solve

SEEN = 2000  # of the results so many are compared with the truth
NOISE = 0.002  # of image coordinates [mm]


def _shift_data(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(20240601)
    return np.hypot(*rng.uniform(-150, 150, (2, count))), rng.uniform(0, 200, count)


def _shift(count: int, way: str) -> Task:
    radius, depth = _shift_data(count)
    truth = bench_shift.reference(radius[:SEEN], depth[:SEEN])
    layers, height = bench_shift.LAYERS, bench_shift.HEIGHT
    if way == "numpy":
        work: Any = functools.partial(radial_shift, radius, z0=height, zp=depth, layers=layers)
    elif way == "compiled":
        heights = [np.asarray(height), np.asarray(layers.thicknesses[0]), depth]
        work = functools.partial(compiled_solve, radius, heights, layers.indices, threads=1)
        work()  # compiled once
    else:
        work = bench_shift.optv_work(radius, depth)
    return Task(work, lambda found: np.abs(found[:SEEN] - truth).max())


def _seen_from(camera: Any, xyz: np.ndarray) -> np.ndarray:
    """Return image coordinates by the shift in long double, then a plain central projection."""
    away = xyz[:, :2] - camera.centre[:2]
    glass = tank.LAYERS.thicknesses[0]
    top = tank.WALL.point[2]
    radius = np.hypot(*away.T)
    apparent = bench_shift.reference(radius, top - xyz[:, 2], camera.centre[2] - top - glass)
    moved = xyz.copy()
    moved[:, :2] = camera.centre[:2] + away * np.asarray(apparent / radius, float)[:, None]
    return np.asarray(project(camera, moved))


@functools.cache
def _optv() -> tank.Optv:
    return tank.Optv(Path(tempfile.mkdtemp()) / "experiment")


def _projection(count: int, *, ours: bool) -> Task:
    xyz, camera = np.ascontiguousarray(tank.points(count)), tank.CAMERAS[1]
    truth = _seen_from(camera, xyz[:SEEN])
    if ours:
        work: Any = functools.partial(project, camera, xyz, tank.WALL)
    else:
        from optv.imgcoord import flat_image_coordinates

        media = _optv().control.get_multimedia_params()
        work = functools.partial(flat_image_coordinates, xyz, _optv().cameras[1], media)
    return Task(work, lambda found: np.abs(found[:SEEN] - truth).max())


def _intersection(count: int, way: str) -> Task:
    xyz = tank.points(count)
    image = np.stack([project(camera, xyz, tank.WALL) for camera in tank.CAMERAS])
    image = image + NOISE * np.random.default_rng(3).standard_normal(image.shape)
    if way == "rigorous":
        call = functools.partial(intersect, tank.CAMERAS, image, tank.WALL, sigma=NOISE)
        return Task(call, lambda found: _rms(found.xyz - xyz))
    if way == "pairs":
        pairs = functools.partial(intersect_pairs, tank.CAMERAS, image, tank.WALL)
        return Task(pairs, lambda found: _rms(found[0] - xyz))
    from optv.orientation import multi_cam_point_positions

    flat = np.ascontiguousarray(np.moveaxis(image, 0, 1))
    call = functools.partial(multi_cam_point_positions, flat, _optv().control, _optv().cameras)
    return Task(call, lambda found: _rms(found[0] - xyz))


def _rms(away: np.ndarray) -> float:
    return float(np.sqrt((away**2).sum(axis=1).mean()))


def _resection(count: int, *, ours: bool) -> Task:
    xyz, truth = tank.points(count), tank.CAMERAS[2]
    image = project(truth, xyz, tank.WALL)
    image = image + NOISE * np.random.default_rng(4).standard_normal(image.shape)
    start = truth.stepped(
        ("X0", "Y0", "Z0", "omega", "phi", "kappa"), (20, -10, 15, 0.03, -0.02, 0.02)
    )
    if ours:
        call = functools.partial(resect, start, xyz, image, tank.WALL)
        return Task(call, lambda found: np.linalg.norm(found.camera.centre - truth.centre))
    from optv.calibration import Calibration
    from optv.orientation import full_calibration

    optv = _optv()
    targets = optv.targets(tank.SENSOR.pixel_from_image(image))
    glass = optv.cameras[2].get_glass_vec()

    def work() -> Calibration:
        made = Calibration(
            pos=np.array(start.centre), angs=np.array(start.angles),
            prim_point=np.array([0.0, 0.0, 25.0]), rad_dist=np.zeros(3), decent=np.zeros(2),
            affine=np.array([1.0, 0.0]), glass=glass,
        )  # fmt: skip
        full_calibration(made, xyz, targets, optv.control, [])
        return made

    return Task(work, lambda found: np.linalg.norm(np.array(found.get_pos()) - truth.centre))


def _curves(count: int, *, ours: bool) -> Task:
    """Ten vertices at equal depths; each vertex is where the ray's point there is seen."""
    first, second = tank.CAMERAS[1], tank.CAMERAS[2]
    image = project(first, tank.points(count), tank.WALL)
    how = {"z_range": (60.0, 240.0), "vertices": 10}
    few = epipolar_curve(first, image[:20], second, tank.WALL, **how)  # type: ignore[arg-type]
    xyz = few.points.reshape(-1, 3)
    truth = tank.SENSOR.pixel_from_image(_seen_from(second, xyz)).reshape(20, -1, 2)

    def error(found: np.ndarray) -> float:
        # The same depths, perhaps from the other end.
        return float(min(np.abs(found[:20] - truth[:, ::k]).max() for k in (1, -1)))

    if ours:

        def ours_work() -> np.ndarray:
            found = epipolar_curve(first, image, second, tank.WALL, **how)  # type: ignore[arg-type]
            return np.asarray(tank.SENSOR.pixel_from_image(found.image))

        return Task(ours_work, error)
    from optv.epipolar import epipolar_curve as curve

    optv, pixels = _optv(), tank.SENSOR.pixel_from_image(image)

    def work() -> np.ndarray:
        return np.array(
            [curve(p, *optv.cameras[1:3], 10, optv.control, optv.volume) for p in pixels]
        )

    return Task(work, error)


def _of(function: Any, **chosen: Any) -> Any:
    return lambda count, _folder: function(count, **chosen)


TANK = (
    "Four cameras above a tank, air some 500 mm, 10 mm of glass, up to 200 mm of water, c = 25 mm, "
    "pixel 0.012 mm."
)
COMPARISONS = {
    "shift": Comparison(
        title="Radial shift of points under water",
        data="Air 500 mm, glass 10 mm, water 0 to 200 mm. Truth: Newton's iteration in long "
        "double.",
        item="point", error="largest error [mm]", sizes=(10_000, 100_000, 1_000_000),
        tools={
            "multimedia, NumPy": Tool(_of(_shift, way="numpy"), "bifocal-relief"),
            "multimedia, compiled": Tool(_of(_shift, way="compiled"), "numba"),
            "OpenPTV liboptv": Tool(_of(_shift, way="optv"), "optv"),
        },
    ),
    "projection": Comparison(
        title="Projection through glass into water",
        data=f"{TANK} Truth: the shift in long double, then a plain central projection.",
        item="point", error="largest error [mm]", sizes=(10_000, 100_000, 1_000_000),
        tools={
            "multimedia": Tool(_of(_projection, ours=True), "bifocal-relief"),
            "OpenPTV liboptv": Tool(_of(_projection, ours=False), "optv", 100_000),
        },
    ),
    "intersection": Comparison(
        title="Intersection of four rays through water",
        data=f"{TANK} 2 µm of noise. Truth: the points.",
        item="point", error="RMS error [mm]", sizes=(1_000, 10_000, 100_000),
        tools={
            "multimedia, rigorous, with covariances": Tool(
                _of(_intersection, way="rigorous"), "bifocal-relief"
            ),
            "multimedia, mean of pairs": Tool(_of(_intersection, way="pairs"), "bifocal-relief"),
            "OpenPTV liboptv, mean of pairs": Tool(_of(_intersection, way="optv"), "optv"),
        },
    ),
    "resection": Comparison(
        title="Resection of a camera from points under water",
        data=f"{TANK} 2 µm of noise, start 27 mm and 2 degrees off. Truth: the camera.",
        item="point", error="error of the position [mm]", sizes=(20, 200, 2_000, 20_000),
        tools={
            "multimedia": Tool(_of(_resection, ours=True), "bifocal-relief"),
            "OpenPTV liboptv": Tool(_of(_resection, ours=False), "optv"),
        },
    ),
    "epipolar": Comparison(
        title="Epipolar curves through water, ten vertices",
        data=f"{TANK} Truth: the vertices projected by the shift in long double.",
        item="curve", error="largest error [px]", sizes=(100, 1_000, 10_000),
        tools={
            "multimedia": Tool(_of(_curves, ours=True), "bifocal-relief"),
            "OpenPTV liboptv": Tool(_of(_curves, ours=False), "optv", 1_000),
        },
    ),
}  # fmt: skip
