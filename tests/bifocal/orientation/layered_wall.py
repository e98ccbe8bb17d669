"""A wall of flat boards at known relief, photographed exactly through homographies, for tests.

Every board is a plane parallel to the wall, so each photo is a stack of warped textures, near ones
painted over far ones: no ray casting, and the truth is known at every board.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal import Pinhole
from tests.builders.pinholes import camera_matrix, rotation_from_vector

SIZE = (960, 640)
#: Boards: x, y of the lower left corner, width, height, relief. [m]
BOARDS = (
    (-5.2, -3.4, 1.2, 6.0, 0.35), (4.0, -3.4, 1.2, 6.0, 0.35), (-3.4, -2.2, 1.5, 2.6, -0.30),
    (1.8, -2.2, 1.5, 2.6, -0.30), (-0.7, -3.4, 1.4, 2.4, 0.20), (-2.6, 1.4, 5.2, 0.8, 0.50),
    (-3.2, 0.9, 1.0, 0.8, 0.25), (2.2, 0.9, 1.0, 0.8, -0.25),
)  # fmt: skip
#: Texels per metre of the textures.
TEXELS = 100


@dataclass(frozen=True)
class Views:
    """Two photos and their cameras, far one first."""

    far: np.ndarray
    near: np.ndarray
    cameras: tuple[Pinhole, Pinhole]


def camera(
    distance: float,
    *,
    pixel: float = 0.013,
    focal: float | None = None,
    offset: tuple[float, float] = (0.0, 0.0),
    turn_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    shift: tuple[float, float] = (0.0, 0.0),
) -> Pinhole:
    """Return a camera that looks at the wall, with an optional turn and principal-point shift."""
    focal = focal or distance / pixel
    matrix = camera_matrix(focal, 1.0, (SIZE[0] - 1) / 2 + shift[0], (SIZE[1] - 1) / 2 + shift[1])
    square_on = np.diag([1.0, -1.0, -1.0])
    rotation = rotation_from_vector(np.deg2rad(turn_deg)) @ square_on
    return Pinhole(matrix, rotation, np.array([*offset, distance]))


def texture(width: float, height: float, seed: int) -> np.ndarray:
    """Return a random texture with detail at every scale, 8 bits."""
    rng = np.random.default_rng(seed)
    shape = (round(height * TEXELS), round(width * TEXELS))
    total = np.zeros(shape)
    for step, weight in ((1, 14), (3, 22), (9, 26), (40, 20)):
        small = rng.normal(size=(shape[0] // step + 2, shape[1] // step + 2))
        total += weight * cv2.resize(small, shape[::-1], interpolation=cv2.INTER_CUBIC)
    return np.clip(130 + total, 0, 255).astype(np.uint8)


def photograph(
    cam: Pinhole, *, seed: int = 1, boards: tuple = BOARDS, noise: float = 1.0
) -> np.ndarray:
    """Return the grey photo a camera takes of the wall and its boards."""
    layers = [(-9.0, -6.0, 18.0, 12.0, 0.0), *boards]
    order = sorted(range(len(layers)), key=lambda i: (layers[i][4] > 0, layers[i][4]))
    photo = np.zeros((2 * SIZE[1], 2 * SIZE[0]), np.uint8)  # supersampled: no aliasing
    for i in order:
        x, y, width, height, relief = layers[i]
        skin = texture(width, height, 100 * seed + i)
        texel = np.array([[1, 0, x + 0.5 / TEXELS], [0, -1, y + height - 0.5 / TEXELS], [0, 0, 1]])
        texel[:2, :2] /= TEXELS
        plane = np.eye(3)
        plane[:, 2] = [-cam.centre[0], -cam.centre[1], relief - cam.centre[2]]
        twice = np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1.0]])
        matrix = twice @ cam.matrix @ cam.rotation @ plane @ texel
        flags = cv2.INTER_LINEAR
        size = (photo.shape[1], photo.shape[0])
        warped = cv2.warpPerspective(skin, matrix, size, flags=flags)
        mask = cv2.warpPerspective(np.full_like(skin, 255), matrix, size, flags=flags)
        photo = np.where(mask > 127, warped, photo)
    small = cv2.resize(photo, SIZE, interpolation=cv2.INTER_AREA).astype(np.float64)
    rng = np.random.default_rng(seed + 1000)
    return np.clip(np.round(small + rng.normal(0, noise, small.shape)), 0, 255).astype(np.uint8)


def take(far: Pinhole, near: Pinhole, *, seed: int = 1, boards: tuple = BOARDS) -> Views:
    """Return both photos of one wall."""
    return Views(
        far=photograph(far, seed=seed, boards=boards),
        near=photograph(near, seed=seed, boards=boards),
        cameras=(far, near),
    )


def relief_at(xyz: np.ndarray) -> np.ndarray:
    """Return the relief of the board nearest in depth that carries each point's X, Y."""
    best = np.zeros(len(xyz))
    for x, y, width, height, relief in BOARDS:
        on = (xyz[:, 0] > x) & (xyz[:, 0] < x + width)
        on &= (xyz[:, 1] > y) & (xyz[:, 1] < y + height)
        best = np.where(on, relief, best)
    return best
