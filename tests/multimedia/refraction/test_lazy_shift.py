"""Lazy arrays stay lazy."""

from __future__ import annotations

import numpy as np
import pytest

from multimedia import InputError, Layers, radial_shift
from tests.rounding import EPS

TANK = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,))


def test_a_dask_array_is_shifted_lazily() -> None:
    array = pytest.importorskip("dask.array")
    radius = np.linspace(0, 300, 60).reshape(6, 10)
    depth = np.linspace(0, 200, 10)
    lazy = radial_shift(
        array.from_array(radius, chunks=(2, 5)),
        z0=500.0,
        zp=array.from_array(depth, chunks=5),
        layers=TANK,
    )
    assert hasattr(lazy, "__dask_graph__")
    found = lazy.compute(scheduler="synchronous")
    whole = radial_shift(radius, z0=500.0, zp=depth, layers=TANK)
    np.testing.assert_allclose(found, whole, rtol=4 * EPS)


def test_a_bad_dask_array_is_refused_when_computed() -> None:
    array = pytest.importorskip("dask.array")
    lazy = radial_shift(array.from_array(np.array([-1.0])), z0=1.0, zp=1.0, layers=TANK)
    with pytest.raises(InputError, match="cannot be negative"):
        lazy.compute(scheduler="synchronous")


@pytest.mark.acceptance
def test_a_hundred_million_lazy_points_fit_in_little_memory() -> None:
    import resource

    array = pytest.importorskip("dask.array")
    n = 100_000_000
    radius = array.linspace(0, 300, n, chunks=4_000_000)
    depth = array.linspace(0, 200, n, chunks=4_000_000)
    lazy = radial_shift(radius, z0=500.0, zp=depth, layers=TANK)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    largest = float(lazy.max().compute(scheduler="synchronous"))
    used = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024  # MiB on Linux
    assert largest == pytest.approx(
        float(radial_shift(300.0, z0=500.0, zp=200.0, layers=TANK)), rel=4 * EPS
    )
    assert used < 500
