"""What surfaces look like: seeded noise of all sizes, courses, targets, light and shade."""

from __future__ import annotations

from copy import deepcopy
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tests.scenes.arrays import BoolArray, FloatArray
from tests.scenes.shapes import Material, Scene
from tests.scenes.tracing import Faces, Tracer

#: Side of the noise tile; it repeats after this many texels (several metres). [texel]
TILE = 2048
#: How far before the wall the houses on the other side of the street stand. [m]
OPPOSITE = 24.0


def noise_tile(rng: np.random.Generator) -> NDArray[np.float32]:
    """Return periodic noise of unit variance with equal energy per octave, shape (TILE+4, TILE+4).

    Amplitude falls with 1/frequency; a Gaussian of one texel limits the band, as a lens does, so
    that one sample per pixel of the photo is enough away from edges. Four columns and rows repeat.
    """
    across = np.fft.rfftfreq(TILE)[None, :]
    down = np.fft.fftfreq(TILE)[:, None]
    frequency = np.hypot(across, down)
    frequency[0, 0] = 1.0
    shape = np.exp(-2 * (np.pi * frequency) ** 2) / np.maximum(frequency, 8 / TILE)
    shape[0, 0] = 0.0
    white = np.fft.rfft2(rng.standard_normal((TILE, TILE)))
    tile = np.fft.irfft2(white * shape, s=(TILE, TILE))
    tile /= tile.std()
    return np.pad(tile, 2, mode="wrap").astype(np.float32)


@lru_cache(maxsize=4)  # to make one takes longer than to paint a small scene
def _tile_of(seed: int) -> tuple[NDArray[np.float32], np.random.Generator]:
    """Return the noise tile of a seed, and its generator as it is then."""
    rng = np.random.default_rng(seed)
    return noise_tile(rng), rng


class Painter:
    """Gives every hit its colour."""

    def __init__(self, scene: Scene, tracer: Tracer) -> None:
        self.scene, self.tracer = scene, tracer
        self.tile, rng = _tile_of(scene.seed)
        bodies = int(tracer.table.bodies.max()) + 2
        self.offsets = deepcopy(rng).uniform(0, TILE, size=(bodies, 2))
        self.target_faces = self._faces_of_targets()

    def _faces_of_targets(self) -> Faces:
        """Return the face each target is painted on: what a look square on the wall meets."""
        if not self.scene.targets:
            return np.zeros(0, dtype=np.int32)
        from tests.scenes.truth import look_square_on

        _, face = look_square_on(
            self.tracer, np.array([target.position for target in self.scene.targets])
        )
        return face

    def colours(
        self, points: FloatArray, face: Faces, lit: BoolArray, rays: FloatArray | None = None
    ) -> FloatArray:
        """Return red, green and blue of hits, shape (n, 3), about 0..1; rays are for mirrors."""
        normals = self.tracer.normals_at(points, face)
        uv = _surface_coordinates(points, normals)
        offset = self.offsets[self.tracer.table.bodies[face] + 1]
        texel = self.scene.texel
        fine = self._noise(uv / texel + offset)
        # The same tile sixteen times larger: stains and weathering with a hint of hue.
        broad = self._noise(uv / (16 * texel) + offset[:, ::-1])
        colour = np.empty((len(points), 3))
        for material, on in self._by_material(face):
            tone = 1 + material.contrast * (fine[on] + 0.35 * broad[on])
            if material.courses is not None:
                tone *= _courses(points[on], uv[on], material, self.scene.texel, self.scene.seed)
            hue = 0.15 * material.contrast * broad[on, None] * np.array([1.0, 0.1, -1.0])
            colour[on] = np.array(material.colour) * (tone[:, None] + hue)
        self._paint_targets(points, face, colour, fine)
        shade = np.clip(normals @ self.scene.sun, 0, None) * lit
        deep = np.clip(-points[:, 2] / 0.6, 0, 1)
        light = self.scene.ambient * (1 - 0.35 * deep) + (1.35 - self.scene.ambient) * shade
        seen = colour * light[:, None]
        for material, on in self._by_material(face) if rays is not None else ():
            if material.mirror and len(on):
                mirrored = self._mirrored(points[on], normals[on], rays[on])
                seen[on] = (1 - material.mirror) * seen[on] + material.mirror * mirrored[:, None]
        return seen

    def _mirrored(self, points: FloatArray, normals: FloatArray, rays: FloatArray) -> FloatArray:
        """Return the light of the houses opposite, or of the sky, that mirrors show, shape (n,)."""
        back = rays - 2 * (rays * normals).sum(1, keepdims=True) * normals
        far = (OPPOSITE - points[:, 2]) / np.maximum(back[:, 2], 0.05)
        place = points[:, :2] + far[:, None] * back[:, :2]
        houses = 0.35 + 0.15 * self._noise(place / (10 * self.scene.texel))
        return np.asarray(np.where(place[:, 1] > 6.0, 0.9, np.clip(houses, 0.02, 1)))

    def _by_material(self, face: Faces) -> list[tuple[Material, NDArray[np.int64]]]:
        """Group hits by material."""
        kinds: dict[Material, list[int]] = {}
        for number in np.unique(face):
            kinds.setdefault(self.tracer.table.materials[number], []).append(int(number))
        return [
            (material, np.flatnonzero(np.isin(face, numbers)))
            for material, numbers in kinds.items()
        ]

    def _noise(self, places: FloatArray) -> FloatArray:
        """Return the tile at places in texels, wrapped, bicubic."""
        import cv2

        wrapped = (np.mod(places, TILE) + 2).astype(np.float32)
        parts = np.array_split(wrapped, len(wrapped) // 30000 + 1)  # remap's limit is 32767
        sampled = [
            cv2.remap(self.tile, part[None, :, 0], part[None, :, 1], cv2.INTER_CUBIC)[0]
            for part in parts
            if len(part)
        ]
        return np.concatenate(sampled).astype(np.float64) if sampled else np.zeros(0)

    def _paint_targets(
        self, points: FloatArray, face: Faces, colour: FloatArray, fine: FloatArray
    ) -> None:
        """Paint the targets over the colours, in place."""
        if not len(points):
            return
        low, high = points[:, :2].min(0), points[:, :2].max(0)
        for target, on_face in zip(self.scene.targets, self.target_faces, strict=True):
            middle, radius = np.array(target.position), target.diameter / 2
            if (middle + 2 * radius < low).any() or (middle - 2 * radius > high).any():
                continue
            away = points[:, :2] - middle
            reach = np.hypot(away[:, 0], away[:, 1])
            on = np.flatnonzero((reach < 1.8 * radius) & (face == on_face))
            soft = self.scene.texel
            if target.kind == "checker":
                ink = 0.5 - 0.5 * np.clip(away[on, 0] / soft, -1, 1) * np.clip(
                    away[on, 1] / soft, -1, 1
                )
                ink = np.where(reach[on] < 1.5 * radius, ink, 0.0)
            else:
                ink = np.clip((radius - reach[on]) / soft + 0.5, 0, 1)
            colour[on] = (0.92 - 0.85 * ink[:, None]) * (1 + 0.01 * fine[on, None])


def _surface_coordinates(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Return coordinates along the surface: X Y on fronts, Z Y on flanks, X Z on ledges."""
    size = np.abs(normals)
    flank = size[:, 0] > np.maximum(size[:, 1], size[:, 2])
    ledge = ~flank & (size[:, 1] > size[:, 2])
    u = np.where(flank, points[:, 2], points[:, 0])
    v = np.where(ledge, points[:, 2], points[:, 1])
    return np.stack([u, v], axis=-1)


def _courses(
    points: FloatArray, uv: FloatArray, material: Material, soft: float, seed: int
) -> FloatArray:
    """Return the brightness of blocks laid in courses with darker joints between them."""
    assert material.courses is not None
    height, length, joint = material.courses
    row = np.floor(points[:, 1] / height)
    along = uv[:, 0] / length + 0.5 * np.mod(row, 2) + 0.17 * _hash(row, 0 * row, seed)
    block = np.floor(along)
    to_bed = np.abs(points[:, 1] / height - row - 0.5)
    to_end = np.abs(along - block - 0.5)
    gap = np.minimum((0.5 - to_bed) * height, (0.5 - to_end) * length)
    dark = np.clip((joint / 2 - gap) / (1.5 * soft) + 0.5, 0, 1)
    return (1 + material.tint * 2 * (_hash(row, block, seed) - 0.5) * 1.7) * (1 - 0.42 * dark)


def _hash(a: FloatArray, b: FloatArray, seed: int) -> FloatArray:
    """Return a reproducible number in 0..1 for each pair of whole numbers."""
    value = np.sin(a * 12.9898 + b * 78.233 + seed * 3.7) * 43758.5453
    return np.asarray(value - np.floor(value))
