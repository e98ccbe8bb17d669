"""Large photos that are soft at full size are taken, with a remark; blurred ones are refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bifocal.orientation.validation import check_sharp
from photocore.errors import GeometryError
from photocore.provenance import noted_remarks, recording


def bricks(height, width, seed=0):
    """Return bricks of many greys with sharp edges, as a camera sees them."""
    greys = np.random.default_rng(seed).integers(
        40, 215, (height // 24, width // 48), dtype=np.uint8
    )
    wall = np.kron(greys, np.ones((24, 48), np.uint8))
    return cv2.GaussianBlur(wall, (0, 0), 0.7)


def enlarged(image, times):
    return cv2.resize(image, None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC)


@pytest.mark.parametrize(("times", "said"), [(2.6, "1/2"), (5.2, "1/4")])
def test_an_enlarged_photo_is_taken_and_said(times, said):
    size = 2448 if times < 4 else 1920
    photo = enlarged(bricks(size * 3 // 4 // 24 * 24, size), times)
    with recording("test"):
        check_sharp("phone.jpg", photo)
        assert said in " ".join(noted_remarks())


def test_a_sharp_large_photo_has_no_remark():
    with recording("test"):
        check_sharp("camera.jpg", bricks(4032, 6048))
        assert not noted_remarks()


def test_a_blurred_photo_is_refused_small_or_large():
    photo = cv2.GaussianBlur(bricks(4032, 6048), (0, 0), 9)
    for size in (photo, photo[:1008, :1512]):
        with pytest.raises(GeometryError, match="blurred"):
            check_sharp("out of focus.jpg", size)
