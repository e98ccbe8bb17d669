"""Lens distortion typed in `Setup`: formulas free raw picks of it, and equal the library."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import openpyxl
import pytest

from bifocal import InputError, Measuring, Pair, SurveySetup, Taking, solve
from bifocal.survey.survey_lens import SurveyLens
from bifocal.workbook.output import write_result
from bifocal.workbook.pair_workflow import _corrected, read_pair
from tests.bifocal.workbook.filled_forms import SETUP, fill, put
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached
from tests.cases import few_by_default
from tests.recalculate import recalculated, rows_of

RNG = np.random.default_rng(5)
XYZ = np.column_stack([RNG.uniform([-5, -3], [5, 3], (12, 2)), RNG.uniform(-0.8, 0.8, 12)])
PITCH, NADIR1, NADIR2 = 0.00739, (1536.0, 1024.0), (1530.0, 1020.0)
LENSES = (
    SurveyLens(k1=-0.12, k2=0.05, x=1550.0, y=1010.0),
    SurveyLens(k1=-0.2, k2=0.08),
)


def seen(c, d, nadir, lens):
    """Return raw pixels by the formula itself: seen = t (1 + k1 t^2 + k2 t^4), t = radius / c."""
    free = c * XYZ[:, :2] / (d - XYZ[:, 2:]) / [PITCH, -PITCH] + nadir
    middle = np.array(nadir if lens.x is None else (lens.x, lens.y))
    t = np.hypot(*(free - middle).T) * PITCH / c
    return middle + (free - middle) * (1 + lens.k1 * t**2 + lens.k2 * t**4)[:, None]


def filled(path, lenses=LENSES, language="en"):
    """Type everything into a fresh template, as a person would."""
    typed = {**SETUP, "input_unit": "px", "pitch": PITCH}
    for image, nadir in ((1, NADIR1), (2, NADIR2)):
        typed |= {f"nadir_{image}_col": nadir[0], f"nadir_{image}_row": nadir[1]}
    for image, lens in enumerate(lenses, start=1):
        typed |= {f"lens_{image}_{key}": getattr(lens, key) for key in ("k1", "k2", "x", "y")}
    picks = np.hstack([seen(35, 17.5, NADIR1, LENSES[0]), seen(19, 9.5, NADIR2, LENSES[1])])
    fill(
        path,
        [(f"P{i}", *values) for i, values in enumerate(picks.tolist())],
        typed,
        ("--lens", "--rows", 12, "--lang", language),
    )


def test_raw_pixels_of_lenses_that_distort_give_the_exact_points(tmp_path):
    filled(tmp_path / "s.xlsx")
    np.testing.assert_allclose(solve(tmp_path / "s.xlsx").table.xyz, XYZ, atol=1e-8)


def test_without_the_cells_filled_in_nothing_is_corrected(tmp_path):
    filled(tmp_path / "s.xlsx", lenses=())
    assert np.nanmax(np.abs(solve(tmp_path / "s.xlsx").table.xyz - XYZ)) > 0.02


def test_the_shift_on_the_photo_leads_to_the_raw_pixel_of_the_foot(tmp_path):
    from bifocal.survey.results import shift_of

    filled(tmp_path / "s.xlsx")
    shift = shift_of(solve(tmp_path / "s.xlsx"))
    free = 35 * XYZ[:, :2] / 17.5 / [PITCH, -PITCH] + NADIR1
    t = np.hypot(*(free - (1550, 1010)).T) * PITCH / 35
    feet = (1550, 1010) + (free - (1550, 1010)) * (1 - 0.12 * t**2 + 0.05 * t**4)[:, None]
    np.testing.assert_allclose(np.stack([shift["x_c"], shift["y_c"]], -1), feet, atol=1e-5)


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize("language", ["en", "de"])
def test_formulas_free_raw_picks_as_the_library_does(language, tmp_path):
    filled(tmp_path / "s.xlsx", language=language)
    write_result(tmp_path / "r.xlsx", solve(tmp_path / "s.xlsx"))
    assert assert_recalculated_equals_cached(tmp_path / "r.xlsx", tmp_path, worth=1e-9) > 500
    points = rows_of(recalculated(tmp_path / "r.xlsx", tmp_path), "Points", 4)[:12]
    found = np.array([[row[key] for key in "XYZ"] for row in points])
    np.testing.assert_allclose(found, XYZ, atol=1e-8)


def test_set_up_and_lens_survive_photos_typed_the_other_way_round():
    setup = SurveySetup(
        taking=Taking(d1=9.5, d2=17.5, c1=19, c2=35, pitch=PITCH, nadir1=NADIR2, nadir2=NADIR1),
        measuring=Measuring(unit="px"),
        lenses=LENSES[::-1],
    ).exchanged()
    assert setup.lenses == LENSES


def test_the_workbook_as_a_pair_sees_through_its_lenses(tmp_path):
    filled(tmp_path / "s.xlsx")
    book = openpyxl.load_workbook(tmp_path / "s.xlsx")
    for image in "12":
        cv2.imwrite(str(tmp_path / f"{image}.png"), np.zeros((2048, 3072), dtype=np.uint8))
        put(book, f"photo_{image}", f"{image}.png")
    book.save(tmp_path / "s.xlsx")
    first, second = read_pair(tmp_path / "s.xlsx").project(XYZ)
    np.testing.assert_allclose(first, seen(35, 17.5, NADIR1, LENSES[0]), atol=1e-6)
    np.testing.assert_allclose(second, seen(19, 9.5, NADIR2, LENSES[1]), atol=1e-6)


@pytest.mark.parametrize("k1", few_by_default([-30.0, 1e9], -30.0))
def test_a_lens_that_folds_the_photo_over_is_refused(tmp_path, k1):
    filled(tmp_path / "s.xlsx", lenses=(SurveyLens(k1=k1), SurveyLens()))
    with pytest.raises(InputError, match="lens_1_k1"):
        solve(tmp_path / "s.xlsx")


def test_distortion_without_a_principal_distance_is_refused():
    lens = SurveyLens(k1=-0.1)
    setup = SurveySetup(taking=Taking(d1=17.5, d2=9.5), lenses=(lens, lens))
    with pytest.raises(InputError, match="c_1"):
        setup.lens(1)
    assert SurveySetup(taking=Taking(d1=17.5, d2=9.5), lenses=(SurveyLens(),) * 2).lens(1) is None


def test_an_adjusted_set_up_is_refused_beside_it(tmp_path):
    filled(tmp_path / "s.xlsx")
    with pytest.raises(InputError, match="lens_1_k1"):
        solve(tmp_path / "s.xlsx", adjust_setup=True)


def test_the_command_writes_the_cells(tmp_path):
    filled(tmp_path / "raw.xlsx")
    book = openpyxl.load_workbook(tmp_path / "raw.xlsx")
    assert "lens_2_k2" in book.defined_names
    assert [cell.value for cell in book["Points"][4]][:8] == [
        *("id", "x1", "y1", "x2", "y2", "use", "code", "note")
    ]


def test_what_the_set_up_corrects_in_millimetres_of_a_photo_moves_it_on_the_wall():
    """1:500 of 35 mm at 17.5 m: 0.02 mm to the right and 0.01 mm up are 10 and 5 mm."""
    photo = Pair.ideal(d1=17.5, d2=9.5, c1=35.0, c2=19.0, pixel_size=0.01).image1
    shift = np.array([[1.0, 0.0, 0.02], [0.0, 1.0, 0.01], [0.0, 0.0, 1.0]])
    moved = replace(photo, plane_from_pixel=_corrected(photo, shift))
    pixels = np.array([[100.0, 50.0], [900.0, 600.0]])
    before, after = photo.plane_from_pixels(pixels), moved.plane_from_pixels(pixels)
    np.testing.assert_allclose(after - before, [[0.01, 0.005]] * 2, atol=1e-12)
    assert _corrected(photo, None) is photo.plane_from_pixel
