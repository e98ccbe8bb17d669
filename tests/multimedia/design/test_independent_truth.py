"""Simplified models, colour seams and network angles against Snell's law solved in the test.

The angle in air is halved into an interval in 40 digits (`mp_camera`) or float64; indices of water
are typed from Quan and Fry's paper. Nothing of the package enters the truth.
"""

from __future__ import annotations

from itertools import combinations, pairwise

import cv2
import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

from multimedia import (
    Approximation,
    Camera,
    FlatInterface,
    Layers,
    agrafiotis,
    correct_dispersion,
    lavest,
    object_grid,
    seam_width,
    study_setup,
    telem,
)
from multimedia.design.workflow import design_ring
from tests.multimedia.mp_camera import apparent_radius

INDICES, GLASS, Z0, C = (1.0, 1.5, 1.337), 0.01, 0.5, 24.0
TANK = Layers(indices=INDICES, thicknesses=(GLASS,))
RADIUS, DEPTH = np.linspace(0.02, 0.3, 8), np.array([0.05, 0.1, 0.2])


def sine_in_air(radius, depth, indices=INDICES, height=Z0, glass=GLASS):
    """Return n1 sin(beta1) of rays that reach a radius and a depth, by halving."""
    radius, depth = np.broadcast_arrays(radius, depth)
    low, high = np.zeros(radius.shape), np.ones(radius.shape)
    for _ in range(60):
        p = (low + high) / 2
        reach = sum(
            h * p / np.sqrt(n**2 - p**2)
            for h, n in zip((height, glass, depth), indices, strict=True)
        )
        low, high = np.where(reach < radius, p, low), np.where(reach < radius, high, p)
    return low


def true_image(radius, depth):
    """Return where a camera that looks straight down sees the points. [mm]"""
    sine = sine_in_air(radius, depth)
    return C * sine / np.sqrt(1 - sine**2)


def test_halving_agrees_with_forty_digits():
    bar = apparent_radius(
        mp.mpf("0.3"), [mp.mpf(Z0), mp.mpf(GLASS), mp.mpf("0.2")], [mp.mpf(n) for n in INDICES]
    )
    expected = C * float(bar) / (Z0 + GLASS + 0.2)
    assert true_image(0.3, 0.2) == pytest.approx(expected, rel=1e-13)


def model_image(model: Approximation, radius, depth):
    """Return what a simplified camera shows: its constant, then its own radial distortion."""
    r = model.principal_distance * radius / (Z0 + GLASS + depth)
    return r * (1 + sum(k * r ** (2 * i) for i, k in enumerate(model.distortion, start=1)))


@pytest.mark.parametrize("make", [lavest, agrafiotis, telem])
def test_errors_of_a_model_are_what_its_camera_gets_wrong(make):
    """In the image: its picture less the true one. At the point: where it would put the point."""
    radius, depth = np.meshgrid(RADIUS, DEPTH)
    model = make(radius, z0=Z0, zp=depth, layers=TANK, principal_distance=C)
    seen = true_image(radius, depth)
    wrong = model_image(model, radius, depth) - seen
    np.testing.assert_allclose(model.image_error, wrong, rtol=0, atol=1e-12)
    assert model.rms == pytest.approx(np.sqrt(np.mean(wrong**2)), rel=1e-11)
    places = np.array([
        brentq(lambda r, z=z, s=s: model_image(model, r, z) - s, 0.0, 0.4, xtol=1e-15)
        for z, s in zip(depth.ravel(), seen.ravel(), strict=True)
    ])  # fmt: skip
    off = (radius.ravel() - places).reshape(radius.shape)
    # To first order in the error: its square over the radius is left.
    np.testing.assert_allclose(model.object_error, off, rtol=0.12, atol=3e-5)


def test_constants_are_those_of_the_papers():
    """Lavest: f n. Agrafiotis: shares of the way in each medium times its index, by hand."""
    points = {"z0": Z0, "zp": DEPTH, "layers": TANK, "principal_distance": C}
    assert lavest(0.1, **points).principal_distance == pytest.approx(24 * 1.337)
    mean = (0.05 + 0.1 + 0.2) / 3
    shares = (0.5 * 1 + 0.01 * 1.5 + mean * 1.337) / (0.51 + mean)
    assert agrafiotis(0.1, **points).principal_distance == pytest.approx(24 * shares, rel=1e-12)


def test_no_camera_constant_and_distortion_fit_better_than_telem_s():
    radius, depth = (a.ravel() for a in np.meshgrid(RADIUS, DEPTH))
    seen, tangent = true_image(radius, depth), radius / (Z0 + GLASS + depth)

    def miss(q):
        r = q[0] * tangent
        return r * (1 + q[1] * r**2 / 1e2 + q[2] * r**4 / 1e4 + q[3] * r**6 / 1e6) - seen

    best = least_squares(miss, (C, 0, 0, 0), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    model = telem(radius, z0=Z0, zp=depth, layers=TANK, principal_distance=C)
    assert model.rms == pytest.approx(np.sqrt(2 * best.cost / len(radius)), rel=1e-6)
    assert model.principal_distance == pytest.approx(best.x[0], rel=1e-6)


def quan_fry(wavelength: float, temperature: float) -> float:
    """Return the index of fresh water (Quan and Fry 1995, Eq. 3)."""
    t, w = temperature, wavelength
    return 1.31405 - 2.02e-6 * t**2 + (15.868 - 0.00423 * t) / w - 4382 / w**2 + 1.1455e6 / w**3


def colours(glass: float = 1.5) -> list[Layers]:
    """Return the media for red and blue at 20 degrees."""
    return [
        Layers(indices=(1.0, glass, quan_fry(w, 20.0)), thicknesses=(GLASS,))
        for w in (650.0, 450.0)
    ]


def test_the_seam_is_the_distance_of_red_and_blue_images():
    radius, depth = np.meshgrid(RADIUS, DEPTH)
    sines = [sine_in_air(radius, depth, media.indices) for media in colours()]
    red, blue = (C * s / np.sqrt(1 - s**2) / 0.004 for s in sines)
    found = seam_width(
        radius, z0=Z0, zp=depth, colours=colours(), principal_distance=C, pixel_size=0.004
    )
    np.testing.assert_allclose(found, blue - red, rtol=1e-10)
    assert 2 < found.max() < 5


def test_a_dot_whose_colours_snell_has_parted_comes_together():
    """Red, green and blue dots at their own image radii; after correction their centroids agree."""
    media = [Layers(indices=(1.0, 1.5, n), thicknesses=(GLASS,)) for n in (1.31, 1.337, 1.365)]
    y, x = np.mgrid[0:161, 0:161].astype(float)
    image = np.zeros((161, 161, 3), dtype=np.float32)
    places = []
    for channel, layers in enumerate(media):
        sine = sine_in_air(0.12, 0.2, layers.indices)
        radius = C * sine / np.sqrt(1 - sine**2) / 0.05
        where = 80 + radius * np.array([0.6, -0.8])
        places.append(where)
        image[..., channel] = 200 * np.exp(-((x - where[0]) ** 2 + (y - where[1]) ** 2) / 12.5)
    assert np.hypot(*(places[2] - places[0])) > 0.5
    fixed = correct_dispersion(
        image, z0=Z0, zp=0.2, colours=media, principal_distance=C, pixel_size=0.05
    )
    for channel in range(3):
        moments = cv2.moments(np.ascontiguousarray(fixed[..., channel]))
        centre = np.array([moments["m10"], moments["m01"]]) / moments["m00"]
        np.testing.assert_allclose(centre, places[1], atol=0.01)


CAMERAS = [
    Camera.looking_at(
        (0.35 * np.cos(a), 0.35 * np.sin(a), 0.55), (0, 0, -0.1), principal_distance=C
    )
    for a in (0.2, 2.2, 4.4)
]


def rays_in_water(centre: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return unit vectors of the rays from a camera above the tank at points in its water."""
    offset = points[:, :2] - centre[:2]
    radius = np.hypot(*offset.T)
    sine = sine_in_air(radius, -points[:, 2], height=centre[2] - GLASS) / INDICES[2]
    return np.column_stack([offset / radius[:, None] * sine[:, None], -np.sqrt(1 - sine**2)])


def widest(rays: list[np.ndarray]) -> np.ndarray:
    """Return the largest angle between any two."""
    angles = [np.arccos(np.clip((a * b).sum(axis=1), -1, 1)) for a, b in combinations(rays, 2)]
    return np.max(angles, axis=0)


def test_network_angles_are_those_between_snell_s_rays():
    points = object_grid((0.3, 0.2), (0.02, 0.2), count=4)
    tank = FlatInterface(layers=TANK)
    study = study_setup(CAMERAS, [tank] * 3, points, sigma_image=0.001)
    wet = widest([rays_in_water(camera.centre, points) for camera in CAMERAS])
    np.testing.assert_allclose(study.angle, wet, rtol=1e-8)
    lines = [points - camera.centre for camera in CAMERAS]
    dry = widest([line / np.linalg.norm(line, axis=1, keepdims=True) for line in lines])
    np.testing.assert_allclose(study.angle_in_air, dry, rtol=1e-8)
    # Small angles shrink by the index of the water; here they are 50 degrees.
    assert (wet < dry).all()


def test_expected_sigmas_follow_from_differences_of_images_through_snell():
    """sigma² (J^T J)^-1 with J by differences of images that the test itself computes."""
    point = np.array([[0.07, -0.05, -0.12]])

    def images(p):
        seen = []
        for camera in CAMERAS:
            ray = rays_in_water(camera.centre, p)
            sine = np.hypot(ray[:, 0], ray[:, 1]) * INDICES[2]
            level = ray[:, :2] / np.hypot(ray[:, 0], ray[:, 1])[:, None]
            air = np.column_stack([level * sine[:, None], -np.sqrt(1 - sine**2)])
            x, y, z = (air @ camera.rotation).T
            seen += [-C * x / z, -C * y / z]
        return np.concatenate(seen)

    step = 1e-5
    jacobian = np.stack(
        [(images(point + d) - images(point - d)) / (2 * step) for d in step * np.eye(3)], axis=-1
    )
    expected = 0.002 * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    study = study_setup(CAMERAS, [FlatInterface(layers=TANK)] * 3, point, sigma_image=0.002)
    np.testing.assert_allclose(study.sigma[0], expected, rtol=1e-6)


def test_the_command_s_models_and_seam_hold_for_its_first_camera():
    design = design_ring(
        count=3, distance=0.6, half_angle=0.4, principal_distance=25.0, indices=INDICES,
        thicknesses=(GLASS,), extent=(0.3, 0.2), depths=(0.02, 0.2), sigma_image=0.001,
    )  # fmt: skip
    points = design.study.points
    # The ring stands on a cone about the point of the last face above its target.
    centre = 0.6 * np.array([np.sin(0.4), 0.0, np.cos(0.4)])
    radius, depth = np.hypot(*(points[:, :2] - centre[:2]).T), -points[:, 2]
    height = centre[2] - GLASS
    sine = sine_in_air(radius, depth, height=height)
    bar = sine / np.sqrt(1 - sine**2) * (centre[2] + depth)
    name, rms, largest = design.models[0]
    wrong = np.abs(radius - bar / INDICES[2])  # f n makes R bar / n of every R
    assert name.startswith("Lavest")
    assert rms == pytest.approx(np.sqrt(np.mean(wrong**2)), rel=1e-9)
    assert largest == pytest.approx(wrong.max(), rel=1e-9)
    seams = []
    for wavelength in (650.0, 450.0):
        s = sine_in_air(radius, depth, (1.0, 1.5, quan_fry(wavelength, 20.0)), height)
        seams.append(25.0 * s / np.sqrt(1 - s**2))
    assert design.seam == pytest.approx(np.abs(seams[1] - seams[0]).max(), rel=1e-6)


def test_wider_rings_have_wider_angles_at_every_point():
    tank, points = FlatInterface(layers=TANK), object_grid((0.1, 0.1), (0.05, 0.15), count=3)
    angles = []
    for half in (0.15, 0.3, 0.45):
        eyes = [
            (0.6 * np.sin(half) * np.cos(a), 0.6 * np.sin(half) * np.sin(a), 0.6 * np.cos(half))
            for a in (0.0, np.pi)
        ]
        ring = [Camera.looking_at(eye, (0, 0, -0.1), principal_distance=C) for eye in eyes]
        study = study_setup(ring, [tank] * 2, points, sigma_image=0.001)
        np.testing.assert_allclose(
            study.angle, widest([rays_in_water(np.array(e), points) for e in eyes]), rtol=1e-7
        )
        angles.append(study.angle)
    assert all((narrow < wide).all() for narrow, wide in pairwise(angles))
