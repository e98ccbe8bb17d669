r"""Maas's radial shift for a camera and points, seen through `Layers`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from multimedia.refraction.layers import Layers
from multimedia.refraction.shift import (
    ShiftDerivatives,
    shift_derivatives,
    shift_ratio,
    shifted_radius,
)
from photocore.arrays import FloatArray


def radial_shift(
    radius: ArrayLike, *, z0: ArrayLike, zp: ArrayLike, layers: Layers, compiled: bool | None = None
) -> FloatArray:
    r"""Radius :math:`\bar R` of the points as straight rays in the camera's medium would see them.

    Parameters
    ----------
    radius : array_like, shape (...)
        Horizontal distance R from the camera's nadir to the point. [m]
    z0 : array_like, shape (...)
        Camera centre to the first interface. [m]
    zp : array_like, shape (...)
        Depth of the point below the last interface. [m]
    layers : Layers
        The media, any number and order.
    compiled : bool, optional
        Whether to use the machine code of the extra ``fast`` (``pip install ".[fast]"``), on
        all cores. By default where it is installed and pays: fifty million points and more.

    Returns
    -------
    radius_bar : ndarray, shape (...)
        Shifted radius; replace (X, Y) by nadir + (X - X0, Y - Y0) R_bar / R in the collinearity
        equations. NaN where radius, z0 or zp is NaN and where no ray exists (a camera of z0 = 0
        looking into denser media beyond its circle of vision). A lazy dask array if radius, z0 or
        zp is one. [m]

    Raises
    ------
    GeometryError
        If a camera or point is on the wrong side of its interface.
    InputError
        If a radius is negative, or machine code is asked for and not installed.

    Notes
    -----
    Eqs. (1) to (3) of [1]_, solved to the last digit instead of to an epsilon.

    References
    ----------
    .. [1] Maas, "On the accuracy potential in underwater/multimedia photogrammetry", Sensors 2015.

    Examples
    --------
    >>> layers = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,))
    >>> round(float(radial_shift(0.1, z0=0.5, zp=0.2, layers=layers)), 6)
    0.108322
    """
    if any(hasattr(value, "__dask_graph__") for value in (radius, z0, zp)):
        return _lazily(radius, z0, zp, layers, compiled)
    heights = layers.heights(z0=z0, zp=zp)
    return shifted_radius(radius, heights, layers.indices, compiled=compiled)


def radial_shift_ratio(
    radius: ArrayLike, *, z0: ArrayLike, zp: ArrayLike, layers: Layers
) -> FloatArray:
    r"""Ratio :math:`\bar R / R`, with its finite limit on the axis.

    Parameters
    ----------
    radius, z0, zp, layers
        As in `radial_shift`.

    Returns
    -------
    ratio : ndarray, shape (...)
        [-]

    Raises
    ------
    GeometryError, InputError
        As `radial_shift`.

    Examples
    --------
    >>> layers = Layers(indices=(1.0, 1.333))
    >>> round(float(radial_shift_ratio(0.0, z0=1.0, zp=1.0, layers=layers)), 6)
    1.142735
    """
    return shift_ratio(radius, layers.heights(z0=z0, zp=zp), layers.indices)


def radial_shift_derivatives(
    radius: ArrayLike, *, z0: ArrayLike, zp: ArrayLike, layers: Layers
) -> ShiftDerivatives:
    r"""Shifted radius with its derivatives with respect to R, every height and every index.

    Parameters
    ----------
    radius, z0, zp, layers
        As in `radial_shift`.

    Returns
    -------
    ShiftDerivatives
        ``radius_bar``, ``d_radius``, ``d_heights`` (..., m) in the order z0, thicknesses, zp and
        ``d_indices`` (..., m).

    Raises
    ------
    GeometryError, InputError
        As `radial_shift`.

    Examples
    --------
    >>> layers = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,))
    >>> d = radial_shift_derivatives(0.1, z0=0.5, zp=0.2, layers=layers)
    >>> d.d_heights.shape
    (3,)
    """
    return shift_derivatives(radius, layers.heights(z0=z0, zp=zp), layers.indices)


def _lazily(
    radius: ArrayLike, z0: ArrayLike, zp: ArrayLike, layers: Layers, compiled: bool | None
) -> FloatArray:
    """Return the shift as a dask array, computed chunk by chunk when asked for."""
    import dask.array

    # One thread per chunk: dask runs the chunks side by side.
    def chunk(r: FloatArray, z: FloatArray, p: FloatArray) -> FloatArray:
        return radial_shift(r, z0=z, zp=p, layers=layers, compiled=bool(compiled))

    return dask.array.map_blocks(chunk, radius, z0, zp, dtype=np.float64)
