"""Rows taken apart whole, by their form, are read and changed as the XML parser does it."""

from __future__ import annotations

import math
import random

import pytest

from photocore.workbook.changing.cells import NewColumn, NewRows, result_texts, type_and_content
from photocore.workbook.changing.changes import SheetChanges
from photocore.workbook.changing.splice import splice_sheet
from photocore.workbook.reading.plainsheet import plain_rows, sheet_data
from photocore.workbook.reading.xlsx import open_xlsx
from tests.bare_workbook import write

ROWS = 120
STRINGS = ["id", "Wänd & <1>", ""]
#: Cells of a row; the first ones are by far the most frequent.
FORMS = {
    "A": [
        '<c r="A{r}" s="1" t="inlineStr"><is><t xml:space="preserve">P{r} &amp; Ö</t></is></c>',
        '<c r="A{r}" s="1" t="s"><v>1</v></c>',
        '<c r="A{r}" t="s"><v>2</v></c>',
    ],
    "B": ['<c r="B{r}" s="1"><v>{x}</v></c>', '<c r="B{r}" s="2"><v>43210.5</v></c>', ""],
    "C": ['<c r="C{r}"><v>0.50</v></c>', '<c r="C{r}"><v/></c>', '<c r="C{r}" s="1"/>'],
    "D": [
        '<c r="D{r}" s="1"><f>B{r}*2&lt;3</f><v>{x}</v></c>',
        '<c r="D{r}" s="1" t="e"><f>NA()</f><v>#N/A</v></c>',
        '<c r="D{r}" s="1"><f>B{r}</f></c>',
        '<c r="D{r}"><v>7</v></c>',
    ],
    "E": [
        '<c r="E{r}" t="str"><f>IF(A{r}="","","a")</f><v></v></c>',
        '<c r="E{r}" t="str"><f>IF(A{r}="","","a")</f><v>a &amp; b</v></c>',
        '<c r="E{r}" t="str"><f>IF(A{r}="","","a")</f><v/></c>',
    ],
    "F": [
        '<c r="F{r}"><f t="shared" si="0"/><v>1</v></c>',
        '\n <c r="F{r}" t="b"><f ca="1">TRUE()</f><v>1</v></c>',
    ],
}
ATTRIBUTES = ["", ' spans="1:6" ht="15" customHeight="1"', ' hidden="1"']


def sheet(seed, rate):
    """Return a sheet whose rows are of the frequent form but for a share of their cells."""
    rng = random.Random(seed)

    def pick(choices):
        return rng.choice(choices) if rng.random() < rate else choices[0]

    rows = []
    for r in range(2, ROWS + 2):
        x = repr(rng.uniform(-9, 9)) if rng.random() < 0.9 else "3"
        cells = "".join(pick(own).format(r=r, x=x) for own in FORMS.values())
        rows.append(f'<row r="{r}"{pick(ATTRIBUTES)}>{cells}</row>')
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    return (
        f'<worksheet xmlns="{main}"><dimension ref="A2:F{ROWS + 1}"/><sheetData>{"".join(rows)}'
        "</sheetData></worksheet>"
    )


def by_parser(text):
    """Return a sheet that holds the same and is left to the XML parser."""
    return text.replace("</sheetData>", "<!-- --></sheetData>")


def formed(text):
    """Return how many rows are taken apart by a form."""
    data = text.encode()
    return sum(row.form is not None for row in plain_rows(data, *sheet_data(data)))


@pytest.fixture(autouse=True)
def eager(monkeypatch):
    monkeypatch.setattr("photocore.workbook.reading.plainsheet._OFTEN", 3)


CASES = [(1, 0.0), (2, 0.02), (3, 0.1), (4, 0.3), (5, 0.05)]


def grid(path, text):
    write(path, text, strings=STRINGS)
    found = open_xlsx(path, max_rows=2**20).grid("S")
    return found.rows, found.hidden


@pytest.mark.parametrize(("seed", "rate"), CASES)
def test_rows_of_a_form_are_read_as_by_the_parser(seed, rate, tmp_path):
    text = sheet(seed, rate)
    rows, hidden = grid(tmp_path / "a.xlsx", text)
    assert (rows, hidden) == grid(tmp_path / "b.xlsx", by_parser(text))
    assert len(rows) == ROWS
    assert formed(text) > (20 if rate < 0.2 else -1)


@pytest.mark.parametrize("typed", [False, True])
@pytest.mark.parametrize(("seed", "rate"), CASES)
def test_rows_of_a_form_are_changed_as_by_the_parser(seed, rate, typed):
    text, rng = sheet(seed, rate), random.Random(seed)
    size = ROWS + 5
    numbers = [rng.uniform(-1, 1) if rng.random() > rate else math.nan for _ in range(size)]
    numbers[17] = None
    texts = [rng.choice(["", "a & b", "new"]) for _ in range(size)]
    whole = [rng.choice([1.0, 2.0]) if rng.random() > rate else True for _ in range(size)]
    columns = [
        NewColumn(4, numbers, "5", lambda row: f"B{row}*2"),
        NewColumn(5, texts, "6", lambda _: "E"),
        NewColumn(6, whole, "7", lambda _: "F"),
    ]
    inputs = {}
    if typed:
        inputs = {row: {2: float(row), 3: 0.5} for row in range(2, ROWS, 3)}
        inputs |= {50: {2: None}, 51: {1: "own"}, 52: {3: 4.0}, 53: {2: "text"}}

    def spliced(data):
        changes = SheetChanges(inputs=inputs, added=[NewRows(2, size, columns, "filled")])
        found = splice_sheet(None, "s", data.encode(), changes, lambda: STRINGS)
        said = found.inputs_changed, found.formula_lost
        return said, found.joined(strip=True).replace(b"<!-- -->", b"")

    said, data = spliced(text)
    assert (said, data) == spliced(by_parser(text))
    assert data != text.encode()


def test_a_row_that_holds_its_results_already_is_not_touched():
    text = sheet(1, 0.0)
    found = [part.split("<")[0] for part in text.split("&lt;3</f><v>")[1:]]
    columns = [
        NewColumn(4, [float(value) for value in found], "1", lambda row: f"B{row}*2&lt;3"),
        NewColumn(5, [""] * ROWS, "", lambda row: f'IF(A{row}="","","a")'),
        NewColumn(6, [1.0] * ROWS, "", lambda _: "F"),
    ]
    changes = SheetChanges(added=[NewRows(2, ROWS, columns, "filled")])
    result = splice_sheet(None, "s", text.encode(), changes)
    assert not result.edits
    assert not result.inputs_changed
    assert result.joined(strip=False) == text.encode()


def test_an_infinite_result_is_refused_only_where_it_would_be_stored():
    text = sheet(1, 0.0)
    values = [1.0] * 60 + [math.inf] + [1.0] * (ROWS - 61)
    columns = [NewColumn(column, values, "", lambda _: "F") for column in (4, 5, 6)]
    changes = SheetChanges(added=[NewRows(2, ROWS, columns, "filled")])
    with pytest.raises(ValueError, match="infinite"):
        splice_sheet(None, "s", text.encode(), changes)
    # A typed number stands in each of these cells: it stays.
    kept = text
    for letter in "DEF":
        start = kept.index(f'<c r="{letter}62"')
        kept = (
            f'{kept[:start]}<c r="{letter}62"><v>7</v></c>{kept[kept.index("</c>", start) + 4 :]}'
        )
    changed = splice_sheet(None, "s", kept.encode(), changes).joined(strip=False).decode()
    assert '<c r="D62"><v>7</v></c>' in changed


VALUES = [
    [1.0, -0.0, 0.1, 1e16, 1e22, 1e-7, 123456789.0, 10.0, 5e-324],
    [1.5, math.nan, 2.0],
    ["", "a", "a", "<&>", "_x000D_"],
    [1.0, "x", True, None, 3],
]


@pytest.mark.parametrize("values", VALUES)
def test_many_results_are_written_as_each_of_them(values):
    kinds, texts = result_texts(values)
    for value, kind, text in zip(values, kinds, texts, strict=True):
        content = "" if text is None else f"<v>{text.decode()}</v>"
        assert (kind, content) == type_and_content(value, "", formula=True)
