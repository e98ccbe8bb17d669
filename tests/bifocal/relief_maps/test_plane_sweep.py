"""A plane sweep finds bars that are narrower than their own parallax."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from bifocal import Foot, Grid, MapSurface, dense_relief
from bifocal.model.image import as_grey
from bifocal.orthophotos.visibility import hidden_from
from bifocal.relief_maps import plane_sweep, second_hypothesis
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import make_frame
from bifocal.relief_maps.second_hypothesis import HYPOTHESIS
from bifocal.relief_maps.smoothing import straightened
from tests.scenes import RICH, CameraPair, Rendering, Scene, bifocal_cameras, render
from tests.scenes.balconies import balconies


def corner(scene: Scene, middle: tuple[float, float], size: tuple[int, int]) -> Rendering:
    """Return a pair of which only a window about a place of the wall is photographed."""
    whole = bifocal_cameras(size=size)
    cameras = []
    for camera in (whole.far, whole.near):
        matrix = camera.matrix.copy()
        matrix[:2, 2] += np.array([-middle[0], middle[1]]) * matrix[0, 0] / camera.centre[2]
        cameras.append(replace(camera, matrix=matrix))
    pair = CameraPair(
        far=cameras[0], near=cameras[1], nominal_far=cameras[0], nominal_near=cameras[1]
    )
    return render(scene, pair, rng=np.random.default_rng(1))


@cache
def railing() -> tuple[Rendering, np.ndarray]:
    """Return a pair of the corner of a balcony, and where its railing stands on the map."""
    shot = corner(balconies(seed=1104, palette=RICH), (-3.9, 0.3), (440, 320))
    truth = shot.truth.r
    body = cv2.morphologyEx(truth, cv2.MORPH_OPEN, np.ones((23, 23), np.uint8))
    return shot, shot.visible1 & shot.visible2 & (truth - body > 0.3)


@pytest.mark.acceptance
def test_a_railing_is_found_that_flow_cannot_find(monkeypatch):
    anywhere = replace(HYPOTHESIS, least_valid=0.0)  # there is little else in the picture
    monkeypatch.setattr(second_hypothesis, "HYPOTHESIS", anywhere)
    shot, rail = railing()
    grid = shot.truth.grid
    found = dense_relief(shot.pair, shot.image1, shot.image2, gsd=grid.gsd, bounds=grid.bounds)
    right = np.abs(found.r - shot.truth.r) < 0.05
    assert rail.mean() > 0.05
    assert right[rail].mean() > 0.35  # flow alone finds nothing of it
    assert right[(shot.visible1 & shot.visible2 & ~rail)].mean() > 0.9  # flow alone 0.82


@pytest.mark.acceptance  # compiles
def test_numpy_and_machine_code_give_the_same_bits(monkeypatch):
    shot, _ = railing()
    greys = (as_grey(image, "photo") for image in (shot.image1, shot.image2))
    frame = make_frame(shot.pair, *greys, shot.truth.grid)
    box = slice(60, 100), slice(20, 75)
    tried = plane_sweep.Hypotheses.near(frame, box, np.repeat(np.float32([-0.2, 0, 1.0]), 20))
    assert (np.diff(tried.numbers) > 1).any()  # relief jumps over what is left out
    found = []
    for compiled in (True, False):
        monkeypatch.setattr(type(plane_sweep._compare), "pays", lambda *_, way=compiled: way)
        found.append(plane_sweep.swept(frame, box, tried))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_straightening_keeps_a_bar_and_leaves_unknown_what_is():
    r = np.full((60, 60), -0.5, np.float32)
    r[:, 20:25] = 0.5
    r[:, 40:44] = np.nan
    straight = straightened(MapBands(r, np.full_like(r, 0.01), np.ones(r.shape, np.uint8))).r
    np.testing.assert_array_equal(straight[5:-5], r[5:-5])


def test_a_rail_hides_by_its_face_where_the_wall_behind_it_is_measured():
    grid = Grid.from_bounds((1.0, -0.2, 3.0, 0.2), gsd=0.004)
    rail = np.abs(grid.columns_x - 2.0) < 0.011
    r = np.where(rail, 1.0, 0.0) * np.ones((grid.height, 1))
    camera = Foot(np.array([0.0, 0.0]), 10.0)
    for measured in (True, False):
        flags = np.full(grid.shape, measured)
        surface = MapSurface.of_array(r.astype(np.float32), grid, flags)
        hidden = hidden_from(surface, grid, camera, r.astype(np.float32))[50]
        face = np.abs(grid.columns_x - 2.0 / 0.9) < 0.008  # Eq. (1): seen at 2 d / (d - r)
        below = (grid.columns_x > 2.03) & (grid.columns_x < 2.19)
        assert hidden[face].all()
        assert hidden[below].all() != measured
        assert hidden[below].any() != measured
