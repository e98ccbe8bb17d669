"""Tables as people bring them, in every file format."""

import re

import numpy as np
import openpyxl
import pytest

from bifocal import InputError, WorkbookError
from photocore.tables import Column, open_tables, parse_column_map, read_named_values, read_table
from tests.photocore.tables.small_book import POLAR, SAMPLES, check_samples, polar_rows


@pytest.mark.parametrize(
    "heading",
    [
        ("id", "s1", "s2", "theta"),
        ("ID ", "S1 [mm]", " s_2 (mm)", "Theta [deg]"),
        ("Punto", "Distanza radiale 1", "distanza_radiale 2 [mm]", "Anomalia [°]"),
        ("Punkt", "Radialdistanz 1 [mm]", "RADIALDISTANZ 2", "Richtung"),
        ("Point", "s₁ [mm]", "s₂ [mm]", "theta"),
        ("Nr", "s1 mm", "s2, mm", "theta"),
    ],
)
def test_headings_are_found_in_any_case_language_and_with_units(book, heading):
    table = read_table(book(polar_rows(heading)), POLAR)
    check_samples(table)
    assert table.numbers("theta").tolist() == [30.0, 200.0]


def test_units_in_headings_are_reported(book):
    table = read_table(book(polar_rows(("id", "s1 [px]", "s2 (mm)", "theta"))), POLAR)
    assert table.units == {"s1": "px", "s2": "mm"}


@pytest.mark.parametrize("ending", ["xlsx", "csv"])
@pytest.mark.parametrize("heading", ["s1 [furlong]", "s1 [parsec²]", "s1 (ft)", "S 1 (Inch)"])
def test_a_unit_nobody_knows_is_refused_with_the_known_ones(book, tmp_path, heading, ending):
    rows = [("Point", heading, "s2 [mm]", "theta"), *SAMPLES]
    path = book([], rows)
    if ending == "csv":
        path = tmp_path / "survey.csv"
        path.write_text("\n".join(",".join(map(str, row)) for row in rows), encoding="utf-8")
    with pytest.raises(WorkbookError) as caught:
        read_table(path, POLAR)
    unit = heading.strip(")]").partition("[")[2] or heading.strip(")]").partition("(")[2]
    place = "Sheet2!B1" if ending == "xlsx" else "B1"
    assert str(caught.value).startswith(f"survey.{ending} › {place} (s1): ")
    assert f'"{unit}", which is not known. Known are um, mm, cm, dm, m, km, px' in str(caught.value)


@pytest.mark.parametrize("heading", ["s1 (far photo)", "s1 [-]", "s1 []", "s1 [mm]", "s1 [1]"])
def test_notes_in_round_brackets_and_known_units_are_no_fault(book, heading):
    table = read_table(book([("Point", heading, "s2", "theta"), *SAMPLES]), POLAR)
    assert table.numbers("s1").tolist() == [12.5, 14.75]


@pytest.mark.parametrize(
    ("label", "message"),
    [
        ("d1 [cm]", 'the label "d1 [cm]" says [cm], expected [m]. Write 17.5, and [m].'),
        ("d1 [furlong]", 'the label "d1 [furlong]" says [furlong], expected [m].'),
        ("d1 (ft)", 'the label "d1 (ft)" says [ft], expected [m].'),
        ("d1 [px]", 'the label "d1 [px]" says [px], expected [m].'),
    ],
)
def test_a_label_with_another_unit_than_its_value_is_wanted_in_is_refused(book, label, message):
    wanted = [Column("d1", unit="m"), Column("d2", unit="m")]
    path = book([(label, 1750), ("d2 (near)", 9.5)])
    with pytest.raises(WorkbookError, match=re.escape(message)) as caught:
        read_named_values(path, wanted)
    assert str(caught.value).startswith("survey.xlsx › Sheet1!B1 (d1): ")


def test_a_label_with_the_unit_wanted_is_read(book):
    path = book([("d1 [m]", 17.5), ("d2", 9.5)])
    values = read_named_values(path, [Column("d1", unit="m"), Column("d2", unit="m")])
    assert values.number("d1") == 17.5


def test_a_row_of_units_below_the_headings_is_taken_as_units(book):
    rows = [("id", "s1", "s2"), (None, "[mm]", "mm"), ("P1", 1, 2)]
    table = read_table(book(rows), POLAR)
    assert table.units == {"s1": "mm", "s2": "mm"}
    assert table.texts("id") == ["P1"]


def test_columns_are_found_in_any_order_sheet_and_row(book):
    rows = [(), ("Survey of the church",), (), (None, "s2", "theta", "id", "other", "s1")]
    rows += [(None, s2, theta, name, "x", s1) for name, s1, s2, theta in SAMPLES]
    table = read_table(book([("notes",)], [], rows), POLAR)
    check_samples(table)
    assert table.sheet == "Sheet3"
    assert table.cell(1, "s1") == "F6"
    assert str(table.error(1, "s1", "too long.")) == "survey.xlsx › Sheet3!F6 (s1): too long."


def test_a_missing_optional_column_is_blank_and_not_present(book):
    table = read_table(book([row[:3] for row in polar_rows()]), POLAR)
    assert "theta" not in table.present
    assert np.isnan(table.numbers("theta")).all()


def test_a_missing_required_column_is_named_with_the_headings_that_are_there(book):
    path = book([("id", "s1", "theta"), ("P1", 1, 2)])
    with pytest.raises(InputError, match=r'row 1 has no column s2; .*"theta" \(C1\).*--columns'):
        read_table(path, POLAR)


def test_a_table_is_found_by_its_name_before_anything_else(book):
    from openpyxl.worksheet.table import Table as ExcelTable

    def add(workbook):
        workbook.worksheets[1].add_table(ExcelTable(displayName="tblPoints", ref="A1:D3"))

    other = [("id", "s1", "s2", "theta", "use"), ("wrong", 1, 2, 3, 1)]
    path = book(other, polar_rows(), edit=add)
    check_samples(read_table(path, POLAR, name="Points"))
    assert read_table(path, POLAR).texts("id") == ["wrong"]


def test_rows_typed_below_a_named_table_are_used_with_a_remark(book):
    from openpyxl.worksheet.table import Table as ExcelTable

    def add(workbook):
        workbook.worksheets[0].add_table(ExcelTable(displayName="tblPoints", ref="A1:D2"))

    table = read_table(book(polar_rows(), edit=add), POLAR, name="Points")
    check_samples(table)
    assert "1 rows directly below the table" in table.remarks[0]


def test_rows_parted_from_a_named_table_by_a_blank_one_are_not_left_out_in_silence(book):
    from openpyxl.worksheet.table import Table as ExcelTable

    def add(workbook):
        sheet = workbook.worksheets[0]
        last = sheet.max_row
        sheet.add_table(ExcelTable(displayName="tblPoints", ref=f"A1:D{last}"))
        for column, value in enumerate(("P99", 1.5, 2.5, 3.5), start=1):
            sheet.cell(last + 3, column).value = value
        sheet.cell(last + 5, 1).value = "measured by 2 people"

    table = read_table(book(polar_rows(), edit=add), POLAR, name="Points")
    check_samples(table)
    row = max(table.rows) + 3
    assert any(f"from row {row} on, that are NOT used" in text for text in table.remarks)


def test_a_sheet_that_is_not_there_is_named_with_those_that_are(book):
    with pytest.raises(InputError, match='no sheet "Punti"; it has "Sheet1"'):
        read_table(book(polar_rows()), POLAR, sheet="Punti")


def test_merged_two_row_headings_name_photo_and_coordinate(book):
    columns = (Column("id", kind="text"), *map(Column, ("x1", "y1", "x2", "y2")))
    rows = [("id", "Photo 1", None, "Photo 2", None), (None, "x [mm]", "y [mm]", "x", "y")]
    rows += [("P1", 1, 2, 3, 4)]

    def merge(workbook):
        for area in ("A1:A2", "B1:C1", "D1:E1"):
            workbook.worksheets[0].merge_cells(area)

    table = read_table(book(rows, edit=merge), columns)
    assert [table.numbers(k).tolist() for k in ("x1", "y1", "x2", "y2")] == [[1], [2], [3], [4]]
    assert table.units == {"x1": "mm", "y1": "mm"}
    assert table.texts("id") == ["P1"]


def test_a_key_row_wins_over_the_row_of_labels_above_it(book):
    rows = [("Punto", "s1 [mm]", "s2 [mm]"), ("id", "s1", "s2"), ("P1", 1, 2)]
    assert read_table(book(rows), POLAR).texts("id") == ["P1"]


def test_blocks_with_repeated_headings_and_gaps_are_one_table(book):
    heading = ("id", "s1", "s2")
    rows = [heading, ("P1", 1, 2), (), heading, ("P2", 3, 4), (), ("P3", 5, 6)]
    rows += [(), ("measured by Rossi",), ("on a rainy day",)]
    table = read_table(book(rows), POLAR)
    assert table.texts("id") == ["P1", "P2", "P3"]
    assert table.remarks == [
        "Left out as notes, since they stand apart and lack numbers: row 9, 10."
    ]


def test_prepared_rows_that_hold_only_a_flag_are_no_data(book):
    rows = [("id", "s1", "s2", "use"), ("P1", 1, 2, "yes"), (None, None, None, 1)]
    table = read_table(book(rows), POLAR)
    assert table.texts("id") == ["P1"]
    assert table.numbers("use").tolist() == [1.0]


def test_repeated_names_and_points_are_found(book):
    table = read_table(book([("id", "s1", "s2"), ("P1", 1, 2), ("P1", 3, 4)]), POLAR)
    assert [str(error) for error in table.repeated("id")] == [
        'survey.xlsx › Sheet1!A3 (id): "P1" stands in A2 already; give each point its own name.'
    ]


def test_more_rows_than_the_limit_lead_to_csv(book):
    rows = [("id", "s1", "s2"), *((f"P{i}", 1, 2) for i in range(6))]
    with pytest.raises(InputError, match=r"more than 5 rows. Save the sheet as .csv"):
        read_table(book(rows), POLAR, max_rows=5)


def test_the_same_heading_twice_needs_a_letter(book):
    path = book([("id", "s1", "s2", "s1"), ("P1", 1, 2, 3)])
    with pytest.raises(InputError, match=r'"s1" stands in B1 and D1.*--columns "s1=B"'):
        read_table(path, POLAR)
    assert read_table(path, POLAR, column_map={"s1": "D"}).numbers("s1").tolist() == [3.0]


def test_a_first_point_measured_in_one_photo_only_is_kept_where_there_are_no_headings(book):
    columns = (Column("id", kind="text"), *map(Column, ("x1", "y1", "x2", "y2")))
    path = book([("P1", 1, 2, None, None), ("P2", 1, 2, 3, 4)])
    table = read_table(path, columns, column_map=parse_column_map("id,x1,y1,x2,y2"))
    assert table.texts("id") == ["P1", "P2"]
    assert np.isnan(table.numbers("x2")[0])


def test_a_column_map_names_headings_or_letters():
    assert parse_column_map("s1=my column, S2=C", ("s1", "s2")) == {"s1": "my column", "s2": "C"}
    with pytest.raises(InputError, match='no column "s3"; known are s1, s2'):
        parse_column_map("s3=A", ("s1", "s2"))
    with pytest.raises(InputError, match="named twice"):
        parse_column_map("s1=A,s1=B")


def test_named_values_are_found_by_name_and_by_label(book):
    from openpyxl.workbook.defined_name import DefinedName

    def name(workbook):
        workbook.defined_names["c_1"] = DefinedName("c_1", attr_text="Sheet1!$D$2")

    rows = [("name", "description", "unit", "value"), ("long lens", None, "mm", 35)]
    rows += [("d_2", "distance 2 of the near camera", "m", "9,5"), ("input unit", "", "", "px")]
    names = (
        Column("c_1"),
        Column("d_2"),
        Column("unit", ("input unit",), kind="text"),
        Column("pitch"),
    )
    values = read_named_values(book(rows, edit=name), names)
    assert (values.number("c_1"), values.number("d_2"), values.text("unit")) == (35.0, 9.5, "px")
    assert not values.has("pitch")
    assert str(values.error("d_2", "too near.")) == "survey.xlsx › Sheet1!D3 (d_2): too near."


def test_what_stands_before_a_label_is_not_its_value(book):
    wanted = [Column("project", kind="text"), Column("d_2")]
    values = read_named_values(book([("north wall", "project"), ("d_2", 9.5)]), wanted)
    assert values.text("project") == ""


def test_a_missing_required_value_is_named(book):
    with pytest.raises(InputError, match=r"survey.xlsx › Setup: no value for c_1"):
        read_named_values(book([("x", 1)]), [Column("c_1", required=True)], sheet="Setup")


class TestSampleWorkbooks:
    """The workbooks of the data folder, each with a trap of its own."""

    XY = (
        Column("id", ("ID", "Point"), kind="text"),
        Column("x1", ("x",)),
        Column("y1", ("y",)),
        Column("x2", ("x",)),
        Column("y2", ("y",)),
    )

    def test_every_cell_is_what_another_reader_finds(self, data_dir):
        for path in sorted((data_dir / "spreadsheets").glob("*.xlsx")):
            opened = open_tables(path)
            book = openpyxl.load_workbook(path, data_only=True)
            assert opened.titles == book.sheetnames
            for sheet in book:
                expected = {
                    (c.row, c.column): c.value for row in sheet for c in row if c.value is not None
                }
                rows = opened.grid(sheet.title).rows
                found = {(r, c): value for r, cells in rows.items() for c, value in cells.items()}
                assert found == expected

    def test_without_headings_the_columns_are_given_by_order(self, data_dir):
        columns = (Column("id", kind="text"), Column("X"), Column("Y"))
        path = data_dir / "spreadsheets/no_header_xy.xlsx"
        with pytest.raises(InputError, match=r"no table with the headings id, X, Y.*--columns"):
            read_table(path, columns)
        table = read_table(path, columns, column_map=parse_column_map("id,X,Y"))
        assert len(table) == 28
        assert table.texts("id")[0] == "1"
        assert table.numbers("Y")[0] == -283760.6273

    def test_repeated_names_go_to_photo_1_and_2_and_a_nameless_first_column_names_points(
        self, data_dir
    ):
        table = read_table(data_dir / "spreadsheets/repeated_column_names.xlsx", self.XY)
        assert len(table) == 22
        assert table.texts("id")[16] == "T1"
        assert [table.numbers(k)[16] for k in ("x1", "y1", "x2", "y2")] == [
            -10.105,
            15.011,
            -103.829,
            16.042,
        ]

    def test_rows_that_hold_only_a_photo_number_label_blocks(self, data_dir):
        path = data_dir / "spreadsheets/photo_number_rows.xlsx"
        with pytest.raises(InputError, match="stands in A2 and E2 and G2"):
            read_table(path, self.XY)
        table = read_table(path, self.XY, column_map=parse_column_map("x1,y1,x2,y2"))
        assert table.blocks == ["27"] * 4 + ["28"] * 4
        assert table.numbers("x1").tolist()[3:5] == [15338.0, 7365.0]
        assert table.cell(4, "x1") == "A8"

    @pytest.mark.parametrize("ending", [".xlsx", ".csv"])
    def test_the_nearest_label_above_data_without_headings_names_the_block(
        self, book, tmp_path, ending
    ):
        rows = [[26], [27], [9, 8], [1, 2, 3, 4], [5, 6, 7, 8]]
        if ending == ".xlsx":
            path = book(rows)
        else:
            path = tmp_path / "t.csv"
            padded = [row if len(row) == 1 else [*row, "", ""][:4] for row in rows]
            path.write_text("".join(",".join(map(str, row)) + "\n" for row in padded))
        table = read_table(path, self.XY, column_map=parse_column_map("x1=A,y1=B,x2=C,y2=D"))
        assert table.blocks == ["27"] * 3
        assert table.numbers("x1").tolist() == [9.0, 1.0, 5.0]

    def test_as_many_labels_as_records_do_not_hide_the_separator(self, tmp_path):
        path = tmp_path / "t.csv"
        path.write_text("26\n1,2,3,4\n27\n5,6,7,8\n")
        table = read_table(path, self.XY, column_map=parse_column_map("x1=A,y1=B,x2=C,y2=D"))
        assert table.numbers("y2").tolist() == [4.0, 8.0]

    def test_headings_above_columns_given_by_letter_are_passed_over(self, data_dir):
        path = data_dir / "spreadsheets/two_row_header_empty_sheets.xlsx"
        table = read_table(path, self.XY, column_map=parse_column_map("id,x1,y1,x2,y2"))
        assert len(table) == 230
        assert table.cell(0, "x1") == "B3"

    def test_headings_in_two_rows_are_read_together(self, data_dir):
        columns = (Column("id", kind="text"), Column("row1"), Column("col2"), Column("X"))
        table = read_table(
            data_dir / "spreadsheets/two_row_header_empty_sheets.xlsx",
            columns,
            column_map={"row1": "588 i", "col2": "589 j"},
        )
        assert len(table) == 230
        assert table.texts("id")[0] == "1"
        assert (table.numbers("row1")[0], table.numbers("col2")[0]) == (2026.0, 17744.0)
