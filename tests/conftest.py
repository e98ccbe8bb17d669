"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

# Tests run one process per core: threads inside each would only get in each other's way.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

# The same examples on every machine and in every run: a red test is then a change of the code.
settings.register_profile("same", derandomize=True, deadline=None)
settings.load_profile("same")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real example data; skip where it is not set."""
    folder = os.environ.get("BIFOCAL_DATA")
    if not folder:
        pytest.skip("BIFOCAL_DATA is not set")
    return Path(folder)
