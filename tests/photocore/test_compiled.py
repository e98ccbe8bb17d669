"""Kernels: the same numbers with numba and without, loaded when it pays, kept on the disk."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from photocore import compiled as module
from photocore.compiled import Kernel, compiled

MODULE = """
import numpy as np
from photocore.compiled import compiled

SCALE = 3.0


@compiled
def square(number, power=2):
    return SCALE * number**power


@compiled
def sum_of_squares(numbers):
    total = 0.0
    for number in numbers:
        total += square(number)
    return total
"""


def _run(folder: Path, code: str, **environment: str) -> str:
    (folder / "kernels.py").write_text(MODULE, encoding="utf-8")
    path = os.pathsep.join([str(folder), str(Path(module.__file__).parents[1])])
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path, **environment},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.acceptance  # compiles
def test_kernels_call_each_other_and_are_kept_on_the_disk(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    cache = tmp_path / "cache"
    code = "import kernels, numpy; print(kernels.sum_of_squares(numpy.array([1.0, 2.0])))"
    assert _run(tmp_path, code, NUMBA_CACHE_DIR=str(cache)) == "15.0"
    assert [path.suffix for path in sorted(cache.rglob("kernels.*"))].count(".nbi") == 2


def test_the_copy_on_the_disk_is_another_when_a_module_called_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "called.py").write_text(MODULE, encoding="utf-8")
    (tmp_path / "calling.py").write_text(
        "from called import square, compiled\n@compiled\ndef half(x):\n    return square(x) / 2\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(tmp_path)
    half = importlib.import_module("calling").half

    def name() -> str:
        return half._bound(lambda kernel: kernel.plain).__qualname__

    before = name()
    assert half.plain(2.0) == 6.0
    assert name() == before != "half"
    (tmp_path / "called.py").write_text(MODULE.replace("3.0", "4.0"), encoding="utf-8")
    assert name() != before


def test_without_numba_the_function_itself_is_called(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_numba", lambda: None)
    kernel = compiled(lambda numbers: sum(numbers))
    assert not kernel.pays(1e9)
    assert kernel([1, 2]) == 3


def test_numba_that_refuses_the_installed_numpy_counts_as_absent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "numba.py").write_text("raise ImportError('Numba needs NumPy 2.3 or less')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    assert module._numba.__wrapped__() is None


def test_numba_that_is_switched_off_counts_as_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")  # its loops would run as Python, slower than numpy
    assert module._numba.__wrapped__() is None


def test_a_kernel_pays_once_the_road_of_numpy_has_taken_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "_numba", lambda: np)
    kernel: Kernel = compiled(lambda: None)
    assert [kernel.pays(0.1) for _ in range(4)] == [False, False, True, True]


def test_a_full_disk_costs_the_copy_and_not_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    numba = pytest.importorskip("numba")
    monkeypatch.setattr(module, "_numba", lambda: numba)
    kernel = Kernel(lambda number: number + 1)

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kernel, "_run", full)
    assert kernel(2) == 3
