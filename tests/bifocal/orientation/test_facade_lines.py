"""Lines of a drawn façade, and how far they come out of a wall that is thought to be tilted."""

import cv2
import numpy as np
import pytest

from bifocal import Interior, Pinhole, RadialDivision
from bifocal.orientation.facade_lines import (
    FacadeDirection,
    facade_rotation,
    lines_of_photos,
)
from tests.builders.pinholes import camera_matrix, project, rotation_from_vector

SIZE = (1200, 800)
MATRIX = camera_matrix(1500.0, 1.0, 605.0, 396.0)
#: Square to the wall: x right, y down, z towards it.
SQUARE = np.diag([1.0, -1.0, -1.0])


def windows(lean: float = 0.0) -> list[np.ndarray]:
    """Return the corners of windows on the wall, each of shape (4, 3). [m]

    They lean out of it by random slopes of that size.
    """
    rng = np.random.default_rng(2)
    out = []
    for x in np.arange(-6.0, 6.1, 1.5):
        for y in np.arange(-4.0, 4.1, 1.6):
            box = np.array([[x, y], [x + 0.8, y], [x + 0.8, y + 1.0], [x, y + 1.0]])
            out.append(np.column_stack([box, lean * rng.choice([-1, 1]) * (box[:, 1] - y)]))
    return out


def drawn(camera: Pinhole, radial: RadialDivision, lean: float = 0.0) -> np.ndarray:
    """Return a photo of the windows."""
    # Drawn four times as large and reduced: OpenCV's own smoothing leaves edges on whole rows.
    image = np.full((4 * SIZE[1], 4 * SIZE[0]), 200, np.uint8)
    for box in windows(lean):
        steps = np.linspace(0, 1, 20, endpoint=False)[:, None]
        edge = [a + (b - a) * steps for a, b in zip(box, np.roll(box, -1, axis=0), strict=True)]
        seen = radial.distort(project(camera, np.concatenate(edge)))
        corners = np.round(((seen + 0.5) * 4 - 0.5) * 256).astype(np.int32)[None]
        cv2.fillPoly(image, corners, 90, cv2.LINE_8, 8)
    return cv2.resize(image, SIZE, interpolation=cv2.INTER_AREA)


def view(*turn_deg: float) -> Pinhole:
    turn = rotation_from_vector(np.deg2rad(turn_deg))
    return Pinhole(MATRIX, turn @ SQUARE, np.array([0.3, -0.2, 14.0]))


def found(photos, cameras, radial) -> dict[tuple[int, str], FacadeDirection]:
    interior = Interior.from_focal(1500.0, image_size=SIZE, sigma=1e-3, source="test")
    lines = lines_of_photos(photos, cameras, (interior, interior), (radial, radial))
    return {(line.camera, line.name): line for line in lines}


@pytest.mark.parametrize("k1", [0.0, -0.05])
def test_the_tilt_of_a_photo_is_how_far_its_lines_come_out_of_the_wall(k1) -> None:
    radial = RadialDivision(k1, MATRIX[:2, 2], 1500.0)
    true = view(1.2, -0.7, 0.0), view(-0.5, 0.9, 0.0)
    photos = drawn(true[0], radial), drawn(true[1], radial)
    lines = found(photos, (view(0, 0, 0), view(0, 0, 0)), radial)
    assert len(lines) == 4
    for camera, (about_x, about_y) in ((1, (1.2, -0.7)), (2, (-0.5, 0.9))):
        # Turned about its x axis by +a the camera sees the uprights run away from it by a.
        for name, angle in (("upright", about_x), ("level", about_y)):
            z = lines[camera, name].in_frame(view(0, 0, 0))[2]
            assert abs(np.rad2deg(np.arcsin(abs(z))) - abs(angle)) < 0.15
            # In the true camera they lie along the wall.
            assert abs(np.rad2deg(lines[camera, name].in_frame(true[camera - 1])[2])) < 0.15


def test_lines_that_scatter_tell_less() -> None:
    radial = RadialDivision(0.0, MATRIX[:2, 2], 1500.0)
    camera = view(0, 0, 0)
    even, leaning = (
        found((drawn(camera, radial, lean),) * 2, (camera, camera), radial)[1, "upright"]
        for lean in (0.0, 0.02)
    )
    # What façades are built to, 0.2 degrees, and a root of 2 for two photos of the same lines.
    assert np.rad2deg(even.sigma) == pytest.approx(0.2 * np.sqrt(2), rel=0.02)
    assert leaning.sigma > 1.1 * even.sigma
    out = np.arcsin(abs(leaning.in_frame(camera)[2]))
    assert out < 2 * leaning.sigma


def test_a_turned_facade_is_turned_first() -> None:
    radial = RadialDivision(0.0, MATRIX[:2, 2], 1500.0)
    true = view(0.8, 0.0, 6.0)
    interior = Interior.from_focal(1500.0, image_size=SIZE, sigma=1e-3, source="test")
    turn, share = facade_rotation(drawn(true, radial), view(0, 0, 0), interior)
    assert abs(np.rad2deg(turn)) == pytest.approx(6.0, abs=0.2)
    assert share > 0.5
    lines = found((drawn(true, radial),) * 2, (view(0, 0, 0),) * 2, radial)
    assert {name for _, name in lines} == {"upright", "level"}
    for line in lines.values():
        assert abs(np.rad2deg(line.in_frame(true)[2])) < 0.08


def test_a_photo_without_lines_tells_nothing() -> None:
    noise = np.random.default_rng(1).integers(0, 255, SIZE[::-1], np.uint8)
    radial = RadialDivision(0.0, MATRIX[:2, 2], 1500.0)
    assert not found((noise, noise), (view(0, 0, 0),) * 2, radial)
