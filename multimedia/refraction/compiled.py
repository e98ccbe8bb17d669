r"""The radial shift compiled to machine code, for hundreds of millions of points.

The same mathematics as `multimedia.refraction.tangent`, in blocks that fit the first-level cache,
loops the compiler turns into vector instructions, and threads. Needs the extra ``fast`` (numba).
Steep rays and absent layers are handed to the numpy kernel, so the results agree to the last digit
or two.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib.util import find_spec
from itertools import pairwise

import numpy as np

from multimedia.refraction.tangent import solve
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import MissingExtraError

#: Elements per inner block: five scratch rows of 256 float64 stay in a first-level cache of 32 kB.
INNER = 256

#: Elements per call of the kernel, shared among the threads.
OUTER = 1 << 18

#: Below this the numpy kernel has finished before the compiled one is ready: half a second from
#: numba's cache, three when it is compiled for the first time.
WORTHWHILE = 50_000_000

_Kernel = Callable[
    [FloatArray, FloatArray, BoolArray, FloatArray, FloatArray, int, FloatArray, BoolArray], None
]


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
    lowest = min(indices)
    a = np.array([(n / lowest) ** 2 for n in indices])
    b = np.array([(n - lowest) * (n + lowest) / lowest**2 for n in indices])
    moving = np.array([h.size > 1 for h in heights])
    varying = [h for h in heights if h.size > 1]
    shape = np.broadcast_shapes(radius.shape, *(h.shape for h in heights))
    result = np.empty(shape)
    operands = [np.broadcast_to(x, shape) for x in (radius, *varying)] + [result]
    flags = [["readonly"]] * (1 + len(varying)) + [["writeonly"]]
    with (
        ThreadPoolExecutor(workers) as pool,
        np.nditer(
            operands,
            flags=["external_loop", "buffered", "zerosize_ok"],
            op_flags=flags,  # type: ignore[arg-type]  # numpy wants literals
            buffersize=OUTER,
        ) as rows,
    ):
        for row in rows:
            width = row[0].size
            layers: FloatArray = np.zeros((len(heights), width if varying else 1))
            changing = iter(row[1:-1])
            for target, height in zip(layers, heights, strict=True):
                target[...] = next(changing) if height.size > 1 else height.item()
            out, unsure = np.empty(width), np.empty(width, dtype=np.bool_)
            jobs = [
                pool.submit(
                    kernel,
                    row[0][part],
                    layers[:, part] if varying else layers,
                    moving,
                    a,
                    b,
                    INNER,
                    out[part],
                    unsure[part],
                )
                for part in _parts(width, workers)
            ]
            for job in jobs:
                job.result()
            left = np.flatnonzero(unsure)
            if len(left):
                rest: list[FloatArray] = [
                    layer[left] if layer.size > 1 else layer for layer in layers
                ]
                out[left] = solve(row[0][left], rest, indices, tangent=False)[0]
            row[-1][...] = out
    return result


def _parts(width: int, workers: int) -> list[slice]:
    """Return even slices of a row, one per thread."""
    edges = np.linspace(0, width, workers + 1).astype(int).tolist()
    return [slice(i, j) for i, j in pairwise(edges) if j > i]


@cache
def _kernel() -> _Kernel:
    """Return the compiled loops; compiled once, then read from numba's cache on disk."""
    if not is_available():
        raise MissingExtraError("The compiled radial shift", "fast")
    from numba import njit

    # Fused multiply-adds are allowed, re-association is not: it would cost digits.
    options = {"nogil": True, "fastmath": {"contract"}, "error_model": "numpy"}
    try:
        kernel: _Kernel = njit(cache=True, **options)(_shift_blocks)
    except RuntimeError:  # nowhere to write a cache
        kernel = njit(**options)(_shift_blocks)
    return kernel


def _shift_blocks(
    radius: FloatArray,
    heights: FloatArray,
    moving: BoolArray,
    a: FloatArray,
    b: FloatArray,
    inner: int,
    out: FloatArray,
    unsure: BoolArray,
) -> None:
    """Shift every element, in loops that the compiler vectorises."""
    layers = a.size
    t, value, slope = np.empty(inner), np.empty(inner), np.empty(inner)
    whole, straight = np.empty(inner), np.empty(inner)
    for low in range(0, radius.size, inner):
        width = min(inner, radius.size - low)
        goal = radius[low : low + width]
        for i in range(width):
            whole[i] = straight[i] = value[i] = slope[i] = 0.0
        for j in range(layers):
            linear = 1 / np.sqrt(a[j])
            cubic = 0.5 * b[j] * linear * linear * linear
            lowest = 1.0 if b[j] == 0 else 0.0
            h = heights[j, low : low + width] if moving[j] else heights[j, :1]
            if moving[j]:
                for i in range(width):
                    whole[i] += h[i]
                    straight[i] += lowest * h[i]
                    slope[i] += linear * h[i]
                    value[i] += cubic * h[i]
            else:
                one = h[0]
                for i in range(width):
                    whole[i] += one
                    straight[i] += lowest * one
                    slope[i] += linear * one
                    value[i] += cubic * one
        for i in range(width):
            inverse = 1 / slope[i]
            x = goal[i] * inverse
            # beyond 0.6 the cubic guess may overshoot; x itself never does
            t[i] = x * (1 + (x * x * value[i] * inverse if x < 0.6 else 0.0))
        for _ in range(12):
            for i in range(width):
                value[i] = slope[i] = straight[i]
            for j in range(layers):
                aj, bj = a[j], b[j]
                if bj == 0:
                    continue
                h = heights[j, low : low + width] if moving[j] else heights[j, :1]
                if moving[j]:
                    for i in range(width):
                        s = 1 / (aj + bj * t[i] * t[i])
                        part = h[i] * np.sqrt(s)
                        value[i] += part
                        slope[i] += aj * part * s
                else:
                    one = h[0]
                    for i in range(width):
                        s = 1 / (aj + bj * t[i] * t[i])
                        part = one * np.sqrt(s)
                        value[i] += part
                        slope[i] += aj * part * s
            open_ = 0
            for i in range(width):
                step = (goal[i] - value[i] * t[i]) / slope[i]
                t[i] += step
                open_ += abs(step) > 1e-9 * t[i]
            if open_ == 0:
                break
        for i in range(width):
            out[low + i] = whole[i] * t[i] / np.sqrt(a[0] + b[0] * t[i] * t[i])
            # steep (or not finite), or the layer that t belongs to is absent
            unsure[low + i] = not (t[i] < 2.0 and straight[i] > 0)
