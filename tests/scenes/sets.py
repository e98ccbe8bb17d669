"""Three photos and more of a scene: far, near, and cameras a step aside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bifocal import PhotoSet, ReliefMap
from tests.scenes.arrays import BoolArray, ByteArray
from tests.scenes.cameras import SceneCamera
from tests.scenes.rendering import Exposure, expose, photograph
from tests.scenes.shapes import Scene
from tests.scenes.texture import Painter
from tests.scenes.tracing import Tracer
from tests.scenes.truth import relief_truth, visible_from


@dataclass(frozen=True, kw_only=True, eq=False)
class SetRendering:
    """Photos of a scene and what is true about it.

    Attributes
    ----------
    images : tuple of ndarray of uint8, shape (height, width, 3)
    photos : PhotoSet
        Exact geometry.
    truth : ReliefMap
        Exact relief over what the first camera has in frame.
    tracer : Tracer
    cameras : tuple of SceneCamera
    """

    images: tuple[ByteArray, ...]
    photos: PhotoSet
    truth: ReliefMap
    tracer: Tracer
    cameras: tuple[SceneCamera, ...]

    @cached_property
    def visible(self) -> BoolArray:
        """What each camera sees of the truth, shape (photos, h, w)."""
        return np.stack([visible_from(self.tracer, one, self.truth) for one in self.cameras])


def aside(camera: SceneCamera, by: float) -> SceneCamera:
    """Return a camera moved to the right along the wall and turned back to where it looked. [m]"""
    aim = np.array([*camera.centre[:2], 0.0])
    centre = camera.centre + np.array([by, 0.0, 0.0])
    z = (aim - centre) / np.linalg.norm(aim - centre)
    x = np.cross([0.0, -1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return replace(camera, centre=centre, rotation=np.stack([x, np.cross(z, x), z]))


def render_set(
    scene: Scene,
    cameras: Sequence[SceneCamera],
    *,
    rng: np.random.Generator,
    exposures: Sequence[Exposure] | None = None,
) -> SetRendering:
    """Photograph a scene with cameras square to the wall, the first one, or not."""
    tracer = Tracer(scene)
    painter = Painter(scene, tracer)
    images = tuple(
        expose(photograph(tracer, painter, camera), exposure, rng)
        for camera, exposure in zip(cameras, exposures or [Exposure()] * len(cameras), strict=True)
    )
    photos = tuple(
        replace(camera.photo(f"{number}.png"), image_size=camera.size)
        for number, camera in enumerate(cameras, start=1)
    )
    width, height = cameras[0].size
    corners = photos[0].plane_from_pixels([[-0.5, height - 0.5], [width - 0.5, -0.5]])
    (x_min, y_min), (x_max, y_max) = corners.tolist()
    bounds, gsd = (x_min, y_min, x_max, y_max), (x_max - x_min) / width
    truth = relief_truth(tracer, bounds=bounds, gsd=gsd)
    return SetRendering(
        images=images,
        photos=PhotoSet(photos=photos),
        truth=truth,
        tracer=tracer,
        cameras=tuple(cameras),
    )
