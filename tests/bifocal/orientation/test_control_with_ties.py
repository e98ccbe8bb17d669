"""Control points with common points of the photos: never worse than control points alone."""

import numpy as np
import pytest

from bifocal import Control, Interior, Pinhole, SiteMeasures
from bifocal.orientation.adjustment.pair_observations import PairObservations, PairUnknowns
from bifocal.orientation.orientation_stages import (
    OrientedPair,
    PhotoInput,
    control_alone,
    oriented_in_stages,
)
from photocore.camera.pinhole import triangulate
from tests.scenes import SetupErrors, bifocal_cameras

SIZE = (3072, 2048)
#: Six points on the wall, three off it. [m]
KNOWN = np.array(
    [[-4, -2.5, 0], [4, -2.5, 0], [4, 2.5, 0], [-4, 2.5, 0], [0, -2, 0], [0.3, 2.2, 0],
     [-2, 1, 0.5], [2, -1, -0.5], [1.5, 1.5, 0.4]],
)  # fmt: skip


def rough_wall(rng: np.random.Generator, *, face: float) -> np.ndarray:
    """Return details of a wall that waves by 6 mm, at so much before Z = 0, and of its relief."""
    xyz = np.column_stack([rng.uniform(-5, 5, 1200), rng.uniform(-3, 3, 1200), np.zeros(1200)])
    start = rng.uniform(0, 6, 2)
    x, y = xyz[:800, :2].T
    wave = 0.006 * np.sin(2 * x + start[0]) * np.cos(1.7 * y + start[1])
    xyz[:800, 2] = face + wave + rng.normal(0, 0.003, 800)
    xyz[800:, 2] = rng.uniform(-0.6, 0.6, 400)
    return xyz


def oriented(seed: int, *, noise: float = 1.0, face: float = 0.0) -> tuple[OrientedPair, float]:
    """Return the pair from control and ties, and its RMS of relief over that of control alone.

    Lens, picks and coordinates are as precise as they are said to be, times ``noise``; the ties
    are off by 0.1 px each and by a smooth field of as much. Without noise control alone is exact:
    then the RMS itself. [m]
    """
    rng = np.random.default_rng(seed)
    made = bifocal_cameras(size=SIZE, errors=SetupErrors(), rng=rng)
    true = [Pinhole(c.matrix, c.rotation, c.centre) for c in (made.far, made.near)]
    xyz = rough_wall(rng, face=face)
    ties = [c.view_of(xyz) + rng.normal(0, 0.1, (1200, 2)) for c in (made.far, made.near)]
    ties[1] += 0.1 * noise * np.sin(ties[0] / 400 + rng.uniform(0, 6, 2))
    known = KNOWN + rng.uniform(-0.4, 0.4, KNOWN.shape) * [1, 1, 0]
    picks = [c.view_of(known) + noise * rng.normal(0, 0.4, (9, 2)) for c in (made.far, made.near)]
    control = Control(
        ids=tuple("abcdefghi"), xyz=known + noise * rng.normal(0, 0.003, (9, 3)),
        sigma=np.full((9, 3), 0.003), pixels1=picks[0], pixels2=picks[1],
    )  # fmt: skip
    lenses = [
        Interior(
            focal=c.matrix[0, 0] * np.exp(noise * rng.normal(0, 5e-4)), sigma_focal=5e-4,
            centre=c.matrix[:2, 2] + noise * rng.normal(0, 5, 2), sigma_centre=5.0,
            image_size=SIZE, source="known",
        )
        for c in true
    ]  # fmt: skip
    observations = PairObservations(
        interiors=(lenses[0], lenses[1]), control=control, pick_used=np.ones(9, dtype=bool),
        sigma_pick=0.4, tie1=ties[0], tie2=ties[1], sigma_tie=0.1,
        tie_used=np.ones(1200, dtype=bool), wall=np.zeros(1200, dtype=bool),
        wall_rows=np.zeros((3, 1200)),
    )  # fmt: skip
    start = PairUnknowns(cameras=(true[0], true[1]))
    photos = [PhotoInput(grey=None, interior=lens, name="photo") for lens in lenses]
    pair = oriented_in_stages(
        observations, start, (photos[0], photos[1]), SiteMeasures(), with_control=True
    )
    points = rng.uniform(-1, 1, (300, 3)) * [5, 3, 0.6]
    seen = [c.view_of(points) for c in (made.far, made.near)]
    both = [
        float(np.sqrt(np.mean((triangulate(*p.adjusted.cameras, *seen) - points)[:, 2] ** 2)))
        for p in (pair, control_alone(observations, start, named=False))
    ]
    return pair, both[0] / both[1] if noise else both[0]


@pytest.mark.parametrize("seed", range(2))
def test_common_points_make_control_points_better(seed: int) -> None:
    # Twenty draws: 0.13 to 0.42 of control alone.
    assert oriented(seed)[1] < 0.8


@pytest.mark.parametrize("face", [-0.05, 0.04])
def test_a_face_that_is_not_the_control_points_plane_does_not_overrule_them(face: float) -> None:
    pair, share = oriented(5, face=face)
    assert share < 1.0
    assert any("lie on another plane" in text for text in pair.remarks)


def test_exact_control_stays_within_what_a_rough_wall_leaves() -> None:
    # Six points said to be good to 3 mm share the plane with a wall of 6 mm: 0.4 to 1.3 mm.
    assert oriented(2, noise=0.0)[1] < 0.0013
