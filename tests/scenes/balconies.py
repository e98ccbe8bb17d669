"""A façade of thin things before deep ground: iron railings, grilles, shutters, a shaded cornice.

Bars are 18 mm wide and 11 cm apart, on balconies that stand out by a metre: narrower than their own
parallax. It fills photos of 11 x 7.5 m; nothing is tuned on seeds of 1100 and above.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from tests.scenes.facade import Palette
from tests.scenes.shapes import Material, Scene, box, column, prism

#: Painted iron: dark, and nearly without texture.
IRON = Material(colour=(0.13, 0.14, 0.14), contrast=0.05)
#: Width of a bar and of a handrail, and distance of bars. [m]
BAR, RAIL, APART = 0.018, 0.05, 0.11


def balconies(*, seed: int, palette: Palette, texel: float = 0.0025) -> Scene:
    """Return a façade with relief from -0.4 m to +1.25 m; sizes and depths vary with the seed."""
    rng = np.random.default_rng(seed)
    scene = Scene(wall=palette.wall, texel=texel, seed=seed)
    _rustication(scene, palette, rng)
    for x in (-3.3, 0.0, 3.3):
        at = x + rng.uniform(-0.1, 0.1)
        _french_window(scene, palette, rng, x=at)
        if x:
            _balcony(scene, palette, x=at, out=rng.uniform(0.95, 1.25))
            _grilled_window(scene, palette, rng, x=at)
        else:
            _stairs(scene, palette, rng, x=at)
    for x in (-5.25, 5.3):
        place = (x + rng.uniform(-0.1, 0.1), 0.1)
        scene.add(column(place, 0.05, (-4.5, 2.75), replace(IRON, colour=(0.35, 0.30, 0.24))))
    _cornice(scene, palette, out=rng.uniform(0.55, 0.75))
    return scene


def _rustication(scene: Scene, palette: Palette, rng: np.random.Generator) -> None:
    """Ground floor of blocks with open joints, a band over it."""
    out = rng.uniform(0.04, 0.07)
    for row in range(8):
        low = -3.95 + 0.42 * row
        for left, right in ((-9.0, -4.15), (-2.45, -0.75), (0.75, 2.45), (4.15, 9.0)):
            edges = np.arange(left, right - 0.1, 0.85) + (0.425 if row % 2 else 0.0)
            edges = np.unique(np.clip([left, *edges, right], left, right))
            for start, end in itertools.pairwise(edges):
                if end - start > 0.1:
                    inner = (start + 0.012, end - 0.012)
                    block = (low + 0.012, low + 0.408)
                    scene.add(box(inner, block, (-0.05, out), palette.stone))
    scene.add(box((-9.0, 9.0), (-0.58, -0.42), (-0.05, out + 0.04), palette.trim))


def _french_window(scene: Scene, palette: Palette, rng: np.random.Generator, *, x: float) -> None:
    """Window to the floor with glazing bars, between open louvred shutters."""
    half, low, high, deep = 0.55, -0.1, 2.05, rng.uniform(0.2, 0.3)
    reveal = scene.sink(box((x - half, x + half), (low, high), (-deep, 0.0), palette.trim))
    floor = -deep - 0.05
    for left, right in ((x - half + 0.07, x - 0.04), (x + 0.04, x + half - 0.07)):
        for under in np.linspace(low + 0.1, high - 0.55, 4):
            pane = (under, under + (high - low) / 4 - 0.06)
            scene.sink(box((left, right), pane, (floor, -deep), palette.glass, parent=reveal))
    out = rng.uniform(0.05, 0.08)
    for left in (x - 2 * half - 0.02, x + half + 0.02):
        right = left + half
        for side in ((left, left + 0.06), (right - 0.06, right)):
            scene.add(box(side, (low, high), (-0.01, out), palette.wood))
        for slat in np.arange(low, high - 0.03, 0.07):
            profile = [(slat, 0.01), (slat + 0.01, 0.01), (slat + 0.04, out), (slat + 0.03, out)]
            scene.add(prism(profile, (left, right), palette.wood))
    scene.add(
        box((x - half - 0.1, x + half + 0.1), (high, high + 0.12), (-0.05, 0.15), palette.trim)
    )


def _balcony(scene: Scene, palette: Palette, *, x: float, out: float) -> None:
    """Slab on brackets with an iron railing round it."""
    left, right, floor, top = x - 1.3, x + 1.3, -0.1, 0.92
    scene.add(box((left - 0.05, right + 0.05), (floor - 0.14, floor), (-0.05, out), palette.trim))
    for at in (left + 0.3, right - 0.3):
        profile = [(floor - 0.14, -0.05), (floor - 0.14, 0.8 * out), (floor - 0.45, 0.1),
                   (floor - 0.5, -0.05)]  # fmt: skip
        scene.add(prism(profile, (at - 0.09, at + 0.09), palette.trim))
    front = out - 0.06
    for at in np.arange(left, right + 0.01, APART):
        scene.add(_bar((at, floor + 0.08, front), top))
    for side in (left, right):
        for z in np.arange(0.06, front - 0.5 * APART, APART):
            scene.add(_bar((side, floor + 0.08, z), top))
        scene.add(box((side - RAIL / 2, side + RAIL / 2), (top, top + RAIL), (0.0, front), IRON))
    ends = (left - RAIL / 2, right + RAIL / 2)
    scene.add(
        box(ends, (top, top + RAIL), (front - RAIL / 2, front + RAIL / 2), IRON),
        box(ends, (floor + 0.06, floor + 0.09), (front - BAR, front + BAR), IRON),
    )


def _bar(foot: tuple[float, float, float], top: float):
    """Return a square upright bar."""
    x, y, z = foot
    half = BAR / 2
    return box((x - half, x + half), (y, top), (z - half, z + half), IRON)


def _grilled_window(scene: Scene, palette: Palette, rng: np.random.Generator, *, x: float) -> None:
    """Ground-floor window behind a grille that stands out."""
    half, low, high, deep = 0.6, -2.6, -1.0, rng.uniform(0.2, 0.3)
    scene.sink(box((x - half, x + half), (low, high), (-deep, 0.0), palette.glass))
    scene.add(box((x - 0.04, x + 0.04), (low, high), (-deep - 0.02, -deep + 0.04), palette.wood))
    out = rng.uniform(0.1, 0.18)
    for at in np.arange(x - half, x + half + 0.01, 0.12):
        scene.add(_bar((at, low, out), high))
    for y in np.linspace(low + 0.05, high - 0.05, 5):
        scene.add(box((x - half, x + half), (y - 0.009, y + 0.009), (out - 0.02, out + 0.02), IRON))
    for side in (x - half - 0.18, x + half):
        scene.add(box((side, side + 0.18), (low, high), (-0.05, 0.08), palette.trim))


def _stairs(scene: Scene, palette: Palette, rng: np.random.Generator, *, x: float) -> None:
    """Door up some steps, with handrails on posts."""
    deep = rng.uniform(0.3, 0.4)
    scene.sink(box((x - 0.6, x + 0.6), (-2.9, -0.75), (-deep, 0.0), palette.wood))
    for step, out in enumerate((0.9, 0.6, 0.3)):
        top = -3.4 + 0.17 * step
        scene.add(box((x - 1.2, x + 1.2), (-5.0, top), (-0.1, out), palette.trim))
    for side in (x - 1.1, x + 1.1):
        rail = [(-2.1, 0.1), (-2.45, 0.85), (-2.5, 0.85), (-2.15, 0.1)]
        scene.add(prism(rail, (side - RAIL / 2, side + RAIL / 2), IRON))
        for z, foot in ((0.8, -3.4), (0.5, -3.23), (0.2, -3.06)):
            scene.add(_bar((side, foot, z), -2.45 + (0.85 - z) * 0.46))


def _cornice(scene: Scene, palette: Palette, *, out: float) -> None:
    """Cornice on modillions that lie in its shade."""
    wide = (-9.0, 9.0)
    scene.add(box(wide, (2.45, 2.6), (-0.05, 0.08), palette.trim))
    for at in np.arange(-5.6, 5.7, 0.4):
        profile = [(2.75, -0.05), (2.75, 0.15), (2.9, 0.8 * out), (3.05, 0.8 * out), (3.05, -0.05)]
        scene.add(prism(profile, (at - 0.07, at + 0.07), palette.trim))
    scene.add(
        box(wide, (3.05, 3.2), (-0.05, out), palette.trim),
        prism([(3.2, -0.05), (3.2, out), (3.34, out + 0.1), (3.4, -0.05)], wide, palette.trim),
    )
