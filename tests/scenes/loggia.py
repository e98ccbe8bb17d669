"""Another façade than `facade`: portal with archivolts, barred windows, balcony with balusters.

Nothing is tuned on it; it is laid out for photos of half the width (5.7 x 3.8 m).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tests.scenes.facade import Palette
from tests.scenes.shapes import Scene, arch_outline, box, column, prism


def loggia(*, seed: int, palette: Palette, texel: float = 0.0025) -> Scene:
    """Return a façade with relief from -0.9 m to +0.6 m; sizes and depths vary with the seed."""
    rng = np.random.default_rng(seed)
    scene = Scene(wall=palette.stone, texel=texel, seed=seed)
    _portal(scene, palette, x=-1.55 + rng.uniform(-0.1, 0.1), deep=rng.uniform(0.5, 0.65))
    for x in (0.55, 1.95):
        _barred_window(scene, palette, x=x + rng.uniform(-0.05, 0.05), deep=rng.uniform(0.2, 0.3))
    _balcony(scene, palette, out=rng.uniform(0.45, 0.55))
    for x in (-2.7, -0.3, 2.7):
        scene.add(box((x - 0.12, x + 0.12), (-3.0, 0.35), (-0.05, 0.12), palette.trim))
    scene.add(box((-6.0, 6.0), (-3.0, -1.6), (-0.05, rng.uniform(0.12, 0.18)), palette.wall))
    return scene


def _portal(scene: Scene, palette: Palette, *, x: float, deep: float) -> None:
    """Round-headed door behind three receding arches, each with its colonettes."""
    spring, parent, steps = -0.35, -1, 3
    for step in range(steps):
        half = 0.85 - 0.13 * step
        outline = arch_outline((x - half, x + half), (-1.6, spring), facets=20)
        low, high = -deep * (step + 1) / steps, -deep * step / steps
        parent = scene.sink(prism(outline, (low, high), palette.trim, along="z", parent=parent))
        for side in (-1, 1):
            place = (x + side * (half - 0.05), low + 0.05)
            scene.add(column(place, 0.045, (-1.6, spring), palette.trim))
    half = 0.85 - 0.13 * (steps - 1) - 0.1
    door = arch_outline((x - half, x + half), (-1.6, spring), facets=20)
    scene.sink(prism(door, (-deep - 0.15, -deep), palette.wood, along="z", parent=parent))
    angles = np.linspace(0, np.pi, 14)
    for start, end in pairwise(angles):
        ring = [
            (x + r * np.cos(a), spring + r * np.sin(a))
            for r, a in ((0.86, start), (1.02, start), (1.02, end), (0.86, end))
        ]
        scene.add(prism(ring, (-0.05, 0.09), palette.trim, along="z"))


def _barred_window(scene: Scene, palette: Palette, *, x: float, deep: float) -> None:
    """Deep window with upright bars before the glass."""
    low, high, half = -1.3, -0.1, 0.42
    scene.sink(box((x - half, x + half), (low, high), (-deep, 0.0), palette.glass))
    for i in range(5):
        at = x - half + 2 * half * (i + 1) / 6
        scene.add(box((at - 0.012, at + 0.012), (low, high), (-0.06, -0.036), palette.wood))
    for side in (-1, 1):
        left, right = sorted((x + side * half, x + side * (half + 0.11)))
        scene.add(box((left, right), (low, high), (-0.05, 0.05), palette.trim))
    scene.add(box((x - 0.6, x + 0.6), (high, high + 0.14), (-0.05, 0.16), palette.trim))


def _balcony(scene: Scene, palette: Palette, *, out: float) -> None:
    """Slab, balusters and rail, before an upper wall with a field sunk into it."""
    scene.sink(box((-2.0, 2.2), (0.75, 1.8), (-0.15, 0.0), palette.wall))
    scene.add(box((-2.4, 2.6), (0.42, 0.54), (-0.05, out), palette.trim))
    scene.add(box((-2.4, 2.6), (0.98, 1.06), (out - 0.14, out - 0.02), palette.trim))
    for i in range(16):
        at = -2.3 + i * 0.32
        scene.add(column((at, out - 0.08), 0.045, (0.54, 0.98), palette.trim))
