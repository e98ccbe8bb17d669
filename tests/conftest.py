"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real example data; skip where it is not set."""
    folder = os.environ.get("BIFOCAL_DATA")
    if not folder:
        pytest.skip("BIFOCAL_DATA is not set")
    return Path(folder)
