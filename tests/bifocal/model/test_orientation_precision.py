"""What the orientation's covariance does to points, against drawn orientations."""

import json
from dataclasses import replace

import numpy as np
import pytest

from bifocal import Measuring, Pair, Photo, RadialDivision, georeference, solve
from bifocal.model.orientation_precision import CAMERA, NAMES, moved, pinhole
from multimedia import InputError
from photocore.camera.pinhole import PARAMETERS, plane_from_pixel
from tests.builders.pinholes import rotation_from_vector
from tests.scenes import SetupErrors, bifocal_cameras

CAMERAS = bifocal_cameras(errors=SetupErrors(tilt_deg=8.0), rng=np.random.default_rng(2))
PAIR = CAMERAS.exact
SIGMA = dict(
    zip(CAMERA, (1e-3, 1e-4, 3.0, 3.0, 1e-4, 1e-4, 1e-4, 0.01, 0.01, 0.02, 2e-3, 1e-3), strict=True)
)
SPREAD = np.array([SIGMA[name.rsplit(" ", 1)[0]] for name in NAMES])
RNG = np.random.default_rng(3)
XYZ = np.column_stack([RNG.uniform(2, 5, 20), RNG.uniform(-3, 3, 20), RNG.uniform(-0.6, 0.8, 20)])


def covariance() -> np.ndarray:
    """Return a covariance with correlations."""
    mix = np.random.default_rng(4).normal(size=(24, 24)) / 10 + np.eye(24)
    return (SPREAD[:, None] * mix) @ (SPREAD[:, None] * mix).T


def test_a_homography_with_nadir_and_distance_is_its_camera() -> None:
    for camera, photo in ((CAMERAS.far, PAIR.image1), (CAMERAS.near, PAIR.image2)):
        found = pinhole(photo)
        np.testing.assert_allclose(found.matrix, camera.matrix, rtol=1e-8, atol=1e-6)
        np.testing.assert_allclose(found.rotation, camera.rotation, atol=1e-9)
        np.testing.assert_array_equal(found.centre, camera.centre)


def drawn_points(step, seen) -> np.ndarray:
    """Return the points that a pair with errors in all its parameters finds from pixels."""
    photos, ideal = [], []
    for number, (photo, pixels) in enumerate(zip((PAIR.image1, PAIR.image2), seen, strict=True)):
        own = step[number * len(CAMERA) : (number + 1) * len(CAMERA)]
        camera = pinhole(photo)
        lens = RadialDivision(own[-2], camera.matrix[:2, 2], camera.matrix[0, 0], own[-1])
        ideal.append(lens.undistort(pixels))
        camera = camera.stepped(own[: len(PARAMETERS)])
        photos.append(
            Photo(
                plane_from_pixel=plane_from_pixel(camera),
                nadir=camera.centre[:2],
                distance=camera.centre[2],
            )
        )
    return Pair(image1=photos[0], image2=photos[1]).intersect(*ideal).xyz


@pytest.mark.acceptance
def test_the_spread_of_points_over_drawn_orientations_is_the_covariance_stated() -> None:
    stated = replace(PAIR, orientation=covariance()).covariance_of_orientation(XYZ)
    steps = np.random.default_rng(5).multivariate_normal(np.zeros(24), covariance(), 1500)
    seen = PAIR.project(XYZ)
    draws = [drawn_points(step, seen) for step in steps]
    spread = np.std(draws, axis=0)
    # 1500 draws give a standard deviation to 1.8 %; three of those, and some curvature.
    np.testing.assert_allclose(spread, np.sqrt(np.diagonal(stated, axis1=1, axis2=2)), rtol=0.07)


@pytest.mark.acceptance
def test_control_points_take_up_most_of_it_and_the_rest_is_in_the_sigmas() -> None:
    # Small enough for no curvature; 0.3 px of picks is then about as much as what is left.
    loose = 0.15**2 * covariance()
    seen, rng = PAIR.project(XYZ), np.random.default_rng(6)
    names = [str(i) for i in range(len(XYZ))]
    keys = ("col1", "row1", "col2", "row2")
    control = {"id": names[:8], **dict(zip("ENH", XYZ[:8].T + 1000.0, strict=True))}
    picked = {"id": names, **dict(zip(keys, np.hstack(seen).T, strict=True))}
    pair = replace(PAIR, orientation=loose)
    survey = solve(picked, pair=pair, measuring=Measuring(sigma_px=0.3))
    placed = georeference(survey.table, control, model="3D")
    survey = replace(survey, georeference=placed)
    own, errors = survey.table.own_covariance, []
    for step in rng.multivariate_normal(np.zeros(24), loose, 250):
        xyz = drawn_points(step, [p + rng.normal(0, 0.3, p.shape) for p in seen])
        columns = {"id": names, **dict(zip("XYZ", xyz.T, strict=True))}
        fit = georeference(columns, control, model="3D", covariance=own)
        if not fit.bad:
            errors.append(fit.world_from_wall(xyz) - XYZ - 1000.0)
    ratio = np.sqrt((np.array(errors) ** 2).mean(axis=0)) / survey.world_sigma
    assert np.sqrt((ratio**2).mean()) == pytest.approx(1.0, abs=0.05)
    # Taken as each point's own, most of what the fit takes up would be stated too.
    whole = np.sqrt(np.diagonal(survey.table.covariance, axis1=1, axis2=2))
    assert np.median(survey.world_sigma[:, 2] / whole[:, 2]) < 0.8


def test_intersection_and_survey_add_it_to_the_picks() -> None:
    pair = replace(PAIR, orientation=covariance())
    seen = PAIR.project(XYZ)
    alone, both = (p.intersect(*seen, sigma_px=0.3) for p in (PAIR, pair))
    added = both.covariance - alone.covariance
    np.testing.assert_allclose(added, pair.covariance_of_orientation(XYZ), rtol=1e-5, atol=1e-12)
    columns = dict(zip(("col1", "row1", "col2", "row2"), np.hstack(seen).T, strict=True))
    names = {"id": [str(i) for i in range(len(XYZ))]}
    table = solve(names | columns, pair=pair, measuring=Measuring(sigma_px=0.3)).table
    np.testing.assert_allclose(table["sigma_r"], both.sigma[:, 2], rtol=1e-9)


def test_it_goes_through_the_pair_file_and_follows_exchanged_photos(tmp_path) -> None:
    path = tmp_path / "wall.pair.json"
    pair = replace(PAIR, orientation=covariance())
    pair.write(path)
    np.testing.assert_allclose(Pair.read(path).orientation, covariance(), rtol=1e-12)
    data = json.loads(path.read_text())
    data["image1"], data["image2"] = data["image2"], data["image1"]
    order = np.roll(np.arange(24), 12)
    data["orientation"]["covariance"] = covariance()[np.ix_(order, order)].tolist()
    turned = Pair.from_dict(data)
    np.testing.assert_allclose(
        turned.covariance_of_orientation(XYZ), pair.covariance_of_orientation(XYZ), rtol=1e-9
    )


def test_turning_the_axes_turns_the_covariance() -> None:
    axes = rotation_from_vector([0.0, 0.0, 0.4])
    far, near = (pinhole(p).moved(axes, np.zeros(3)) for p in (PAIR.image1, PAIR.image2))
    photos = [
        Photo(plane_from_pixel=plane_from_pixel(c), nadir=c.centre[:2], distance=c.centre[2])
        for c in (far, near)
    ]
    turned = Pair(image1=photos[0], image2=photos[1], orientation=moved(covariance(), axes))
    first = replace(PAIR, orientation=covariance()).covariance_of_orientation(XYZ)
    second = turned.covariance_of_orientation(XYZ @ axes.T)
    np.testing.assert_allclose(second, axes @ first @ axes.T, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ([1, 2], "expected .*parameters"),
        ({"parameters": ["Z 1"], "covariance": [[1]]}, "24 parameters"),
        ({"parameters": list(NAMES), "covariance": [[1.0]]}, "shape"),
        ({"parameters": list(NAMES), "covariance": (-np.eye(24)).tolist()}, "no covariance"),
        (
            {"parameters": list(NAMES), "covariance": (np.eye(24) + np.eye(24, k=1) / 2).tolist()},
            "no covariance",
        ),
    ],
)
def test_what_is_no_covariance_is_refused(stated, said) -> None:
    data = json.loads(json.dumps(PAIR.to_dict(), default=np.ndarray.tolist))
    with pytest.raises(InputError, match=said):
        Pair.from_dict(data | {"orientation": stated})
