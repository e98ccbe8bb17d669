"""The folder of valid files that hostile lines are tried in, made once a session."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.attack.site import make_site


@pytest.fixture(scope="session")
def whole_site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with one valid file of every kind; tests work in copies made of links."""
    folder = tmp_path_factory.mktemp("site")
    make_site(folder)
    return folder
