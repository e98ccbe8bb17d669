"""Rays through waves that nobody chose: drawn forwards with Snell's law written out here."""

from __future__ import annotations

import numpy as np
import pytest

from multimedia import Interfaces, WaveSurface, aim_rays, correct_bathymetry

N = 1.337


class Sea:
    """A few random waves, their heights and slopes, by sines of this test's own."""

    def __init__(self, rng: np.random.Generator) -> None:
        count = int(rng.integers(1, 4))
        self.length = rng.uniform(0.4, 8.0, count)
        self.steepness = rng.uniform(0.01, 0.2, count) / count
        self.bearing, self.phase = rng.uniform(0, 2 * np.pi, (2, count))
        self.number = 2 * np.pi / self.length
        self.height = self.steepness / self.number

    @property
    def surface(self) -> WaveSurface:
        vector = self.number[:, None] * np.column_stack(
            [np.sin(self.bearing), np.cos(self.bearing)]
        )
        return WaveSurface(level=0.0, amplitude=self.height, wave_vector=vector, phase=self.phase)

    def at(self, x, y):
        """Return height and slopes by x and y."""
        way = np.multiply.outer(x, np.sin(self.bearing)) + np.multiply.outer(
            y, np.cos(self.bearing)
        )
        angle = self.number * way + self.phase
        steep = -self.height * self.number * np.sin(angle)
        return (
            (self.height * np.cos(angle)).sum(-1), (steep * np.sin(self.bearing)).sum(-1),
            (steep * np.cos(self.bearing)).sum(-1),
        )  # fmt: skip

    def refracted(self, camera, x, y):
        """Return where rays from a camera meet the sea at x, y, and their way in the water."""
        z, by_x, by_y = self.at(x, y)
        met = np.column_stack([x, y, z])
        up = np.column_stack([-by_x, -by_y, np.ones_like(z)])
        up /= np.linalg.norm(up, axis=1)[:, None]
        ray = met - camera
        ray /= np.linalg.norm(ray, axis=1)[:, None]
        along = (ray - (ray * up).sum(1)[:, None] * up) / N
        return met, ray, along - np.sqrt(1 - (along**2).sum(1))[:, None] * up, up

    def first(self, camera, met):
        """Return which of these points no other wave hides from the camera."""
        share = np.linspace(0.0, 1.0, 2000)[1:-1]
        line = camera + share[:, None, None] * (met - camera)
        return (line[..., 2] - self.at(line[..., 0], line[..., 1])[0] > 0)[:-2].all(axis=0)


@pytest.mark.parametrize("seed", range(20, 24))
def test_rays_through_any_waves_are_found(seed):
    rng = np.random.default_rng(seed)
    for _ in range(4):
        sea, lean = Sea(rng), np.radians(rng.uniform(0, 68))
        away, bearing = rng.uniform(2, 60), rng.uniform(0, 2 * np.pi)
        camera = away * np.array([np.sin(lean) * np.cos(bearing), np.sin(lean) * np.sin(bearing),
                                  np.cos(lean)]) + [0, 0, 1.0]  # fmt: skip
        x, y = rng.uniform(-3, 3, (2, 60))
        met, ray, down, up = sea.refracted(camera, x, y)
        seen = ((ray * up).sum(1) < -0.02) & sea.first(camera, met)
        target = met + rng.uniform(0.3, 5.0, (60, 1)) * down
        # What the ray leaves again below a trough is not under water all the way.
        way = met + np.linspace(0.02, 1, 60)[:, None, None] * (target - met)
        seen &= (way[..., 2] < sea.at(way[..., 0], way[..., 1])[0]).all(axis=0)
        path = aim_rays(camera, target[seen], Interfaces(surfaces=(sea.surface,), indices=(1.0, N)))
        assert (path.status == 0).mean() > 0.98
        # Another ray than the one drawn is one, too: by Snell's law at its own vertex.
        good = path.status == 0
        crossed = path.vertices[good, 0]
        vertex, _, down, _ = sea.refracted(camera, crossed[:, 0], crossed[:, 1])
        assert np.abs(vertex - crossed).max() < 1e-9
        wanted = target[seen][good] - vertex
        wanted /= np.linalg.norm(wanted, axis=1)[:, None]
        assert np.abs(wanted - down).max() < 1e-7


def test_points_under_waves_seen_at_65_degrees_are_corrected_in_little_time():
    # 15 s of processor time for these twenty points when each start was tried alone.
    rng = np.random.default_rng(3)
    sea = Sea(rng)
    bottom = np.column_stack([rng.uniform(-2, 2, (20, 2)), rng.uniform(-5, -1, 20)])
    reach = 20 * np.tan(np.radians(65))
    centres = np.array([[reach * np.cos(a), reach * np.sin(a), 20.0] for a in (0, 1.2, 2.4, 4)])
    water = Interfaces(surfaces=(sea.surface,), indices=(1.0, N))
    rays = aim_rays(centres[None], bottom[:, None], water).directions[:, :, 0]
    # The point that such rays make without water: weighted by distance, as bundles do.
    apparent = bottom * (1, 1, 0.6)
    for _ in range(8):
        square = np.eye(3) - rays[..., :, None] * rays[..., None, :]
        weight = 1 / ((apparent[:, None] - centres) ** 2).sum(-1)[..., None, None]
        apparent = np.linalg.solve(
            (weight * square).sum(1), ((weight * square) @ centres[..., None]).sum(1)
        )[..., 0]
    corrected = correct_bathymetry(
        apparent, water_level=sea.surface, refractive_index=N, cameras=centres
    )
    found = np.isfinite(corrected.xyz[:, 0])
    assert found.mean() >= 0.9
    assert np.median(np.linalg.norm(corrected.xyz - bottom, axis=1)[found]) < 1e-6
