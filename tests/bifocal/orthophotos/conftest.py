"""Fixtures of this folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bifocal.orthophotos.ortho_command import write_wall


@pytest.fixture
def wall(tmp_path: Path) -> Path:
    write_wall(tmp_path)
    return tmp_path
