"""Points of three photos and more: least squares, honest sigmas, and which pick is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import SAMPLE, InputError, Pair, Photo, PhotoSet
from bifocal.model.orientation_precision import CAMERA, names_of, pinhole
from multimedia import Layers
from photocore.camera.pinhole import plane_from_pixel, project

GSD = 0.0037
METRES = np.array([[GSD, 0, -1536 * GSD], [0, -GSD, 1024 * GSD], [0, 0, 1.0]])
#: 35, 28 and 19 mm at one scale, and a fourth photo from a step aside.
AXIS, ASIDE = ((17.5, 0.0), (14.0, 0.0), (9.5, 0.0)), (9.5, 1.5)
PORT = {"layers": Layers(indices=(1.0, 1.49, 1.337), thicknesses=(0.02,)), "z0": 0.1}


def photo_set(stations=AXIS, **more):
    photos = [
        Photo(plane_from_pixel=METRES, nadir=[aside, 0], distance=distance, sigma_pixel=0.5, **more)
        for distance, aside in stations
    ]
    return PhotoSet(photos=tuple(photos))


def hand_held(**more):
    """Return tilted photos of different scale and precision, no two of one station."""
    matrices = (
        [[0.004, 1e-5, -6.1], [2e-5, -0.0041, 4.0], [1e-6, -4e-6, 1.0]],
        [[0.003, -3e-5, -4.1], [1e-5, -0.0031, 3.2], [-5e-6, 3e-6, 1.0]],
        [[0.0035, 2e-5, -5.0], [-3e-5, -0.0034, 3.6], [4e-6, 2e-6, 1.0]],
        [[0.0045, 1e-5, -6.9], [2e-5, -0.0044, 4.4], [-2e-6, 1e-6, 1.0]],
    )
    stations = (
        (14.2, 0.3, -0.2, 0.4), (8.7, -0.1, 0.15, 0.6), (8.7, 1.6, 0.3, 0.5), (20, -1, 0.5, 0.8)
    )  # fmt: skip
    photos = [
        Photo(plane_from_pixel=matrix, nadir=[x, y], distance=d, sigma_pixel=sigma, **more)
        for matrix, (d, x, y, sigma) in zip(matrices, stations, strict=True)
    ]
    return PhotoSet(photos=tuple(photos))


def scene(count, seed=1):
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [rng.uniform(-4, 4, count), rng.uniform(-3, 3, count), rng.uniform(-0.8, 1.0, count)]
    )


def noisy(photos, xyz, rng):
    return [
        pixels + rng.normal(0, photo.precision(), pixels.shape)
        for photo, pixels in zip(photos.photos, photos.project(xyz), strict=True)
    ]


@pytest.mark.parametrize("media", [{}, PORT], ids=["air", "port"])
def test_projected_points_are_intersected_where_they_were(media):
    photos, xyz = hand_held(**media), scene(400)
    found = photos.intersect(photos.project(xyz))
    np.testing.assert_allclose(found.xyz, xyz, atol=1e-10)
    assert np.abs(found.residuals).max() < 1e-6
    assert set(found.flags) <= {"OK", "ON-PLANE"}


def test_the_intersection_is_the_least_squares_one():
    from scipy.optimize import least_squares

    photos, xyz = hand_held(), scene(20)
    picks = noisy(photos, xyz, np.random.default_rng(5))
    picks[1][3] = picks[3][4] = np.nan
    found = photos.intersect(picks)
    for i in range(20):

        def misses(point, i=i):
            miss = [
                (pick[i] - own[0]) / photo.precision()
                for photo, pick, own in zip(
                    photos.photos, picks, photos.project(point[None]), strict=True
                )
            ]
            return np.nan_to_num(np.concatenate(miss))

        best = least_squares(misses, found.xyz[i], xtol=1e-15, ftol=1e-15, gtol=1e-15)
        np.testing.assert_allclose(found.xyz[i], best.x, atol=0.02 * found.sigma[i].max())
        cofactor = np.linalg.inv(best.jac.T @ best.jac)
        np.testing.assert_allclose(found.covariance[i], cofactor, rtol=0.02, atol=1e-9)


@pytest.mark.parametrize("media", [{}, PORT], ids=["air", "port"])
def test_errors_are_as_large_as_their_sigmas_say(media):
    photos, xyz = hand_held(**media), scene(4000, seed=3)
    picks = noisy(photos, xyz, np.random.default_rng(8))
    for seed, own in enumerate(picks):  # some points in three photos, two, one
        own[np.random.default_rng(seed).random(len(own)) < 0.15] = np.nan
    found = photos.intersect(picks)
    error = found.xyz - xyz
    normal = np.linalg.solve(found.covariance, error[..., None])[..., 0]
    known = np.isfinite(error).all(axis=1)
    assert known.mean() > 0.9
    assert 0.95 < np.sqrt(np.mean((error * normal).sum(axis=1)[known] / 3)) < 1.05
    assert np.isin(np.array(found.flags)[~known], ["CHECK", "NADIR"]).all()


def test_the_orientation_is_in_every_sigma_and_common_to_the_points():
    count = 4  # of cameras without skew
    cameras = [pinhole(photo).stepped(np.zeros(10)) for photo in hand_held().photos]
    exact = PhotoSet(
        photos=tuple(
            replace(photo, plane_from_pixel=plane_from_pixel(camera))
            for photo, camera in zip(hand_held().photos, cameras, strict=True)
        )
    )
    names = names_of(None, count)
    rng = np.random.default_rng(2)
    sigma = {"X": 0.02, "Y": 0.02, "Z": 0.03, "turn X": 1e-3, "turn Y": 1e-3, "turn Z": 1e-3}
    scale = np.array([sigma.get(name.rsplit(" ", 1)[0], 0.0) for name in names])
    mixing = np.eye(len(names)) + 0.3 * rng.normal(size=(len(names),) * 2) / np.sqrt(len(names))
    root = scale[:, None] * mixing
    photos = replace(exact, orientation=root @ root.T)
    xyz, ratios, deviates = scene(150, seed=4), [], []
    for _ in range(60):
        errors = (root @ rng.normal(size=len(names))).reshape(count, len(CAMERA))
        moved = [camera.stepped(step[:10]) for camera, step in zip(cameras, errors, strict=True)]
        picks = [
            project(camera, xyz) + rng.normal(0, photo.precision(), (len(xyz), 2))
            for camera, photo in zip(moved, photos.photos, strict=True)
        ]
        found = photos.intersect(picks)
        error = found.xyz - xyz
        solved = np.linalg.solve(found.covariance, error[..., None])[..., 0]
        ratios.append((error * solved).sum(axis=1) / 3)
        deviates.append(found.standardised)
    assert 0.93 < np.sqrt(np.mean(ratios)) < 1.07  # 60 orientations, common to 150 points each
    # What the orientation leaves of misfit is no wrong pick.
    assert 0.003 < np.mean(np.array(deviates) > 2.576) < 0.02


def test_photos_whose_rows_count_upwards_are_as_precise_as_the_others():
    mirror, xyz = np.diag([1.0, -1.0, 1.0]), scene(20)
    mirror[1, 2] = 2047.0
    turned = PhotoSet(photos=tuple(
        replace(photo, plane_from_pixel=photo.plane_from_pixel @ mirror)
        for photo in hand_held().photos
    ))  # fmt: skip
    for photo in turned.photos:
        camera = pinhole(photo)
        assert camera.matrix[1, 1] < 0 < camera.matrix[0, 0]
        assert np.linalg.det(camera.rotation) == pytest.approx(1.0)
        assert project(camera, xyz) == pytest.approx(photo.project(xyz), abs=1e-6)
    sigmas = [photos.intersect(photos.project(xyz)).sigma for photos in (hand_held(), turned)]
    assert sigmas[1] == pytest.approx(sigmas[0], rel=1e-9)


def test_a_set_of_two_gives_the_pair_to_the_last_bit():
    pair = Pair.read(SAMPLE / "facade.pair.json")
    xyz = scene(200)
    rng = np.random.default_rng(3)
    far, near = (own + rng.normal(0, 0.5, own.shape) for own in pair.project(xyz))
    near[5] = far[6, 0] = np.nan
    near[7] += [40.0, -40.0]
    for photos in (PhotoSet.from_pair(pair), PhotoSet.read(SAMPLE / "facade.pair.json")):
        own, ours = pair.intersect(far, near), photos.intersect([far, near])
        for name in ("xyz", "covariance", "standardised"):
            assert np.array_equal(getattr(ours, name), getattr(own, name), equal_nan=True), name
        assert np.array_equal(ours.residuals.reshape(-1, 4), own.residuals, equal_nan=True)
        assert ours.flags == own.flags
    turned = PhotoSet(photos=photos.photos[::-1], folder=photos.folder, extra=photos.extra)
    assert np.array_equal(turned.intersect([near, far]).xyz, own.xyz, equal_nan=True)


def test_points_of_two_photos_of_a_larger_set_are_those_of_their_pair():
    photos = hand_held()
    photos = replace(photos, orientation=np.diag(np.full(48, 1e-8)))
    picks = noisy(photos, scene(50), np.random.default_rng(1))
    picks[1][:] = picks[2][:] = np.nan
    found, own = photos.intersect(picks), photos.pair(0, 3).intersect(picks[3], picks[0])
    assert np.array_equal(found.xyz, own.xyz)
    assert np.array_equal(found.covariance, own.covariance)
    assert found.flags == own.flags
    assert not found.suspects.any()


def test_two_photos_from_one_distance_are_no_pair_and_still_meet():
    photos, xyz = photo_set(((9.5, 0.0), (9.5, 1.5))), scene(20)
    np.testing.assert_allclose(photos.intersect(photos.project(xyz)).xyz, xyz, atol=1e-10)


def test_a_slip_along_the_radius_is_noticed_as_often_as_three_rays_can():
    """58, 94 and 7 % of slips of 3 px, of picks of 0.5 px; a pair notices none."""
    photos, rng = photo_set(), np.random.default_rng(1)
    xyz = rng.uniform([-5.5, -3.7, -0.5], [5.5, 3.7, 0.5], (6000, 3))
    away = xyz[:, :2] * [1, -1]
    radial = away / np.hypot(*away.T)[:, None]
    honest = noisy(photos, xyz, rng)
    rate = [np.mean(np.array(photos.intersect(honest).flags) == "OFF-RADIAL")]
    for number in range(3):
        picks = [own + 3.0 * radial * (k == number) for k, own in enumerate(honest)]
        found = photos.intersect(picks)
        noticed = np.array(found.flags) == "OFF-RADIAL"
        rate.append(noticed.mean())
        # Along one axis the three rays cannot tell which it is: they name all that it may be.
        assert found.suspects[noticed, number].mean() > 0.9
        assert found.suspects[noticed].sum(axis=1).mean() > 2.5
    np.testing.assert_allclose(rate, [0.01, 0.58, 0.94, 0.07], atol=0.04)
    pair = photos.pair(0, 2)
    picks = honest[0] + 3.0 * radial, honest[2]
    assert np.mean(np.array(pair.intersect(*picks).flags) == "OFF-RADIAL") < 0.01


@pytest.mark.parametrize("number", range(4))
def test_the_photo_of_a_wrong_pick_is_named_with_the_size_of_the_slip(number):
    photos, xyz = photo_set((*AXIS, ASIDE)), scene(500)
    picks = noisy(photos, xyz, np.random.default_rng(number))
    picks[number] += [4.0, -5.0]
    found = photos.intersect(picks)
    noticed = np.array(found.flags) == "OFF-RADIAL"
    named = noticed & (found.suspects.sum(axis=1) == 1)
    assert noticed.mean() > 0.99
    assert found.suspects[noticed, number].mean() > 0.97
    assert (found.suspects[named, number]).mean() > 0.97
    assert named.mean() > 0.6
    assert np.median(found.slips[named, number]) == pytest.approx(np.hypot(4, 5), abs=0.3)


def test_at_the_nadir_of_photos_on_one_axis_nothing_is_measured_but_aside_it_is():
    at_nadir = np.array([[0.0, 0.0, 0.3]])
    on_axis = photo_set().intersect(photo_set().project(at_nadir))
    assert on_axis.flags == ("NADIR",)
    assert np.isnan(on_axis.xyz).all()
    photos = photo_set((*AXIS, ASIDE))
    found = photos.intersect(photos.project(at_nadir))
    np.testing.assert_allclose(found.xyz, at_nadir, atol=1e-10)
    assert found.flags == ("OK",)


def test_points_of_one_ray_or_none_are_flagged_and_have_no_coordinates():
    photos = photo_set()
    picks = [own.copy() for own in photos.project(scene(4))]
    picks[0][0] = picks[1][0] = np.nan
    picks[0][1] = picks[1][1] = picks[2][1] = np.nan
    found = photos.intersect([own.reshape(2, 2, 2) for own in picks])
    assert found.flags[:2] == ("CHECK", "CHECK")
    assert found.xyz.shape == (2, 2, 3)
    assert np.isnan(found.xyz[0]).all()
    assert np.isfinite(found.xyz[1]).all()
    assert found.residuals.shape == (2, 2, 3, 2)


def test_picks_that_do_not_go_with_the_set_are_refused():
    photos = photo_set()
    picks = photos.project(scene(4))
    with pytest.raises(InputError, match="picks of 2 photos for a set of 3"):
        photos.intersect(picks[:2])
    with pytest.raises(InputError, match=r"different shapes \(4, 2\), \(4, 2\), \(3, 2\)"):
        photos.intersect([*picks[:2], picks[2][:3]])
    with pytest.raises(InputError, match="pixels of photo 2"):
        photos.intersect([picks[0], picks[1][:, :1], picks[2]])
    with pytest.raises(InputError, match="sigma_px"):
        photos.intersect(picks, sigma_px=-1)
