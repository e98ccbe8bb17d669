"""Photos of boards under water, by ray shooting: Snell's law in vectors, nothing of the package.

A camera looks out of a housing through a plane glass (or into nothing). Every pixel is one ray,
followed through glass and water to the board's plane; its grey is the pattern averaged over the
pixel's footprint there, so that edges are soft and lie where they should to a hundredth of a pixel.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np


class Housing(NamedTuple):
    """Camera [mm, px], and a glass square to the axis but for a tilt."""

    width: int = 640
    height: int = 480
    pitch: float = 0.006
    c: float = 4.2
    centre: tuple[float, float] = (0.021, -0.016)
    k1: float = -1.5e-3
    distance: float = 38.0
    thickness: float = 8.0
    tilt: tuple[float, float] = (0.01, -0.006)
    indices: tuple[float, float, float] = (1.0, 1.5, 1.337)


def _bent(rays, normal, ratio):
    """Snell's law: unit rays through a plane whose unit normal points along them."""
    cosine = rays @ normal
    along = ratio * (rays - cosine[..., None] * normal)
    return along + np.sqrt(1 - (along**2).sum(-1))[..., None] * normal


def rays_in_water(eye: Housing):
    """Origins and directions of all pixels in water, camera frame: x right, y down, z forwards."""
    column, row = np.meshgrid(np.arange(eye.width), np.arange(eye.height))
    x = (column - (eye.width - 1) / 2) * eye.pitch - eye.centre[0]
    y = (row - (eye.height - 1) / 2) * eye.pitch + eye.centre[1]
    seen = np.stack([x, y], axis=-1)
    ideal = seen.copy()
    for _ in range(40):  # measured = ideal (1 + k1 r^2)
        ideal = seen / (1 + eye.k1 * (ideal**2).sum(-1, keepdims=True))
    rays = np.concatenate([ideal, np.full((*x.shape, 1), eye.c)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    normal = np.array([*eye.tilt, 1.0]) / np.linalg.norm([*eye.tilt, 1.0])
    n1, n2, n3 = eye.indices
    inner = rays * (eye.distance / (rays @ normal))[..., None]
    glass = _bent(rays, normal, n1 / n2)
    outer = inner + glass * (eye.thickness / (glass @ normal))[..., None]
    return outer, _bent(glass, normal, n2 / n3)


def _soft(t):
    """The sign of a wave of squares, linear over the width of a pixel."""
    return np.clip(t, -1, 1)


def chessboard(columns, rows, square):
    """Return the grey of a chessboard with so many inner corners at board positions (X, Y)."""

    def grey(x, y, wide, tall):
        inside = (np.abs(x - (columns - 1) * square / 2) < (columns + 1) * square / 2) & (
            np.abs(y - (rows - 1) * square / 2) < (rows + 1) * square / 2
        )
        parts = []
        for place, foot in ((x, wide), (y, tall)):
            phase = np.mod(place / square, 2.0)
            near = np.minimum(np.abs(phase - np.round(phase)), 1.0) * square
            sign = np.where(phase < 1, 1.0, -1.0)
            parts.append(sign * _soft(2 * near / np.maximum(foot, 1e-9)))
        board = 0.5 - 0.5 * parts[0] * parts[1]
        return np.where(inside, board, 1.0)

    return grey


def drawn(picture, millimetres):
    """Return the grey of a picture (0 to 1) whose pixels are so large, by linear interpolation."""

    def grey(x, y, wide, tall):  # noqa: ARG001
        soft = cv2.GaussianBlur(
            picture.astype(np.float32), (0, 0), 0.35 * float(np.median(wide)) / millimetres
        )
        column, row = x / millimetres, y / millimetres
        return cv2.remap(
            soft,
            column.astype(np.float32),
            row.astype(np.float32),
            cv2.INTER_LINEAR,
            borderValue=1.0,
        )

    return grey


def dots(columns, rows, spacing, radius):
    """Return the grey of dark circles on white, the first at (0, 0)."""

    def grey(x, y, wide, tall):  # noqa: ARG001
        column = np.clip(np.round(x / spacing), 0, columns - 1)
        row = np.clip(np.round(y / spacing), 0, rows - 1)
        away = np.hypot(x - column * spacing, y - row * spacing)
        return 0.5 + 0.5 * _soft(2 * (away - radius) / np.maximum(wide, 1e-9))

    return grey


def photo(eye: Housing, grey, turn, shift, *, dark=30.0, bright=220.0, noise=2.0, seed=0):
    """Return a photo of a board whose points X lie at R X + shift in the camera frame, uint8."""
    origins, rays = rays_in_water(eye)
    rotation, _ = cv2.Rodrigues(np.asarray(turn, float))
    normal, shift = rotation[:, 2], np.asarray(shift, float)
    reach = ((shift - origins) @ normal) / (rays @ normal)
    local = (origins + reach[..., None] * rays - shift) @ rotation
    x, y = local[..., 0], local[..., 1]
    wide = np.hypot(*np.gradient(x))
    tall = np.hypot(*np.gradient(y))
    value = np.where(reach > 0, grey(x, y, wide, tall), 1.0)
    value = dark + (bright - dark) * value
    value += noise * np.random.default_rng(seed).standard_normal(value.shape)
    return np.clip(np.round(value), 0, 255).astype(np.uint8)


def poses(count, extent, near=650.0, far=1050.0, seed=5):
    """Return turns and shifts of a board of an extent [mm] that stays in view."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        turn = rng.uniform(-0.6, 0.6, 3) * (1, 1, 0.6)
        depth = rng.uniform(near, far)
        rotation, _ = cv2.Rodrigues(turn)
        place = np.array([*(rng.uniform(-0.12, 0.12, 2) * depth * (1, 0.75)), depth])
        yield turn, place - rotation @ [extent[0] / 2, extent[1] / 2, 0.0]
