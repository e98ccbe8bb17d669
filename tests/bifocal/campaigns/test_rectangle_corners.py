"""A rectangle begun at another corner, measures in millimetres, and walls in a national grid."""

from __future__ import annotations

import contextlib
import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from bifocal import rectify
from tests.bifocal.campaigns.test_rectification import CAMERA, CORNERS, DOTS, LENS, SIZE, seen
from tests.builders.commands import bifocal_command

LENS_OPTIONS = ("--focal", f"{1500 * 36 / SIZE[0]:.6f}", "--sensor-width", "36")
IMAGE = np.zeros(SIZE[::-1], np.uint8)


def camera(corners, **options):
    return rectify(IMAGE, gsd=0.2, rectangle=((5.0, 4.0), corners), interior=LENS, **options)


@pytest.mark.parametrize("begun", [1, 3])
def test_a_rectangle_begun_at_another_corner_gives_the_same_camera_and_says_so(begun):
    expected = camera(seen(CORNERS))
    turned = camera(np.roll(seen(CORNERS), -begun, axis=0))
    np.testing.assert_allclose(turned.photo.camera.centre, expected.photo.camera.centre, atol=1e-6)
    assert any("do not begin at the upper left" in text for text in turned.remarks)
    assert not any("begin at" in text for text in expected.remarks)


def test_a_rectangle_begun_at_the_lower_right_says_that_the_picture_is_upside_down():
    turned = camera(np.roll(seen(CORNERS), -2, axis=0))
    assert any("upside down against the photo" in text for text in turned.remarks)


def run(*words, folder):
    with contextlib.chdir(folder):
        return CliRunner().invoke(bifocal_command, words)


LINE = "rectify wall.png --control control.csv --out o.tif --gsd 0.2"
BY_CONTROL = (*LINE.split(), *LENS_OPTIONS)


def written(folder, points, relief, scale=1.0, heading="id,X,Y,r,col,row"):
    cv2.imwrite(str(folder / "wall.png"), np.zeros(SIZE[::-1], np.uint8))
    places = np.column_stack([points, np.full(len(points), relief)]) * scale
    pixels = seen(DOTS)
    rows = [
        f"P{k},{x:.5f},{y:.5f},{r:.5f},{col:.4f},{row:.4f}"
        for k, ((x, y, r), (col, row)) in enumerate(zip(places, pixels, strict=True))
    ]
    (folder / "control.csv").write_text("\n".join([heading, *rows]) + "\n")


def test_measures_in_millimetres_are_asked_for_their_unit(tmp_path):
    written(tmp_path, DOTS, 0.0, scale=1000.0)
    refused = run(*BY_CONTROL, folder=tmp_path)
    assert refused.exit_code == 1
    assert "Are the measures in millimetres" in refused.stderr
    assert not (tmp_path / "o.tif").exists()
    done = run(*BY_CONTROL, "--unit", "mm", folder=tmp_path)
    assert done.exit_code == 0, done.stderr


def test_a_wall_in_a_national_grid_is_rectified_as_near_the_origin(tmp_path):
    shift = np.array([652345.0, 6862123.0])
    made = []
    for name, origin in (("near", [0.0, 0.0]), ("far", shift)):
        folder = tmp_path / name
        folder.mkdir()
        written(folder, DOTS + origin, 0.0)
        done = run(*BY_CONTROL, "--json", folder=folder)
        assert done.exit_code == 0, done.stderr
        made.append(np.array([*(told := json.loads(done.stdout))["nadir"], told["distance"]]))
    np.testing.assert_allclose(made[1] - made[0], [*shift, 0.0], atol=1e-5)
    np.testing.assert_allclose(made[0], CAMERA.centre, atol=0.1)
