"""Dense relief against OpenCV's own optical flow on the same photos, in the same run.

    python benchmarks/bench_relief.py [--large]

CPU seconds of ``bifocal.dense_relief`` (all of it: first relief, flow there and back, edges, noise,
map) over those of cv2's DIS "medium" run to full resolution once, on a rendered pair of 6 MP;
with ``--large`` also of 24 MP. The relief is checked against the exact truth first.
"""

from __future__ import annotations

import sys
import time

import cv2
import numpy as np

from bifocal import Quality, dense_relief
from tests.scenes import bifocal_cameras, facade, render


def cpu(job):
    """Return CPU seconds of a job and its result."""
    start = time.process_time()
    result = job()
    return time.process_time() - start, result


def peak_gib() -> float:
    """Return the greatest memory of this process so far; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def flow_to_full_resolution(image1, image2):
    """Run the yardstick: OpenCV's DIS, medium, finest scale 0, forward only."""
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow.setFinestScale(0)
    grey = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in (image1, image2)]
    return flow.calc(*grey, None)


def bench(size: tuple[int, int], pixel: float, qualities: tuple[str, ...]) -> None:
    """Render a pair, check the relief, print times and errors."""
    cameras = bifocal_cameras(size=size, pixel=pixel)
    scene = facade(seed=31, texel=pixel / 1.5)
    shot = render(scene, cameras, rng=np.random.default_rng(31))
    both = shot.visible1 & shot.visible2
    truth = shot.truth.r
    image1, image2, pair = shot.image1, shot.image2, shot.pair
    del shot
    print(f"\n{size[0]} x {size[1]} px ({size[0] * size[1] / 1e6:.1f} MP)")
    yardstick, _ = cpu(lambda: flow_to_full_resolution(image1, image2))
    before = peak_gib()
    print(f"  cv2 DIS to full resolution     {yardstick:6.1f} CPU s")
    for quality in qualities:
        seconds, found = cpu(lambda q=quality: dense_relief(pair, image1, image2, quality=q))
        error = np.abs(found.r - truth)[both]
        assert np.nanmedian(error) < 0.005, "the relief is wrong: no time is quoted"
        good = both & (found.quality == Quality.MEASURED)
        print(
            f"  dense_relief {quality:8s}          {seconds:6.1f} CPU s"
            f" = {seconds / yardstick:.2f} x yardstick, peak {peak_gib():.2f} GiB"
            f" (before: {before:.2f}); median {1e3 * np.nanmedian(error):.2f} mm,"
            f" {100 * np.mean(~(error <= 0.03)):.2f} % beyond 3 cm,"
            f" {100 * good.sum() / both.sum():.1f} % measured"
        )


if __name__ == "__main__":
    bench((3072, 2048), 0.00369, ("standard", "fast"))
    if "--large" in sys.argv[1:]:
        bench((6000, 4000), 0.00189, ("standard",))
