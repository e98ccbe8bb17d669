"""Façades of other makes than `facade`: arcade, tracery, street, gable, palazzo; with cables, pots.

They fill photos of 11 x 7.5 m. `unseen` says how they are photographed and what is tuned on which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tests.scenes.balconies import IRON, balconies
from tests.scenes.facade import POOR, RICH, Palette
from tests.scenes.shapes import (
    Convex,
    Material,
    Scene,
    arch_outline,
    boss,
    box,
    column,
    prism,
    roll,
)

WIDE = (-9.0, 9.0)
#: Stone and wood with glass that mirrors the other side of the street.
MIRRORING = replace(RICH, glass=replace(RICH.glass, mirror=0.6))
#: Whitewash: brighter and with less texture than `POOR`; its wood is painted.
WHITE = replace(
    POOR,
    wall=Material(colour=(0.70, 0.69, 0.66), contrast=0.004),
    stone=Material(colour=(0.62, 0.61, 0.58), contrast=0.006),
    trim=Material(colour=(0.68, 0.67, 0.64), contrast=0.004),
    wood=Material(colour=(0.22, 0.30, 0.22), contrast=0.03),
    glass=Material(colour=(0.10, 0.11, 0.13), contrast=0.03, mirror=0.35),
)
CABLE = Material(colour=(0.06, 0.06, 0.06), contrast=0.03)
LEAVES = Material(colour=(0.16, 0.30, 0.10), contrast=0.3)
CLAY = Material(colour=(0.55, 0.28, 0.18), contrast=0.06)


def _stones(
    scene: Scene, material: Material, centre: tuple[float, float], radii: tuple[float, float],
    z: tuple[float, float], turn: tuple[float, float] = (0.0, np.pi), count: int = 12,
) -> None:  # fmt: skip
    """Add a ring of straight stones about a centre."""
    for start, end in pairwise(np.linspace(*turn, count + 1)):
        corners = ((radii[0], start), (radii[1], start), (radii[1], end), (radii[0], end))
        ring = [(centre[0] + r * np.cos(a), centre[1] + r * np.sin(a)) for r, a in corners]
        scene.add(prism(ring, z, material, along="z"))


def _band(scene: Scene, y: float, out: float, material: Material, high: float = 0.2) -> None:
    """Add a moulded band all along a façade."""
    profile = [(y, -0.05), (y + 0.5 * high, out), (y + high, out), (y + high, -0.05)]
    scene.add(prism(profile, WIDE, material))


def _cable(scene: Scene, y: float, z: float, sag: float) -> None:
    """Hang a cable of 2 cm along a façade, in straight pieces."""
    x = np.linspace(-6.0, 6.0, 13)
    height = y + sag * ((x / 6.0) ** 2 - 1)
    for (left, low), (right, high) in pairwise(zip(x, height, strict=True)):
        outline = [(left, low), (right, high), (right, high + 0.02), (left, low + 0.02)]
        scene.add(prism(outline, (z, z + 0.02), CABLE, along="z"))


def _pot(scene: Scene, x: float, y: float, z: float) -> None:
    """Stand a pot with a plant on a sill."""
    scene.add(column((x, z), 0.09, (y, y + 0.16), CLAY))
    for shift, up in ((-0.07, 0.24), (0.06, 0.28), (0.0, 0.36)):
        scene.add(boss((x + shift, y + up, z), (0.1, 0.12, 0.09), LEAVES))


def _paned(
    scene: Scene, palette: Palette, x: float, y: tuple[float, float], half: float, deep: float,
    parent: int = -1, front: float = 0.0,
) -> None:  # fmt: skip
    """Sink a window with a cross of glazing bars 5 cm before its panes."""
    reveal = scene.sink(
        box((x - half, x + half), y, (front - deep, front), palette.wood, parent=parent)
    )
    middle = y[0] + 0.62 * (y[1] - y[0])
    for left, right in ((x - half + 0.06, x - 0.025), (x + 0.025, x + half - 0.06)):
        for low, high in ((y[0] + 0.06, middle - 0.025), (middle + 0.025, y[1] - 0.06)):
            floor = (front - deep - 0.05, front - deep)
            scene.sink(box((left, right), (low, high), floor, palette.glass, parent=reveal))


def arcade(*, seed: int, palette: Palette = MIRRORING, texel: float = 0.0025) -> Scene:
    """Return arches on round columns before a porch of 1.5 m, windows and a pipe above them."""
    rng = np.random.default_rng(seed)
    scene = Scene(wall=palette.stone, texel=texel, seed=seed)
    deep, spring = rng.uniform(1.4, 1.8), rng.uniform(-1.35, -1.15)
    for x in (-4.05, -1.35, 1.35, 4.05):
        outline = arch_outline((x - 1.05, x + 1.05), (-5.0, spring), facets=24)
        porch = scene.sink(prism(outline, (-deep, 0.0), palette.wall, along="z"))
        door = arch_outline((x - 0.45, x + 0.45), (-5.0, spring - 0.7), facets=16)
        leaf = (-deep - 0.25, -deep)
        scene.sink(prism(door, leaf, palette.wood, along="z", parent=porch))
        _stones(scene, palette.trim, (x, spring), (1.05, 1.3), (-0.05, 0.1), count=18)
    for x in (-5.4, -2.7, 0.0, 2.7, 5.4):
        scene.add(column((x, 0.16), 0.17, (-5.0, spring - 0.15), palette.trim))
        scene.add(box((x - 0.26, x + 0.26), (spring - 0.15, spring), (-0.05, 0.42), palette.trim))
    _band(scene, 0.55, rng.uniform(0.15, 0.25), palette.trim)
    for x in (-4.05, -1.35, 1.35, 4.05):
        at = x + rng.uniform(-0.08, 0.08)
        _paned(scene, palette, at, (1.0, 2.5), 0.5, rng.uniform(0.2, 0.35))
        for side in (at - 0.62, at + 0.5):
            scene.add(box((side, side + 0.12), (0.95, 2.5), (-0.05, 0.07), palette.trim))
        _stones(scene, palette.trim, (at, 2.5), (0.5, 0.68), (-0.05, 0.1))
    for x in (-2.72, 2.66):
        scene.add(column((x, 0.09), 0.05, (0.75, 3.4), replace(IRON, colour=(0.35, 0.3, 0.24))))
    _band(scene, 3.3, rng.uniform(0.5, 0.7), palette.trim, high=0.45)
    return scene


def tracery(*, seed: int, palette: Palette = MIRRORING, texel: float = 0.0025) -> Scene:
    """Return a Gothic front: mullions and rings before dark glass, a rose, a stepped portal."""
    rng = np.random.default_rng(seed)
    scene = Scene(wall=palette.stone, texel=texel, seed=seed)
    for x in (-3.6, 3.6):
        at, half, deep = x + rng.uniform(-0.1, 0.1), 1.15, rng.uniform(0.35, 0.5)
        outline = arch_outline((at - half, at + half), (-2.4, 1.0), facets=24)
        scene.sink(prism(outline, (-deep, 0.0), palette.glass, along="z"))
        bars = (-deep + 0.12, -deep + 0.26)
        for shift in np.linspace(-half, half, 5)[1:-1]:
            upright = (at + shift - 0.045, at + shift + 0.045)
            scene.add(box(upright, (-2.4, 1.0), bars, palette.trim))
        for y in np.arange(-1.9, 0.9, 0.55):
            thin = (-deep + 0.14, -deep + 0.17)
            scene.add(box((at - half, at + half), (y, y + 0.02), thin, IRON))
        for shift in (-0.57, 0.57):
            _stones(scene, palette.trim, (at + shift, 1.0), (0.48, 0.57), bars)
        ring = (at, 1.55)
        _stones(scene, palette.trim, ring, (0.36, 0.45), bars, (0.0, 2 * np.pi), 20)
        _stones(scene, palette.trim, (at, 1.0), (half, half + 0.22), (-0.05, 0.12), count=20)
    hub, deep = (0.0, 1.7), rng.uniform(0.35, 0.45)
    round_outline = [(hub[0] + 1.3 * np.cos(a), hub[1] + 1.3 * np.sin(a))
                     for a in np.linspace(0, 2 * np.pi, 33)[:-1]]  # fmt: skip
    scene.sink(prism(round_outline, (-deep, 0.0), palette.glass, along="z"))
    for angle in np.linspace(0, 2 * np.pi, 13)[:-1]:
        along, aside = np.array([np.cos(angle), np.sin(angle)]), np.array(
            [-np.sin(angle), np.cos(angle)]
        )  # fmt: skip
        corners = [along * r + aside * w for r, w in
                   ((0.3, 0.035), (1.3, 0.035), (1.3, -0.035), (0.3, -0.035))]  # fmt: skip
        spoke = [(float(c[0]), float(c[1] + hub[1])) for c in corners]
        scene.add(prism(spoke, (-deep + 0.1, -deep + 0.22), palette.trim, along="z"))
    for radii in ((0.24, 0.34), (0.86, 0.94), (1.3, 1.5)):
        z = (-0.05, 0.14) if radii[1] > 1.4 else (-deep + 0.1, -deep + 0.24)
        _stones(scene, palette.trim, hub, radii, z, (0.0, 2 * np.pi), 28)
    parent, depth = -1, rng.uniform(0.8, 1.0)
    for step in range(4):
        half = 1.25 - 0.16 * step
        outline = arch_outline((-half, half), (-5.0, -1.4), facets=24)
        low = -depth * (step + 1) / 4
        wall = palette.wood if step == 3 else palette.trim
        parent = scene.sink(prism(outline, (low, low + depth / 4), wall, along="z", parent=parent))
        for side in (-1, 1):
            scene.add(column((side * (half - 0.06), low + 0.06), 0.05, (-5, -1.4), palette.trim))
    for x in (-5.25, -1.95, 1.95, 5.25):
        for low, out in ((-5.0, 0.6), (-1.2, 0.42), (1.6, 0.25)):
            scene.add(box((x - 0.24, x + 0.24), (low, low + 3.9), (-0.05, out), palette.trim))
    _band(scene, 3.35, 0.3, palette.trim, high=0.3)
    return scene


def street(*, seed: int, palette: Palette = MIRRORING, texel: float = 0.0025) -> Scene:
    """Return `balconies` with pots on their slabs, cables, a lamp and a wet step that mirrors."""
    scene = balconies(seed=seed, palette=palette, texel=texel)
    rng = np.random.default_rng(seed + 1)
    for x in (-3.3, 3.3):
        for shift in rng.uniform(-1.1, 1.1, 3):
            _pot(scene, x + shift, -0.1, rng.uniform(0.5, 0.7))
    _cable(scene, rng.uniform(2.2, 2.35), 0.12, 0.15)
    _cable(scene, rng.uniform(-0.75, -0.65), 0.2, 0.25)
    wet = replace(palette.trim, mirror=0.35)
    scene.add(box((-1.3, 1.3), (-5.0, -3.42), (-0.1, 1.2), wet))
    scene.add(roll((1.3, 0.35), 0.03, (1.9, 2.0), IRON), boss((1.95, 1.2, 0.5), (0.1,) * 3, IRON))
    return scene


def gable(*, seed: int, palette: Palette = MIRRORING, texel: float = 0.0025) -> Scene:
    """Return a stepped gable before a tiled roof and the wall of the next house."""
    rng = np.random.default_rng(seed)
    brick = replace(palette.stone, colour=(0.55, 0.30, 0.22), courses=(0.075, 0.25, 0.012))
    tiles = replace(palette.wood, colour=(0.45, 0.24, 0.18), courses=(0.16, 0.18, 0.015))
    scene = Scene(wall=palette.wall, texel=texel, seed=seed)
    out = rng.uniform(0.5, 0.7)
    roof = [(0.6, -0.05), (0.6, out - 0.1), (3.9, 0.05), (3.9, -0.05)]
    scene.add(prism(roof, (-4.6, 4.6), tiles))
    scene.add(box((-4.3, 4.3), (-5.0, 0.7), (-0.05, out), brick))
    for step in range(6):
        half, low = 4.3 - 0.62 * step, 0.7 + 0.5 * step
        scene.add(box((-half, half), (low, low + 0.5), (out - 0.35, out), brick))
        for side in (-1, 1):
            left, right = sorted((side * half, side * (half - 0.66)))
            cap = (low + 0.46, low + 0.54)
            scene.add(box((left, right), cap, (out - 0.4, out + 0.08), palette.trim))
    for x, y in ((-3.0, -2.2), (0.0, -2.2), (3.0, -2.2), (-2.4, -0.4), (0.0, -0.4), (2.4, -0.4)):
        at, half, high = x + rng.uniform(-0.08, 0.08), 0.5, 1.25
        inner = (at - half + 0.05, at + half - 0.05)
        scene.add(
            box((at - half, at + half), (y, y + high), (out - 0.01, out + 0.02), palette.trim),
            box(inner, (y + 0.05, y + high - 0.05), (out, out + 0.025), palette.glass),
            box((at - 0.03, at + 0.03), (y, y + high), (out, out + 0.06), palette.trim),
            box((at - half, at + half), (y + 0.8, y + 0.85), (out, out + 0.06), palette.trim),
        )
    for x in (-3.9, 3.9):
        scene.add(column((x, out + 0.08), 0.045, (-5.0, 0.6), IRON))
        for y in np.arange(-3.5, 0.0, 0.5):
            scene.add(boss((x + 0.3, y, out), (0.22, 0.3, 0.1), LEAVES))
    scene.add(box((-1.6, 1.6), (1.35, 1.39), (out, out + 0.35), IRON))
    for x in np.arange(-1.6, 1.61, 0.13):
        bar = (out + 0.32, out + 0.34)
        scene.add(box((x - 0.01, x + 0.01), (0.75, 1.39), bar, IRON))
    return scene


def palazzo(*, seed: int, palette: Palette = WHITE, texel: float = 0.0025) -> Scene:
    """Return three storeys of whitewash whose shutters have louvres of 22 mm every 55 mm."""
    rng = np.random.default_rng(seed)
    scene = Scene(wall=palette.wall, texel=texel, seed=seed)
    for y in (-1.35, 1.05):
        _band(scene, y, rng.uniform(0.12, 0.2), palette.trim)
    for y, high in ((-3.4, 1.6), (-0.85, 1.55), (1.5, 1.3)):
        for x in (-4.3, -1.45, 1.45, 4.3):
            at, half = x + rng.uniform(-0.06, 0.06), 0.46
            _paned(scene, palette, at, (y, y + high), half, rng.uniform(0.18, 0.28))
            for side in (at - half - 0.12, at + half):
                scene.add(box((side, side + 0.12), (y, y + high), (-0.05, 0.05), palette.trim))
            hood = [(y + high, -0.05), (y + high, 0.1), (y + high + 0.14, 0.18)]
            scene.add(prism([*hood, (y + high + 0.14, -0.05)], (at - 0.7, at + 0.7), palette.trim))
            if y > -2.0 and rng.uniform() < 0.8:
                for left in (at - 2 * half - 0.02, at + half + 0.02):
                    _shutter(scene, palette, left, (y, y + high), half)
    for x in (-5.5, 5.5):
        scene.add(box((x - 0.3, x + 0.3), (-5.0, 3.1), (-0.05, 0.09), palette.trim))
    for at in np.arange(-5.6, 5.7, 0.7):
        profile = [(2.95, -0.05), (2.95, 0.1), (3.1, 0.4), (3.25, 0.4), (3.25, -0.05)]
        scene.add(prism(profile, (at - 0.07, at + 0.07), palette.trim))
    _band(scene, 3.25, rng.uniform(0.5, 0.65), palette.trim, high=0.3)
    _cable(scene, rng.uniform(0.85, 0.95), 0.06, 0.05)
    return scene


def _shutter(
    scene: Scene, palette: Palette, left: float, y: tuple[float, float], wide: float
) -> None:
    """Open a louvred shutter against the wall."""
    right = left + wide
    for edge in ((left, left + 0.05), (right - 0.05, right)):
        scene.add(box(edge, y, (-0.01, 0.09), palette.wood))
    for slat in np.arange(y[0], y[1] - 0.03, 0.055):
        profile = [(slat, 0.03), (slat + 0.01, 0.03), (slat + 0.03, 0.08), (slat + 0.022, 0.08)]
        scene.add(prism(profile, (left, right), palette.wood))


def people(rng: np.random.Generator, count: int = 2) -> tuple[list[Convex], list[Convex]]:
    """Return people as the far and as the near photo shows them: they have walked on."""
    far: list[Convex] = []
    near: list[Convex] = []
    for _ in range(count):
        cloth = Material(colour=tuple(rng.uniform(0.08, 0.5, 3).tolist()), contrast=0.15)
        start, walked, z = rng.uniform(-4.5, 3.5), rng.uniform(0.4, 1.2), rng.uniform(0.6, 1.0)
        for bodies, x in ((far, start), (near, start + walked)):
            bodies.extend(_person(x, z, cloth))
    return far, near


def _person(x: float, z: float, cloth: Material) -> Sequence[Convex]:
    """Return somebody who stands before a façade."""
    skin = Material(colour=(0.62, 0.45, 0.36), contrast=0.05)
    return (
        boss((x, -2.75, z), (0.22, 0.75, 0.15), cloth),
        boss((x, -1.9, z), (0.1, 0.13, 0.1), skin),
    )
