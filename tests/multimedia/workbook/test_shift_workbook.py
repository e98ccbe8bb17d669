"""The multimedia workbook: LibreOffice, stored values and the library agree."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from multimedia import QUAN_FRY, InputError, Layers, radial_shift, water_refractive_index
from multimedia.refraction.unrolled import unrolled_shift
from multimedia.workbook.shift_points import ShiftPoints, ShiftSetup
from multimedia.workbook.shift_workbook import write_shift_workbook
from multimedia.workbook.workflow import write_template
from tests import office
from tests.workbook_lint import lint

ORDERS = {
    "air glass water": ShiftSetup(
        layers=Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10,)), z0=500
    ),
    "water glass air": ShiftSetup(
        layers=Layers(indices=(1.34, 1.5, 1.0), thicknesses=(10,)), z0=200
    ),
    "five media": ShiftSetup(
        layers=Layers(indices=(1.34, 1.52, 1.0, 1.52, 1.34), thicknesses=(5, 12, 5)), z0=80
    ),
    "two media": ShiftSetup(layers=Layers(indices=(1.0, 1.337)), z0=0.7, nadir=(5e5, 4e6)),
}


def points_for(setup: ShiftSetup, *, steepest: float = 75.0) -> ShiftPoints:
    """Return points seen at up to the given angle in the thinnest medium."""
    rng = np.random.default_rng(8)
    n = 40
    depth = setup.z0 * rng.uniform(0.05, 3, n)
    angle = np.radians(np.linspace(0, steepest, n))
    lowest = min(setup.layers.indices)
    radius = np.zeros(n)
    for height, index in zip(
        setup.layers.heights(z0=setup.z0, zp=depth), setup.layers.indices, strict=True
    ):
        radius += height * np.tan(np.arcsin(lowest / index * np.sin(angle)))
    azimuth = rng.uniform(0, 2 * np.pi, n)
    xy = np.asarray(setup.nadir) + radius[:, None] * np.stack(
        [np.sin(azimuth), np.cos(azimuth)], axis=-1
    )
    xy[::3] = np.nan  # every third point by R and ZP
    seen = np.hypot(*(xy - np.asarray(setup.nadir)).T)
    radius = np.where(np.isnan(seen), radius, seen)
    ids = (*(f"P{i}" for i in range(n - 2)), "=A1", "007")
    return ShiftPoints(ids=ids, radius=radius, depth=depth, xy=xy)


def table_of(values: dict[str, object], *, head: int) -> dict[str, list[object]]:
    """Return key -> values below the header row of the sheet Multimedia."""
    keys = {
        re.sub(r"\d", "", cell): str(value)
        for cell, value in values.items()
        if re.fullmatch(rf"[A-Z]+{head}", cell)
    }
    rows = max(int(re.sub(r"[A-Z]", "", cell)) for cell in values)
    return {
        key: [values.get(f"{letters}{row}") for row in range(head + 1, rows + 1)]
        for letters, key in keys.items()
    }


def head_row(path: Path) -> int:
    """Return the row of the keys."""
    area = openpyxl.load_workbook(path)["Multimedia"].tables["tblMM"].ref
    return int(re.match(r"A(\d+)", area)[1])  # type: ignore[index]


@pytest.mark.parametrize("name", ORDERS)
def test_what_the_formulas_give_equals_the_library(name: str, tmp_path: Path) -> None:
    setup, path = ORDERS[name], tmp_path / "points.xlsx"
    points = points_for(setup)
    write_shift_workbook(path, setup, points, rows=1)
    stored = office.stored(path)
    table = table_of(stored["Multimedia"], head=head_row(path))
    exact = radial_shift(points.radius, z0=setup.z0, zp=points.depth, layers=setup.layers)
    np.testing.assert_allclose(np.array(table["Rbar"], float), exact, rtol=1e-9, atol=1e-12)
    assert table["flag"] == ["OK"] * len(exact)
    light = {"wavelength_nm": 550, "temperature_c": 20, "salinity_percent": 0, "depth": 0}
    for cell, formula in (("C11", {}), ("C12", {"formula": QUAN_FRY})):
        n_w = float(water_refractive_index(**light, **formula))
        assert stored["RefractiveIndex"][cell] == pytest.approx(n_w, rel=1e-14)


@pytest.mark.acceptance
@pytest.mark.office
@pytest.mark.parametrize("name", ORDERS)
def test_recalculated_formulas_equal_the_library(name: str, tmp_path: Path) -> None:
    setup = ORDERS[name]
    points = points_for(setup)
    path = tmp_path / "points.xlsx"
    write_shift_workbook(path, setup, points, rows=1)
    head = head_row(path)
    live = table_of(office.recalculated(path, tmp_path)["Multimedia"], head=head)
    kept = table_of(office.stored(path)["Multimedia"], head=head)
    exact = radial_shift(points.radius, z0=setup.z0, zp=points.depth, layers=setup.layers)
    np.testing.assert_allclose(np.array(live["Rbar"], float), exact, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        np.array(live["Rbar"], float), np.array(kept["Rbar"], float), rtol=1e-12, atol=1e-12
    )
    assert live["flag"] == kept["flag"] == ["OK"] * len(exact)
    assert live["id"] == list(points.ids)
    for axis, column in (("X", 0), ("Y", 1)):
        truth = points.shifted(setup).xy_bar[:, column]
        for shown, value in zip(live[f"{axis}bar"], truth, strict=True):
            assert shown == (None if np.isnan(value) else pytest.approx(value, rel=1e-9))


@pytest.mark.acceptance
@pytest.mark.office
def test_template_calculates_what_is_typed_into_it(tmp_path: Path) -> None:
    path = tmp_path / "tank.xlsx"
    write_shift_workbook(path, ORDERS["air glass water"], rows=5)
    head = head_row(path)
    book = openpyxl.load_workbook(path)
    sheet = book["Multimedia"]
    keys = {sheet.cell(head, c).value: c for c in range(1, sheet.max_column + 1)}
    typed = [("A", 100.0, 50.0), ("B", 300.0, 0.0), ("C", 0.0, 20.0), ("D", 10.0, -1.0)]
    for row, (name, radius, depth) in enumerate(typed, start=head + 1):
        sheet.cell(row, keys["id"]).value = name
        sheet.cell(row, keys["R"]).value = radius
        sheet.cell(row, keys["ZP"]).value = depth
    book["RefractiveIndex"]["C7"] = 3.5  # salinity
    book.save(tmp_path / "typed.xlsx")
    values = office.recalculated(tmp_path / "typed.xlsx", tmp_path)
    n_w = water_refractive_index(wavelength_nm=550, temperature_c=20, salinity_percent=3.5, depth=0)
    assert values["RefractiveIndex"]["C11"] == pytest.approx(float(n_w), rel=1e-14)
    quan_fry = water_refractive_index(
        wavelength_nm=550, temperature_c=20, salinity_percent=3.5, depth=0, formula=QUAN_FRY
    )
    assert values["RefractiveIndex"]["C12"] == pytest.approx(float(quan_fry), rel=1e-14)
    live = table_of(values["Multimedia"], head=head)
    layers = Layers(indices=(1.0, 1.5, float(n_w)), thicknesses=(10,))
    exact = radial_shift([100.0, 300.0, 0.0], z0=500, zp=[50.0, 0.0, 20.0], layers=layers)
    np.testing.assert_allclose(np.array(live["Rbar"][:3], float), exact, rtol=1e-9)
    assert live["flag"][:4] == ["OK", "OK", "OK", "DRY"]
    assert not any(isinstance(v, str) and v.startswith("#") for v in live["Rbar"])


@pytest.mark.acceptance
@pytest.mark.office
def test_no_formula_is_unknown_to_libreoffice_and_stored_values_are_its_own(
    tmp_path: Path,
) -> None:
    path = tmp_path / "tank.xlsx"
    write_shift_workbook(path, ORDERS["air glass water"], rows=3, steps=10)
    live, kept = office.recalculated(path, tmp_path), office.stored(path)
    for sheet, cells in office.formulas_of(path).items():
        for cell in cells:
            value, stored = live[sheet].get(cell), kept[sheet].get(cell)
            if isinstance(value, float | int):
                assert stored == pytest.approx(value, rel=1e-12, abs=1e-12), (sheet, cell)
            else:
                assert (value or None) == (stored or None), (sheet, cell)


def test_six_columns_reach_a_billionth_up_to_75_degrees_and_ten_up_to_85() -> None:
    for setup in ORDERS.values():
        for steepest, steps in ((75.0, 6), (85.0, 10)):
            points = points_for(setup, steepest=steepest)
            heights = setup.layers.heights(z0=setup.z0, zp=points.depth)
            found = unrolled_shift(points.radius, heights, setup.layers.indices, steps=steps)
            exact = radial_shift(points.radius, z0=setup.z0, zp=points.depth, layers=setup.layers)
            np.testing.assert_allclose(found.radius_bar, exact, rtol=1e-9)


def test_the_columns_say_themselves_when_they_are_too_few() -> None:
    gap = Layers(indices=(1.34, 1.0, 1.34), thicknesses=(0.02,))
    setup = ShiftSetup(layers=gap, z0=100)
    points = points_for(setup, steepest=89.9)
    heights = setup.layers.heights(z0=setup.z0, zp=points.depth)
    found = unrolled_shift(points.radius, heights, setup.layers.indices)
    exact = radial_shift(points.radius, z0=setup.z0, zp=points.depth, layers=setup.layers)
    wrong = np.abs(found.radius_bar / np.where(exact > 0, exact, 1) - 1)[1:] > 1e-8
    flagged = (np.abs(found.residual) > 1e-9 * points.radius)[1:]
    assert wrong.any()
    assert flagged[wrong].all()


def test_a_camera_on_the_glass_is_calculated_too() -> None:
    layers = Layers(indices=(1.34, 1.5, 1.0), thicknesses=(0.01,))
    found = unrolled_shift(0.3, layers.heights(z0=0.0, zp=0.4), layers.indices)
    assert found.radius_bar == pytest.approx(
        float(radial_shift(0.3, z0=0.0, zp=0.4, layers=layers)), rel=1e-9
    )


def test_cells_let_in_every_number_that_can_be_meant(tmp_path: Path) -> None:
    write_template(tmp_path / "form.xlsx", rows=3, steps=6, overwrite=False)
    sheet = openpyxl.load_workbook(tmp_path / "form.xlsx")["Multimedia"]
    rules = {rule.promptTitle: rule for rule in sheet.data_validations.dataValidation}
    limits = {
        name: (float(r.formula1), float(r.formula2)) for name, r in rules.items() if r.formula2
    }
    assert limits["z_0"] == limits["t_1"] == (0, 1e9)
    assert limits["X_0"] == limits["Y_0"] == (-1e9, 1e9)


def test_names_and_headings_are_what_spreadsheets_accept(tmp_path: Path) -> None:
    path = tmp_path / "tank.xlsx"
    write_shift_workbook(path, ORDERS["air glass water"], rows=3)
    assert lint(path) == []
    book = openpyxl.load_workbook(path)
    assert book.sheetnames == ["Readme", "Multimedia", "RefractiveIndex"]
    for name in book.defined_names:
        assert not re.fullmatch(r"[A-Za-z]{1,3}\d+|[RrCc]\d*|[Rr]\d*[Cc]\d*", name)
    sheet = book["Multimedia"]
    head = head_row(path)
    keys = [c.name for c in sheet.tables["tblMM"].tableColumns]
    assert keys == [sheet.cell(head, i).value for i in range(1, len(keys) + 1)]
    assert {"R", "ZP", "u0", "u6", "Rbar", "dR", "resid", "flag"} <= set(keys)
    for cells in office.formulas_of(path).values():
        for text in cells.values():
            assert "[@" not in text
            assert ";" not in text


def test_equal_input_makes_equal_cells(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_shift_workbook(tmp_path / f"{name}.xlsx", ORDERS["air glass water"], rows=3)
    assert office.stored(tmp_path / "a.xlsx") == office.stored(tmp_path / "b.xlsx")


@pytest.mark.parametrize(
    ("options", "message"),
    [({"steps": 0}, "1 to 30 steps"), ({"rows": 0}, "0 rows"), ({"rows": 20_001}, r"\.csv file")],
)
def test_impossible_sizes_are_refused(
    options: dict[str, int], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        write_shift_workbook(tmp_path / "x.xlsx", ORDERS["two media"], **options)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_the_committed_template_is_what_the_command_writes(tmp_path: Path) -> None:
    committed = Path(__file__).parents[3] / "templates" / "multimedia.xlsx"
    fresh = tmp_path / "fresh.xlsx"
    write_template(fresh, rows=50, steps=6, overwrite=False)
    assert office.formulas_of(fresh) == office.formulas_of(committed), (
        "rebuild it with `write_template`"
    )
    assert office.stored(fresh) == office.stored(committed)
