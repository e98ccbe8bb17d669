"""Poses by the kernel: the same as the general adjustment's, compiled or not, one or many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from multimedia import (
    Brown,
    Camera,
    Fisheye,
    FlatInterface,
    InputError,
    Layers,
    project,
    resect,
    resect_many,
)
from multimedia.media.camera import EXTERIOR
from multimedia.media.projection import as_media, project_with_jacobian
from multimedia.orientation import many_resections, quick_pose, resection
from multimedia.orientation.pose_kernel import fitted_pose, fitted_poses, pose_rows
from multimedia.orientation.quick_pose import layering_of, linear_lens
from tests.multimedia.tank import LAYERS, cameras, control

PORT = FlatInterface(
    layers=Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,)), point=(0, 0, -40.0),
    normal=(0.05, -0.03, 1.0), moves_with_camera=True,
)  # fmt: skip
LEANING = FlatInterface(layers=LAYERS, normal=(0.03, -0.02, 1.0))
THREE = Layers(indices=(1.0, 1.5, 1.2, 1.34), thicknesses=(10.0, 0.0))
MEDIA = {"tank": LAYERS, "leaning": LEANING, "port": PORT, "thin": THREE, "air": None}


def noisy(camera: Camera, points, media, seed: int = 1):
    noise = 0.002 * np.random.default_rng(seed).standard_normal((len(points), 2))
    return project(camera, points, media) + noise


def off(camera: Camera, by: float = 1.0) -> Camera:
    return camera.stepped(EXTERIOR, by * np.array([20.0, -10.0, 15.0, 0.03, -0.02, 0.02]))


@pytest.mark.parametrize("name", MEDIA)
def test_the_kernel_s_rows_are_those_of_the_projection(name):
    camera, points, media = cameras(Brown())[0], control()[:20], as_media(MEDIA[name])
    points[0, :2] = camera.centre[:2]  # below the centre, where the ray is not bent
    camera = replace(camera, principal_point=np.zeros(2))
    ideal, ones = np.zeros((len(points), 2)), np.ones((len(points), 2))
    lens = linear_lens(camera, ideal, ideal, ones)
    args = (
        points.T.copy(), lens, camera.centre.copy(), camera.rotation.copy(),
        camera.principal_distance, layering_of(media),
    )  # fmt: skip
    want = project_with_jacobian(camera, points, media, camera_names=EXTERIOR)
    size = np.abs(want.by_camera).max(axis=(0, 1))
    for road in (pose_rows, pose_rows.plain):
        seen, image, rows = road(*args)
        assert seen
        assert np.abs(image.T - want.image).max() < 3e-14
        assert np.abs(rows[:, 0].T - want.image).max() < 3e-14
        assert (np.abs(np.moveaxis(rows[:, 1:], 2, 0) - want.by_camera) < 1e-12 * size).all()


@pytest.mark.parametrize("name", MEDIA)
@pytest.mark.parametrize(
    "lens", [Brown(), Brown(k1=2e-5, p1=1e-5, scale=1.0005), Fisheye(k1=1e-3)], ids=str
)
def test_both_roads_lead_to_the_same_camera(name, lens, monkeypatch):
    truth = replace(cameras()[2], distortion=lens, principal_point=np.array([0.1, -0.2]))
    points, media = control(), MEDIA[name]
    image = noisy(truth, points, media)
    monkeypatch.setattr(fitted_pose, "pays", lambda _: False)
    plain = resect(off(truth), points, image, media)
    monkeypatch.setattr(fitted_pose, "pays", lambda _: True)
    quick = resect(off(truth), points, image, media)
    monkeypatch.setattr(resection, "quick_pose", lambda *_: None)
    slow = resect(off(truth), points, image, media)
    sigmas = np.array([slow.sigmas[axis] for axis in ("X0", "Y0", "Z0")])
    for found in (quick, plain):
        assert (np.abs(found.camera.centre - slow.camera.centre) < 1e-7 * sigmas).all()
        assert found.covariance == pytest.approx(slow.covariance, rel=1e-8, abs=1e-18)
        assert np.abs(found.residuals - slow.residuals).max() < 1e-10
        assert found.sigma0 == pytest.approx(slow.sigma0, rel=1e-10)


def test_the_kernel_leaves_to_others_what_it_does_not_know():
    assert layering_of(FlatInterface(layers=Layers(indices=(1.33, 1.0)))) is None
    camera, points = cameras()[0], control()
    above = replace(camera, centre=camera.centre * (1, 1, -1))
    assert quick_pose.quick_pose(
        above,
        resection.CameraObservations(
            points=points, image=project(camera, points, LAYERS), media=LAYERS,
            sigma=np.ones((len(points), 2)), what="",
        ),
    ) is None  # fmt: skip


@pytest.fixture(scope="module")
def frames():
    """Return cameras, control and images of nine, one of which sees two points only."""
    rng = np.random.default_rng(4)
    truth = [off(cameras()[k % 3], rng.uniform(-1, 1)) for k in range(9)]
    truth[4] = replace(truth[4], distortion=Brown(k1=2e-5))
    images = np.stack([noisy(camera, control(), LAYERS, k) for k, camera in enumerate(truth)])
    images[2, 3:5] = np.nan
    images[6, 2:] = np.nan
    start = [replace(camera, centre=camera.centre + 5.0) for camera in truth]
    # From nowhere: not for the kernel.
    start[8] = replace(start[8], centre=np.array([500.0, -900.0, 2500.0]))
    return start, images


@pytest.mark.parametrize("quick", [True, False])
def test_many_cameras_are_each_oriented_as_one_alone(frames, quick, monkeypatch):
    start, images = frames
    monkeypatch.setattr(fitted_poses, "pays", lambda _: quick)
    poses = resect_many(start, control(), images, LAYERS)
    assert [k for k, status in enumerate(poses.status) if status != "ok"] == [6]
    assert "2 control points measured" in poses.status[6]
    assert np.isnan(poses.centre[6]).all()
    monkeypatch.setattr(resection, "quick_pose", lambda *_: None)
    for k in {*range(9)} - {6}:
        one = resect(start[k], control(), images[k], LAYERS)
        assert poses.camera(k).centre == pytest.approx(one.camera.centre, abs=1e-9)
        assert poses.covariance[k] == pytest.approx(one.covariance, rel=1e-7, abs=1e-18)
        assert poses.residuals[k] == pytest.approx(one.residuals, abs=1e-10, nan_ok=True)
        assert poses.sigma0[k] == pytest.approx(one.sigma0, rel=1e-9)
        sigma = [one.sigmas[name] for name in EXTERIOR]
        assert poses.sigma[k] == pytest.approx(sigma, rel=1e-7)
    with pytest.raises(InputError, match=r"camera 7: .*control points"):
        poses.camera(6)


@pytest.mark.parametrize("quick", [True, False])
def test_cameras_that_see_nothing_or_start_anywhere_end_in_their_status(frames, quick, monkeypatch):
    start, images = frames[0][:4], frames[1][:4].copy()
    images[1] = np.nan
    start[0] = replace(start[0], centre=control()[0])
    start[3] = replace(start[3], centre=np.array([0.0, 0.0, -50.0]))
    monkeypatch.setattr(fitted_poses, "pays", lambda _: quick)
    poses = resect_many(start, control(), images, LAYERS)
    assert "0 control points measured" in poses.status[1]
    assert np.isfinite(
        poses.centre[[k for k, said in enumerate(poses.status) if said == "ok"]]
    ).all()


def test_many_cameras_keep_the_ratios_of_standard_deviations(frames, monkeypatch):
    start, images = frames
    sigma = np.where(np.arange(images.shape[1]) % 2, 0.002, 0.004)[None, :, None]
    monkeypatch.setattr(fitted_poses, "pays", lambda _: True)
    poses = many_resections.resect_many(start[:1], control(), images[:1], LAYERS, sigma=sigma)
    one = resect(start[0], control(), images[0], LAYERS, sigma=sigma[0])
    assert poses.centre[0] == pytest.approx(one.camera.centre, abs=1e-9)
    assert poses.sigma0[0] == pytest.approx(one.sigma0, rel=1e-9)


def test_shapes_that_do_not_fit_are_refused(frames):
    start, images = frames
    with pytest.raises(InputError, match="9 cameras, object_points"):
        resect_many(start, control()[:4], images, LAYERS)
    with pytest.raises(InputError, match="one for each row"):
        resect_many(start[0], control(), images, LAYERS)
    with pytest.raises(InputError, match="sigma"):
        resect_many(start, control(), images, LAYERS, sigma=np.ones(7))
