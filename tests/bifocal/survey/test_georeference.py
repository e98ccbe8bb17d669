"""World coordinates of a wall, one bad control point, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bifocal import GeometryError, InputError, KnownPoints, ReliefTable, georeference
from bifocal.survey.observations import PointObservations
from bifocal.survey.remarks import angle_remarks, georeference_remarks

RNG = np.random.default_rng(8)
XYZ = np.column_stack([RNG.uniform(-5, 5, 12), RNG.uniform(-3, 3, 12), RNG.uniform(-1, 1, 12)])
IDS = tuple(f"P{i}" for i in range(12))
UTM = np.array([351234.0, 4123456.0, 33.0])
TURN = np.array([[np.cos(0.3), 0, np.sin(0.3)], [np.sin(0.3), 0, -np.cos(0.3)], [0, 1, 0]])


def table():
    columns = {axis: XYZ[:, i] for i, axis in enumerate("XYZ")}
    return ReliefTable(
        ids=IDS, columns=columns, flags=("OK",) * 12, standardised=np.zeros(12), of_pixels={},
        image_scale=500.0,
    )  # fmt: skip


def control(world, rows):
    return KnownPoints(ids=tuple(IDS[i] for i in rows), xyz=world[list(rows)])


def levelled(noise=0.0):
    return UTM + 1.0001 * XYZ @ TURN.T + np.random.default_rng(1).normal(0, noise, XYZ.shape)


def test_every_point_gets_its_world_coordinates():
    found = georeference(table(), control(levelled(), range(4)))
    assert found.model == "levelled"
    assert found.world_from_wall(XYZ) == pytest.approx(levelled(), abs=1e-8)
    assert found.redundancy == 7


def test_sigma0_is_that_of_the_noise():
    found = georeference(table(), control(levelled(0.02), range(12)))
    assert found.sigma0 == pytest.approx(0.02, rel=0.3)
    assert found.residuals.mean(axis=0) == pytest.approx(0, abs=1e-9)


def test_sigma0_of_points_without_height_counts_two_equations_each():
    # Corners of a square moved in X in turn by +-5 mm: no shift, turn or scale takes that up.
    # By hand: 8 equations, 4 unknowns, sigma0 = sqrt(4 * 5^2 / 4) = 5 mm.
    square = np.array([[1.0, 1, 0.2], [-1, 1, 0.2], [-1, -1, 0.2], [1, -1, 0.2]])
    world = UTM + square + [[0.005, 0, 0], [-0.005, 0, 0], [0.005, 0, 0], [-0.005, 0, 0]]
    world[:, 2] = np.nan
    found = georeference(
        KnownPoints(ids=IDS[:4], xyz=square), KnownPoints(ids=IDS[:4], xyz=world), model="2D"
    )
    assert found.redundancy == 4
    assert found.sigma0 == pytest.approx(0.005, rel=1e-6)


@pytest.mark.parametrize("count", [4, 5, 12])
def test_one_bad_point_is_found_and_left_out(count):
    world = levelled(0.005)
    world[2] += [0.4, 0.0, 0.3]
    found = georeference(table(), control(world, range(count)))
    assert found.bad == ("P2",)
    assert found.sigma0 < 0.02
    assert found.world_from_wall(XYZ) == pytest.approx(levelled(), abs=0.02)
    assert found.residuals[2, 0] == pytest.approx(0.4, abs=0.03)


def test_good_points_are_never_thrown_out_more_than_chance_allows():
    thrown = 0
    for seed in range(60):
        world = UTM + XYZ @ TURN.T + np.random.default_rng(seed).normal(0, 0.01, XYZ.shape)
        thrown += len(georeference(table(), control(world, range(8))).bad)
    assert thrown <= 4


def test_a_wall_that_leans_is_given_seven_parameters():
    rotation = Rotation.from_euler("xyz", [0.3, 0.5, 1.2]).as_matrix()
    world = UTM + 0.98 * XYZ @ rotation.T
    world += np.random.default_rng(3).normal(0, 0.003, world.shape)
    found = georeference(table(), control(world, range(7)))
    assert found.model == "3D"
    assert found.world_from_wall.scale == pytest.approx(0.98, abs=2e-3)


def test_noise_alone_is_no_reason_for_more_parameters():
    assert georeference(table(), control(levelled(0.01), range(8))).model == "levelled"


def test_without_heights_the_plan_is_fitted():
    world = np.column_stack([XYZ[:, :2] * 2.0 + [100, 200], np.full(12, np.nan)])
    found = georeference(table(), control(world, range(5)))
    assert found.model == "2D"
    assert found.world_from_wall(XYZ)[:, :2] == pytest.approx(world[:, :2], abs=1e-9)
    assert np.isnan(found.residuals[:, 2]).all()


def test_too_few_points_are_refused_with_the_number_needed():
    with pytest.raises(GeometryError, match=r"1 usable control point.*at least 2"):
        georeference(table(), control(levelled(), [0]))
    with pytest.raises(GeometryError, match="3D needs at least 3"):
        georeference(table(), control(levelled(), [0, 1]), model="3D")


def test_names_that_were_not_measured_are_said():
    known = KnownPoints(ids=("P0", "TOWER"), xyz=levelled()[:2])
    with pytest.raises(GeometryError, match="Not among the measured points: TOWER"):
        georeference(table(), known)


def test_unknown_model_is_refused():
    with pytest.raises(InputError, match="affine"):
        georeference(table(), control(levelled(), range(4)), model="affine")


def rotation_of(model):
    if model == "2D":
        return Rotation.from_euler("z", 0.7).as_matrix()
    return TURN if model == "levelled" else Rotation.from_euler("xyz", [0.3, 0.5, 1.2]).as_matrix()


@pytest.mark.parametrize("model", ["2D", "levelled", "3D"])
def test_sigmas_of_placed_points_count_the_picks_and_the_transformation(model):
    # Covariances as far from round as those of a bifocal pair: radius and relief go together.
    rng = np.random.default_rng(11)
    shape = rng.normal(0, 1, (12, 3, 3)) * np.array([0.002, 0.003, 0.01])[:, None]
    own = shape @ shape.transpose(0, 2, 1) + 1e-6 * np.eye(3)
    draw = np.linalg.cholesky(own)
    world = UTM * [1, 1, model != "2D"] + 1.3 * XYZ @ rotation_of(model).T
    known = control(world if model != "2D" else world * [1, 1, np.nan], range(5))
    standard = []
    for _ in range(100):
        seen = XYZ + np.einsum("nij,nj->ni", draw, rng.normal(0, 1, (12, 3)))
        columns = {"id": IDS, **dict(zip("XYZ", seen.T, strict=True))}
        found = georeference(columns, known, model=model, covariance=own)
        if not found.bad:
            stated = found.covariance_of(seen, own, ids=IDS)
            sigma = np.sqrt(np.diagonal(stated, axis1=1, axis2=2))
            standard.append((found.world_from_wall(seen) - world) / sigma)
    ratio = np.sqrt((np.array(standard) ** 2).mean(axis=(0, 2)))
    # 100 draws give one ratio to 4 %; the five control points share their error with the fit.
    assert np.sqrt((ratio[:5] ** 2).mean()) == pytest.approx(1.0, abs=0.09)
    assert np.sqrt((ratio[5:] ** 2).mean()) == pytest.approx(1.0, abs=0.09)


def test_points_weighing_alike_are_as_good_as_the_residuals_say():
    found = georeference(table(), control(levelled(0.02), range(12)))
    # By hand: a shift in E, N, H from twelve points is good to sigma0 / sqrt(12) at their centre.
    assert found.precision is not None
    centre = found.precision.of_points(found.near.mean(axis=0)[None])[0]
    expected = found.sigma0 / np.sqrt(12)
    assert np.sqrt(np.diagonal(centre)) == pytest.approx([expected] * 3, rel=0.01)


def test_east_and_north_exchanged_are_named():
    right = levelled(0.001)
    for world, expected in ((right[:, [1, 0, 2]], True), (right, False)):
        typed = control(world, range(8))
        placed = georeference(table(), typed)
        said = georeference_remarks(placed, typed, table(), is_auto=True)
        assert any("fit with E and N exchanged" in words for words in said) == expected


@pytest.mark.parametrize(("factor", "word"), [(np.pi / 180, "radians"), (1 / 0.9, "gon"), (1, "")])
def test_angles_in_another_unit_are_said(factor, word):
    theta = np.array([12.0, 71.0, 140.0, 188.0, 240.0, 301.0, 355.0])
    points = {"id": list("ABCDEFG"), "s1": [5.0] * 7, "s2": [5.2] * 7, "theta": theta * factor}
    said = angle_remarks(PointObservations.from_columns(points))
    assert bool(said) == bool(word)
    assert word in "".join(said)
