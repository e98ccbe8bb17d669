r"""The radial shift compiled to machine code, for hundreds of millions of points.

The formulas of `multimedia.refraction.tangent` in blocks that fit the first-level cache, loops the
compiler turns into vector instructions, and threads. Needs the extra ``fast`` (numba). Steep rays
and absent layers are handed to the numpy rows, so the results agree to the last digit or two.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib.util import find_spec
from itertools import pairwise

import numpy as np

from multimedia.refraction import tangent
from photocore.arrays import FloatArray
from photocore.errors import MissingExtraError

#: Elements per inner block: the scratch rows of 256 float64 stay in a first-level cache of 32 kB.
INNER = 256

#: Elements per call of the kernel, shared among the threads.
OUTER = 1 << 18

#: Below this the numpy kernel has finished before the compiled one is ready: half a second from
#: numba's cache, three when it is compiled for the first time.
WORTHWHILE = 50_000_000


def is_available() -> bool:
    """Tell whether the compiler (numba) is installed; nothing is imported."""
    return find_spec("numba") is not None


def compiled_solve(
    radius: FloatArray,
    heights: list[FloatArray],
    indices: Sequence[float],
    *,
    threads: int | None = None,
) -> FloatArray:
    """Return the shifted radius, as ``multimedia.refraction.tangent.solve``.

    Parameters
    ----------
    radius : ndarray, shape (...)
        R, not negative.
    heights : list of ndarray
        Height of each layer, of shapes that broadcast with radius.
    indices : sequence of float
        Refractive index of each layer.
    threads : int, optional
        By default one per core.

    Raises
    ------
    MissingExtraError
        If numba is not installed.
    """
    kernel = _kernel()
    workers = threads or os.cpu_count() or 1
    k, q = np.array([tangent.ratios(n, min(indices)) for n in indices]).T.copy()
    with ThreadPoolExecutor(workers) as pool:

        def solve_row(
            row: FloatArray, layers: list[tangent.Height], indices: Sequence[float]
        ) -> tangent.Row:
            moving = np.array([isinstance(h, np.ndarray) for h in layers])
            stack: FloatArray = np.empty((len(layers), row.size if moving.any() else 1))
            for target, height in zip(stack, layers, strict=True):
                target[...] = height
            out, unsure = np.empty(row.size), np.empty(row.size, dtype=np.bool_)
            edges = np.linspace(0, row.size, workers + 1).astype(int).tolist()
            parts = [slice(i, j) for i, j in pairwise(edges) if j > i]

            def work(part: slice) -> None:
                heights = stack[:, part] if moving.any() else stack
                kernel(row[part], heights, moving, k, q, INNER, out[part], unsure[part])

            list(pool.map(work, parts))
            left = np.flatnonzero(unsure)
            if len(left):
                rest = [h[left] if isinstance(h, np.ndarray) else h for h in layers]
                out[left] = tangent.solve_row(row[left], rest, indices)[0]
            return out, out, 0.0

        return tangent.solve(radius, heights, indices, row_solver=solve_row, block=OUTER)[0]


@cache
def _kernel() -> Callable[..., None]:
    """Return the compiled loops; compiled once, then read from numba's cache on disk."""
    if not is_available():
        raise MissingExtraError("The compiled radial shift", "fast")
    from numba import njit
    from numba.extending import register_jitable

    # Fused multiply-adds are allowed, re-association is not: it would cost digits.
    options = {"fastmath": {"contract"}, "error_model": "numpy"}
    for formula in (tangent.layer_terms, tangent.first_tangent, tangent.apparent_radius):
        register_jitable(**options)(formula)
    try:
        kernel: Callable[..., None] = njit(cache=True, nogil=True, **options)(tangent.shift_blocks)
    except RuntimeError:  # nowhere to write a cache
        kernel = njit(nogil=True, **options)(tangent.shift_blocks)
    return kernel
