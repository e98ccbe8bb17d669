"""Large photos that are soft at full size are taken, with a remark; blurred ones are refused."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from bifocal.orientation import validation
from bifocal.orientation.validation import check_sharp
from photocore.errors import GeometryError
from photocore.provenance import noted_remarks, recording


@pytest.fixture(autouse=True)
def _small_photos_are_large(monkeypatch):
    """Of photos of 1.9 MP what holds of 100 MP."""
    assert validation.VALIDATION.large == 24e6
    small = replace(validation.VALIDATION, large=0.4e6)
    monkeypatch.setattr(validation, "VALIDATION", small)


def bricks(blur, height=1152, width=1536):
    """Return bricks of many greys, blurred by so many pixels."""
    greys = np.random.default_rng(3).integers(40, 215, (height // 96, width // 192), dtype=np.uint8)
    return cv2.GaussianBlur(np.kron(greys, np.ones((96, 192), np.uint8)), (0, 0), blur)


@pytest.mark.parametrize(("blur", "size"), [(0.7, ""), (4.5, "at 1/2 "), (9.0, "at 1/4 ")])
def test_a_large_photo_is_judged_at_the_size_at_which_it_is_sharp(blur, size):
    with recording("test"):
        check_sharp("phone.jpg", bricks(blur))
        assert size in " ".join(noted_remarks())
        assert bool(noted_remarks()) == bool(size)


@pytest.mark.parametrize(("blur", "part"), [(24.0, 1), (4.5, 3)])
def test_a_blurred_photo_is_refused(blur, part):
    with pytest.raises(GeometryError, match="blurred"):
        check_sharp("out of focus.jpg", bricks(blur)[: 1152 // part, : 1536 // part])
