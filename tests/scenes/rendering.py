"""Photos of a scene with their exact truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bifocal import Pair, ReliefMap
from tests.scenes.arrays import BoolArray, ByteArray, FloatArray, IntArray
from tests.scenes.cameras import CameraPair, SceneCamera
from tests.scenes.shapes import Convex, Scene
from tests.scenes.texture import Painter
from tests.scenes.tracing import Faces, Parallel, Tracer
from tests.scenes.truth import look_square_on, relief_truth, sees, visible_from

#: Rays per side of a pixel where surfaces meet.
SUBSAMPLES = 3
_TILE = 128


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposure:
    """How a camera turns light into grey values.

    Attributes
    ----------
    gain, gamma : float
        value = 255 (gain * light) ** gamma.
    vignetting : float
        Share of the light lost in the corners.
    noise : float
        Standard deviation per channel. [grey levels]
    jpeg : int, optional
        Quality at which the photo is compressed.
    """

    gain: float = 1.0
    gamma: float = 1.0
    vignetting: float = 0.0
    noise: float = 1.5
    jpeg: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Haze:
    """What water does to light on its way: J exp(-c d) + B (1 - exp(-b d)) (Jaffe 1990, McGlamery).

    Attributes
    ----------
    attenuation, backscatter : tuple of float
        c and b of red, green and blue. [1/m]
    veil : tuple of float
        B: the light of the water where nothing is seen through it.
    """

    attenuation: tuple[float, float, float]
    backscatter: tuple[float, float, float]
    veil: tuple[float, float, float]

    def seen(self, light: FloatArray, way: FloatArray) -> FloatArray:
        """Return light (n, 3) as it arrives after ways through water (n,). [m]"""
        direct = light * np.exp(-way[:, None] * np.array(self.attenuation))
        return direct + self.veil * (1 - np.exp(-way[:, None] * np.array(self.backscatter)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NamedPoint:
    """A target or corner with its exact place.

    Attributes
    ----------
    name : str
    xyz : ndarray, shape (3,)
        X, Y, relief. [m]
    pixel1, pixel2 : ndarray, shape (2,)
        Exact (column, row) in the far and the near photo. [px]
    seen : bool
        Whether both photos show it.
    """

    name: str
    xyz: FloatArray
    pixel1: FloatArray
    pixel2: FloatArray
    seen: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Rendering:
    """A bifocal pair of photos and everything that is true about it.

    Attributes
    ----------
    image1, image2 : ndarray of uint8, shape (height, width, 3)
        Far and near photo, RGB.
    pair : Pair
        Exact geometry.
    nominal : Pair
        Geometry as planned, without the set-up errors.
    truth : ReliefMap
        Exact relief in the plane frame.
    takings : tuple of (Tracer, SceneCamera)
        What stands before the far and the near camera, and these.
    targets, corners : tuple of NamedPoint
    """

    image1: ByteArray
    image2: ByteArray
    pair: Pair
    nominal: Pair
    truth: ReliefMap
    takings: tuple[tuple[Tracer, SceneCamera], tuple[Tracer, SceneCamera]]
    targets: tuple[NamedPoint, ...] = field(default=())
    corners: tuple[NamedPoint, ...] = field(default=())

    @cached_property
    def visible1(self) -> BoolArray:
        """What the far camera sees of the truth, of its shape."""
        return visible_from(*self.takings[0], self.truth)

    @cached_property
    def visible2(self) -> BoolArray:
        """What the near camera sees of the truth, of its shape."""
        return visible_from(*self.takings[1], self.truth)


def render(
    scene: Scene,
    cameras: CameraPair,
    *,
    rng: np.random.Generator,
    exposures: tuple[Exposure, Exposure] = (Exposure(), Exposure()),
    gsd: float | None = None,
    haze: Haze | None = None,
    passing: tuple[Sequence[Convex], Sequence[Convex]] = ((), ()),
) -> Rendering:
    """Photograph a scene with a bifocal pair.

    Parameters
    ----------
    scene : Scene
    cameras : CameraPair
    rng : Generator
        Of the noise.
    exposures : tuple of Exposure
        Of the far and the near photo.
    gsd : float, optional
        Pixel of the truth; by default that of the nominal far photo. [m]
    haze : Haze, optional
        Of the water behind the last interface.
    passing : tuple of sequences of Convex
        What stands before the scene in the far and in the near photo, as many bodies in each; it
        hides, and is no part of the truth.
    """
    tracer = Tracer(scene)
    shown = [Tracer(replace(scene, solids=[*scene.solids, *bodies])) for bodies in passing]
    takings = list(zip(shown, (cameras.far, cameras.near), strict=True))
    images = [
        expose(photograph(one, Painter(one.scene, one), camera, haze), exposure, rng)
        for (one, camera), exposure in zip(takings, exposures, strict=True)
    ]
    nominal = cameras.nominal
    width, height = cameras.far.size
    corners = nominal.image1.plane_from_pixels([[-0.5, height - 0.5], [width - 0.5, -0.5]])
    (x_min, y_min), (x_max, y_max) = corners.tolist()
    step = gsd or (x_max - x_min) / width
    truth = relief_truth(tracer, bounds=(x_min, y_min, x_max, y_max), gsd=step)
    places = np.array([target.position for target in scene.targets]).reshape(-1, 2)
    relief = look_square_on(tracer, places)[0] if len(places) else np.zeros(0)
    named = {
        target.name: (*target.position, float(r))
        for target, r in zip(scene.targets, relief, strict=True)
    }
    return Rendering(
        image1=images[0],
        image2=images[1],
        pair=cameras.exact,
        nominal=nominal,
        truth=truth,
        takings=(takings[0], takings[1]),
        targets=_named(named, tracer, cameras),
        corners=_named(scene.corners, tracer, cameras),
    )


def photograph(
    tracer: Tracer, painter: Painter, camera: SceneCamera, haze: Haze | None = None
) -> FloatArray:
    """Return the light in each pixel, shape (height, width, 3), about 0..1."""
    width, height = camera.size
    light = np.empty((height, width, 3), dtype=np.float32)
    bounds = tracer.bounds(camera)
    sun = Parallel(tracer.scene.sun)
    shadows = tracer.bounds(sun)
    marks = _target_pixels(tracer, camera)
    steps = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5
    inner = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(1, -1, 2)

    def shoot(pixels: FloatArray) -> tuple[FloatArray, Faces, BoolArray, FloatArray]:
        origins, rays = camera.emitted(pixels)
        distance, face = tracer.cast(origins, rays, pixels, bounds)
        points = origins + rays * distance[:, None]
        return points, face, tracer.lit(points, shadows, sun), rays * distance[:, None]

    def colours(points: FloatArray, face: Faces, lit: BoolArray, way: FloatArray) -> FloatArray:
        light = painter.colours(points, face, lit, way)
        return light if haze is None else haze.seen(light, np.linalg.norm(way, axis=1))

    for top in range(0, height, _TILE):
        for left in range(0, width, _TILE):
            rows = np.arange(top - 1, min(top + _TILE, height) + 1)
            columns = np.arange(left - 1, min(left + _TILE, width) + 1)
            pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(float)
            points, face, lit, way = shoot(pixels)
            shape = (len(rows), len(columns))
            mixed = _mixed((2 * face + lit).reshape(shape))
            for box in marks:
                mixed |= _within(columns, rows, box)
            core = np.zeros(shape, dtype=bool)
            core[1:-1, 1:-1] = True
            plain = np.flatnonzero(core & ~mixed)
            tile = np.zeros((len(pixels), 3))
            tile[plain] = colours(points[plain], face[plain], lit[plain], way[plain])
            some = np.flatnonzero(core & mixed)
            if len(some):
                many = (pixels[some][:, None, :] + inner).reshape(-1, 2)
                tile[some] = colours(*shoot(many)).reshape(len(some), -1, 3).mean(1)
            light[top : rows[-1], left : columns[-1]] = tile.reshape(*shape, 3)[1:-1, 1:-1]
    return light


def expose(light: FloatArray, exposure: Exposure, rng: np.random.Generator) -> ByteArray:
    """Return the photo of given light: vignetting, gain, gamma, noise, 8 bits, JPEG."""
    height, width = light.shape[:2]
    x = (np.arange(width) - (width - 1) / 2)[None, :]
    y = (np.arange(height) - (height - 1) / 2)[:, None]
    fall = 1 - exposure.vignetting * (x * x + y * y) * 4 / (width**2 + height**2)
    value = np.clip(light * (exposure.gain * fall[..., None]), 0, None) ** exposure.gamma * 255
    value += exposure.noise * rng.standard_normal(value.shape, dtype=np.float32)
    photo = np.clip(np.rint(value), 0, 255).astype(np.uint8)
    if exposure.jpeg is None:
        return photo
    import cv2

    coded = cv2.imencode(".jpg", photo[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, exposure.jpeg])[1]
    return np.ascontiguousarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)[..., ::-1])


def _mixed(kind: Faces) -> BoolArray:
    """Return pixels that differ from one of their eight neighbours."""
    import cv2

    values = kind.astype(np.float32)
    kernel = np.ones((3, 3), dtype=np.uint8)
    return np.asarray(cv2.dilate(values, kernel) != cv2.erode(values, kernel))


def _target_pixels(tracer: Tracer, camera: SceneCamera) -> list[FloatArray]:
    """Return the pixel rectangle of every target: sampled finely throughout."""
    rectangles = []
    targets = tracer.scene.targets
    if not targets:
        return []
    places = np.array([target.position for target in targets])
    relief = look_square_on(tracer, places)[0]
    for target, r in zip(targets, relief, strict=True):
        around = 0.9 * target.diameter * np.array([[-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        points = np.column_stack([np.array(target.position) + around, np.full(3, r)])
        seen = camera.view_of(points)
        rectangles.append(np.concatenate([seen.min(0), seen.max(0)]))
    return rectangles


def _within(columns: IntArray, rows: IntArray, box: FloatArray) -> BoolArray:
    """Return which pixels of a tile lie in a rectangle."""
    across = (columns >= box[0]) & (columns <= box[2])
    down = (rows >= box[1]) & (rows <= box[3])
    return np.asarray(down[:, None] & across[None, :])


def _named(
    points: dict[str, tuple[float, float, float]], tracer: Tracer, cameras: CameraPair
) -> tuple[NamedPoint, ...]:
    """Return points with their exact pixels in both photos."""
    if not points:
        return ()
    xyz = np.array(list(points.values()))
    pixels = [camera.view_of(xyz) for camera in (cameras.far, cameras.near)]
    # A corner is on its own surface: lift it by a hair, so that it does not hide itself.
    seen = [
        sees(tracer, camera, xyz + (camera.centre - xyz) * 1e-6)
        for camera in (cameras.far, cameras.near)
    ]
    return tuple(
        NamedPoint(
            name=name,
            xyz=xyz[i],
            pixel1=pixels[0][i],
            pixel2=pixels[1][i],
            seen=bool(seen[0][i] and seen[1][i]),
        )
        for i, name in enumerate(points)
    )
