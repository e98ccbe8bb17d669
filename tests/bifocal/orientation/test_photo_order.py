"""Which of two photos is the near one, where typed values alone say so; which way a pair is set up.

The boards of the wall hide more of it from near than from afar, whatever was typed.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from bifocal import Control, GeometryError, Interior, SiteMeasures
from bifocal.collimation.job_tasks import task_of
from bifocal.orientation.align_workflow import AlignOptions, KnownLens, align_photos, way_of
from bifocal.orientation.approximate_orientation import Given, order_of
from bifocal.orientation.starts.photo_order import _change, first_is_far
from bifocal.orientation.starts.relative_orientation import Ties
from bifocal.orientation.tuning import ORDER
from photocore.camera.pinhole import plane_transfer
from tests.bifocal.orientation.layered_wall import SIZE, camera, relief_at, take
from tests.builders.orientation import PhotoInput, orient_pair
from tests.builders.pinholes import project
from tests.page_session import opened, sample_folder

FAR, NEAR = camera(16.0), camera(8.0)
SITE = SiteMeasures(distance1=16.0, distance2=8.0, parallel=True)


@pytest.fixture(scope="module")
def views():
    return take(FAR, NEAR)


def typed(cam) -> Interior:
    made = Interior.from_focal(cam.matrix[0, 0], image_size=SIZE, sigma=0.02, source="--focal")
    return replace(made, is_typed=True)


def inputs(first, second) -> tuple[PhotoInput, PhotoInput]:
    """Return two photos with the lenses typed for the far and the near one, as they lie."""
    return (
        PhotoInput(grey=first, interior=typed(FAR), name="one.jpg"),
        PhotoInput(grey=second, interior=typed(NEAR), name="two.jpg"),
    )


def ties(first, second) -> Ties:
    """Return points that both cameras see, and the wall's homography, from the truth."""
    rng = np.random.default_rng(0)
    xyz = np.column_stack([rng.uniform(-5, 5, (300, 2)) * [1, 0.7], np.zeros(300)])
    xyz[:, 2] = relief_at(xyz)
    pixels1, pixels2 = project(first, xyz), project(second, xyz)
    return Ties(
        pixels1=pixels1, pixels2=pixels2, seen1=pixels1, seen2=pixels2,
        homography=plane_transfer(first, second, np.zeros(3)), on_plane=xyz[:, 2] == 0,
        tolerance=1.0,
    )  # fmt: skip


def test_what_is_hidden_shows_which_photo_is_the_far_one(views) -> None:
    assert first_is_far((views.far, views.near), ties(FAR, NEAR)) > ORDER.sure
    assert first_is_far((views.near, views.far), ties(NEAR, FAR)) < -ORDER.sure


def test_a_flat_wall_shows_no_order() -> None:
    flat = take(FAR, NEAR, boards=())
    assert abs(first_is_far((flat.far, flat.near), ties(FAR, NEAR))) < ORDER.sure


def test_lenses_alike_leave_no_order_to_ask(views, monkeypatch) -> None:
    """What was typed for one photo fits the other as well: the scale on the wall tells."""
    monkeypatch.setattr(
        "bifocal.orientation.approximate_orientation.first_is_far", lambda *_: pytest.fail("asked")
    )
    photos = tuple(replace(p, interior=typed(FAR)) for p in inputs(views.far, views.near))
    given = Given(photos=(photos[0], photos[1]), control=Control(), site=SITE)
    assert order_of(given, ties(FAR, NEAR)) == np.inf


@pytest.mark.parametrize("known", [False, True])
def test_the_order_is_asked_where_a_lens_is_unknown(views, known) -> None:
    """Both distances then make up for the lens, whichever photo they belong to."""
    first, second = inputs(views.near, views.far)
    lens = replace(first.interior, is_typed=False) if known else Interior.unknown(SIZE)
    photos = replace(first, interior=lens), replace(second, interior=Interior.unknown(SIZE))
    given = Given(photos=photos, control=Control(), site=SITE)
    assert order_of(given, ties(NEAR, FAR)) < -ORDER.sure


@pytest.mark.acceptance
def test_photos_in_the_wrong_order_keep_the_sign_of_relief(views) -> None:
    made = orient_pair(inputs(views.near, views.far), control=Control(), site=SITE)
    assert made.exchanged
    assert "one.jpg is the near photo" in made.remarks[0]
    cameras = made.adjusted.cameras
    assert [float(c.matrix[0, 0]) for c in cameras] == pytest.approx([16 / 0.013, 8 / 0.013], 0.02)
    # The user's own word stands.
    kept = orient_pair(
        inputs(views.near, views.far), control=Control(), site=replace(SITE, ordered=True)
    )
    assert not kept.exchanged


@pytest.mark.acceptance
def test_an_order_that_nothing_tells_is_asked(views, monkeypatch) -> None:
    monkeypatch.setattr("bifocal.orientation.approximate_orientation.first_is_far", lambda *_: -2.0)
    made = orient_pair(inputs(views.far, views.near), control=Control(), site=SITE)
    assert not made.exchanged
    assert "cannot be told" in made.remarks[0]


def test_missing_focal_lengths_are_found_before_the_work(views, monkeypatch) -> None:
    monkeypatch.setattr(
        "bifocal.orientation.approximate_orientation.find_features",
        lambda *_: pytest.fail("worked"),
    )
    unknown = [
        replace(photo, interior=Interior.unknown(SIZE)) for photo in inputs(views.far, views.near)
    ]
    with pytest.raises(GeometryError, match=r"unknown .*one\.jpg and two\.jpg"):
        orient_pair(
            (unknown[0], unknown[1]), control=Control(), site=SiteMeasures(distance1=16.0)
        )  # fmt: skip


def test_both_distances_are_taken_the_same_way_by_page_and_command(tmp_path) -> None:
    """A wall that is not flat shows itself how the cameras stood to it."""
    both = SiteMeasures(distance1=16.0, distance2=8.0)
    ways = [way_of(AlignOptions(site=both, auto=auto)) for auto in (False, True)]
    assert ways[0][0] == ways[1][0] == "site"
    assert ways[0][1].site == ways[1][1].site
    folder = sample_folder(tmp_path)
    with opened(folder / "far.jpg", folder / "near.jpg") as session:
        session.command({"op": "setup.set", "d1": 17.5, "d2": 9.5})
        assert task_of(session, "align", {}).options.auto


@pytest.mark.acceptance
def test_turned_cameras_and_both_distances_give_what_one_distance_gives() -> None:
    """Cameras 9 and 12 degrees off the wall's normal, in one sitting with both tapes."""
    far = camera(16.0, offset=(-1.5, 0.0), turn_deg=(0.0, -9.0, 0.0))
    near = camera(8.0, offset=(-1.0, 0.3), turn_deg=(2.0, -12.0, 0.0))
    views = take(far, near)
    made = orient_pair(inputs(views.far, views.near), control=Control(), site=SITE)
    found = [float(np.rad2deg(np.linalg.norm(c.tilt))) for c in made.adjusted.cameras]
    assert found == pytest.approx([9.0, np.hypot(2.0, 12.0)], abs=0.3)
    assert not any("parallel" in text for text in made.assumed)


@pytest.mark.acceptance
@pytest.mark.parametrize("first", ["d9.png", pytest.param("d18.png", marks=pytest.mark.long)])
def test_a_rendered_church_dropped_in_either_order_lies_back(
    data_dir: Path, tmp_path: Path, first: str
) -> None:
    folder = data_dir / "semireal_church"
    second = "d18.png" if first == "d9.png" else "d9.png"
    made = align_photos(
        folder / first, folder / second, tmp_path / "church.pair.json",
        AlignOptions(
            site=SiteMeasures(distance1=18.0, distance2=9.0),
            lenses=tuple(KnownLens(focal=focal, sensor_width=22.7) for focal in (36.0, 18.0)),
        ),
    )  # fmt: skip
    rows = np.loadtxt(folder / "checkpoints.csv", delimiter=",", skiprows=1)
    found = made.pair.intersect(rows[:, 6:8], rows[:, 4:6]).xyz[:, 2]
    assert made.pair.image1.file.endswith("d18.png")
    assert np.nanmedian(np.abs(found - rows[:, 3])) < 0.003


def test_faint_texture_tells_less_of_what_another_surface_replaces_than_strong_one():
    """A block of the second photo stands 6 px further right; grey values of plaster and of stone.

    Noise of some grey values is not to count as a surface: the share of plaster is the smaller.
    """
    rng, side = np.random.default_rng(3), 300
    rough = cv2.GaussianBlur(rng.normal(0, 1, (side, side + 40)).astype(np.float32), (0, 0), 2)
    away = np.zeros((side, side, 2), np.float32)
    away[..., 0] = 1
    shares = []
    for contrast in (3, 30):
        wall = np.clip(128 + contrast * rough / rough.std(), 0, 255).astype(np.uint8)
        first, second = wall[:, 20:-20].copy(), wall[:, 20:-20].copy()
        second[:, 100:200] = wall[:, 114:214]
        shares.append(_change((first, second), away, np.ones((side, side), bool))[0])
    assert -2.5 < shares[0] < shares[1] - 0.4 < -1.4
