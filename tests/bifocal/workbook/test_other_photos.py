"""A third photo and more beside a pair: relief of every pair and of all, at check points."""

from __future__ import annotations

import json

import numpy as np
import openpyxl
import pytest

from bifocal import InputError, Measuring, Photo, PhotoSet, PointObservations, Taking, relief, solve
from bifocal.survey.other_photos import CHANCE, of_all_photos
from bifocal.survey.setup import OtherPhoto, SurveySetup
from bifocal.workbook.template_workflow import write_template
from tests.bifocal.workbook.filled_forms import SETUP, fill, named, run
from tests.bifocal.workbook.test_survey_workbook import assert_recalculated_equals_cached

#: Principal distances [mm] and distances [m] of the photos, the last not quite to scale.
LENSES = ((35.0, 17.5), (19.0, 9.5), (28.0, 14.0), (24.0, 12.02))
TAKING = Taking(d1=17.5, d2=9.5, c1=35.0, c2=19.0)
OTHERS = tuple(OtherPhoto(c=c, d=d) for c, d in LENSES[2:])


def picks(count=14, seed=2):
    """Return points and their picks in four photos, (4, n, 2), some missing, one wrong."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform((-5, -3, -0.5), (5, 3, 0.5), (count, 3))
    seen = np.stack([c * xyz[:, :2] / (d - xyz[:, 2:]) for c, d in LENSES])
    seen = np.round(seen + rng.normal(0, 0.004, seen.shape), 4)
    seen[2, 3, 1] += 0.2
    seen[2:, 5], seen[3, 6] = np.nan, np.nan
    return xyz, seen


def observed(seen):
    return PointObservations(
        ids=tuple(f"P{i}" for i in range(seen.shape[1])),
        xy1=seen[0], xy2=seen[1], other_xy=seen[2:].transpose(1, 0, 2),
    )  # fmt: skip


def photo_set(count=4):
    """Return the same photos as a set whose pixels are millimetres, rows downwards."""
    return PhotoSet(
        photos=tuple(
            Photo(
                name=f"photo {k}", plane_from_pixel=np.diag([d / c, -d / c, 1.0]), nadir=[0, 0],
                distance=d,
            )
            for k, (c, d) in enumerate(LENSES[:count])
        )
    )  # fmt: skip


def test_all_photos_together_are_the_set_of_photos():
    _, seen = picks(count=60)
    setup = SurveySetup(taking=TAKING, others=OTHERS)
    columns = of_all_photos(setup, observed(seen))
    solved = photo_set().intersect(list(seen * [1, -1]), sigma_px=setup.precision)
    several = (~np.isnan(seen).any(axis=2)).sum(axis=0) > 2
    found = np.stack([columns[key] for key in ("X_all", "Y_all", "r_all")], axis=-1)
    np.testing.assert_allclose(found[several], solved.xyz[several], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(columns["sigma_all"][several], solved.sigma[several, 2], rtol=1e-9)
    assert np.isnan(found[~several]).all()
    flagged = np.array(solved.flags) == "OFF-RADIAL"
    assert flagged[several].tolist() == (columns["chance"][several] < CHANCE).tolist()
    assert flagged[3]


def test_every_pair_with_the_first_photo_is_midullas_formula():
    _, seen = picks()
    columns = of_all_photos(SurveySetup(taking=TAKING, others=OTHERS), observed(seen))
    radii = np.hypot(*seen.transpose(2, 0, 1)) * [[d / c] for c, d in LENSES]
    for k in (3, 4):
        expected = relief(radii[0], radii[k - 1], d1=17.5, d2=LENSES[k - 1][1])
        np.testing.assert_allclose(columns[f"r_1_{k}"], expected, rtol=1e-12)


def form(path, seen, xyz, language="en", what_if=False, **cells):
    """Fill a form for four photos in: points, and relief measured on site."""
    options = ("--photos", 4, "--rows", 14, "--lang", language, *(["--what-if"] if what_if else []))
    values = {**SETUP, "c_3": 28, "d_3": 14, "c_4": 24, "d_4": 12.02}
    keys = [f"{axis}{k}" for k in "1234" for axis in "xy"]
    points = [
        {"id": f"P{i}", **{k: v for k, v in zip(keys, picks, strict=True) if v == v}}
        for i, picks in enumerate(np.hstack(seen).tolist())
    ]
    check = [{"id": f"P{i}", "Z_ref": round(r, 4)} for i, r in enumerate(xyz[:, 2].tolist())]
    return fill(path, points, values | cells, options, Check=check)


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize("language", ["it", "de"])
def test_the_formulas_recalculated_by_libreoffice_equal_the_library(tmp_path, language):
    xyz, seen = picks()
    # The form in German was an English one.
    path = form(tmp_path / "four.xlsx", seen, xyz, what_if=True)
    if language == "it":  # pixels of a print's scan, y down
        path = form(
            tmp_path / "px.xlsx", seen * [250, -250] + [3000, 2000], xyz, language,
            input_unit="px", pitch=0.004,
            **{f"nadir_{k}_{a}": v for k in "1234" for a, v in (("col", 3000), ("row", 2000))},
        )  # fmt: skip
    line = ("solve", path, "--lang", language, "--out", path, "--overwrite")
    assert run(*line).exit_code == 0
    assert assert_recalculated_equals_cached(path, tmp_path) > 4000


@pytest.mark.acceptance
def test_pairs_stand_beside_each_other_with_their_errors_at_check_points(tmp_path):
    xyz, seen = picks()
    path = form(tmp_path / "four.xlsx", seen, xyz)
    result = run("solve", path, "--out", path, "--overwrite")
    assert result.exit_code == 0, result.stderr
    assert "P3: the picks in three photos and more contradict" in result.stderr
    book = openpyxl.load_workbook(path, data_only=True)
    columns = solve(path).table.columns
    told = json.loads(run("solve", path, "--json").stdout)["points"][0]
    assert [told[key] for key in ("r_1_3", "r_all", "sigma_all", "chance")] == pytest.approx(
        [columns[key][0] for key in ("r_1_3", "r_all", "sigma_all", "chance")]
    )
    assert run("solve", path, "--out", tmp_path / "four.csv").exit_code == 0
    head = (tmp_path / "four.csv").read_text().splitlines()[0]
    assert "r_1_4 [m],sigma_1_4 [m],r_all [m],sigma_all [m],X_all [m],Y_all [m],chance" in head

    def shown(name):
        return named(book, name).value

    for key, missing in (("r", [3]), ("r_1_3", [3, 5]), ("r_1_4", [3, 5, 6]), ("r_all", [3, 5])):
        error = np.delete(columns[key] - np.round(xyz[:, 2], 4), missing)
        assert shown(f"compare_n_{key}") == len(error)
        assert shown(f"compare_rmse_{key}") == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
        assert shown(f"compare_max_{key}") == pytest.approx(np.abs(error).max(), rel=1e-9)
        sigma = np.delete(
            columns[key.replace("r", "sigma", 1) if key != "r" else "sigma_r"], missing
        )
        assert shown(f"compare_sigma_{key}") == pytest.approx(np.sqrt(np.mean(sigma**2)), rel=1e-9)
    # 35 and 19 mm are better than 35 and 28, all together no worse than the best pair.
    assert shown("compare_sigma_r") < shown("compare_sigma_r_1_3") / 3
    assert shown("compare_sigma_r_all") <= 1.01 * shown("compare_sigma_r")


@pytest.mark.acceptance
def test_a_workbook_whose_near_photo_was_typed_first_has_the_same_pairs(tmp_path):
    xyz, seen = picks()
    path = form(
        tmp_path / "s.xlsx", seen[[1, 0, 2, 3]], xyz, c_1=19, c_2=35, d_1=9.5, d_2=17.5,
        delta_d=None,
    )  # fmt: skip
    assert run("solve", path, "--out", path, "--overwrite").exit_code == 0
    whole = of_all_photos(SurveySetup(taking=TAKING, others=OTHERS), observed(seen))["r_all"]
    found = solve(path).table.columns["r_all"]
    np.testing.assert_allclose(found, whole, rtol=1e-9, atol=1e-12)


@pytest.mark.acceptance
def test_impossible_forms_and_set_ups_are_refused(tmp_path):
    for options in ({"photos": 1}, {"photos": 7}, {"photos": 3, "lens": True}):
        with pytest.raises(InputError, match="photos:"):
            write_template(tmp_path / "no.xlsx", **options)
    xyz, seen = picks()
    path = form(tmp_path / "bad.xlsx", seen, xyz, d_3=-14)
    result = run("solve", path)
    assert result.exit_code == 1
    assert "found -14, expected a number above zero" in result.stderr
    assert (
        solve(form(tmp_path / "blank.xlsx", seen, xyz, d_3=None), measuring=Measuring(sigma_s=0.01))
        .table.columns["r_1_4"]
        .size
    )


def test_half_a_pick_in_another_photo_is_named(tmp_path):
    xyz, seen = picks()
    seen[2, 4, 1] = np.nan
    result = run("solve", form(tmp_path / "half.xlsx", seen, xyz))
    assert result.exit_code == 1
    assert "point P4 lacks y3" in result.stderr
