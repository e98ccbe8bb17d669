"""Windows all alike: the photos lie together where what does not repeat says, or it is told."""

import cv2
import numpy as np
import pytest

from bifocal import Interior, SiteMeasures, align
from bifocal.model.doubts import covariance_of_doubts
from bifocal.model.homography import apply_homography
from bifocal.model.orientation_precision import NAMES
from bifocal.orientation.repetition import repetition
from bifocal.orientation.starts.relative_orientation import Ties
from photocore.camera.pinhole import Pinhole
from tests.scenes.repeated import D1, D2, front, photo

SIZE, PIXEL = (512, 340), 0.022


def pair_of(*, plaster, aside, pitch=1.2, seed=1, size=SIZE, pixel=PIXEL, depth=0.2, **more):
    rng = np.random.default_rng(seed)
    sheets = front(rng, plaster=plaster, pitch=pitch, **more)
    views = ((D1, 0.0), (D2, aside))
    images = tuple(
        photo(sheets, rng, distance=d, x=x, size=size, pixel=pixel, depth=depth) for d, x in views
    )
    lenses = tuple(
        Interior.from_focal(distance / pixel, image_size=size, sigma=0.02, source="typed")
        for distance, _ in views
    )
    return images, lenses


def repeated(images, lenses, *, believed, height=D1):
    """Return how the wall repeats itself, where ties believe the near camera at that X."""
    shift = np.eye(3)
    shift[0, 2] = -believed / PIXEL
    none = np.zeros((0, 2))
    ties = Ties(
        pixels1=none, pixels2=none, seen1=none, seen2=none, homography=shift,
        on_plane=np.zeros(0, dtype=bool), tolerance=1.0,
    )  # fmt: skip
    far = Pinhole(lenses[0].matrix, np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, height]))
    return repetition(images, lenses, far, ties)


@pytest.mark.parametrize(
    ("periods", "front_of"),
    [(-3, {"plaster": 2.0}), (1, {"plaster": 2.0}), (-1, {"plaster": 0.0, "door": True})],
    ids=["plaster, three to the left", "plaster, one to the right", "a door"],
)
def test_photos_some_periods_aside_are_laid_together_by_what_does_not_repeat(
    periods: int, front_of: dict
) -> None:
    images, lenses = pair_of(aside=0.62, **front_of)
    found = repeated(images, lenses, believed=0.62 + 1.2 * periods)
    assert found is not None
    assert found.is_certain
    assert np.ptp(found.ends[:2, 0]) == pytest.approx(1.2 / PIXEL, abs=2)
    middle = np.array(SIZE) / 2
    away = apply_homography(found.surrounding.homography, middle) - middle
    assert away == pytest.approx([-0.62 / PIXEL, 0.0], abs=1.5)
    assert found.surrounding.reach < 0.4 * 1.2 / PIXEL


def test_smooth_plaster_tells_nothing_and_is_not_believed_to() -> None:
    images, lenses = pair_of(plaster=0.0, aside=0.62)
    found = repeated(images, lenses, believed=0.62 - 1.2)
    assert found is not None
    assert not found.is_certain


@pytest.mark.parametrize("believed", [0.62, 60.0], ids=["seen by both", "seen by one"])
def test_a_wall_on_which_nothing_is_to_be_seen_tells_nothing(believed: float) -> None:
    lenses = tuple(Interior.unknown(SIZE) for _ in range(2))
    empty = np.full(SIZE[::-1], 128, np.uint8)
    assert repeated((empty, empty), lenses, believed=believed) is None
    images, lenses = pair_of(plaster=2.0, aside=0.62)
    found = repeated(images, lenses, believed=believed)
    assert found is not None
    assert found.is_certain == (believed == 0.62)


def test_three_windows_in_a_row_are_no_repetition_but_three_storeys_are() -> None:
    images, lenses = pair_of(plaster=2.0, aside=0.62, pitch=4.4)
    found = repeated(images, lenses, believed=0.62)
    assert found is not None
    assert np.ptp(found.ends[:, 0]) < 2
    assert np.ptp(found.ends[:, 1]) == pytest.approx(2.4 / PIXEL, abs=2)


def test_a_wall_without_windows_in_rows_does_not_repeat_itself() -> None:
    rng = np.random.default_rng(5)
    wall = cv2.resize(rng.uniform(60, 220, (9, 12)), SIZE, interpolation=cv2.INTER_NEAREST)
    image = wall.astype(np.uint8)
    lenses = tuple(Interior.unknown(SIZE) for _ in range(2))
    assert repeated((image, image), lenses, believed=0.0) is None


def test_a_pair_that_may_lie_aside_is_uncertain_by_a_period() -> None:
    said = {"standard_deviations": {"aside_x": 1.2, "aside_y": 0.0}}
    variance = covariance_of_doubts(said)
    assert variance is not None
    place = NAMES.index("X 2")
    assert np.sqrt(variance[place, place]) == pytest.approx(1.2)
    assert np.count_nonzero(variance) == 1


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("plaster", "aside", "depth", "pitch"),
    [(1.0, 0.62, 0.0, 1.2), (0.3, 1.0, 0.2, 1.2), (0.6, -1.3, 0.12, 0.9)],
)
def test_align_finds_the_near_camera_before_the_right_window(plaster, aside, depth, pitch) -> None:
    fine = {"size": (1024, 680), "pixel": 0.011}
    images, lenses = pair_of(plaster=plaster, aside=aside, pitch=pitch, depth=depth, **fine)
    site = SiteMeasures(distance1=D1, distance2=D2, parallel=True)
    made = align(*images, interiors=lenses, site=site)
    off = made.pair.image2.nadir - made.pair.image1.nadir - [aside, 0.0]
    assert np.linalg.norm(off) < 3 * np.sqrt(2) * made.deviations["nadir2"]
    assert made.deviations["nadir2"] < 0.06
    assert any("repeats itself" in text for text in made.remarks)


@pytest.mark.acceptance
def test_align_says_first_that_nothing_tells_which_window_is_which() -> None:
    images, lenses = pair_of(plaster=0.0, aside=1.0, size=(1024, 680), pixel=0.011)
    site = SiteMeasures(distance1=D1, distance2=D2, parallel=True)
    made = align(*images, interiors=lenses, site=site)
    assert made.remarks[0].startswith("THE WALL REPEATS ITSELF")
    assert made.deviations["nadir2"] > 1.1
    assert not any("relief is good to" in text for text in made.words)
    variance = covariance_of_doubts(made.setup)
    assert variance is not None
    assert np.sqrt(variance[NAMES.index("X 2"), NAMES.index("X 2")]) > 1.1


@pytest.mark.parametrize("height", [np.nan, -D1, 0.0])
def test_approximate_cameras_that_see_no_wall_ask_for_no_repetition(height: float) -> None:
    images, lenses = pair_of(aside=0.62, plaster=2.0)
    assert repeated(images, lenses, believed=0.62, height=height) is None
