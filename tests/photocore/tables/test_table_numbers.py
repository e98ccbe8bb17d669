"""Numbers as people type them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from photocore.tables.numbers import converted, decimal_of, take_apart, unit_symbol


@pytest.mark.parametrize(
    ("text", "decimal", "value"),
    [
        ("12", "point", 12.0),
        ("12.5", "point", 12.5),
        ("12,5", "comma", 12.5),
        (".5", "point", 0.5),
        (",5", "comma", 0.5),
        ("5.", "point", 5.0),
        ("1,250", "comma", 1.25),
        ("1,250", "point", 1250.0),
        ("1.250", "comma", 1250.0),
        ("1.234.567", "comma", 1234567.0),
        ("1,234,567.5", "point", 1234567.5),
        ("1.234.567,5", "comma", 1234567.5),
        ("1'234.5", "point", 1234.5),
        ("1 234 567,25", "comma", 1234567.25),
        ("\u22121\u202f234,5", "comma", -1234.5),
        ("1.5e-3", "point", 1.5e-3),
        ("1,5E+3", "comma", 1500.0),
        ("12.5", "comma", None),
        ("12,5", "point", None),
        ("1,25,3", "point", None),
        ("1.5.2", "point", None),
    ],
)
def test_a_text_is_read_with_a_decimal_separator(text, decimal, value):
    part = take_apart(text)
    assert part is not None
    assert part.value(decimal) == value


@pytest.mark.parametrize(
    "text", ["", "abc", "1 2", "1'23", "12 34 567", "--1", "1-2", "+", ".", "e5", "1 234.5 6", "=1"]
)
def test_other_texts_are_no_numbers(text):
    part = take_apart(text)
    assert part is None or part.value("point") is None


@pytest.mark.parametrize(
    ("text", "evidence"),
    [
        ("12", "none"),
        ("12.5", "point"),
        ("12,5", "comma"),
        ("1,250", "grouped comma"),
        ("1.250", "grouped point"),
        ("0,250", "comma"),
        ("1234,567", "comma"),
        ("1,250,000", "point"),
        ("1.250,5", "comma"),
        ("1,250.5", "point"),
    ],
)
def test_a_text_proves_its_decimal_separator_or_not(text, evidence):
    assert take_apart(text).evidence == evidence


@pytest.mark.parametrize(
    ("text", "proven", "thousands", "elsewhere", "expected"),
    [
        ("1,250", set(), False, set(), None),
        ("1.250", set(), False, set(), "point"),
        ("1,250", {"comma"}, False, set(), "comma"),
        ("1,250", {"point"}, False, set(), None),
        ("1,250", {"point"}, True, set(), "point"),
        ("1.250", {"comma"}, True, set(), "comma"),
        ("1.250", {"comma"}, False, set(), None),
        ("1,250", set(), False, {"comma"}, "comma"),
        ("1.250", set(), False, {"comma"}, None),
        ("1,250", set(), False, {"point"}, None),
        ("1,250", set(), False, {"point", "comma"}, None),
        ("12,5", {"point"}, False, set(), "comma"),
    ],
)
def test_an_ambiguous_number_is_only_read_when_one_meaning_is_left(
    text, proven, thousands, elsewhere, expected
):
    part = take_apart(text)
    assert decimal_of(part, proven, thousands=thousands, elsewhere=elsewhere) == expected


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_reads_back_with_point_and_comma(value):
    assert take_apart(repr(value)).value("point") == value
    assert take_apart(repr(value).replace(".", ",")).value("comma") == value


@given(st.integers(-(10**9), 10**9), st.sampled_from(" '.\u00a0\u202f"))
def test_grouped_whole_numbers_read_back(value, separator):
    text = f"{value:,}".replace(",", separator)
    assert take_apart(text).value("comma") == value


@given(st.text(max_size=20))
def test_no_text_raises(text):
    part = take_apart(text)
    if part is not None:
        part.value("point")
        part.value("comma")


def test_units_are_known_by_their_spellings_and_convert():
    assert [unit_symbol(u) for u in ("mm", "[PX]", "pixel", "°", "gradi", "inch")] == [
        "mm",
        "px",
        "px",
        "deg",
        "deg",
        "",
    ]
    assert converted(1.24, "cm", "mm") == 12.4
    assert converted(1, "px", "mm") is None
