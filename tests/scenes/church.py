"""The west front of a small church: rose window, lancets, portal, stepped buttresses.

Nothing is tuned on it; it fills photos of 11 x 7.5 m.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tests.scenes.facade import Palette
from tests.scenes.shapes import Scene, arch_outline, boss, column, prism


def church(*, seed: int, palette: Palette, texel: float = 0.0025) -> Scene:
    """Return a front with relief from -1 m to +0.9 m; sizes and depths vary with the seed."""
    rng = np.random.default_rng(seed)
    scene = Scene(wall=palette.stone, texel=texel, seed=seed)
    _portal(scene, palette, deep=rng.uniform(0.7, 0.9))
    _rose(scene, palette, deep=rng.uniform(0.3, 0.4))
    for x in (-3.0, 3.0):
        _lancet(scene, palette, x=x + rng.uniform(-0.1, 0.1), deep=rng.uniform(0.35, 0.5))
    for x in (-4.7, -1.75, 1.75, 4.7):
        _buttress(scene, palette, x=x, out=rng.uniform(0.5, 0.75))
    for y in (-2.9, 3.1):
        out = rng.uniform(0.12, 0.25)
        profile = [(y, -0.05), (y, out), (y + 0.12, out), (y + 0.2, 0.02), (y + 0.2, -0.05)]
        scene.add(prism(profile, (-9.0, 9.0), palette.trim))
    for i in range(24):
        scene.add(boss((-5.5 + 0.48 * i, 2.95, 0.0), (0.1, 0.12, 0.16), palette.trim))
    return scene


def _ring(
    scene: Scene, palette: Palette, centre: tuple[float, float], radii: tuple[float, float],
    z: tuple[float, float], angles: np.ndarray,
) -> None:  # fmt: skip
    """Add a ring of straight stones about a centre."""
    for start, end in pairwise(angles):
        corners = ((radii[0], start), (radii[1], start), (radii[1], end), (radii[0], end))
        ring = [(centre[0] + r * np.cos(a), centre[1] + r * np.sin(a)) for r, a in corners]
        scene.add(prism(ring, z, palette.trim, along="z"))


def _portal(scene: Scene, palette: Palette, *, deep: float) -> None:
    """Door behind four receding arches with colonettes, under a gable."""
    spring, parent, steps = -1.7, -1, 4
    for step in range(steps):
        half = 1.15 - 0.14 * step
        outline = arch_outline((-half, half), (-3.7, spring), facets=20)
        low, high = -deep * (step + 1) / steps, -deep * step / steps
        parent = scene.sink(prism(outline, (low, high), palette.trim, along="z", parent=parent))
        for side in (-1, 1):
            place = (side * (half - 0.06), low + 0.06)
            scene.add(column(place, 0.05, (-3.7, spring), palette.trim))
    door = arch_outline((-0.62, 0.62), (-3.7, spring), facets=20)
    scene.sink(prism(door, (-deep - 0.15, -deep), palette.wood, along="z", parent=parent))
    for side in (-1, 1):
        rake = [(side * 1.5, -1.5), (side * 1.3, -1.5), (0.0, 0.1), (0.0, 0.35)]
        scene.add(prism(rake, (-0.05, 0.28), palette.trim, along="z"))


def _rose(scene: Scene, palette: Palette, *, deep: float) -> None:
    """Round window with twelve spokes and two rings of tracery."""
    centre, angles = (0.0, 1.6), np.linspace(0, 2 * np.pi, 25)
    hole = [(1.2 * np.cos(a), 1.6 + 1.2 * np.sin(a)) for a in angles[:-1]]
    scene.sink(prism(hole, (-deep, 0.0), palette.glass, along="z"))
    _ring(scene, palette, centre, (1.2, 1.36), (-0.05, 0.1), angles)
    for radii in ((0.28, 0.36), (0.8, 0.87)):
        _ring(scene, palette, centre, radii, (-0.2, -0.1), angles)
    for angle in angles[::2]:
        u, v = np.cos(angle), np.sin(angle)
        spoke = [
            (r * u - side * 0.03 * v, 1.6 + r * v + side * 0.03 * u)
            for r, side in ((0.3, 1), (0.3, -1), (1.2, -1), (1.2, 1))
        ]
        scene.add(prism(spoke, (-0.2, -0.1), palette.trim, along="z"))


def _lancet(scene: Scene, palette: Palette, *, x: float, deep: float) -> None:
    """Tall narrow window with a splayed sill, a mullion and a hood mould."""
    outline = arch_outline((x - 0.4, x + 0.4), (-1.6, 1.5), facets=16)
    scene.sink(prism(outline, (-deep, 0.0), palette.glass, along="z"))
    scene.add(column((x, -deep + 0.12), 0.04, (-1.6, 1.85), palette.trim))
    sill = [(-1.6, -deep), (-1.6, 0.06), (-1.3, -deep)]
    scene.add(prism(sill, (x - 0.4, x + 0.4), palette.trim))
    _ring(scene, palette, (x, 1.5), (0.45, 0.58), (-0.05, 0.12), np.linspace(0, np.pi, 12))


def _buttress(scene: Scene, palette: Palette, *, x: float, out: float) -> None:
    """Buttress of two steps with sloped tops."""
    for half, top, share in ((0.32, -0.4, 1.0), (0.26, 1.9, 0.55)):
        front = share * out
        profile = [
            (-6.0, -0.05), (-6.0, front), (top, front), (top + 0.8 * front, 0.0),
            (top + 0.8 * front, -0.05),
        ]  # fmt: skip
        scene.add(prism(profile, (x - half, x + half), palette.stone))
