"""Colour seams: direction, width, and putting them right in an image."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from multimedia import (
    FLOAT_GLASS,
    InputError,
    Layers,
    colour_positions,
    correct_dispersion,
    layers_per_colour,
    radial_shift,
    seam_width,
    shift_per_colour,
)

COLOURS = layers_per_colour(glass=FLOAT_GLASS, thickness=0.01)
SCENE = {"z0": 0.5, "zp": 0.4}


def test_blue_lies_outwards_and_red_towards_the_nadir() -> None:
    red, green, blue = shift_per_colour(0.3, **SCENE, colours=COLOURS)
    assert red < green < blue


def test_each_colour_is_the_radial_shift_in_its_own_media() -> None:
    found = shift_per_colour([0.1, 0.2], **SCENE, colours=COLOURS)
    assert found.shape == (2, 3)
    np.testing.assert_array_equal(found[:, 2], radial_shift([0.1, 0.2], **SCENE, layers=COLOURS[2]))


def test_seam_by_hand_near_the_axis() -> None:
    # Paraxial: R bar = R 2 / (1 + 1 / n); n 1.332 -> 1.1423671, n 1.338 -> 1.1445680.
    # Difference 0.0022009 of R = 0.01 over 2 m, times 24 mm / 0.004 mm = 0.0660 px.
    media = [Layers(indices=(1.0, 1.332)), Layers(indices=(1.0, 1.338))]
    width = seam_width(
        0.01, z0=1.0, zp=1.0, colours=media, principal_distance=24.0, pixel_size=0.004
    )
    assert float(width) == pytest.approx(0.0660, abs=5e-5)


def test_one_colour_has_no_seam() -> None:
    width = seam_width(
        0.3, **SCENE, colours=[COLOURS[0]] * 3, principal_distance=24.0, pixel_size=0.004
    )
    assert width == 0


def test_colours_come_together_at_their_own_point() -> None:
    # Forward: the same point in every colour; the reference's position must lead to the others'.
    bars = shift_per_colour(0.25, **SCENE, colours=COLOURS)
    image = 24.0 * bars / 0.91
    found = colour_positions([0.0, image[1]], **SCENE, colours=COLOURS, principal_distance=24.0)
    np.testing.assert_allclose(found[1], image, rtol=1e-14)
    assert (found[0] == 0).all()


def test_the_nadir_point_stays() -> None:
    found = colour_positions([[0.0, 0.0]], **SCENE, colours=COLOURS, principal_distance=24.0)
    assert (found == 0).all()


def seam_between(image: np.ndarray) -> float:
    """Return the largest distance between the centroids of a blob in red and blue."""
    count, labels = cv2.connectedComponents((image[..., 1] > 20).astype(np.uint8))
    y, x = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    worst = 0.0
    for label in range(1, count):
        near = cv2.dilate((labels == label).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
        centre = [
            np.array([(w * x).sum(), (w * y).sum()]) / w.sum()
            for w in (image[..., c] * near for c in (0, 2))
        ]
        worst = max(worst, float(np.hypot(*(centre[0] - centre[1]))))
    return worst


@pytest.mark.acceptance
def test_correction_removes_the_seam_of_a_rendered_image() -> None:
    exaggerated = tuple(Layers(indices=(1.0, n)) for n in (1.30, 1.335, 1.37))
    scene = {"z0": 0.5, "zp": 0.41}
    image = np.zeros((600, 700, 3), dtype=np.float32)
    y, x = np.mgrid[0:600, 0:700].astype(float)
    for angle in np.arange(0, 2 * np.pi, 0.5):
        for radius in (0.05, 0.10, 0.16):
            bars = shift_per_colour(radius, **scene, colours=exaggerated)
            for channel, bar in enumerate(bars):
                r = 24.0 * bar / 0.91 / 0.02
                u, v = 349.5 + r * np.sin(angle), 299.5 - r * np.cos(angle)
                image[..., channel] += np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 2.5**2))
    image *= 200
    corrected = correct_dispersion(
        image, **scene, colours=exaggerated, principal_distance=24.0, pixel_size=0.02
    )
    assert seam_between(image) > 2.0
    assert seam_between(corrected) < 0.01
    np.testing.assert_array_equal(corrected[..., 1], image[..., 1])


def test_an_image_without_a_channel_per_colour_is_refused() -> None:
    with pytest.raises(InputError, match="expected 3 channels"):
        correct_dispersion(
            np.zeros((5, 5), np.uint8), **SCENE, colours=COLOURS,
            principal_distance=24.0, pixel_size=0.02,
        )  # fmt: skip


def test_a_reference_that_is_no_colour_is_refused() -> None:
    with pytest.raises(InputError, match="3 colours"):
        colour_positions([1.0, 0.0], **SCENE, colours=COLOURS, principal_distance=24, reference=3)
