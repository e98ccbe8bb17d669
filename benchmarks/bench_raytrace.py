"""Ray tracing: time per ray and miss at the point, beside the radial shift where planes allow it.

Run: python benchmarks/bench_raytrace.py [POINTS]

Lengths in mm. One core, CPU time. The miss is the distance of the object point from the ray that is
traced forward again from the camera; it is checked before the time is printed.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = "1"

import sys
import time

import numpy as np

import multimedia as mm

LAYERS = mm.Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,))


def wave_raster() -> mm.RasterSurface:
    axis = np.arange(-400.0, 405.0, 5.0)
    grid = np.stack(np.meshgrid(axis, axis[::-1]), axis=-1)
    wave = mm.WaveSurface.sinusoid(0.0, amplitude=2.0, wavelength=100.0, direction=0.3)
    return mm.RasterSurface(
        raster=wave.height_at(grid), xy_from_cell=[[5, 0, axis[0]], [0, -5, axis[-1]]]
    )


def scenes():
    """Yield name, interfaces, camera, low and high corner of the points."""
    box = ([-150, -150, -200], [150, 150, -5])
    yield "parallel planes", mm.Interfaces.parallel(LAYERS), [0, 0, 510], *box
    tilted = mm.Interfaces.parallel(LAYERS, normal=[0.2, 0.1, 1])
    yield "tilted planes", tilted, [0, 0, 510], [-150, -150, -300], [150, 150, -60]
    dome = tuple(mm.Sphere(centre=[1, 2, 3], radius=r) for r in (50.0, 57.0))
    dome_port = mm.Interfaces(surfaces=dome, indices=(1, 1.49, 1.34))
    yield "dome port", dome_port, [0, 0, 0], [100, 100, 100], [900, 900, 900]
    tube = tuple(mm.Cylinder(point=[0, 0, 0], axis=[0, 1, 0], radius=r) for r in (60.0, 50.0))
    window = (mm.Plane.level(100.0), mm.Plane.level(90.0))
    engine = mm.Interfaces(surfaces=window + tube, indices=(1, 1.5, 1.34, 1.5, 1))
    yield "plane + cylinder", engine, [0, 0, 510], [-30, -30, -30], [30, 30, 30]
    waves = mm.Interfaces(surfaces=(wave_raster(),), indices=(1, 1.34))
    yield "raster of waves", waves, [0, 0, 510], *box


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    rng = np.random.default_rng(1)
    print(f"{count} points   scene               inverse      forward    miss")
    for name, interfaces, centre, low, high in scenes():
        points = rng.uniform(low, high, (count, 3))
        start = time.process_time()
        found = mm.aim_rays(centre, points, interfaces)
        middle = time.process_time()
        traced = mm.trace_rays(centre, found.directions[:, 0], interfaces)
        end = time.process_time()
        gap = np.cross(points - traced.vertices[:, -1], traced.directions[:, -1])
        miss = np.linalg.norm(gap, axis=-1).max()
        assert (found.status == 0).all()
        assert miss < 1e-10
        per = 1e6 / count
        inverse, forward = per * (middle - start), per * (end - middle)
        print(f"{'':16s}{name:18s} {inverse:7.2f} us {forward:9.2f} us  {miss:.1e} mm")
        if name == "parallel planes":
            radius = np.hypot(points[:, 0], points[:, 1])
            start = time.process_time()
            shift = mm.radial_shift(radius, z0=500.0, zp=-points[:, 2], layers=LAYERS)
            seconds = time.process_time() - start
            heading = found.directions[:, 0]
            traced_shift = (510 - points[:, 2]) * np.hypot(*heading[:, :2].T) / -heading[:, 2]
            worst = np.abs(traced_shift / shift - 1).max()
            assert worst < 1e-12
            print(f"{'':16s}{'(radial shift)':18s} {per * seconds:7.2f} us, agrees to {worst:.1e}")


if __name__ == "__main__":
    main()
