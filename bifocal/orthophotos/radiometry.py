"""Colours for the picture: vignetting, lateral colour shift, exposure of one photo to the other.

Nothing here is done unless asked for, and what is done is said; measuring uses the photos as they
are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Grid
from bifocal.model.image import ImageArray, as_photo
from bifocal.model.photo import Photo
from bifocal.model.surface import Surface
from bifocal.options import VIGNETTING
from bifocal.orthophotos.rectify import ChromaticShift, SourcePhoto
from bifocal.orthophotos.tuning import COLOURS
from bifocal.orthophotos.visibility import hidden_from
from bifocal.remarks import remark
from photocore.arrays import BoolArray, Float32Array, FloatArray
from photocore.errors import InputError
from photocore.large_photos import LargePhoto, Pixels


def corrected_photo(
    image: Pixels, photo: Photo, *, vignetting: str = "", chromatic: bool = False
) -> tuple[Pixels, ChromaticShift | None, tuple[str, ...]]:
    """Return a photo freed of vignetting, its colour shift, and what was done.

    Parameters
    ----------
    image : ndarray or LargePhoto, shape (h, w, 3) or (h, w)
        A large one is read whole where the colour shift is measured.
    photo : Photo
        Its geometry.
    vignetting : str
        Empty for none; ``cos4`` for the natural fall-off; or ``k1,k2,k3`` of
        ``1 + k1 r^2 + k2 r^4 + k3 r^6`` with r = 1 in the corner.
    chromatic : bool
        Measure the radial shift of red and blue against green.
    """
    notes = []
    if chromatic or not isinstance(image, LargePhoto):
        image = as_photo(np.asarray(image))
    if vignetting:
        image = devignetted(image, photo, vignetting)
        notes.append(remark("ortho.vignetting", law=vignetting))
    shift = None
    if chromatic:
        if image.ndim == 2:
            notes.append(remark("ortho.grey"))
        elif not isinstance(image, LargePhoto):
            shift = chromatic_shift(image)
            corner = [sum(terms) * shift.radius for terms in (shift.red, shift.blue)]
            notes.append(remark("ortho.colour_shift", red=corner[0], blue=corner[1]))
    return image, shift, tuple(notes)


def devignetted(image: Pixels, photo: Photo, model: str) -> Pixels:
    """Return a photo with the fall-off of light towards its corners undone.

    Raises
    ------
    InputError
        If the model is neither ``cos4`` nor three numbers.
    """
    height, width = image.shape[:2]
    _, radius = _middle((width, height))
    if model == "cos4":
        focal = photo.distance / photo.gsd((width, height))
        if photo.lens is not None:
            focal = float(photo.lens.camera_matrix[0, 0])
        # cos^4 of the angle off the axis = (1 + tan^2)^-2.
        share = (radius / focal) ** 2
        return _scaled(image, lambda square: (1 + np.float32(share) * square) ** 2)
    try:
        k1, k2, k3 = VIGNETTING.reader(model)
    except ValueError:
        raise InputError(f"vignetting: {model!r} is not {VIGNETTING.wanted}.") from None

    def gain(square: Float32Array) -> Float32Array:
        falloff = 1 + square * (k1 + square * (k2 + square * k3))
        return np.asarray(1 / np.maximum(falloff, 0.05), dtype=np.float32)

    return _scaled(image, gain)


def chromatic_shift(image: ImageArray) -> ChromaticShift:
    """Return the radial stretch of red and blue that makes them fit green best.

    Notes
    -----
    If red is stretched by ``1 + a(rho)`` it differs from green by ``-a rho dG/drho`` wherever both
    show the same edges; a0 and a1 follow by least squares over all edges, in two rounds.
    """
    height, width = image.shape[:2]
    centre, radius = _middle((width, height))
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    x, y = x - np.float32(centre[0]), y - np.float32(centre[1])
    green = _edges(image[:, :, 1])
    dx, dy = (cv2.Sobel(green, cv2.CV_32F, *axis, scale=1 / 8) for axis in ((1, 0), (0, 1)))
    radial = dx * x + dy * y  # rho dG/drho
    square = (x * x + y * y) / np.float32(radius**2)
    stretches = []
    for band in (0, 2):
        a = np.zeros(2)
        for _ in range(2):
            stretch = np.float32(a[0]) + np.float32(a[1]) * square
            columns = x * (1 + stretch) + np.float32(centre[0])
            rows = y * (1 + stretch) + np.float32(centre[1])
            moved = cv2.remap(
                np.ascontiguousarray(image[:, :, band]), columns, rows, cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )  # fmt: skip
            difference = _edges(moved) - green
            # Coloured things differ for other reasons than the lens; they are the large residuals.
            keep = np.abs(difference) < 2 * float(np.std(difference)) + 1e-6
            g = np.stack([radial[keep], (radial * square)[keep]]).astype(np.float64)
            normal = g @ g.T
            if np.linalg.cond(normal) > 1e12:
                break
            a -= np.linalg.solve(normal, g @ difference[keep])
        stretches.append((float(a[0]), float(a[1])))
    return ChromaticShift(red=stretches[0], blue=stretches[1], centre=centre, radius=radius)


def match_exposure(
    first: SourcePhoto, second: SourcePhoto, surface: Surface, grid: Grid
) -> tuple[SourcePhoto, str]:
    """Return the second photo in the colours of the first, and what was done.

    Notes
    -----
    Where both see the wall, ``log I1 = a + g log I2 + b rho^2 + c rho^4`` is fitted for each band
    with rho the distance from the middle of photo 2: exposure, white balance, gamma and the
    difference in vignetting.
    """
    factor = max(1.0, max(grid.shape) / COLOURS.compare)
    coarse = Grid.from_bounds(grid.bounds, gsd=grid.gsd * factor)
    relief = surface.window(coarse)
    samples, usable, positions = [], np.ones(coarse.shape, bool), []
    limit = float(np.iinfo(first.image.dtype).max)
    for view in (first, second):
        column, row = view.pixel_map(coarse, relief)
        usable &= view.inside(column, row) & ~hidden_from(surface, coarse, view.photo.foot, relief)
        colours = view.sample(column, row, "linear").astype(np.float64) / limit
        samples.append(colours.reshape(*coarse.shape, -1))
        positions.append((column, row))
    usable &= np.logical_and.reduce([((s > 0.03) & (s < 0.97)).all(axis=-1) for s in samples])
    if np.count_nonzero(usable) < COLOURS.least_common:
        return second, remark("ortho.not_matched")
    centre, radius = _middle(second.size)
    column, row = positions[1]
    square = ((column - centre[0]) ** 2 + (row - centre[1]) ** 2)[usable] / radius**2
    bands = samples[0].shape[-1]
    fits = [
        _fit(np.log(samples[0][usable, band]), np.log(samples[1][usable, band]), square)
        for band in range(bands)
    ]
    image = _recoloured(second.image, fits, limit)
    gains = ", ".join(f"{math.exp(fit[0]):.2f}" for fit in fits)
    return replace(second, image=image), remark(
        "ortho.matched", second=second.number, first=first.number, gains=gains
    )


def _fit(log1: FloatArray, log2: FloatArray, square: FloatArray) -> FloatArray:
    """Return a, g, b, c, robustly."""
    design = np.stack([np.ones_like(log2), log2, square, square**2], axis=-1)
    keep: BoolArray = np.ones(len(log1), bool)
    solution = np.array([0.0, 1.0, 0.0, 0.0])
    for _ in range(4):
        # A pull towards "unchanged" that only matters where the data say nothing.
        weight = 1e-3 * len(log1)
        normal = design[keep].T @ design[keep] + weight * np.diag([0.0, 1.0, 1.0, 1.0])
        right = design[keep].T @ log1[keep] + weight * np.array([0.0, 1.0, 0.0, 0.0])
        solution = np.linalg.solve(normal, right)
        residual = np.abs(log1 - design @ solution)
        keep = residual < 2.5 * 1.4826 * float(np.median(residual)) + 1e-9
    least, most = COLOURS.gamma
    if not least <= solution[1] <= most:  # what the photos show is not alike: brightness alone
        return np.array([float(np.median(log1 - log2)), 1.0, 0.0, 0.0])
    return solution


def _recoloured(image: Pixels, fits: list[FloatArray], limit: float) -> Pixels:
    """Return the image with every band's fit applied."""
    levels = np.arange(int(limit) + 1) / limit
    tables = [(limit * np.exp(a) * levels**g).astype(np.float32) for a, g, _, _ in fits]

    def recolour(part: ImageArray, square: Float32Array) -> Float32Array:
        layers = part.reshape(*square.shape, -1)
        bands = [
            table[layers[:, :, band]] * np.exp(square * (np.float32(b) + np.float32(c) * square))
            for band, (table, (_, _, b, c)) in enumerate(zip(tables, fits, strict=True))
        ]
        return np.stack(bands, axis=-1).reshape(part.shape)

    return _by_rows(image, recolour)


def _scaled(image: Pixels, gain: Callable[[Float32Array], Float32Array]) -> Pixels:
    """Return the image times a gain that depends on (rho / R)^2."""
    bands = (1,) * (image.ndim - 2)
    return _by_rows(image, lambda part, square: part * gain(square).reshape(*square.shape, *bands))


def _by_rows(image: Pixels, change: Callable[[ImageArray, Float32Array], Float32Array]) -> Pixels:
    """Return the image as changed by a function of its pixels and (rho / R)^2, in small parts.

    A photo reduced in size has the same middle and corner, so the same (rho / R)^2.
    """
    height, width = image.shape[:2]
    centre, radius = _middle((width, height))
    limit = np.iinfo(image.dtype).max
    x = ((np.arange(width) - centre[0]) ** 2).astype(np.float32)
    y = ((np.arange(height) - centre[1]) ** 2).astype(np.float32)

    def changed(part: ImageArray, rows: slice, columns: slice) -> ImageArray:
        square = (x[None, columns] + y[rows, None]) / np.float32(radius**2)
        return np.rint(change(part, square).clip(0, limit)).astype(part.dtype)

    if isinstance(image, LargePhoto):
        return image.changed(changed)
    out = np.empty_like(image)
    for top in range(0, height, COLOURS.rows):
        rows = slice(top, top + COLOURS.rows)
        out[rows] = changed(image[rows], rows, np.s_[:])
    return out


def _edges(band: NDArray[np.integer]) -> Float32Array:
    """Return local contrast, comparable between bands of different brightness."""
    value = band.astype(np.float32)
    fine = cv2.GaussianBlur(value, (0, 0), 1.0) - cv2.GaussianBlur(value, (0, 0), 6.0)
    energy = cv2.GaussianBlur(fine * fine, (0, 0), 6.0)
    floor = float(np.iinfo(band.dtype).max) * 0.01
    return fine / (np.sqrt(energy) + np.float32(floor))


def _middle(size: tuple[int, int]) -> tuple[tuple[float, float], float]:
    """Return the middle of a photo and half its diagonal. [px]"""
    return ((size[0] - 1) / 2, (size[1] - 1) / 2), math.hypot(*size) / 2
