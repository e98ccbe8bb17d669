"""Text tables: encodings, delimiters, decimal separators, and what spreadsheets do to them."""

import re

import numpy as np
import pytest

from bifocal import InputError, WorkbookError
from photocore.tables import Column, read_named_values, read_table, write_csv

COLUMNS = (
    Column("id", ("Punto",), kind="text"),
    Column("s1", ("x",)),
    Column("s2", ("y",)),
    Column("use", kind="flag"),
    Column("n", kind="integer"),
)


@pytest.fixture
def file(tmp_path):
    """Return a function that writes a text file and returns its path."""

    def write(text, name="points.csv", encoding="utf-8"):
        path = tmp_path / name
        path.write_bytes(text.encode(encoding))
        return path

    return write


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_delimiter_and_line_ends_are_found_out(file, delimiter, end):
    text = end.join(["id,s1,s2", "P1,1.5,-2", "P2,,3e2", ""]).replace(",", delimiter)
    table = read_table(file(text), COLUMNS)
    assert table.texts("id") == ["P1", "P2"]
    np.testing.assert_array_equal(table.numbers("s1"), [1.5, np.nan])
    assert table.numbers("s2").tolist() == [-2.0, 300.0]


def test_the_unit_of_a_cell_is_not_that_of_a_hundred_thousand_bare_numbers(file):
    lines = ["id,s1", "P0,12.4 cm", *(f"P{i},{i}.5" for i in range(1, 100_000))]
    with pytest.raises(WorkbookError, match=r'\(s1\): found "12.4 cm", while other cells say no'):
        read_table(file("\n".join(lines)), COLUMNS[:2])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_letters_of_any_usual_encoding_are_read(file, encoding):
    table = read_table(file("Punto,s1\nà è,1\n", encoding=encoding), COLUMNS)
    assert table.texts("id") == ["à è"]
    assert bool(table.remarks) == (encoding == "cp1252")


def test_a_first_line_that_names_the_delimiter_is_obeyed_and_counted(file):
    table = read_table(file("sep=;\nid;s1\nP,1;2,5\n"), COLUMNS)
    assert table.texts("id") == ["P,1"]
    assert table.numbers("s1").tolist() == [2.5]
    assert table.cell(0, "s1") == "B3"


def test_titles_above_notes_below_blank_lines_and_quotes_are_no_obstacle(file):
    text = 'Survey of the church\n\n"id","s1 [mm]","note"\n"P 1","1.5","a ""b"", c"\n\nby Rossi\n'
    columns = (*COLUMNS[:2], Column("note", kind="text"))
    table = read_table(file(text), columns)
    assert (table.texts("id"), table.texts("note")) == (["P 1"], ['a "b", c'])
    assert table.units == {"s1": "mm"}
    assert "row 6" in table.remarks[0]


def test_decimal_commas_are_found_out_per_column(file):
    table = read_table(file("id;s1;s2\nP1;1,5;2.5\nP2;12,25;3.125\n"), COLUMNS)
    assert table.numbers("s1").tolist() == [1.5, 12.25]
    assert table.numbers("s2").tolist() == [2.5, 3.125]


def test_thousands_with_a_decimal_comma_are_read(file):
    table = read_table(file("id;s1\nP1;-1.234,5\nP2;1.250\nP3;7\n"), COLUMNS)
    assert table.numbers("s1").tolist() == [-1234.5, 1250.0, 7.0]


def test_an_ambiguous_number_is_refused_unless_the_user_decides(file):
    path = file("id;s1\nP1;1,250\nP2;2\n")
    with pytest.raises(WorkbookError, match=r"points.csv › B2 \(s1\): .*1.25 or 1250.*--decimal"):
        read_table(path, COLUMNS)
    assert read_table(path, COLUMNS, decimal="comma").numbers("s1").tolist() == [1.25, 2.0]
    assert read_table(path, COLUMNS, decimal="point").numbers("s1").tolist() == [1250.0, 2.0]


def test_another_column_settles_what_an_ambiguous_number_means(file):
    table = read_table(file("id;s1;s2\nP1;1,250;0,5\n"), COLUMNS)
    assert table.numbers("s1").tolist() == [1.25]


def test_a_column_of_grouped_points_beside_decimal_commas_is_refused(file):
    path = file("id;s1;s2\nP1;1.250;0,5\n")
    with pytest.raises(WorkbookError, match=r"B2 \(s1\): .*1.25 or 1250"):
        read_table(path, COLUMNS)
    assert read_table(path, COLUMNS, decimal="comma").numbers("s1").tolist() == [1250.0]


def test_point_and_comma_in_one_column_are_refused(file):
    with pytest.raises(WorkbookError, match=r"B4 \(s1\): found \"1.75\", while"):
        read_table(file("id;s1\nP1;1,25\nP2;1,5\nP3;1.75\n"), COLUMNS)


def test_a_given_decimal_point_refuses_commas(file):
    with pytest.raises(WorkbookError, match=r"B2 \(s1\): .*decimal point. Write 1.25"):
        read_table(file("id;s1\nP1;1,25\n"), COLUMNS, decimal="point")


def test_decimal_commas_in_a_file_separated_by_commas_are_noticed(file):
    with pytest.raises(WorkbookError, match=r"has 5 fields, the headings 3.*semicolons"):
        read_table(file("id,s1,s2\nP1,1,5,2,5\n"), COLUMNS)


@pytest.mark.parametrize(
    "text", ["nan", "inf", "-inf", "1e999", "1_000", "0x10", "12abc", "1 2", "--1"]
)
def test_what_python_takes_for_a_number_but_people_do_not_is_refused(file, text):
    with pytest.raises(WorkbookError, match=r"points.csv › B3 \(s1\): found"):
        read_table(file(f"id,s1\nP1,1\nP2,{text}\n"), COLUMNS)


@pytest.mark.parametrize("end", ["3", "x"])
def test_flags_and_whole_numbers_are_checked(file, end):
    table = read_table(file("id,use,n\nP1,yes,3\nP2,0,\nP3,ja,1e3\n"), COLUMNS)
    assert table.numbers("use").tolist() == [1.0, 0.0, 1.0]
    np.testing.assert_array_equal(table.numbers("n"), [3, np.nan, 1000])
    with pytest.raises(WorkbookError, match=r"expected 1 \(yes\) or 0"):
        read_table(file(f"id,use\nP1,{end}7\n"), COLUMNS)
    with pytest.raises(WorkbookError, match="expected a whole number"):
        read_table(file("id,n\nP1,1.5\n"), COLUMNS)


def test_columns_without_headings_are_given_by_letter(file):
    table = read_table(
        file("P1 ;1.5;2.5\nP2;3.5;4.5\n"), COLUMNS, column_map={"id": "A", "s1": "B", "s2": "C"}
    )
    assert table.texts("id") == ["P1", "P2"]
    assert table.numbers("s2").tolist() == [2.5, 4.5]


def test_columns_lined_up_with_blanks_are_read(file):
    table = read_table(
        file("  id    s1     s2\nP1   1.5   -2.25\nP10 12.5    3\n", "points.txt"), COLUMNS
    )
    assert table.texts("id") == ["P1", "P10"]
    assert table.numbers("s2").tolist() == [-2.25, 3.0]


def test_named_values_are_read_from_text_tables_too(file):
    values = read_named_values(file("d_1;17,5\nd_2;9,5\n"), [Column("d_1"), Column("d_2")])
    assert (values.number("d_1"), values.number("d_2")) == (17.5, 9.5)


TEXTS = [
    "001",
    "=1+1",
    '=HYPERLINK("x")',
    "+a",
    "-a",
    "@SUM",
    "'=x",
    "''@x",
    "'plain",
    "-5",
    'è, é; "q"',
]


@pytest.mark.parametrize("flavour", ["plain", "excel-it", "excel-de"])
def test_what_is_written_reads_back_to_the_last_bit(tmp_path, flavour):
    numbers = np.array([0.1, 1 / 3, -1e-300, 5.0, np.nan, 123456.789, 1e22, 0.0, -0.0, 2.5, 1.25])
    path = tmp_path / "out.csv"
    write_csv(path, {"id": TEXTS, "s1": numbers, "n": np.arange(11)}, flavour=flavour)
    table = read_table(path, COLUMNS)
    assert table.texts("id") == TEXTS
    np.testing.assert_array_equal(table.numbers("s1"), numbers)
    assert table.numbers("n").tolist() == list(range(11))


@pytest.mark.parametrize("flavour", ["plain", "excel-it"])
def test_no_text_is_left_that_a_spreadsheet_would_run(tmp_path, flavour):
    path = tmp_path / "out.csv"
    write_csv(path, {"=evil": TEXTS}, flavour=flavour)
    raw = path.read_text(encoding="utf-8-sig").splitlines()
    assert not [line for line in raw if line.strip('"')[:1] in ("=", "+", "@")]
    assert [line for line in raw if line.startswith("-")] == ["-5"]


def test_what_excel_in_italy_splits_is_no_formula_either(tmp_path):
    """Excel splits at semicolons there; quotes count only where a field begins with them."""
    texts = ["P1;=1+1", "P2;-5;'@SUM(A1);+1", "a;b", "c\r\n=1;\t=2", "';=", "-5", "d;-5"]
    path = tmp_path / "out.csv"
    write_csv(path, {"note": ["x"] * len(texts), "id": texts, "s1": np.zeros(len(texts))})
    fields = re.split(r"[;\r\n]", path.read_bytes().decode())
    assert not [field for field in fields if field.strip('"').startswith(tuple("=+-@\t"))]
    assert "x,a" in [field.replace('"', "") for field in fields]
    assert read_table(path, COLUMNS).texts("id") == texts


def test_flavours_are_what_excel_expects(tmp_path):
    for flavour, expected in (
        ("plain", b"id,X\nP1,1.5\nP2,\n"),
        ("excel-it", b"\xef\xbb\xbfid;X\r\nP1;1,5\r\nP2;\r\n"),
    ):
        path = tmp_path / f"{flavour}.csv"
        write_csv(path, {"id": ["P1", "P2"], "X": np.array([1.5, np.nan])}, flavour=flavour)
        assert path.read_bytes() == expected


def test_formats_round_numbers_and_mixed_columns_are_written(tmp_path):
    path = tmp_path / "out.csv"
    write_csv(path, {"X": np.array([1.23456, 2.0]), "note": [1.5, None]}, formats={"X": ".3f"})
    assert path.read_text() == "X,note\n1.235,1.5\n2.000,\n"


def test_an_existing_file_unknown_flavours_and_uneven_columns_are_refused(tmp_path):
    path = tmp_path / "out.csv"
    write_csv(path, {"X": np.zeros(1)})
    with pytest.raises(InputError, match="--overwrite"):
        write_csv(path, {"X": np.zeros(1)})
    with pytest.raises(InputError, match='"excel-fr" is not known; choose plain'):
        write_csv(path, {"X": np.zeros(1)}, flavour="excel-fr", overwrite=True)
    with pytest.raises(InputError, match="different lengths"):
        write_csv(path, {"X": np.zeros(1), "Y": np.zeros(2)}, overwrite=True)


@pytest.mark.acceptance
def test_large_tables_with_blanks_and_one_odd_field_keep_every_number(tmp_path):
    random = np.random.default_rng(5)
    count = 120_000
    s1, s2 = random.normal(size=(2, count)) * 100
    s2[70_000] = np.nan
    path = tmp_path / "big.csv"
    write_csv(path, {"id": [str(i) for i in range(count)], "s1": s1, "s2": s2}, flavour="excel-de")
    text = path.read_text(encoding="utf-8-sig").splitlines()
    name, _, rest = text[90_001].split(";")
    text[90_001] = f"{name};1.234,5;{rest}"
    path.write_text("\n".join(text))
    table = read_table(path, COLUMNS)
    s1[90_000] = 1234.5
    np.testing.assert_array_equal(table.numbers("s1"), s1)
    np.testing.assert_array_equal(table.numbers("s2"), s2)


def test_a_bad_field_far_down_a_large_table_is_named(tmp_path):
    path = tmp_path / "big.csv"
    lines = ["id,s1", *(f"{i},{i}.5" for i in range(60_000)), "last,x"]
    path.write_text("\n".join(lines))
    with pytest.raises(WorkbookError, match=r"big.csv › B60002 \(s1\): found \"x\""):
        read_table(path, COLUMNS)


@pytest.mark.parametrize("columns", [{"s1": "nope"}, {"id": "A", "s1": "nope"}])
def test_a_heading_the_user_names_must_exist(file, columns):
    with pytest.raises(
        InputError, match=r'names "nope" for s1, but there is no such heading; .*"s1"'
    ):
        read_table(file("id;s1;s2\nP1;1.5;2.5\n"), COLUMNS, column_map=columns)


def test_what_the_user_says_of_columns_goes_before_their_own_headings(file):
    table = read_table(file("id;s1;s2\nP1;1.5;2.5\n"), COLUMNS, column_map={"s1": "s2", "s2": "s1"})
    assert (table.numbers("s1").item(), table.numbers("s2").item()) == (2.5, 1.5)
