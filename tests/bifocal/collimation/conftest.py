"""One browser and one served survey for all tests of the page in the browser."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.browser import Served, launched, sample_survey


@pytest.fixture(scope="package")
def browser() -> Iterator[Any]:
    """Return a headless browser."""
    with launched() as found:
        yield found


@pytest.fixture(scope="package")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """Serve the sample pair; a test that needs it without points begins with `Driver.empty`."""
    with sample_survey(tmp_path_factory.mktemp("survey")) as started:
        yield started
