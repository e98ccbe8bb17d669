"""What `bifocal solve` refuses: every bad input is named, with the way to mend it."""

from __future__ import annotations

import zipfile

import numpy as np
import openpyxl
import pytest

from tests.bifocal.workbook.filled_forms import (
    POINTS,
    SETUP,
    by_id,
    fill,
    put,
    refused,
    rows,
    run,
    solved,
    write_csv,
)
from tests.bifocal.workbook.test_cli_solve import pixel_rows, write_pair


def edited(path, change):
    book = openpyxl.load_workbook(path)
    change(book)
    book.save(path)
    return path


@pytest.mark.parametrize("sign", [1, -1])
def test_scales_that_differ_by_two_hundredths_are_of_no_bifocal_pair(tmp_path, sign):
    path = write_csv(tmp_path / "s.csv", "id,x1,y1,x2,y2\nA,4,1,4.5,1.1\n")
    for share, status in ((0.019, 0), (0.021, 1)):
        options = ("--d1", 17.5, "--d2", 9.5, "--c1", 35, "--c2", 19 * (1 + sign * share))
        done = run("solve", path, *options)
        assert done.exit_code == status, done.stderr
        assert "tolerance 2.0%" in done.stderr or not status


def test_missing_sheet_points(tmp_path):
    path = edited(fill(tmp_path / "s.xlsx"), lambda book: book.remove(book["Points"]))
    refused(path, 'no sheet "Points"')


def test_missing_sheet_setup(tmp_path):
    def change(book):
        book.remove(book["Setup"])
        for name in list(book.defined_names):
            if "Setup" in book.defined_names[name].attr_text:
                del book.defined_names[name]

    refused(edited(fill(tmp_path / "s.xlsx"), change), "no value for d_1, d_2")


def test_missing_column(tmp_path):
    def change(book):
        book["Points"]["E4"] = "my own"

    refused(edited(fill(tmp_path / "s.xlsx"), change), "no column y2")


def test_all_bad_cells_are_reported_at_once_with_sheet_and_cell(tmp_path):
    def change(book):
        book["Points"]["B5"] = "twelve"
        book["Points"]["C6"] = "#DIV/0!"
        book["Points"]["D7"] = "NaN"
        book["Points"]["A8"] = "P1"
        put(book, "c_1", "thirty-five")

    path = edited(fill(tmp_path / "s.xlsx"), change)
    refused(
        path,
        "Points!B5 (x1)", '"twelve"', "Points!C6 (y1)", "#DIV/0!", "Points!D7 (x2)", "NaN",
        "Points!A8 (id)", "stands in A5 already", "Setup!C5 (c_1)",
    )  # fmt: skip


def test_numbers_that_cannot_be_meant(tmp_path):
    def change(book):
        book["Points"]["B5"] = 1e300
        put(book, "pitch", 1e-320)

    refused(edited(fill(tmp_path / "s.xlsx"), change), "Points!B5 (x1)", "too large", "(pitch)")


def test_equal_distances(tmp_path):
    refused(
        fill(tmp_path / "s.xlsx", setup={**SETUP, "d_1": 9.5, "delta_d": None}),
        "s.xlsx › Setup",
        "both 9.5 m",
    )


def test_distances_that_contradict_the_way_between_the_cameras(tmp_path):
    refused(fill(tmp_path / "s.xlsx", setup={**SETUP, "d_1": 18.5}), "Setup!C9 (d_1)", "= 17.5 m")


def test_scales_that_do_not_match(tmp_path):
    refused(fill(tmp_path / "s.xlsx", setup={**SETUP, "c_2": 28}), "Setup: c_1/d_1", "differ by")


def test_radial_distance_not_above_zero(tmp_path):
    table = [("P1", None, None, None, None, 0, 4.4, 90), ("P2", None, None, None, None, 4, -1, 90)]
    refused(fill(tmp_path / "s.xlsx", table), "Points!F5 (s1)", "Points!G6 (s2)", "above zero")


@pytest.mark.acceptance
def test_point_measured_on_one_image_only(tmp_path):
    table = [*rows(POINTS), ("P9", 1.0, 2.0, None, None)]
    refused(fill(tmp_path / "s.xlsx", table), "Points!D9 (x2)", "P9 is measured only on image 1")
    unused = [*table[:-1], (*table[-1], None, None, None, 0)]
    assert run("solve", fill(tmp_path / "t.xlsx", unused)).exit_code == 0


def test_pixels_typed_where_millimetres_are_expected(tmp_path):
    table = [(name, *(135 * v for v in values)) for name, *values in rows(POINTS)]
    refused(fill(tmp_path / "s.xlsx", table), "look like pixels", "input_unit")


def test_millimetres_typed_where_pixels_are_expected(tmp_path):
    setup = SETUP | {
        "input_unit": "px", "pitch": 0.0074, "nadir_1_col": 1536, "nadir_1_row": 1024,
        "nadir_2_col": 1536, "nadir_2_row": 1024,
    }  # fmt: skip
    refused(fill(tmp_path / "s.xlsx", setup=setup), "look like millimetres")


def test_millimetres_typed_as_raw_pixels_of_a_pair(tmp_path):
    pair = write_pair(tmp_path / "wall.pair.json")
    text = "id,col1,row1,col2,row2\n" + "\n".join(",".join(map(str, row)) for row in rows(POINTS))
    points = write_csv(tmp_path / "p.csv", text)
    refused(points, "look like millimetres", options=("--pair", pair))


def test_pixels_typed_as_millimetres_of_a_pair(tmp_path):
    pair = write_pair(
        tmp_path / "w.pair.json", image1_principal_distance=35, image2_principal_distance=19
    )
    text = pixel_rows().replace("col1 [px],row1 [px],col2 [px],row2 [px]", "x1,y1,x2,y2")
    points = write_csv(tmp_path / "p.csv", text)
    refused(points, "look like pixels", options=("--pair", pair))
    answer, _ = solved(points, "--pair", pair, "--unit", "px")
    assert by_id(answer)["P1"]["r"] == pytest.approx(1.0, abs=1e-9)


def test_pixels_without_nadir_points(tmp_path):
    setup = {**SETUP, "input_unit": "px", "pitch": 0.0074}
    refused(fill(tmp_path / "s.xlsx", setup=setup), "nadir_1_col")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("e.csv", b"", "empty"),
        ("e.xlsx", b"", "empty"),
        ("s.xlsx", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(2000), "password"),
        ("s.xlsx", b"just a letter", "not a workbook"),
    ],
)
def test_files_that_hold_no_table(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    refused(tmp_path / name, said)


def test_empty_template(tmp_path):
    refused(fill(tmp_path / "t.xlsx", (), {}), "no point")


def test_zip_bomb(tmp_path):
    path = tmp_path / "s.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        package.writestr("[Content_Types].xml", "<Types/>")
        package.writestr("xl/worksheets/sheet1.xml", bytes(2 * 2**20))
    refused(path, "unpack")


def test_a_missing_file(tmp_path):
    refused(tmp_path / "nowhere.xlsx", "no such file")


def test_a_pair_file_with_a_singular_homography(tmp_path):
    pair = write_pair(
        tmp_path / "bad.pair.json", image1_plane_from_pixel=[[1, 2, 3], [2, 4, 6], [0, 0, 1]]
    )
    points = write_csv(tmp_path / "p.csv", pixel_rows())
    refused(points, "singular", options=("--pair", pair))


def test_raw_pixels_without_a_pair(tmp_path):
    points = write_csv(tmp_path / "p.csv", pixel_rows())
    refused(points, "--pair", options=("--d1", 17.5, "--d2", 9.5))


def test_too_few_control_points(tmp_path):
    path = fill(tmp_path / "s.xlsx", Georeference=[("P1", 1000, 2000, 50)])
    refused(path, "at least 2")


SPREAD = [
    (f"Q{k}", x, y, r)
    for k, (x, y, r) in enumerate(
        [(2, 0.4, 1), (-3, 2, 0.5), (4, -2, -0.4), (-4, -1.5, 0), (1, 2.2, 0.3), (-2, -2.3, 0.8),
         (3.1, 1.9, 0.0), (-0.7, 1.1, 0.6)]
    )
]  # fmt: skip


@pytest.mark.parametrize("down", [False, True], ids=["y upwards", "y downwards"])
def test_millimetres_from_a_corner_of_the_pictures_are_refused_with_what_to_subtract(
    tmp_path, down
):
    rng, sign = np.random.default_rng(4), -1 if down else 1
    counted = [
        (name, *(np.array(xy) * [1, sign, 1, sign] + [11.35, 7.6] * 2 + rng.normal(0, 0.004, 4)))
        for name, *xy in rows(SPREAD)
    ]
    refused(fill(tmp_path / "s.xlsx", counted), "corner of the pictures", " 11.")
    plain = [(name, *(np.array(xy) + rng.normal(0, 0.004, 4))) for name, *xy in rows(SPREAD)]
    answer, said = solved(fill(tmp_path / "t.xlsx", plain))
    assert "corner" not in said
    # All in one quadrant, as when the camera stood at the wall's end.
    aside = [(name, abs(x) + 0.3, abs(y) + 0.2, r) for name, x, y, r in SPREAD]
    answer, said = solved(fill(tmp_path / "u.xlsx", rows(aside)))
    assert by_id(answer)["Q0"]["X"] == pytest.approx(2.3, abs=1e-9)


def test_pixels_that_all_lie_at_the_nadir_are_taken_for_millimetres(tmp_path):
    """Coordinates up to 4, from the nadir: 4 px of 7.4 µm are 0.0296 mm, of 35 mm nothing."""
    table = [(name, x / 4, y / 4, x / 3, y / 3) for name, x, y in (("A", 4, 3), ("B", -8, 12))]
    nadirs = {f"nadir_{number}_{side}": 0 for number in (1, 2) for side in ("col", "row")}
    setup = {**SETUP, **nadirs, "input_unit": "px", "pitch": 0.0074}
    words = ("within 0.0296 mm of the nadir", "Set the input unit to mm")
    refused(fill(tmp_path / "s.xlsx", table, setup=setup), *words)
