"""Which of several planes of different directions is the wall."""

import numpy as np
import pytest

from bifocal import SiteMeasures
from bifocal.orientation.walls.wall_planes import (
    likely_wall,
    planes_of_any_direction,
    steep_rivals_in_words,
)

CENTRES = (np.array([0.0, 0.0, 27.0]), np.array([1.0, -1.0, 17.0]))
#: The plane turned by 15 degrees, z = 1 + 0.268 x: distances by hand, (z - 1 - 0.268 x) cos 15.
TURNED = ((27 - 1) * 0.96593, (17 - 1 - 0.268) * 0.96593)


def scene(turned: int, present: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points of the turned plane, of z = 0 and of nothing, and their pixels."""
    rng = np.random.default_rng(3)
    count = turned + present + 150
    xyz = np.column_stack([rng.uniform(-7, 7, (count, 2)), np.zeros(count)])
    xyz[:turned, 2] = 1.0 + 0.268 * xyz[:turned, 0]
    xyz[-150:, 2] = rng.uniform(-5, 5, 150)
    xyz[:, 2] += rng.normal(0, 0.03, count)
    xyz[:turned, 1] += 14.0  # in the upper part of the photo
    return xyz, np.column_stack([1500 + 100 * xyz[:, 0], 1000 - 100 * xyz[:, 1]])


def chosen(turned: int, present: int, site: SiteMeasures, sigma: float = 0.004):
    xyz, pixels = scene(turned, present)
    planes = planes_of_any_direction(xyz, np.ones(len(xyz)), CENTRES)
    wall = likely_wall(planes, pixels, CENTRES, site, sigma_ratio=sigma)
    return wall, steep_rivals_in_words(planes, wall, pixels, site)


def test_the_fullest_plane_is_taken_and_its_rivals_are_asked_for() -> None:
    wall, question = chosen(600, 380, SiteMeasures(distance1=27.0))
    assert wall.slope == pytest.approx(0.268, abs=0.01)
    assert wall.distance(CENTRES[0]) == pytest.approx(TURNED[0], abs=0.05)
    assert wall.distance(CENTRES[1]) == pytest.approx(TURNED[1], abs=0.05)
    assert "turned by 15°" in question
    assert "--wall" in question
    clear, question = chosen(600, 100, SiteMeasures(distance1=27.0))
    assert clear.slope > 0.2
    assert question == ""


def test_the_present_plane_stays_unless_another_is_clearly_fuller() -> None:
    wall, question = chosen(400, 350, SiteMeasures(distance1=27.0))
    assert wall.slope < 0.02
    assert "turned by 15°" in question


def test_the_measured_distances_choose_the_plane() -> None:
    present = SiteMeasures(distance1=27.0, distance2=17.0)
    wall, question = chosen(600, 250, present)
    assert wall.slope < 0.02
    assert question == ""
    turned = SiteMeasures(distance1=TURNED[0], distance2=TURNED[1])
    assert chosen(250, 350, turned)[0].slope == pytest.approx(0.268, abs=0.01)


def test_a_chance_plane_of_the_right_ratio_does_not_replace_a_full_wall() -> None:
    # The wall is 2.5 of the rough model's standard deviations off the ratio of the distances.
    turned = SiteMeasures(distance1=TURNED[0], distance2=TURNED[1])
    assert chosen(250, 700, turned, sigma=0.016)[0].slope < 0.02
    assert chosen(250, 700, turned, sigma=0.008)[0].slope > 0.2


def test_a_spot_of_the_wall_chooses_the_plane() -> None:
    wall, question = chosen(300, 500, SiteMeasures(distance1=27.0, wall=(1500.0, -400.0)))
    assert wall.slope == pytest.approx(0.268, abs=0.01)
    assert question == ""
    assert chosen(600, 300, SiteMeasures(wall=(1500.0, 1000.0)))[0].slope < 0.02


def test_too_few_points_are_no_plane() -> None:
    planes = planes_of_any_direction(np.zeros((5, 3)), np.ones(5), CENTRES)
    assert planes == []
    assert likely_wall(planes, np.zeros((5, 2)), CENTRES, SiteMeasures(), sigma_ratio=0.1) is None
