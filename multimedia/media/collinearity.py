r"""Collinearity through plane-parallel media: object vector to image vector, with derivatives.

Everything happens in the camera frame, the projection centre at the origin. The interface is a
plane with unit normal m towards the camera; the camera is at height H above its *last* face. Let

- a = the vector from the centre to the object point, w = m . a (negative: the point is below),
- rho^2 = a . a - w^2, its squared distance from the normal through the centre (Maas' R),
- q = R / R_bar, the inverse of the shift ratio (Maas 2015, Eqs. 1 to 9).

Maas moves the point away from that normal by R_bar / R at constant depth. Moving it along the
normal instead, by (q - 1) w, gives the same direction, hence the same image point, and one
product less:

.. math:: u = a + g m, \qquad g = (q - 1) w, \qquad x = -c\, u_x / u_z, \quad y = -c\, u_y / u_z .

The derivatives of q are taken with respect to rho^2, in which it is smooth on the axis too. With
the squared invariant :math:`\pi = (n_i \sin\beta_i)^2`:

.. math:: S = \sum_i \frac{h_i}{\sqrt{n_i^2 - \pi}}, \quad \rho^2 = \pi S^2, \quad
          q = \frac{S \sqrt{n_1^2 - \pi}}{\sum h_i} .
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from multimedia.refraction import Layers, ratio_of
from photocore.arrays import FloatArray
from photocore.compiled import inlined


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Medium:
    """The parallel layers as one camera meets them.

    Attributes
    ----------
    normal : ndarray, shape (3,)
        Unit normal towards the camera, in the camera frame.
    height : float or ndarray, shape (n,)
        Height of the projection centre above the last face; one per point where the points are
        seen from several centres.
    layers : Layers
        From the camera's medium to the object's.
    """

    normal: FloatArray
    height: float | FloatArray
    layers: Layers

    @property
    def first_height(self) -> float | FloatArray:
        """Height of the projection centre above the first face (Maas' Z0)."""
        return self.height - self.layers.thickness


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shifts:
    """g = (q - 1) w of every point, and its derivatives.

    Attributes
    ----------
    g : ndarray, shape (n,)
        How far the point seems raised along the normal.
    w : ndarray, shape (n,)
        m . a
    by_rho2, by_w, by_height : ndarray, shape (n,)
        With respect to rho^2, w (the depth follows, the height does not) and H.
    by_thicknesses : ndarray, shape (n, layers - 2)
        The last face stays where it is.
    by_indices : ndarray, shape (n, layers)
    """

    g: FloatArray
    w: FloatArray
    by_rho2: FloatArray
    by_w: FloatArray
    by_height: FloatArray
    by_thicknesses: FloatArray
    by_indices: FloatArray

    def gradient(self, vectors: FloatArray, medium: Medium) -> FloatArray:
        """Return dg / da, shape (n, 3): u = a + g m, so du / da = I + m (dg / da)^T."""
        twice = 2.0 * self.by_rho2
        gradient = twice[:, None] * vectors
        gradient += (self.by_w - twice * self.w)[:, None] * medium.normal
        return gradient


def image_vectors(vectors: FloatArray, medium: Medium) -> FloatArray:
    """Return u, the direction in the camera's medium in which each point is seen.

    Parameters
    ----------
    vectors : ndarray, shape (n, 3)
        a: projection centre to object points, in the camera frame.
    medium : Medium
        The layers. The centre must be above the first face.

    Returns
    -------
    ndarray, shape (n, 3)
        NaN for points that are not below the last face.
    """
    w = vectors @ medium.normal
    _, q, _ = _inverse_ratio(vectors, w, medium)
    g = (q - 1.0) * w
    return vectors + g[:, None] * medium.normal


def shifts(
    vectors: FloatArray, medium: Medium, *, media: bool = True, before: float = 0.0
) -> Shifts:
    """Return g of every point with its derivatives; see the head of the module.

    Parameters
    ----------
    vectors, medium
        As for `image_vectors`.
    media : bool
        Whether the derivatives by thicknesses and indices are wanted; empty otherwise.
    before : float
        Share of the centre's height by which points may lie before the last face; none where the
        last medium has a lower index than the first, for there rays might go back for ever.
    """
    w = vectors @ medium.normal
    rho2, q, heights = _inverse_ratio(vectors, w, medium, before)
    whole = -w
    n = medium.layers.indices
    with np.errstate(all="ignore"):
        # tan(beta_1) = R_bar / whole = rho / (q whole), and the invariant from it.
        tan2 = rho2 / (q * whole) ** 2
        invariant = n[0] ** 2 * tan2 / (1.0 + tan2)
        cosines = [np.sqrt(index**2 - invariant) for index in n]  # n_i cos(beta_i)
        cosines[0] = n[0] / np.sqrt(1.0 + tan2)
        s = np.zeros_like(w)
        s_pi = np.zeros_like(w)
        for height, cosine in zip(heights, cosines, strict=True):
            part = height / cosine
            s += part
            s_pi += part / cosine**2
        s_pi *= 0.5
        first = cosines[0]
        f_pi = s * (s + 2.0 * invariant * s_pi)  # d rho^2 / d invariant
        q_pi = (s_pi * first - 0.5 * s / first) / whole
        q_rho2 = q_pi / f_pi
        # A change of S at a fixed invariant also moves the invariant (rho^2 is given).
        by_s = first / whole - q_rho2 * 2.0 * invariant * s
        q_heights = [by_s / cosine for cosine in cosines]
        q_indices = []
        if media:
            q_indices = [
                -by_s * height * index / cosine**3
                for height, index, cosine in zip(heights, n, cosines, strict=True)
            ]
            q_indices[0] += s * n[0] / (first * whole)
    by_thicknesses: FloatArray = np.empty((len(w), len(n) - 2 if media else 0))
    for k in range(1, by_thicknesses.shape[1] + 1):
        # z0 = H - sum of thicknesses: what the layer gains the first medium loses.
        by_thicknesses[:, k - 1] = w * (q_heights[k] - q_heights[0])
    by_indices = np.empty((len(w), 0))
    if media:
        by_indices = w[:, None] * np.stack(q_indices, axis=-1)
    return Shifts(
        g=(q - 1.0) * w,
        w=w,
        by_rho2=w * q_rho2,
        # whole = -w and zp = -w - H; q also falls by q / whole per unit of the whole height.
        by_w=(q - 1.0) + w * (q / whole - q_heights[-1]),
        by_height=w * (q_heights[0] - q_heights[-1]),
        by_thicknesses=by_thicknesses,
        by_indices=by_indices,
    )


@inlined
def ray_beyond(
    direction: Any, m: Any, height: Any, thicknesses: FloatArray, k: FloatArray
) -> tuple[Any, tuple[Any, Any, Any], tuple[Any, Any, Any]]:
    """Follow a direction, or each of many, from a projection centre into the last medium.

    Parameters
    ----------
    direction : three numbers or rows
        Of any length.
    m : ndarray, shape (3,)
        Normal towards the camera, in the same frame.
    height : float
        Of the centre above the last face.
    thicknesses, k : ndarray, shape (j,), (j + 1,)
        Of the inner layers; n_1 / n_i of these and of the last medium.

    Returns
    -------
    ahead : bool
        Whether it goes towards the layers.
    origin, ray : tuple of 3
        From the centre to where the ray leaves the last face; its unit vector beyond.
    """
    length = np.sqrt(
        direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]
    )
    x, y, z = direction[0] / length, direction[1] / length, direction[2] / length
    cosine = -(x * m[0] + y * m[1] + z * m[2])
    # Snell: n_i times the component along the interface is the same in every medium.
    x, y, z = x + cosine * m[0], y + cosine * m[1], z + cosine * m[2]
    along2 = x * x + y * y + z * z
    inner, first = 0.0 * along2, height
    for i in range(len(thicknesses)):
        first = first - thicknesses[i]
        inner = inner + thicknesses[i] * k[i] / np.sqrt(1.0 - k[i] * k[i] * along2)
    travel = first / cosine + inner
    last = k[len(thicknesses)]
    down = np.sqrt(1.0 - last * last * along2)
    origin = travel * x - height * m[0], travel * y - height * m[1], travel * z - height * m[2]
    ray = last * x - down * m[0], last * y - down * m[1], last * z - down * m[2]
    return cosine > 0, origin, ray


def rays_in_object_space(directions: FloatArray, medium: Medium) -> tuple[FloatArray, FloatArray]:
    """Follow rays from the projection centre into the last medium.

    Parameters
    ----------
    directions : ndarray, shape (n, 3)
        In the camera frame, of any length.
    medium : Medium
        The layers.

    Returns
    -------
    origins : ndarray, shape (n, 3)
        Where the rays leave the last face, in the camera frame.
    directions : ndarray, shape (n, 3)
        Unit vectors in the last medium. NaN for rays away from the interface and after total
        reflection.
    """
    n = np.array(medium.layers.indices)
    thicknesses = np.array(medium.layers.thicknesses)
    with np.errstate(invalid="ignore", divide="ignore"):
        ahead, origin, ray = ray_beyond.plain(
            directions.T, medium.normal, medium.height, thicknesses, n[0] / n[1:]
        )
    origins: FloatArray = np.stack(origin, axis=-1)
    if not ahead.all():
        origins[~ahead] = np.nan
    return origins, np.stack(ray, axis=-1)


def _inverse_ratio(
    vectors: FloatArray, w: FloatArray, medium: Medium, before: float = 0.0
) -> tuple[FloatArray, FloatArray, list[FloatArray | float]]:
    """Return rho^2, q = R / R_bar, and the heights of the layers under each point."""
    x, y, z = vectors.T
    rho2 = np.maximum(x * x + y * y + z * z - w * w, 0.0)
    depth = -(w + medium.height)
    rising = medium.layers.indices[0] <= min(medium.layers.indices)
    below = depth >= -(before if rising else 0.0) * medium.first_height
    if not below.all():
        depth = np.where(below, depth, np.nan)
    indices = medium.layers.indices
    heights: list[FloatArray | float] = [medium.first_height, *medium.layers.thicknesses, depth]
    if below.all():
        layers = [np.asarray(height) for height in heights]
        return rho2, 1.0 / ratio_of(np.sqrt(rho2), layers, indices), heights
    q = np.full_like(w, np.nan)
    inside = [np.asarray(h[below] if isinstance(h, np.ndarray) else h) for h in heights]
    q[below] = 1.0 / ratio_of(np.sqrt(rho2[below]), inside, indices)
    return rho2, q, heights
