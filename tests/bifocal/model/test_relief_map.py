"""Relief maps: where their pixels are, how they are sampled, what they refuse."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import Grid, InputError, Quality, ReliefMap

GRID = Grid.from_bounds((0.0, 0.0, 4.0, 3.0), gsd=1.0).plane_from_pixel


def slope() -> ReliefMap:
    """Return a map whose relief is X/10 + Y/100: pixel centres at half metres."""
    x, y = np.meshgrid([0.5, 1.5, 2.5, 3.5], [2.5, 1.5, 0.5])
    return ReliefMap.from_relief(x / 10 + y / 100, plane_from_pixel=GRID)


def test_sampling_a_slope_is_exact_between_pixel_centres():
    places = np.array([[0.5, 2.5], [1.0, 2.0], [3.49, 0.51], [2.2, 1.7]])
    wanted = places[:, 0] / 10 + places[:, 1] / 100
    np.testing.assert_allclose(slope().sample(places), wanted, atol=1e-7)


def test_sampling_outside_the_map_is_nan_and_unknown():
    places = [[-0.1, 1.0], [4.1, 1.0], [2.0, 3.1], [np.nan, 1.0]]
    assert np.isnan(slope().sample(places)).all()
    assert (slope().sample_quality(places) == Quality.UNKNOWN).all()


def test_beside_an_unknown_pixel_the_nearest_known_one_counts():
    r = slope().r.copy()
    r[0, 1] = np.nan
    holed = ReliefMap.from_relief(r, plane_from_pixel=GRID)
    assert holed.sample([0.7, 2.4]) == pytest.approx(0.075)
    assert np.isnan(holed.sample([1.4, 2.4]))
    assert holed.quality[0, 1] == Quality.UNKNOWN
    assert holed.quality[0, 0] == Quality.MEASURED
    assert holed.sample_quality([[1.4, 2.4], [0.7, 2.4]]).tolist() == [
        Quality.UNKNOWN,
        Quality.MEASURED,
    ]


def test_a_map_of_one_pixel_can_be_sampled():
    one = ReliefMap.from_relief([[0.25]], plane_from_pixel=GRID)
    assert float(one.sample([0.9, 2.1])) == 0.25


def test_arrays_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        slope().r[0, 0] = 1.0


def test_bands_of_different_shape_are_refused():
    flat = slope()
    with pytest.raises(InputError, match=r"sigma: shape \(2, 2\) differs"):
        ReliefMap(r=flat.r, sigma=np.zeros((2, 2)), quality=flat.quality, plane_from_pixel=GRID)


def test_turned_pixels_are_refused():
    turned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(InputError, match="not square"):
        ReliefMap.from_relief(np.zeros((2, 2)), plane_from_pixel=turned)
