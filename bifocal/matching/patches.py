"""Least-squares matching of small patches: the same wall detail in both photos, to 0.05 px."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from bifocal.matching.tuning import PATCHES
from photocore.arrays import BoolArray, ByteArray, Float32Array, FloatArray


class PatchResult(NamedTuple):
    """Refined matches.

    Attributes
    ----------
    pixels2 : ndarray, shape (n, 2)
        Position in photo 2. [px]
    sigma : ndarray, shape (n,)
        Standard deviation along each direction's worst, from the patch itself. [px of photo 2]
    zncc : ndarray, shape (n,)
        Normalised cross-correlation of the patches, -1 to 1.
    converged : ndarray of bool, shape (n,)
    """

    pixels2: FloatArray
    sigma: FloatArray
    zncc: FloatArray
    converged: BoolArray


def same_scale(
    image1: ByteArray, image2: ByteArray, local: FloatArray
) -> tuple[Float32Array, Float32Array]:
    """Return both photos as floats, the finer one smoothed to the coarser one's sharpness.

    Parameters
    ----------
    image1, image2 : ndarray, shape (h, w)
    local : ndarray, shape (n, 2, 2)
        Derivatives of the position in photo 2 by that in photo 1 at the matches.

    Notes
    -----
    Sampling the finer photo at the coarser one's step would alias; it is smoothed once, by the
    blur that one pixel has more in the coarser photo: sigma = 0.5 sqrt(scale² - 1). The coarser
    photo is left alone, so nothing is blurred twice.
    """
    scale = float(np.median(np.sqrt(np.abs(np.linalg.det(local))))) if len(local) else 1.0
    out = []
    for image, factor in ((image1, 1.0 / scale), (image2, scale)):
        floats = image.astype(np.float32)
        if factor > 1.15:
            sigma = 0.5 * float(np.sqrt(min(factor, 8.0) ** 2 - 1.0))
            floats = cv2.GaussianBlur(floats, (0, 0), sigma)
        out.append(floats)
    return out[0], out[1]


def refine(
    image1: Float32Array,
    image2: Float32Array,
    pixels1: FloatArray,
    pixels2: FloatArray,
    local: FloatArray,
    directions: FloatArray,
    *,
    iterations: int = 8,
) -> PatchResult:
    """Move each match in photo 2 along given directions until the patches agree.

    Parameters
    ----------
    image1, image2 : ndarray, float32
        From `same_scale`.
    pixels1, pixels2 : ndarray, shape (n, 2)
        Matches; pixels1 stays.
    local : ndarray, shape (n, 2, 2)
        Derivative of photo 2 by photo 1 (the zoom k(r) under which the patch is seen).
    directions : ndarray, shape (n, 2, k)
        One (radial matching) or two unit vectors in photo 2.
    iterations : int
        At most so many Gauss-Newton steps.

    Notes
    -----
    Gain and offset are free. The gradient is photo 1's (inverse composition), so it is computed
    once. Samples are as far apart as a pixel of the coarser photo.
    """
    if not len(pixels1):
        none = np.zeros(0)
        return PatchResult(np.zeros((0, 2)), none, none, np.zeros(0, dtype=bool))
    out = []
    for start in range(0, len(pixels1), 4000):
        points = [each[start : start + 4000] for each in (pixels1, pixels2, local, directions)]
        out.append(_refine_part(image1, image2, *points, iterations=iterations))
    return PatchResult(*(np.concatenate(parts) for parts in zip(*out, strict=True)))


def _refine_part(
    image1: Float32Array,
    image2: Float32Array,
    pixels1: FloatArray,
    pixels2: FloatArray,
    local: FloatArray,
    directions: FloatArray,
    *,
    iterations: int,
) -> PatchResult:
    """Refine at most 4000 matches (the coordinate maps stay small)."""
    finite: BoolArray = np.isfinite(local.sum(axis=(1, 2)) + pixels2.sum(axis=1))
    local = np.where(finite[:, None, None], local, np.eye(2))
    scale = np.sqrt(np.abs(np.linalg.det(local)))
    step = np.maximum(1.0, 1.0 / np.clip(scale, 0.1, 10.0))
    axis = np.arange(-PATCHES.half - 1, PATCHES.half + 2, dtype=np.float64)
    wide = np.stack(np.meshgrid(axis, axis), axis=-1)
    # Sampled one ring wider, for the gradient.
    first = _sample(image1, pixels1[:, None, None] + wide[None] * step[:, None, None, None])
    dx = (first[:, 1:-1, 2:] - first[:, 1:-1, :-2]) / 2
    dy = (first[:, 2:, 1:-1] - first[:, :-2, 1:-1]) / 2
    count = len(pixels1)
    grid = wide[1:-1, 1:-1].reshape(-1, 2)
    template = first[:, 1:-1, 1:-1].reshape(count, -1)
    gradient = np.stack([dx.reshape(count, -1), dy.reshape(count, -1)], axis=-1)
    gradient /= step[:, None, None]
    inverse = np.linalg.inv(local)
    columns = gradient @ (inverse @ directions)
    weight = np.exp(-(grid**2).sum(1) / (2 * (0.75 * PATCHES.half) ** 2))
    weight /= weight.sum()
    design = np.concatenate([np.ones((count, len(grid), 1)), template[:, :, None], columns], axis=2)
    normal = np.einsum("nij,i,nik->njk", design, weight, design)
    ok = finite & np.isfinite(normal).all(axis=(1, 2))
    normal[~ok] = np.eye(normal.shape[1])
    normal += 1e-9 * np.eye(normal.shape[1]) * np.trace(normal, axis1=1, axis2=2)[:, None, None]
    solver = np.linalg.inv(normal) @ (design.transpose(0, 2, 1) * weight)
    offsets = (grid[None] * step[:, None, None]) @ local.transpose(0, 2, 1)
    position = pixels2.copy()
    active = ok.copy()
    converged = np.zeros(count, dtype=bool)
    solution = np.zeros((count, design.shape[2]))
    second = np.zeros_like(template)
    for _ in range(iterations):
        index = np.flatnonzero(active)
        if not len(index):
            break
        values = _sample(image2, position[index, None] + offsets[index])
        second[index] = values
        solution[index] = terms = np.nan_to_num(np.einsum("npm,nm->np", solver[index], values))
        with np.errstate(divide="ignore", invalid="ignore"):
            shift = terms[:, 2:] / terms[:, 1:2]
        shift = np.clip(np.nan_to_num(shift, nan=9.0), -1.0, 1.0)
        position[index] -= np.einsum("nij,nj->ni", directions[index], shift)
        size = np.abs(shift).max(axis=1)
        converged[index[size < 0.02]] = True
        lost = np.linalg.norm(position[index] - pixels2[index], axis=1) > PATCHES.reach
        lost |= terms[:, 1] <= 0
        active[index[(size < 0.003) | lost]] = False
        converged[index[lost]] = False
    return PatchResult(
        position,
        _sigma(template, second, design, solution, normal, weight),
        _zncc(template, second, weight),
        converged & ok & np.isfinite(second).all(axis=1),
    )


def _sample(image: Float32Array, where: FloatArray) -> FloatArray:
    """Return the image at pixel positions (..., 2), cubic; NaN outside."""
    shape = where.shape[:-1]
    flat = where.reshape(shape[0], -1, 2).astype(np.float32)
    values = cv2.remap(image, flat, None, cv2.INTER_CUBIC, borderValue=float("nan"))
    return np.asarray(values, dtype=np.float64).reshape(shape)


def _zncc(first: FloatArray, second: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the weighted normalised cross-correlation of patches, shape (n,)."""
    a = first - (first @ weight)[:, None]
    b = second - (second @ weight)[:, None]
    both = (a * b) @ weight
    size = np.sqrt(((a * a) @ weight) * ((b * b) @ weight))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nan_to_num(both / size, nan=-1.0)


def _sigma(
    first: FloatArray,
    second: FloatArray,
    design: FloatArray,
    solution: FloatArray,
    normal: FloatArray,
    weight: FloatArray,
) -> FloatArray:
    """Return the standard deviation of the shift from what is left between the patches. [px]"""
    count = first.shape[1]
    model = np.einsum("nmp,np->nm", design, solution)
    variance = ((second - model) ** 2) @ weight * count / (count - design.shape[2])
    inverse = np.linalg.inv(normal)
    # Weighted normal equations: the effective number of samples is 1 / sum w².
    effective = 1.0 / float((weight**2).sum())
    worst = np.stack([inverse[:, i, i] for i in range(2, design.shape[2])]).max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma = np.sqrt(np.maximum(variance * worst / effective, 0.0)) / np.abs(solution[:, 1])
    return np.nan_to_num(sigma, nan=np.inf)
