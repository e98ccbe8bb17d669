"""A façade composed of what façades are made of, laid out from a seed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tests.scenes.shapes import (
    Convex,
    Material,
    Scene,
    Target,
    arch_outline,
    boss,
    box,
    column,
    prism,
    roll,
)

#: Half width and half height for which the layout is drawn; larger scenes show more plain wall. [m]
HALF_WIDTH, HALF_HEIGHT = 5.67, 3.78


@dataclass(frozen=True, slots=True, kw_only=True)
class Palette:
    """The materials of a façade."""

    wall: Material
    stone: Material
    trim: Material
    wood: Material
    glass: Material


RICH = Palette(
    wall=Material(colour=(0.80, 0.66, 0.48), contrast=0.075),
    stone=Material(colour=(0.66, 0.58, 0.47), contrast=0.10, courses=(0.28, 0.74, 0.012)),
    trim=Material(colour=(0.80, 0.75, 0.66), contrast=0.065),
    wood=Material(colour=(0.36, 0.24, 0.15), contrast=0.12, courses=(9.0, 0.13, 0.008)),
    glass=Material(colour=(0.17, 0.21, 0.25), contrast=0.22),
)
#: Plain plaster: a few grey levels of texture, hardly above the noise of the camera.
POOR = Palette(
    wall=Material(colour=(0.80, 0.66, 0.48), contrast=0.006),
    stone=Material(colour=(0.66, 0.58, 0.47), contrast=0.008),
    trim=Material(colour=(0.80, 0.75, 0.66), contrast=0.006),
    wood=Material(colour=(0.36, 0.24, 0.15), contrast=0.012),
    glass=Material(colour=(0.17, 0.21, 0.25), contrast=0.02),
)


def facade(
    *,
    seed: int = 1,
    palette: Palette = RICH,
    texel: float = 0.0025,
    targets: bool = True,
) -> Scene:
    """Return a façade of 11.3 x 7.6 m with relief from -0.75 m to +1 m.

    Parameters
    ----------
    seed : int
        Of the texture and of the layout: sizes and depths vary from seed to seed.
    palette : Palette
        `RICH` stone and plaster, or `POOR` plain plaster.
    texel : float
        Finest detail: two thirds of the photo's pixel. [m]
    targets : bool
        Whether survey targets are on it.
    """
    rng = np.random.default_rng(seed)
    scene = Scene(wall=palette.wall, texel=texel, seed=seed)
    _base(scene, palette, rng)
    _door(scene, palette, rng)
    for x in (-3.15, 3.15):
        _window(scene, palette, rng, x=x)
    for x in (-3.15, 3.15):
        _arched_window(scene, palette, rng, x=x)
    _niche(scene, palette, rng)
    for x in (-5.0, -1.62, 1.62, 5.0):
        _pilaster(scene, palette, rng, x=x)
    _string_course(scene, palette, rng)
    _cornice(scene, palette, rng)
    if targets:
        _targets(scene)
    return scene


def demo_scene(*, texel: float = 0.0025) -> Scene:
    """Return the façade of `bifocal demo`."""
    scene = facade(seed=7, texel=texel)
    return replace(scene, sun=np.array([-0.44, 0.56, 0.70]))


def _jitter(rng: np.random.Generator, value: float, share: float = 0.12) -> float:
    """Return the value varied by up to a share of itself."""
    return float(value * (1 + share * rng.uniform(-1, 1)))


def _base(scene: Scene, palette: Palette, rng: np.random.Generator) -> None:
    """Plinth with a sloped top, and the pavement before it."""
    out = _jitter(rng, 0.14)
    for x in ((-9.0, -1.35), (1.35, 9.0)):
        scene.add(
            box(x, (-6.0, -2.62), (-0.1, out), palette.stone),
            prism(
                [(-2.62, -0.1), (-2.62, out), (-2.62 + out, 0.0), (-2.62 + out, -0.1)],
                x,
                palette.trim,
            ),
        )
        scene.add(roll((-2.66, out), 0.035, x, palette.trim))
    scene.corners["plinth left"] = (-1.35, -2.72, out)
    scene.corners["plinth right"] = (1.35, -2.72, out)
    for step, depth in enumerate((0.95, 0.65, 0.35)):
        top = -3.62 + 0.16 * step
        wide = 1.95 - 0.22 * step
        scene.add(box((-wide, wide), (-6.0, top), (-0.1, depth), palette.trim))


def _door(scene: Scene, palette: Palette, rng: np.random.Generator) -> None:
    """Arched door in a deep porch with half columns, archivolt and entablature."""
    deep = _jitter(rng, 0.55)
    spring = -0.85
    outline = arch_outline((-0.82, 0.82), (-3.30, spring))
    porch = scene.sink(prism(outline, (-deep, 0.0), palette.trim, along="z"))
    inner = arch_outline((-0.66, 0.66), (-3.30, spring), facets=16)
    scene.sink(prism(inner, (-deep - 0.16, -deep), palette.wood, along="z", parent=porch))
    floor = -deep - 0.16
    for x in (-0.33, 0.33):
        for low, high in ((-3.12, -2.32), (-2.20, -1.25)):
            scene.add(_panel((x - 0.23, x + 0.23), (low, high), floor, 0.05, palette.wood))
    scene.add(box((-0.035, 0.035), (-3.30, spring), (floor, floor + 0.07), palette.wood))
    scene.add(box((-0.66, 0.66), (-1.02, -0.90), (floor, floor + 0.10), palette.wood))
    angles = np.linspace(0, np.pi, 12)
    for i, (start, end) in enumerate(pairwise(angles)):
        out = 0.07 + 0.025 * (i % 2)
        ring = [
            (r * np.cos(a), spring + r * np.sin(a))
            for r, a in ((0.83, start), (1.09, start), (1.09, end), (0.83, end))
        ]
        scene.add(prism(ring, (-0.05, out), palette.trim, along="z"))
    key = [
        (-0.09, spring + 0.80),
        (0.09, spring + 0.80),
        (0.14, spring + 1.16),
        (-0.14, spring + 1.16),
    ]
    scene.add(prism(key, (-0.05, 0.19), palette.trim, along="z"))
    radius = _jitter(rng, 0.155, 0.06)
    for x in (-1.16, 1.16):
        z = radius * 0.75
        scene.add(
            column((x, z), radius, (-2.90, -0.42), palette.trim),
            box((x - 0.2, x + 0.2), (-3.14, -2.98), (-0.05, z + 0.2), palette.trim),
            box((x - 0.175, x + 0.175), (-2.98, -2.90), (-0.05, z + 0.175), palette.trim),
            box((x - 0.175, x + 0.175), (-0.42, -0.34), (-0.05, z + 0.175), palette.trim),
            box((x - 0.2, x + 0.2), (-0.34, -0.24), (-0.05, z + 0.2), palette.trim),
            box((x - 0.2, x + 0.2), (-3.30, -3.14), (-0.05, z + 0.2), palette.stone),
        )
    scene.corners["porch left"] = (-0.82, spring, 0.0)
    scene.corners["porch right"] = (0.82, spring, 0.0)
    out = radius * 1.75
    scene.add(
        box((-1.38, 1.38), (0.31, 0.47), (-0.05, out), palette.trim),
        prism(
            [(0.47, -0.05), (0.47, out + 0.03), (0.53, out + 0.10), (0.53, -0.05)],
            (-1.45, 1.45),
            palette.trim,
        ),
        box((-1.47, 1.47), (0.53, 0.57), (-0.05, out + 0.11), palette.trim),
    )


def _panel(
    x: tuple[float, float], y: tuple[float, float], z: float, out: float, material: Material
) -> Convex:
    """Return a raised field with bevelled edges."""
    body = box(x, y, (z - 0.01, z + out), material)
    slope = np.sqrt(0.5)
    bevels = [
        [slope, 0, slope, slope * (x[1] + z + 0.01)],
        [-slope, 0, slope, slope * (-x[0] + z + 0.01)],
        [0, slope, slope, slope * (y[1] + z + 0.01)],
        [0, -slope, slope, slope * (-y[0] + z + 0.01)],
    ]
    return replace(body, planes=np.vstack([body.planes, bevels]))


def _window(scene: Scene, palette: Palette, rng: np.random.Generator, *, x: float) -> None:
    """Ground-floor window: reveal, frame, mullions, sill, architrave and pediment."""
    half, low, high = 0.62, -1.75, -0.12
    deep = _jitter(rng, 0.26)
    reveal = scene.sink(box((x - half, x + half), (low, high), (-deep, 0.0), palette.trim))
    frame = 0.09
    floor = -deep - 0.07
    for left, right in ((x - half + frame, x - 0.05), (x + 0.05, x + half - frame)):
        for under, over in ((low + frame, -0.78), (-0.70, high - frame)):
            scene.sink(
                box((left, right), (under, over), (floor, -deep), palette.glass, parent=reveal)
            )
            middle = (left + right) / 2
            scene.add(
                box(
                    (middle - 0.018, middle + 0.018),
                    (under, over),
                    (floor, floor + 0.035),
                    palette.wood,
                )
            )
    scene.corners[f"window {x:+.2f} low left"] = (x - half, low, 0.0)
    scene.corners[f"window {x:+.2f} high right"] = (x + half, high, 0.0)
    side = 0.17
    out = _jitter(rng, 0.055)
    for left in (x - half - side, x + half):
        scene.add(box((left, left + side), (low, high), (-0.05, out), palette.trim))
    scene.add(
        box((x - half - side, x + half + side), (high, high + side), (-0.05, out), palette.trim),
        box((x - half - 0.24, x + half + 0.24), (low - 0.12, low), (-0.05, 0.21), palette.trim),
        box((x - half - 0.14, x - half), (low - 0.38, low - 0.12), (-0.05, 0.12), palette.trim),
        box((x + half, x + half + 0.14), (low - 0.38, low - 0.12), (-0.05, 0.12), palette.trim),
    )
    base = high + side
    wide = half + side + 0.14
    scene.add(box((x - wide, x + wide), (base, base + 0.09), (-0.05, 0.24), palette.trim))
    peak = base + 0.09
    scene.add(
        prism(
            [(x - wide, peak), (x + wide, peak), (x, peak + 0.40)],
            (-0.05, 0.13),
            palette.wall,
            along="z",
        ),
    )
    for sign in (-1, 1):
        rake = [
            (x + sign * wide, peak),
            (x + sign * (wide - 0.16), peak),
            (x, peak + 0.36),
            (x, peak + 0.46),
        ]
        scene.add(prism(rake, (-0.05, 0.25), palette.trim, along="z"))
    scene.add(boss((x, peak + 0.14, 0.13), (0.13, 0.10, 0.07), palette.trim))


def _arched_window(scene: Scene, palette: Palette, rng: np.random.Generator, *, x: float) -> None:
    """Upper-floor window with a round head, frame and balustrade."""
    half, low, spring = 0.52, 1.12, 1.98
    deep = _jitter(rng, 0.22)
    reveal = scene.sink(
        prism(
            arch_outline((x - half, x + half), (low, spring)), (-deep, 0.0), palette.trim, along="z"
        )
    )
    pane = half - 0.08
    scene.sink(
        prism(
            arch_outline((x - pane, x + pane), (low + 0.08, spring)),
            (-deep - 0.06, -deep),
            palette.glass,
            along="z",
            parent=reveal,
        )
    )
    for bar in (-0.15, 0.15):
        scene.add(
            box(
                (x + bar - 0.02, x + bar + 0.02),
                (low, spring + 0.42),
                (-deep - 0.06, -deep - 0.01),
                palette.trim,
            )
        )
    for y in (1.55, spring):
        scene.add(
            box(
                (x - pane, x + pane),
                (y - 0.02, y + 0.02),
                (-deep - 0.06, -deep - 0.01),
                palette.trim,
            )
        )
    angles = np.linspace(0, np.pi, 10)
    for start, end in pairwise(angles):
        ring = [
            (x + r * np.cos(a), spring + r * np.sin(a))
            for r, a in ((half, start), (half + 0.14, start), (half + 0.14, end), (half, end))
        ]
        scene.add(prism(ring, (-0.05, 0.06), palette.trim, along="z"))
    for left in (x - half - 0.14, x + half):
        scene.add(box((left, left + 0.14), (low, spring), (-0.05, 0.06), palette.trim))
    scene.add(box((x - 0.80, x + 0.80), (low - 0.08, low), (-0.05, 0.36), palette.trim))
    scene.add(box((x - 0.80, x + 0.80), (low + 0.32, low + 0.39), (0.24, 0.34), palette.trim))
    for i in range(9):
        at = x - 0.74 + i * 0.185
        scene.add(column((at, 0.29), 0.034, (low, low + 0.32), palette.trim))


def _niche(scene: Scene, palette: Palette, rng: np.random.Generator) -> None:
    """Central panel of the upper floor: a sunk field with a carved medallion."""
    deep = _jitter(rng, 0.12)
    scene.sink(box((-0.95, 0.95), (1.02, 2.36), (-deep, 0.0), palette.wall))
    scene.corners["field low right"] = (0.95, 1.02, 0.0)
    scene.corners["field high left"] = (-0.95, 2.36, 0.0)
    middle = 1.69
    angles = np.linspace(0, 2 * np.pi, 21)
    for start, end in pairwise(angles):
        ring = [
            (r * np.cos(a), middle + r * np.sin(a))
            for r, a in ((0.44, start), (0.55, start), (0.55, end), (0.44, end))
        ]
        scene.add(prism(ring, (-deep - 0.05, -deep + 0.10), palette.trim, along="z"))
    for petal in range(8):
        a = petal * np.pi / 4
        scene.add(
            boss(
                (0.23 * np.cos(a), middle + 0.23 * np.sin(a), -deep),
                (0.085, 0.085, 0.06),
                palette.trim,
            )
        )
    scene.add(boss((0.0, middle, -deep), (0.15, 0.15, 0.13), palette.trim))
    for x in (-0.78, 0.78):
        for y in (1.20, 2.18):
            scene.add(_panel((x - 0.1, x + 0.1), (y - 0.1, y + 0.1), -deep, 0.05, palette.trim))


def _pilaster(scene: Scene, palette: Palette, rng: np.random.Generator, *, x: float) -> None:
    """Giant pilaster with base, sunk panel and capital, through both floors."""
    out = _jitter(rng, 0.11)
    half = 0.27
    plain = palette.trim
    scene.add(
        box((x - half, x + half), (-2.20, 0.62), (-0.05, out), plain),
        box((x - half + 0.02, x + half - 0.02), (0.98, 2.22), (-0.05, out * 0.8), plain),
        box((x - half - 0.07, x + half + 0.07), (-2.52, -2.34), (-0.05, out + 0.07), plain),
        roll((-2.29, out), 0.05, (x - half - 0.05, x + half + 0.05), plain),
        box((x - half - 0.05, x + half + 0.05), (-2.34, -2.20), (-0.05, out), plain),
        prism(
            [(2.22, -0.05), (2.22, out), (2.36, out + 0.09), (2.36, -0.05)],
            (x - half - 0.06, x + half + 0.06),
            plain,
        ),
        box((x - half - 0.09, x + half + 0.09), (2.36, 2.46), (-0.05, out + 0.11), plain),
    )
    for shift in (-0.13, 0.0, 0.13):
        scene.add(column((x + shift, out - 0.01), 0.035, (-1.95, 0.40), plain))
    scene.corners[f"pilaster {x:+.2f}"] = (x - half, -1.2, out)


def _string_course(scene: Scene, palette: Palette, rng: np.random.Generator) -> None:
    """Band between the floors with a moulded profile."""
    out = _jitter(rng, 0.20)
    span = (-9.0, 9.0)
    scene.add(
        box(span, (0.62, 0.74), (-0.05, 0.6 * out), palette.trim),
        prism([(0.74, -0.05), (0.74, 0.6 * out), (0.84, out), (0.84, -0.05)], span, palette.trim),
        box(span, (0.84, 0.92), (-0.05, out + 0.02), palette.trim),
        prism([(0.92, -0.05), (0.92, out), (0.98, 0.02), (0.98, -0.05)], span, palette.trim),
    )
    for i in range(48):
        x = -5.64 + 0.24 * i
        scene.add(
            box((x - 0.06, x + 0.06), (0.645, 0.735), (-0.05, 0.6 * out + 0.045), palette.trim)
        )


def _cornice(scene: Scene, palette: Palette, rng: np.random.Generator) -> None:
    """Build the main cornice that steps out to one metre, on brackets."""
    span = (-9.0, 9.0)
    out = _jitter(rng, 0.95, 0.05)
    scene.add(
        box(span, (2.46, 2.58), (-0.05, 0.10), palette.trim),
        prism([(2.58, -0.05), (2.58, 0.10), (2.70, 0.20), (2.70, -0.05)], span, palette.trim),
        box(span, (2.70, 2.98), (-0.05, 0.22), palette.wall),
        box(span, (2.98, 3.06), (-0.05, 0.32), palette.trim),
        prism([(3.06, -0.05), (3.06, 0.32), (3.20, 0.55), (3.20, -0.05)], span, palette.trim),
        box(span, (3.20, 3.32), (-0.05, out - 0.10), palette.trim),
        prism([(3.32, -0.05), (3.32, out - 0.10), (3.44, out), (3.44, -0.05)], span, palette.trim),
        box(span, (3.44, 9.0), (-0.05, out), palette.trim),
    )
    for i in range(19):
        x = -5.58 + 0.62 * i
        profile = [(2.98, 0.20), (2.98, 0.36), (3.08, 0.62), (3.20, 0.74), (3.20, 0.20)]
        scene.add(prism(profile, (x - 0.09, x + 0.09), palette.trim))
        scene.add(boss((x + 0.31, 2.84, 0.22), (0.10, 0.08, 0.06), palette.trim))


def _targets(scene: Scene) -> None:
    """Survey targets on the wall, on the pilasters and on other flat fronts."""
    places = [
        (-4.15, -2.15),
        (-2.10, -2.15),
        (2.10, -2.15),
        (4.15, -2.15),
        (-5.45, -1.0),
        (-1.45, 0.15),
        (5.45, -1.0),
        (-4.40, 0.42),
        (4.40, 0.42),
        (-5.45, 2.15),
        (-2.10, 2.25),
        (2.10, 2.25),
        (5.45, 2.15),
        (-4.30, 2.25),
        (4.30, 2.25),
        (-5.0, 1.6),
        (-1.62, 1.6),
        (1.62, 1.6),
        (5.0, 1.6),
        (-4.6, -3.2),
        (4.6, -3.2),
        (-2.6, -3.2),
        (2.6, -3.2),
        (-4.6, 3.62),
        (-1.5, 3.62),
        (1.5, 3.62),
        (4.6, 3.62),
        (-0.80, 1.45),
        (0.80, 1.95),
        (-2.65, 2.84),
        (2.31, 0.22),
        (-2.31, 0.22),
    ]
    for i, place in enumerate(places):
        kind = "checker" if i % 5 == 4 else "disc"
        scene.targets.append(
            Target(name=f"T{i + 1:02d}", position=place, diameter=0.055, kind=kind)
        )
