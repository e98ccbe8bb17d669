"""The compiled kernel equals the numpy one; lazy arrays stay lazy."""

from __future__ import annotations

import numpy as np
import pytest

from multimedia import Layers, radial_shift
from multimedia.refraction import compiled
from multimedia.refraction.shift import shifted_radius
from photocore.errors import InputError, MissingExtraError
from tests.rounding import EPS

TANK = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,))

needs_numba = pytest.mark.skipif(not compiled.is_available(), reason="numba is not installed")


@needs_numba
@pytest.mark.parametrize(
    ("indices", "heights"),
    [
        ((1.0, 1.5, 1.34), (500.0, 10.0, None)),
        ((1.34, 1.5, 1.0), (200.0, 10.0, None)),
        ((1.337, 1.52, 1.0, 1.52, 1.337), (300.0, 4.0, 1e-3, 4.0, None)),
        ((1.0, 1.34), (0.0, None)),
    ],
)
def test_machine_code_equals_numpy(
    indices: tuple[float, ...], heights: tuple[float | None, ...]
) -> None:
    rng = np.random.default_rng(3)
    radius, depth = rng.uniform(0, 2000, 5000), rng.uniform(0, 400, 5000)
    depth[::50], radius[7], depth[8] = 0.0, np.nan, np.nan
    layers = [depth if h is None else h for h in heights]
    fast = shifted_radius(radius, layers, indices, compiled=True)
    slow = shifted_radius(radius, layers, indices, compiled=False)
    np.testing.assert_array_equal(np.isnan(fast), np.isnan(slow))
    seen = ~np.isnan(slow)
    np.testing.assert_allclose(fast[seen], slow[seen], rtol=8 * EPS)


@needs_numba
def test_machine_code_broadcasts_and_takes_scalars() -> None:
    radius, depth = np.linspace(0, 300, 70)[:, None], np.linspace(0, 200, 50)
    fast = radial_shift(radius, z0=500.0, zp=depth, layers=TANK, compiled=True)
    slow = radial_shift(radius, z0=500.0, zp=depth, layers=TANK)
    np.testing.assert_allclose(fast, slow, rtol=8 * EPS)
    one = radial_shift(100.0, z0=500.0, zp=50.0, layers=TANK, compiled=True)
    assert one.shape == ()
    assert radial_shift([], z0=500.0, zp=50.0, layers=TANK, compiled=True).shape == (0,)


def test_without_the_compiler_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "is_available", lambda: False)
    compiled._kernel.cache_clear()
    with pytest.raises(MissingExtraError, match=r"bifocal\[fast\]"):
        radial_shift(1.0, z0=1.0, zp=1.0, layers=TANK, compiled=True)


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
