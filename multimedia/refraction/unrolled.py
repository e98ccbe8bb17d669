r"""The radial shift in a fixed number of Newton steps: what the workbook's formulas compute.

With F(u) and F'(u) of `multimedia.refraction.tangent`, u = tan(beta) in the thinnest medium,

.. math:: u_0 = \frac{R}{\sum h_i k_i}, \quad u_{j+1} = u_j + \frac{R - F(u_j)}{F'(u_j)} .

Only squares, roots and quotients: every spreadsheet program has them, and no macro is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from multimedia.refraction.shift import as_layers
from multimedia.refraction.tangent import apparent_radius, ratios, ray_sums
from photocore.arrays import FloatArray, as_floats

#: Six steps reach 1e-9 of R bar up to 75 degrees in the thinnest medium.
STEPS = 6

#: What the workbook accepts as solved: F(u) - R against R.
TOLERANCE = 1e-9


class UnrolledShift(NamedTuple):
    """The columns of the workbook.

    Attributes
    ----------
    u : list of ndarray
        Tangents in the thinnest medium, the start and one per step.
    radius_bar : ndarray
        Shifted radius. [unit of radius]
    residual : ndarray
        F(u) - R after the last step. [unit of radius]
    """

    u: list[FloatArray]
    radius_bar: FloatArray
    residual: FloatArray


def unrolled_shift(
    radius: ArrayLike, heights: Sequence[ArrayLike], indices: Sequence[float], *, steps: int = STEPS
) -> UnrolledShift:
    """Shift radially in a fixed number of Newton steps.

    Parameters
    ----------
    radius, heights, indices
        As in `multimedia.refraction.shift.shifted_radius`.
    steps : int
        Number of Newton steps.

    Returns
    -------
    UnrolledShift

    Examples
    --------
    >>> shift = unrolled_shift(300.0, [500.0, 10.0, 200.0], [1.0, 1.5, 1.337])
    >>> [round(float(u), 6) for u in shift.u[:4]]
    [0.457139, 0.462022, 0.462023, 0.462023]
    """
    r = as_floats(radius, "radius")
    layers = as_layers(heights, indices)
    factors = [ratios(index, min(indices)) for index in indices]
    bent = [(h * k, q) for h, (k, q) in zip(layers, factors, strict=True)]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        u: list[FloatArray] = [np.asarray(r / ray_sums(np.zeros(()), 0.0, bent)[0])]
        for _ in range(steps):
            value, slope = ray_sums(u[-1], 0.0, bent)
            u.append(np.asarray(u[-1] + (r - u[-1] * value) / slope))
        bar = np.asarray(apparent_radius(u[-1], sum(layers), *factors[0]))
        residual = np.asarray(u[-1] * ray_sums(u[-1], 0.0, bent)[0] - r)
    return UnrolledShift(u, bar, residual)
