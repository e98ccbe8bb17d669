"""Tables of live columns read from a data file: one row a column, or many; parts of formulas."""

from __future__ import annotations

import pytest

from photocore.workbook.making.live_columns import FormulaBook

FILE = """
[parts]
blank = 'IF([@r]="","",{1})'
far = {media = "reach_{1}", "" = "d_{1}"}

[rows]
ends = [{key = "end_{1}", formula = "{2}"}]

[table]
columns = [
  {key = "id", width = 12},
  {when = "xy !polar", each = "x1 y1", places = 4, limits = [0, 9]},
  {each = "1:+ 2:-", key = "e{1}", label = {media="m"}, formula = "{blank [@s]{2}{far {1}}{end}}"},
  {each = "{words}", rows = "ends"},
]
more = [{key = "one", form = "0", formula = "{far 1}"}]

[table.parts]
end = "*{last}"
"""


@pytest.fixture
def book(tmp_path, monkeypatch):
    package = tmp_path / "formulas_of_a_test"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "formulas.toml").write_text(FILE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    return FormulaBook(package.name)


def test_a_row_is_one_column_or_one_a_word_where_its_facts_hold(book):
    parts = {"last": "7", "words": "a:A"}
    plain = book.columns("table", {"xy"}, parts)
    assert [column.key for column in plain] == ["id", "x1", "y1", "e1", "e2", "end_a"]
    assert (plain[0].kind, plain[0].width, plain[1].limits) == ("input", 12, (0, 9))
    both = book.columns("table", {"xy", "polar"}, parts)
    assert [column.key for column in both] == ["id", "e1", "e2", "end_a"]


def test_parts_stand_in_formulas_with_what_they_are_given_and_by_facts(book):
    parts = {"last": "7", "words": "a:A b:B"}
    air, water = (book.columns("table", facts, parts) for facts in ((), ("media",)))
    assert air[1].formula == 'IF([@r]="","",[@s]+d_1*7)'
    assert water[2].formula == 'IF([@r]="","",[@s]-reach_2*7)'
    assert (air[1].label, water[1].label, air[1].kind) == ("", "m", "formula")
    assert [column.formula for column in air[3:]] == ["A", "B"]


def test_single_formulas_are_another_list_of_a_section(book):
    (one,) = book.columns("table", rows="more")
    assert (one.key, one.formula, one.number_format) == ("one", "d_1", "0")
