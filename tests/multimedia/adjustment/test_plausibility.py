"""What an adjustment may claim: media that exist, unknowns told apart, sigmas with model error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimedia import (
    Adjustment,
    FlatInterface,
    GeometryError,
    ImagePoints,
    Layers,
    Project,
    Unknowns,
    bundle_adjust,
)
from tests.multimedia.adjustment.test_bundle import (
    GLASS,
    INDICES,
    INNER,
    POSES,
    a_project,
    snell_image,
)


def with_start(given: Project, *, index: float = 1.33, glass: float = GLASS) -> Project:
    """Return a project whose media start from other values than the truth."""
    layers = Layers(indices=(1.0, 1.49, index), thicknesses=(glass,))
    return replace(given, media={"tank": FlatInterface(layers=layers)})


def flat_control() -> np.ndarray:
    """Return control points in one plane parallel to the glass: they carry no index."""
    grid = np.mgrid[-60:61:20, -60:61:20].reshape(2, -1).T
    return np.column_stack([grid, np.full(len(grid), -80.0)])


def two_planes() -> np.ndarray:
    """Return the same and as many points 70 mm deeper, between them."""
    return np.concatenate([flat_control(), flat_control() + np.array([7.0, 5.0, -70.0])])


def remark(result: Adjustment, words: str) -> str:
    """Return the one remark with these words."""
    (found,) = (line for line in result.remarks if words in line)
    return found


def test_an_index_that_the_medium_cannot_have_is_refused_with_its_reason():
    oil = with_start(a_project(noise=0.001), index=1.25)
    with pytest.raises(GeometryError, match=r"index3 comes out as 1\.33.*1\.25 was given"):
        bundle_adjust(oil, Unknowns(interior=INNER, media=("index3",)))
    free = bundle_adjust(
        oil, Unknowns(interior=INNER, media=("index3",), priors={"index3": np.inf})
    )
    assert abs(free.value("index3") - INDICES[2]) < 4 * free.sigma("index3")


def test_glass_of_another_thickness_is_refused():
    thin = with_start(a_project(noise=0.0001), glass=GLASS / 4, index=INDICES[2])
    with pytest.raises(GeometryError, match=r"thickness1 comes out as .* mm, 2 mm was given"):
        bundle_adjust(thin, Unknowns(media=("thickness1",)))


def test_flat_control_leaves_the_index_to_its_typical_prior():
    flat = with_start(a_project(noise=0.001, points=flat_control()))
    wanted = Unknowns(interior=("c",), media=("index3",), typical_priors=True)
    result = bundle_adjust(flat, wanted)
    assert abs(result.value("index3") - 1.33) < 0.005
    assert result.sigma("index3") == pytest.approx(0.005, rel=0.1)
    assert "rests on what was given, 1.33 ± 0.005" in remark(result, "hardly carry")


def test_a_prior_weighs_the_same_however_good_the_image_was_called():
    flat = with_start(a_project(noise=0.002, points=flat_control()))
    wanted = Unknowns(interior=("c",), media=("index3",), typical_priors=True)
    honest = bundle_adjust(replace(flat, sigma_image=0.002), wanted)
    boast = bundle_adjust(replace(flat, sigma_image=0.0002), wanted)
    assert boast.value("index3") == pytest.approx(honest.value("index3"), abs=5e-4)
    assert boast.sigma("index3") == pytest.approx(honest.sigma("index3"), rel=0.1)
    assert boast.sigma0 == pytest.approx(honest.sigma0, rel=0.05)


def test_a_gross_error_beside_robust_weights_leaves_a_prior_its_sigma():
    flat = with_start(a_project(noise=0.001, points=flat_control()))
    image = flat.image_points.image.copy()
    image[10] += 0.5
    bad = replace(flat, image_points=replace(flat.image_points, image=image))
    wanted = Unknowns(interior=("c",), media=("index3",), typical_priors=True, robust=2.0)
    result = bundle_adjust(bad, wanted)
    assert result.sigma("index3") == pytest.approx(0.005, rel=0.1)
    assert "point 10 in camera cam0" in result.suspects()[0]


def test_a_prior_of_c_is_that_of_every_camera():
    given = a_project(noise=0.001)
    every = bundle_adjust(given, Unknowns(interior=("c",), priors={"c": 1e-4}))
    named = {f"cam{k}:c": 1e-4 for k in range(4)}
    single = bundle_adjust(given, Unknowns(interior=("c",), priors=named))
    np.testing.assert_array_equal(every.values, single.values)


@pytest.mark.parametrize("turned", [False, True])
def test_a_prior_of_one_camera_counts_more_than_that_of_all(turned):
    said = [("c", 1e-6), ("cam0:c", np.inf)]
    priors = dict(reversed(said) if turned else said)
    result = bundle_adjust(a_project(noise=0.001), Unknowns(interior=("c",), priors=priors))
    assert result.sigma("cam0:c") > 1e-3
    assert result.sigma("cam1:c") < 1e-4


def test_unknowns_that_can_hardly_be_told_apart_are_named_with_a_remedy():
    flat = with_start(a_project(noise=0.001, points=flat_control()), index=INDICES[2])
    result = bundle_adjust(flat, Unknowns(interior=("c",)))
    lines = [line for line in result.remarks if "hardly be told apart" in line]
    assert any(":Z0 and" in line and ":c can" in line and "more depths" in line for line in lines)
    deep = bundle_adjust(with_start(a_project(noise=0.001), index=INDICES[2]), Unknowns())
    assert not any("told apart" in line for line in deep.remarks)


def test_lens_terms_that_the_geometry_does_not_carry_are_named():
    given = with_start(a_project(noise=0.001), index=INDICES[2])
    result = bundle_adjust(given, Unknowns(interior=(*INNER, "p1", "p2")))
    assert "cam0, cam1" in remark(result, "p1 is not significant")
    assert not any("k1 is not significant" in line for line in result.remarks)


def test_auto_takes_the_parameters_that_made_the_photos():
    given = with_start(a_project(noise=0.0005), index=INDICES[2])
    result = bundle_adjust(given, Unknowns(interior=("auto",)))
    assert {name.partition(":")[2] for name in result.names} >= set(INNER)
    assert remark(result, "data carry") == "Interior parameters that the data carry: c, xh, yh, k1."


def test_auto_leaves_a_pinhole_a_pinhole():
    points = two_planes()
    given = pinholes(points, np.random.default_rng(11), 0.0005)
    result = bundle_adjust(given, Unknowns(interior=("auto",)))
    assert "carry: none" in remark(result, "data carry")


def test_auto_takes_priors_of_parameters_that_it_leaves_out():
    given = pinholes(two_planes()[::3], np.random.default_rng(11), 0.0005)
    wanted = Unknowns(interior=("auto",), priors={"c": 1.0, "cam0:k1": 1e-3})
    assert "carry: none" in remark(bundle_adjust(given, wanted), "data carry")


def test_auto_asks_a_set_of_its_own_how_far_it_moved():
    """Two cameras of c 12, two of 12.5, both given rightly: nothing to estimate."""
    given = pinholes(two_planes()[::3], np.random.default_rng(11), 0.0005)
    longer = ("cam2", "cam3")
    grown = np.where(np.isin(given.image_points.cameras, longer), 12.5 / 12.0, 1.0)
    given = replace(
        given,
        image_points=replace(given.image_points, image=given.image_points.image * grown[:, None]),
        cameras=tuple(
            replace(camera, principal_distance=12.5) if camera.name in longer else camera
            for camera in given.cameras
        ),
    )
    sets = {name: "long" if name in longer else "short" for name in given.camera_names}
    result = bundle_adjust(given, Unknowns(interior=("auto",), shared_interior=sets))
    assert "carry: none" in remark(result, "data carry")


def pinholes(
    points: np.ndarray, rng: np.random.Generator, noise: float, k1: float = 0.0
) -> Project:
    """Return a project of cameras that are pinholes, seen with a lens of k1."""
    given = with_start(a_project(points=points), index=INDICES[2])
    image = np.concatenate(
        [snell_image(pose, (12.0, 0.0, 0.0, k1), points, INDICES[2]) for pose in POSES]
    )
    return replace(
        given,
        image_points=ImagePoints(
            cameras=given.image_points.cameras, ids=given.image_points.ids,
            image=image + rng.normal(0, noise, image.shape),
        ),
    )  # fmt: skip


def test_sigmas_grow_where_neighbouring_residuals_are_alike():
    """A lens of k1 taken for none: more than one sigma0 can say, and said."""
    points = two_planes()
    given = pinholes(points, np.random.default_rng(1), 0.0005, k1=1e-3)
    wrong, right = bundle_adjust(given), bundle_adjust(given, Unknowns(interior=("k1",)))
    assert 1.5 < wrong.model_error < 4
    assert right.model_error == 1.0
    assert f"{wrong.model_error:.1f} times larger" in remark(wrong, "alike")
    own = np.array([wrong.sigma(name) for name in wrong.names])
    white = own / wrong.model_error
    np.testing.assert_allclose(np.sqrt(np.diag(wrong.covariance)), own, rtol=1e-12)
    bare = np.array([right.sigma(name) for name in wrong.names]) * wrong.sigma0 / right.sigma0
    assert np.median(white / bare) == pytest.approx(1.0, abs=0.2)


def test_white_residuals_leave_the_sigmas_alone():
    points = two_planes()
    factors = [
        bundle_adjust(pinholes(points, np.random.default_rng(seed), 0.0005), Unknowns()).model_error
        for seed in range(12)
    ]
    assert factors == [1.0] * 12


def plates_of(moved: float, plate: int = 0, seed: int = 3) -> Project:
    """Return four plates at four depths, over one another in the images, one of them moved."""
    rng = np.random.default_rng(seed)
    depths = (-60.0, -85.0, -110.0, -135.0)
    flat = flat_control()[::2]
    points = np.concatenate([flat * (1, 1, 0) + (0, 0, depth) for depth in depths])
    given = pinholes(points, rng, 0.0005)
    names = tuple(f"P{k + 1}" for k in range(4) for _ in flat)
    wrong = points + np.where(np.array(names) == f"P{plate + 1}", moved, 0.0)[:, None] * (
        0.8,
        0.6,
        0,
    )
    return replace(given, object_points=replace(given.object_points, xyz=wrong, groups=names))


@pytest.mark.parametrize("plate", [0, 2])
def test_a_plate_out_of_its_place_is_named_and_freed_by_what_is_said(plate):
    given = plates_of(0.2, plate)
    wrong = bundle_adjust(given)
    told = remark(wrong, "--plate")
    assert f"Points of plate P{plate + 1} are off by" in told
    assert wrong.model_error > 2
    right = bundle_adjust(given, Unknowns(plates=(f"P{plate + 1}",)))
    assert right.model_error == 1.0
    assert not [line for line in right.remarks if "off by" in line]


def test_plates_in_their_places_are_left_alone():
    assert [bundle_adjust(plates_of(0.0, seed=k)).model_error for k in range(6)] == [1.0] * 6


def test_residuals_that_go_with_depth_are_said_to():
    points = np.concatenate([two_planes(), two_planes() + np.array([3.0, 2.0, -30.0])])
    given = pinholes(points, np.random.default_rng(5), 0.0003)
    wrong = bundle_adjust(with_start(given, index=1.40), Unknowns(fixed_cameras=("cam1",)))
    assert "depth is not modelled" in remark(wrong, "before the camera")
    assert wrong.model_error > 1.5
