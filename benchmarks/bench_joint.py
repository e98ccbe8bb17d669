"""Adjust rows of 10, 100 and 1000 overlapping pairs; baseline: the rays projected once.

python benchmarks/bench_joint.py [pairs ...]
"""

from __future__ import annotations

import resource
import sys
import time

import numpy as np

from bifocal.networks.joint_adjustment import adjust_jointly
from photocore.camera.pinhole import project_with_jacobian
from tests.bifocal.orientation.many_pairs import many_pairs


def run(pairs: int) -> None:
    """Time one adjustment, checked against the exact points first."""
    case = many_pairs(pairs, np.random.default_rng(1), control=max(6, pairs // 5))
    start = time.process_time()
    for number, camera in enumerate(case.start.cameras):
        seen = case.observations.point[case.observations.camera == number]
        project_with_jacobian(camera, case.start.xyz[seen])
    base = time.process_time() - start
    start = time.process_time()
    got = adjust_jointly(case.observations, case.start)
    took = time.process_time() - start
    error = np.nanmedian(np.abs(got.xyz - case.truth), axis=0)
    assert (error[:2] < 0.02).all(), error
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{pairs:5} pairs, {12 * pairs:6} unknowns and {len(case.truth):6} points: {took:7.1f} s "
        f"CPU, {took / base:5.0f} times one projection, {memory:5.0f} MB; sigma0 {got.sigma0:.3f}"
    )


if __name__ == "__main__":
    for count in map(int, sys.argv[1:] or (10, 100, 1000)):
        run(count)
