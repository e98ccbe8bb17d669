"""Adjust a block of 50 images and 5000 points; baseline: one projection with derivatives of it.

python benchmarks/bench_bundle.py [images points]
"""

from __future__ import annotations

import resource
import sys
import time
from dataclasses import replace

import numpy as np

from multimedia import (
    FlatInterface,
    ImagePoints,
    Layers,
    ObjectPoints,
    Project,
    Unknowns,
    bundle_adjust,
    project,
    ring_of_cameras,
)
from multimedia.media.projection import project_with_jacobian


def block(images: int, count: int) -> tuple[Project, np.ndarray]:
    """Return a block of cameras on rings over a tank, every camera seeing a third of the points."""
    rng = np.random.default_rng(1)
    tank = FlatInterface(layers=Layers(indices=(1.0, 1.49, 1.3365), thicknesses=(0.008,)))
    points = np.column_stack(
        [
            rng.uniform(-0.5, 0.5, count),
            rng.uniform(-0.4, 0.4, count),
            rng.uniform(-0.3, -0.02, count),
        ]
    )
    cameras = []
    for angle in (0.3, 0.45, 0.6):
        share = images // 3 + (images % 3 if angle == 0.6 else 0)
        cameras += ring_of_cameras(
            share, 1.2, angle, interface=tank, target=np.array([0, 0, -0.15]), principal_distance=20
        )
    cameras = [replace(camera, name=f"c{k}") for k, camera in enumerate(cameras)]
    names, ids, image = [], [], []
    for camera in cameras:
        seen = np.flatnonzero(rng.uniform(size=count) < 0.33)
        names += [camera.name] * len(seen)
        ids += [str(j) for j in seen]
        image.append(project(camera, points[seen], tank) + rng.normal(0, 0.001, (len(seen), 2)))
    control = np.arange(20)
    start = [c.stepped(["X0", "Y0", "Z0"], rng.normal(0, 0.002, 3)) for c in cameras]
    given = Project(
        cameras=tuple(start), media={"tank": tank}, media_of=("tank",) * len(cameras),
        object_points=ObjectPoints(
            ids=tuple(str(j) for j in control), xyz=points[control], sigma=np.zeros((20, 3))
        ),
        image_points=ImagePoints(cameras=tuple(names), ids=tuple(ids), image=np.concatenate(image)),
        sigma_image=0.001,
    )  # fmt: skip
    return given, points


def main() -> None:
    """Build, adjust, check, print."""
    images, count = (int(a) for a in sys.argv[1:3]) if len(sys.argv) > 2 else (50, 5000)
    given, points = block(images, count)
    start = time.process_time()
    result = bundle_adjust(
        given, Unknowns(interior=("c",), shared_interior=True, media=("index3",))
    )
    taken = time.process_time() - start
    assert abs(result.value("index3") - 1.3365) < 5 * result.sigma("index3")
    found = result.project.object_points
    error = found.xyz - points[[int(i) for i in found.ids]]
    start = time.process_time()
    for camera in given.cameras:
        project_with_jacobian(
            camera, points, given.media["tank"], camera_names=("c",), interface_names=("index3",)
        )
    baseline = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    print(
        f"{images} images, {count} points, {len(given.image_points.ids)} image points: "
        f"{taken:.1f} s CPU, {taken / baseline:.0f} x one projection of the block with "
        f"derivatives, {peak:.2f} GiB, {result.iterations} iterations, "
        f"sigma0 {result.sigma0 * 1000:.3f} um, RMS of points {np.sqrt((error**2).mean()):.2g}"
    )


if __name__ == "__main__":
    main()
