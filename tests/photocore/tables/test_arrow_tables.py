"""Large text tables are read by Arrow: whatever stands in them, the result is that without it."""

import random

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from bifocal import PhotogrammetryError
from photocore.tables import Column, csvread, read_table, write_csv

pytest.importorskip("pyarrow")
COLUMNS = [Column("id", kind="text"), Column("x"), Column("n", kind="integer"), Column("y")]
HEADINGS = ("id", "x", "n", "y")

plain = st.floats(allow_nan=False, allow_infinity=False).map(repr)
three_decimals = st.integers(-999_999, 999_999).map(lambda n: f"{n / 1000:.3f}")
odd_numbers = st.sampled_from(
    ["", " ", " 1.5", "2.5\t", "+3", ".5", "5.", "-0", "1e5", "1e-400", "1e400", "nan", "inf",
     "-inf", "1_000", "1 250", "1,250", "1.250", "1.250.000", "12,5", "3 mm", "\u0663", "0x10",
     "1e", "-", "n/a", "0.1000000000000000055511151231257827", "\u22125", "null", "NaN", "true"]
)  # fmt: skip
words = st.text(
    st.sampled_from(list("aP1 '-#\u00e9\ufeff\u2028\u0085\x0b\x0c\x1c\\=")), max_size=6
) | st.sampled_from(["P1", "'=1", "27", "# note", "id", "\u00a0", "null", "NULL", "", '"a"', '"'])


@st.composite
def files(draw: st.DrawFn) -> bytes:
    """Return a text table, mostly clean, with a few odd fields and lines."""
    delimiter = draw(st.sampled_from([",", ";", "\t", "|"]))
    numbers = draw(st.sampled_from([plain, three_decimals, plain | three_decimals]))
    comma = delimiter != "," and draw(st.booleans())
    lines = [list(HEADINGS)]
    for number in range(draw(st.integers(1, 12))):
        x, y = draw(numbers), draw(numbers)
        row = [f"P{number}", x, str(number), y]
        lines.append([text.replace(".", ",") for text in row] if comma else row)
    for _ in range(draw(st.integers(0, 2))):
        row = draw(st.sampled_from(lines[1:]))
        column = draw(st.integers(0, 3))
        row[column] = draw(odd_numbers if column else words)
    texts = [delimiter.join(line) for line in lines]
    if draw(st.integers(0, 4)) == 0:
        extra = draw(st.sampled_from(["", "# a comment", "27", "id;x;n;y", "P1", "a;b;c;d;e;f"]))
        texts.insert(draw(st.integers(0, len(texts))), extra)
    newline = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    return (newline.join(texts) + draw(st.sampled_from(["", newline, 2 * newline]))).encode()


def outcome(path, decimal):
    """Return all that reading a file leads to, numbers as bits."""
    try:
        table = read_table(path, COLUMNS, decimal=decimal)
    except PhotogrammetryError as error:
        return type(error), str(error)
    values = {
        key: value if isinstance(value, list) else np.asarray(value).view(np.uint64).tolist()
        for key, value in table.values.items()
    }
    return values, table.rows, table.blocks, table.units, table.remarks, table.typed_units


@given(
    content=files(),
    decimal=st.sampled_from([None, None, "point", "comma"]),
    block=st.sampled_from([64, 2**22]),
)
@example(content=b"id,x,n,y\n\xef\xbb\xbfP1,1.5,1,2.5\n", decimal=None, block=64)
@example(content=b"id;x;n;y\nP1;1,250;1;2,5\nP2;;;\n", decimal=None, block=64)
@settings(
    max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_arrow_reads_what_the_tolerant_reader_reads(
    tmp_path, monkeypatch, content, decimal, block
) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(content)
    monkeypatch.setattr(csvread, "_LARGE", 10**9)
    expected = outcome(path, decimal)
    monkeypatch.setattr(csvread, "_LARGE", -1)
    monkeypatch.setattr(csvread, "_ARROW_BLOCK", block)
    assert outcome(path, decimal) == expected


def large_file(path, flavour="plain"):
    """Write a clean table of more characters than the limit; return its columns."""
    draw = random.Random(3)
    columns = {"id": [f"P{i}" for i in range(50_000)], "n": [*map(float, range(50_000))]}
    columns |= {key: [draw.uniform(-100, 100) for _ in columns["id"]] for key in "xy"}
    write_csv(path, columns, flavour=flavour)
    assert path.stat().st_size > 1.1 * csvread._LARGE
    return columns


@pytest.mark.acceptance
@pytest.mark.parametrize("flavour", ["plain", "excel-it"])
def test_a_large_clean_table_goes_through_arrow_to_the_last_bit(
    tmp_path, monkeypatch, flavour
) -> None:
    columns = large_file(tmp_path / "large.csv", flavour)
    batches = []
    read = csvread._arrow_chunks
    monkeypatch.setattr(
        csvread, "_arrow_chunks", lambda *given: (batches.append(b) or b for b in read(*given))
    )
    table = read_table(tmp_path / "large.csv", COLUMNS)
    assert batches
    assert None not in batches
    assert table.texts("id") == columns["id"]
    for key in "xny":
        assert table.numbers(key).tolist() == columns[key]


def test_without_arrow_a_large_table_is_read_all_the_same(tmp_path, monkeypatch) -> None:
    columns = large_file(tmp_path / "large.csv")
    monkeypatch.setattr(csvread, "find_spec", lambda _: None)
    table = read_table(tmp_path / "large.csv", COLUMNS)
    assert table.texts("id") == columns["id"]
    assert table.numbers("x").tolist() == columns["x"]


@pytest.mark.acceptance
def test_a_bad_cell_of_a_large_table_is_named(tmp_path) -> None:
    large_file(tmp_path / "large.csv")
    content = (tmp_path / "large.csv").read_bytes()
    newline = b"\r\n" if b"\r\n" in content else b"\n"
    lines = content.split(newline)
    lines[20_000] = b"P19999,19999,12abc,3.5"
    (tmp_path / "large.csv").write_bytes(newline.join(lines))
    with pytest.raises(PhotogrammetryError, match=r'C20001 \(x\): found "12 abc"'):
        read_table(tmp_path / "large.csv", COLUMNS)
