"""Projection, intersection, resection and epipolar curves beside optv (``pip install optv``).

Run: python benchmarks/bench_cameras.py

Set-up: four cameras above a tank, air some 500 mm, glass 10 mm, water 0 to 200 mm, c = 25 mm,
pixel 0.012 mm. The same data for both, in the same run; one core, CPU time, best of several. Every
result is checked before it is timed.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = "1"

import tempfile
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from unittest.mock import patch

import numpy as np

from multimedia import (
    Camera,
    FlatInterface,
    Layers,
    Sensor,
    epipolar_curve,
    intersect,
    intersect_pairs,
    intersect_rays,
    project,
    resect,
    resect_many,
)
from multimedia.openptv.experiment import write_experiment
from multimedia.orientation.pose_kernel import fitted_pose
from multimedia.projects.model import Project

RNG = np.random.default_rng(20240601)
LAYERS = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,))
# OpenPTV measures the glass from the origin, which must lie in the water: Z = 0 is 250 mm down.
WALL = FlatInterface(layers=LAYERS, point=(0, 0, 250.0))
SENSOR = Sensor(width=4000, height=4000, pixel_size=np.full(2, 0.012), origin=np.full(2, 2000.0))
EYES = ((0.1, 0.0, 750.0), (300, 30, 700), (-300, -20, 700), (10, 310, 700))
CAMERAS = [
    replace(
        Camera.looking_at(eye, (0, 0, 150.0), principal_distance=25.0), sensor=SENSOR, name=f"c{k}"
    )
    for k, eye in enumerate(EYES)
]


def points(count: int) -> np.ndarray:
    """Return points in the water."""
    return RNG.uniform((-150, -150, 50), (150, 150, 249), (count, 3))


def best(work: Callable[[], object], per: int, repeats: int = 5) -> float:
    """Return the least CPU time of one item [s]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times) / per


def line(what: str, ours: float, theirs: float | None, unit: str, factor: float) -> None:
    """Print one comparison."""
    text = f"{what:48s} {ours * factor:9.3f} {unit}"
    if theirs is not None:
        text += f"   optv {theirs * factor:9.3f} {unit}   ratio {theirs / ours:6.1f}"
    print(text)


class Optv:
    """The same cameras in optv, through files as OpenPTV reads them."""

    def __init__(self, folder: Path) -> None:
        from optv.calibration import Calibration
        from optv.parameters import ControlParams, VolumeParams

        write_experiment(
            folder,
            Project(cameras=tuple(CAMERAS), media={"w": WALL}, media_of=("w",) * 4, unit="mm"),
        )
        self.control = ControlParams(4)
        self.control.set_image_size((SENSOR.width, SENSOR.height))
        self.control.set_pixel_size((0.012, 0.012))
        media = self.control.get_multimedia_params()
        media.set_layers(np.array([1.5]), np.array([10.0]))
        media.set_n1(1.0)
        media.set_n3(1.34)
        self.volume = VolumeParams()
        self.volume.set_Zmin_lay([60.0, 60.0])
        self.volume.set_Zmax_lay([240.0, 240.0])
        self.cameras = []
        for camera in CAMERAS:
            made = Calibration()
            base = folder / "cal" / f"{camera.name}.tif"
            made.from_file(f"{base}.ori".encode(), f"{base}.addpar".encode())
            self.cameras.append(made)

    def targets(self, pixels: np.ndarray) -> object:
        """Return pixels as optv's targets, numbered in order."""
        from optv.tracking_framebuf import TargetArray

        found = TargetArray(len(pixels))
        for k, pixel in enumerate(pixels):
            found[k].set_pnr(k)
            found[k].set_pos(tuple(pixel))
        return found


def projection(optv: Optv | None) -> None:
    """1e6 points into one oblique camera."""
    xyz = points(1_000_000)
    camera = CAMERAS[1]
    exact = project(camera, xyz[:2000], WALL)
    theirs = None
    if optv is not None:
        from optv.imgcoord import flat_image_coordinates

        media = optv.control.get_multimedia_params()
        check = flat_image_coordinates(xyz[:2000], optv.cameras[1], media)
        assert np.abs(check - exact).max() < 1e-4  # its iteration stops at 1e-3 mm
        part = np.ascontiguousarray(xyz[:100_000])
        theirs = best(
            lambda: flat_image_coordinates(part, optv.cameras[1], media), len(part), repeats=3
        )
    line("projection, 1e6 points, ns per point",
         best(lambda: project(camera, xyz, WALL), len(xyz)), theirs, "ns", 1e9)  # fmt: skip


def intersection(optv: Optv | None) -> None:
    """1e5 points seen by four cameras."""
    xyz = points(100_000)
    image = np.stack([project(c, xyz, WALL) for c in CAMERAS])
    noisy = image + 0.002 * RNG.standard_normal(image.shape)
    assert np.abs(intersect(CAMERAS, image, WALL).xyz - xyz).max() < 1e-9
    theirs = None
    if optv is not None:
        from optv.orientation import multi_cam_point_positions

        # optv wants distortion-free coordinates, about the principal point, by point and camera.
        flat = np.ascontiguousarray(np.moveaxis(noisy, 0, 1))
        check, _ = multi_cam_point_positions(flat[:2000], optv.control, optv.cameras)
        pairs, _ = intersect_pairs(CAMERAS, noisy[:, :2000], WALL)
        assert np.abs(check - pairs).max() < 1e-6
        theirs = best(
            lambda: multi_cam_point_positions(flat, optv.control, optv.cameras), len(xyz), repeats=3
        )
    for what, work in (
        ("intersection, mean of pairs as optv, us per point", intersect_pairs),
        ("intersection, nearest to rays, us per point", intersect_rays),
    ):
        line(what, best(lambda w=work: w(CAMERAS, noisy, WALL), len(xyz)), theirs, "us", 1e6)
    for what, data in (("exact", image), ("2 um noise", noisy)):
        seconds = best(lambda d=data: intersect(CAMERAS, d, WALL, sigma=0.002), len(xyz), repeats=3)
        line(f"intersection, rigorous, {what}, us per point", seconds, theirs, "us", 1e6)


def resection(optv: Optv | None) -> None:
    """Exterior orientation, start 20 mm and 2 degrees off; then 1000 cameras of 20 points."""
    for count in (20, 50, 200, 20_000):
        xyz = points(count)
        truth = CAMERAS[2]
        image = project(truth, xyz, WALL)
        start = truth.stepped(
            ("X0", "Y0", "Z0", "omega", "phi", "kappa"), (20, -10, 15, 0.03, -0.02, 0.02)
        )
        found = resect(start, xyz, image, WALL)
        assert np.abs(found.camera.centre - truth.centre).max() < 1e-8
        theirs = None
        if optv is not None:
            from optv.calibration import Calibration
            from optv.orientation import full_calibration

            targets = optv.targets(SENSOR.pixel_from_image(image))
            glass = optv.cameras[2].get_glass_vec()

            def work(targets=targets, glass=glass, xyz=xyz, start=start) -> Calibration:  # type: ignore[no-untyped-def]
                made = Calibration(
                    pos=np.array(start.centre), angs=np.array(start.angles),
                    prim_point=np.array([0.0, 0.0, 25.0]), rad_dist=np.zeros(3),
                    decent=np.zeros(2), affine=np.array([1.0, 0.0]), glass=glass,
                )  # fmt: skip
                full_calibration(made, xyz, targets, optv.control, [])
                return made

            assert np.abs(np.array(work().get_pos()) - truth.centre).max() < 1e-3
            theirs = best(work, count, repeats=3)
        plain = patch.object(fitted_pose, "pays", lambda _: False)
        for what, road in (("plain", plain), ("compiled", nullcontext())):
            with road:
                for _ in range(300 if count < 1000 else 1):
                    resect(start, xyz, image, WALL)
                repeats = 50 if count < 1000 else 3
                ours = best(lambda s=start, p=xyz, i=image: resect(s, p, i, WALL), count, repeats)
            line(f"resection, {count} points, {what}, us per point", ours, theirs, "us", 1e6)
    xyz, truth = points(20), [replace(CAMERAS[2], centre=CAMERAS[2].centre + d)
                              for d in RNG.uniform(-20, 20, (1000, 3))]  # fmt: skip
    images = np.stack([project(camera, xyz, WALL) for camera in truth])
    images += 0.002 * RNG.standard_normal(images.shape)
    start = [CAMERAS[2]] * len(truth)
    one = resect(CAMERAS[2], xyz, images[7], WALL).camera.centre
    assert np.abs(resect_many(start, xyz, images, WALL).centre[7] - one).max() < 1e-6
    seconds = best(lambda: resect_many(start, xyz, images, WALL), len(truth))
    line("resections of 20 points, 1000 cameras, us per camera", seconds, None, "us", 1e6)


def epipolar(optv: Optv | None) -> None:
    """Curves with ten vertices, and with the vertices that 0.5 um need."""
    xyz = points(20_000)
    image = project(CAMERAS[1], xyz, WALL)
    first, second = CAMERAS[1], CAMERAS[2]

    def curves(**how: object) -> object:
        return epipolar_curve(first, image, second, WALL, z_range=(60.0, 240.0), **how)  # type: ignore[arg-type]

    theirs = None
    if optv is not None:
        from optv.epipolar import epipolar_curve as optv_curve

        pixels = SENSOR.pixel_from_image(image)

        def work(count: int) -> list[np.ndarray]:
            return [
                optv_curve(p, optv.cameras[1], optv.cameras[2], 10, optv.control, optv.volume)
                for p in pixels[:count]
            ]

        got = np.array(work(3))
        want = SENSOR.pixel_from_image(curves(vertices=10).image[:3])  # type: ignore[attr-defined]
        # The same depths from the other end, to what its projection is good for.
        apart = min(np.abs(got - want).max(), np.abs(got - want[:, ::-1]).max())
        assert apart < 0.05, apart
        theirs = best(lambda: work(1000), 1000, repeats=3)
    line("epipolar curve, 10 vertices, us per curve", best(lambda: curves(vertices=10), len(xyz)),
         theirs, "us", 1e6)  # fmt: skip
    line("epipolar curve, chord error 0.5 um, us per curve", best(curves, len(xyz)), theirs,
         "us", 1e6)  # fmt: skip


def main() -> None:
    """Print all comparisons."""
    with tempfile.TemporaryDirectory() as folder:
        optv = Optv(Path(folder) / "experiment") if find_spec("optv") else None
        for task in (projection, intersection, resection, epipolar):
            task(optv)


if __name__ == "__main__":
    main()
