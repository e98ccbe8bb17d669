"""A tank with four cameras, points and images, made once for the tests of the solvers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from multimedia import Brown, Camera, Layers, Sensor, project

SENSOR = Sensor(width=1280, height=1024, pixel_size=np.array([0.012, 0.012]))
LAYERS = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(10.0,))
EYES = ((20.0, 10.0, 520.0), (300.0, 30.0, 450.0), (-300.0, -20.0, 450.0), (10.0, 310.0, 450.0))
LENS = Brown(k1=2e-5, p1=1e-5, p2=-2e-5, scale=1.0005)


def cameras(lens: Brown = LENS) -> list[Camera]:
    """Return four cameras with slightly different lenses. [mm]"""
    made = [Camera.looking_at(eye, (0, 0, -100), principal_distance=25.0) for eye in EYES]
    return [
        replace(
            camera, principal_distance=25.0 + 0.1 * k, principal_point=np.array([0.05 * k, -0.03]),
            distortion=lens, sensor=SENSOR, name=f"cam{k + 1}",
        )
        for k, camera in enumerate(made)
    ]  # fmt: skip


def control(count: int = 210, seed: int = 3) -> np.ndarray:
    """Return points of a calibration body in the water. [mm]"""
    rng = np.random.default_rng(seed)
    return rng.uniform((-70, -60, -180), (70, 60, -20), (count, 3))


def images(views: list[Camera], points: np.ndarray, noise: float = 0.0) -> np.ndarray:
    """Return measured image points, shape (cameras, n, 2). [mm]"""
    exact = np.stack([project(camera, points, LAYERS) for camera in views])
    return exact + noise * np.random.default_rng(4).standard_normal(exact.shape)
