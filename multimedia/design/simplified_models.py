r"""Simplified models of the literature, each with the error it makes in the user's own set-up.

All three hold for a camera that looks at right angles through the layers. They replace refraction
by changes of the ordinary camera model; the exact shift (`multimedia.refraction.shift`) tells how
far off that leaves the points.

References
----------
.. [1] Lavest, Rives, Lapresté, "Underwater camera calibration", ECCV 2000.
.. [2] Agrafiotis, Georgopoulos, "Camera constant in the case of two media photogrammetry", ISPRS
   Archives XL-5/W5, 2015.
.. [3] Telem, Filin, "Photogrammetric modeling of underwater environments", ISPRS Journal 65, 2010.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from multimedia.refraction import Layers, radial_shift_ratio
from multimedia.remarks import remark
from photocore.arrays import FloatArray, as_floats, positive
from photocore.errors import InputError


class Approximation(NamedTuple):
    """A simplified camera and what it gets wrong.

    Attributes
    ----------
    principal_distance : float
        Camera constant to use under water. [mm]
    distortion : tuple of float
        Radial coefficients k1, k2, ... of r' = r (1 + k1 r² + k2 r⁴ + ...), empty where the model
        has none; r from the undistorted projection with the constant above. [mm⁻², mm⁻⁴, ...]
    image_error : ndarray, shape (...)
        Radial distance the model predicts minus the true one, positive outwards. [mm]
    object_error : ndarray, shape (...)
        Where the model would put a point of this image, at its true depth: its true distance from
        the nadir minus that, to first order. [unit of the heights]
    rms : float
        Root mean square of image_error. [mm]
    """

    principal_distance: float
    distortion: tuple[float, ...]
    image_error: FloatArray
    object_error: FloatArray
    rms: float


def lavest(
    radius: ArrayLike, *, z0: float, zp: ArrayLike, layers: Layers, principal_distance: float
) -> Approximation:
    r"""Model refraction as a longer focal length: f times n [1]_.

    Parameters
    ----------
    radius : array_like, shape (...)
        Horizontal distances R of the user's points from the camera's nadir. [m]
    z0 : float
        Camera centre to the first interface. [m]
    zp : array_like, shape (...)
        Depths of the points below the last interface. [m]
    layers : Layers
        The media.
    principal_distance : float
        Camera constant in the camera's own medium. [mm]

    Returns
    -------
    Approximation

    Raises
    ------
    InputError
        If the camera constant is not positive.

    Notes
    -----
    The constant is multiplied by the last index over the first. Exact only on the axis of a camera
    whose lens touches the water.

    References
    ----------
    .. [1] Lavest, Rives, Lapresté, ECCV 2000.

    Examples
    --------
    A housing, lens 2 cm behind 8 mm of glass, points 2 m away; the model is right
    near the axis, and 1.4 mm (hundreds of pixels) wrong 1 m off it:

    >>> port = Layers(indices=(1.0, 1.49, 1.34), thicknesses=(0.008,))
    >>> model = lavest([0.0, 0.2, 1.0], z0=0.02, zp=2.0, layers=port, principal_distance=20.0)
    >>> round(model.principal_distance, 2), model.image_error.round(3).tolist()
    (26.8, [0.0, -0.002, -1.421])
    """
    factor = layers.indices[-1] / layers.indices[0]
    return _judged(_seen(radius, z0, zp, layers, principal_distance), principal_distance * factor)


def agrafiotis(
    radius: ArrayLike, *, z0: float, zp: ArrayLike, layers: Layers, principal_distance: float
) -> Approximation:
    r"""Model refraction as a focal length from the shares of air and water [1]_.

    Parameters
    ----------
    radius, z0, zp, layers, principal_distance
        As in `lavest`. The shares are those of the mean heights.

    Returns
    -------
    Approximation

    Raises
    ------
    InputError
        As `lavest`.

    Notes
    -----
    :math:`c_w = (P_{air} n_{air} + P_{water} n_{water}) c / n_1` with the shares P of the distance
    from camera to object; glass counts with its own index. With a mean depth only, points above and
    below it keep an error even on the axis.

    References
    ----------
    .. [1] Agrafiotis, Georgopoulos, 2015.

    Examples
    --------
    One metre of air over one metre of water:

    >>> sea = Layers(indices=(1.0, 1.34))
    >>> model = agrafiotis(0.0, z0=1.0, zp=1.0, layers=sea, principal_distance=24.0)
    >>> round(model.principal_distance, 2)
    28.08
    """
    means = [float(np.mean(height)) for height in layers.heights(z0=z0, zp=zp)]
    share = [mean / sum(means) for mean in means]
    indices = layers.indices
    factor = sum(s * n for s, n in zip(share, indices, strict=True)) / indices[0]
    return _judged(_seen(radius, z0, zp, layers, principal_distance), principal_distance * factor)


def telem(
    radius: ArrayLike,
    *,
    z0: float,
    zp: ArrayLike,
    layers: Layers,
    principal_distance: float,
    terms: int = 3,
) -> Approximation:
    r"""Let camera constant and radial distortion absorb refraction [1]_.

    Parameters
    ----------
    radius, z0, zp, layers, principal_distance
        As in `lavest`; at least as many points as unknowns, over the whole image.
    terms : int
        Number of radial coefficients, 0 to 5.

    Returns
    -------
    Approximation
        Best possible for the points given: fitted to them by least squares in the image.

    Raises
    ------
    InputError
        If there are too few points off the axis, or the camera constant is not positive.

    Notes
    -----
    What a self-calibration under water finds. At one distance the fit is as good as the polynomial;
    over a range of depths an error remains that no distortion can absorb.

    References
    ----------
    .. [1] Telem, Filin, 2010.

    Examples
    --------
    All points 2 m away: nothing is left after three coefficients. From 1 to 3 m: micrometres.

    >>> r, port = np.linspace(0.0, 1.0, 50), Layers(indices=(1, 1.49, 1.34), thicknesses=(0.008,))
    >>> one = telem(r, z0=0.02, zp=2.0, layers=port, principal_distance=20.0)
    >>> depths = np.linspace(1.5, 3.0, 50)[:, None]
    >>> many = telem(r, z0=0.02, zp=depths, layers=port, principal_distance=20.0)
    >>> one.rms < 1e-4, 1e-3 < many.rms < 1e-1
    (True, True)
    """
    if not 0 <= terms <= 5:
        raise InputError(f"terms: 0 to 5 radial coefficients, found {terms}.")
    view = _seen(radius, z0, zp, layers, principal_distance)
    aside = view.tangent > 0
    if np.count_nonzero(aside) <= terms:
        raise InputError(remark("design.few_off_axis", count=np.count_nonzero(aside), terms=terms))
    # r' = c_w T (1 + k1 (c_w T)² + ...) is linear in c_w, c_w³ k1, ...; T scaled against rounding.
    largest = float(view.tangent.max())
    scaled = (view.tangent[aside] / largest).ravel()
    design = np.stack([scaled ** (2 * i + 1) for i in range(terms + 1)], axis=-1)
    solution = np.linalg.lstsq(design, view.image[aside].ravel(), rcond=None)[0]
    absorbed = float(solution[0]) / largest
    distortion = tuple(
        float(value) / largest ** (2 * i + 1) / absorbed ** (2 * i + 1)
        for i, value in enumerate(solution[1:], start=1)
    )
    return _judged(view, absorbed, distortion)


class _Seen(NamedTuple):
    """True radial image distances [mm], the whole distance, and R over that distance."""

    image: FloatArray
    whole: FloatArray
    tangent: FloatArray


def _seen(
    radius: ArrayLike, z0: float, zp: ArrayLike, layers: Layers, principal_distance: float
) -> _Seen:
    """Return where the camera truly sees the points."""
    constant = positive(principal_distance, "principal_distance", unit="mm")
    r, whole = as_floats(radius, "radius"), z0 + layers.thickness + as_floats(zp, "zp")
    tangent = np.asarray(r / whole)
    ratio = radial_shift_ratio(r, z0=z0, zp=zp, layers=layers)
    return _Seen(np.asarray(constant * tangent * ratio), np.asarray(whole), tangent)


def _judged(views: _Seen, absorbed: float, distortion: tuple[float, ...] = ()) -> Approximation:
    """Return a model with its errors."""
    plain = absorbed * views.tangent
    predicted = plain * (1 + sum(k * plain ** (2 * i) for i, k in enumerate(distortion, start=1)))
    error = np.asarray(predicted - views.image)
    # An image error seen as a displacement of the point, to first order: the model's own scale
    # there is the slope of its radial distance over R.
    rate = 1 + sum((2 * i + 1) * k * plain ** (2 * i) for i, k in enumerate(distortion, start=1))
    at_object = np.asarray(error * views.whole / (absorbed * rate))
    return Approximation(absorbed, distortion, error, at_object, float(np.sqrt(np.mean(error**2))))
