"""Finding columns by their headings, in whatever row, order, case and language."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from photocore.remarks import remark
from photocore.tables.heading_words import (
    bare,
    forms_of,
    numbered,
    parts_of,
    unit_of,
    unknown_unit,
)
from photocore.tables.model import Column
from photocore.workbook import CellGrid, Value, column_letters, column_number

_PHOTO = re.compile(
    r"\b(?:image|photo|picture|foto|bild|immagine|aufnahme|camera|kamera|fotocamera)\s*([12])\b"
)
#: Words above the columns of the photo with the long lens, and of the other one.
_FAR_WORDS = re.compile(r"\b(a|far(ther)?|distant|lontan[aoe]|fern\w*|long|tele\w*|lunga)\b")
_NEAR_WORDS = re.compile(r"\b(b|near(er)?|close|vicin[aoe]|nah\w*|short|wide|corta|weitwinkel)\b")
_FOCAL = re.compile(r"(\d+(?:[.,]\d+)?)\s*mm\b")
#: Headings of point names that are believed where each name stands once.
_OF_POINTS = re.compile(
    "(id|n|nr|no|n°|num|numero|nome|codice)?"
    "(punt[oi]|point|punkt|pto|pkt|vertice|vertex|target|label|bezeichnung|etichetta|sigla|ziel)"
)
_NUMBER = re.compile(r"[+-]?[\d.,]+")
#: A name: a whole number, or neither number (with or without unit), time nor date.
_NAME = re.compile(r"\d{1,9}|(?![+-]?[\d.,]+\s*(?:mm|cm|m|px|°)?\Z|\d+(?::|([-./])\d+\1)\d).{1,24}")
#: What rows are called that hold no point.
_SUMMARIES = re.compile(
    "mean|average|avg|sum|total|min|max|std(ev|dev)?|rmse?|media|somma|totale|devst|scarto|summe|gesamt"
    "|mittel(wert)?|durchschnitt|stabw|standardabweichung|(min|max)imum"
)
#: Rows of a sheet that are searched for headings.
_SEARCHED = 400


@dataclass(slots=True)
class Match:
    """Where a table's columns lie in a grid.

    Parameters
    ----------
    columns : dict
        Key to column number.
    first, last : int
        First and last row that may hold data.
    header : int
        Row of the (lower) headings; 0 where the table has none.
    headings, units : dict
        Key to heading as written, and to the unit it says.
    doubles : dict
        Key to the columns that all carry its heading.
    score : tuple of int
        How many columns matched, how many by their own key, and 1 for a single heading row.
    remarks : list of str
        Choices made that the user should know.
    guessed : str
        That of them which says which column was taken for the names by what it holds.
    """

    columns: dict[str, int]
    first: int
    last: int = 10**9
    header: int = 0
    headings: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    doubles: dict[str, list[int]] = field(default_factory=dict)
    score: tuple[int, int, int] = (0, 0, 0)
    remarks: list[str] = field(default_factory=list)
    guessed: str = ""

    def missing(self, columns: Sequence[Column]) -> list[str]:
        """Return the keys of required columns that were not found."""
        return [c.key for c in columns if c.required and c.key not in self.columns]


def find_columns(
    grid: CellGrid,
    columns: Sequence[Column],
    *,
    column_map: Mapping[str, str] | None = None,
    rows: tuple[int, int] | None = None,
    span: tuple[int, int] | None = None,
) -> Match | None:
    """Return the best place of a table in a grid, None where no heading fits at all.

    Parameters
    ----------
    grid : CellGrid
        The sheet.
    columns : sequence of Column
        What is looked for.
    column_map : mapping, optional
        Key to heading or column letter, as the user says.
    rows : (first, last), optional
        The only rows where the heading may be.
    span : (left, right), optional
        The only columns that count (those of a named table).
    """
    candidates = sorted(grid.rows)[:_SEARCHED]
    fixed, mapped = _apply_map(grid, columns, column_map, candidates)
    if fixed and len(fixed) == len(mapped):
        return _without_heading(grid, columns, fixed, candidates)
    if rows:
        candidates = [row for row in candidates if rows[0] <= row <= rows[1]]
    best: Match | None = None
    words = {word for c in mapped for word in (c.key, bare(c.key), *map(bare, c.aliases))}
    for row in candidates:
        for texts, header in _heading_texts(grid, row, span):
            if words.isdisjoint(_words_of(texts)):
                continue  # most rows: they hold values
            match = _assign(mapped, texts, fixed, header, column_map or {})
            match.score = (*match.score[:2], int(header == row))
            if match.score[0] > len(fixed) and (best is None or match.score > best.score):
                best = match
    if best is not None and "id" not in (column_map or {}):
        _take_names(grid, best, mapped, span or (1, 10**6))
    if best is not None:
        best.remarks += _assumed_order(grid, best, span)
    return best


def _assumed_order(grid: CellGrid, match: Match, span: tuple[int, int] | None) -> list[str]:
    """Return what is said where headings above x, y alone tell photos apart, and no word which."""
    row = match.header - 1
    doubles = _heading_texts(grid, row, span) if row in grid.rows else []
    texts = next((texts for texts, header in doubles if header > row), {})
    for key in ("x", "col", "s"):
        places = [match.columns.get(f"{key}{k}", 0) for k in "12"]
        lower = [str(grid.rows[match.header].get(place, "")).strip() for place in places if texts]
        if len({bare(head) for head in lower}) != 1:
            continue  # these tell the photos apart themselves
        whole = [texts.get(place, [""])[0] for place in places]
        above = [
            f'"{text.removesuffix(head).strip()}"'
            for text, head in zip(whole, lower, strict=True)
            if text.endswith(f" {head}")
        ]
        if len(set(above)) == 2:
            return [remark("table.first_is_far", first=above[0], second=above[1])]
    return []


def _apply_map(
    grid: CellGrid,
    columns: Sequence[Column],
    column_map: Mapping[str, str] | None,
    candidates: Sequence[int],
) -> tuple[dict[str, int], list[Column]]:
    """Return columns fixed by letter, and the columns to look for with the headings to expect."""
    if not column_map:
        return {}, list(columns)
    texts = {
        value.strip()
        for row in candidates
        for value in grid.rows[row].values()
        if isinstance(value, str)
    }
    fixed: dict[str, int] = {}
    pairs = []
    for column in columns:
        place = column_map.get(column.key, "").strip()
        if not place:
            continue
        if place not in texts and re.fullmatch(r"[A-Za-z]{1,3}", place):
            fixed[column.key] = column_number(place)
        elif place not in texts and place.isdecimal():
            fixed[column.key] = int(place)
        pairs.append(Column(column.key, (place,), column.kind, column.required, column.unit))
    mapped = {column.key for column in pairs}
    complete = all(column.key in mapped for column in columns if column.required)
    if len(fixed) == len(pairs) and complete:
        return fixed, pairs
    # With headings to go by, columns that the map does not name are found as usual.
    return fixed, pairs + [column for column in columns if column.key not in mapped]


def _heading_texts(
    grid: CellGrid, row: int, span: tuple[int, int] | None
) -> list[tuple[dict[int, list[str]], int]]:
    """Return the headings that a row, alone or with the next, gives each column."""

    def inside(cells: Mapping[int, Value]) -> dict[int, str]:
        left, right = span or (1, 10**6)
        return {
            column: str(int(value)) if isinstance(value, float) and value % 1 == 0 else str(value)
            for column, value in cells.items()
            if left <= column <= right and isinstance(value, str | float)
        }

    upper = inside(grid.rows[row])
    single = {
        column: [upper[column]]
        for column, value in grid.rows[row].items()
        if isinstance(value, str) and value.strip() and column in upper
    }
    headings = [(single, row)] if single else []
    cells = grid.rows.get(row + 1, {})
    lower = {c: v for c, v in inside(cells).items() if isinstance(cells[c], str) and v.strip()}
    if lower and len(lower) >= 2:
        groups = _filled_right(grid, row, upper, lower)
        double: dict[int, list[str]] = {}
        digits = _photo_digits([groups.get(column, "") for column in sorted(lower)])
        for column in sorted(set(lower) | set(single)):
            group, text = groups.get(column, ""), lower.get(column, "")
            if text:
                titled = [numbered(text, digits[group])] if group in digits else []
                double[column] = [*titled, f"{group} {text}".strip(), text]
            else:
                double[column] = [upper[column]]
        headings.append((double, row + 1))
    return headings


def _words_of(texts: Mapping[int, list[str]]) -> set[str]:
    """Return all by which the headings of a row may be known."""
    forms = {form for variants in texts.values() for form in forms_of(variants)}
    parts = {part for variants in texts.values() for part in parts_of(variants[-1])}
    return forms | parts | {text.strip() for variants in texts.values() for text in variants}


def _photo_digits(groups: Sequence[str]) -> dict[str, str]:
    """Return which headings above others are of photo 1, the far one, and which of photo 2.

    They say so by a number, by a word for far or near, or by the focal lengths of both.
    """
    digits: dict[str, str] = {}
    focal: dict[str, float] = {}
    for group in dict.fromkeys(groups):
        text = group.strip().casefold()
        number, length = _PHOTO.search(text), _FOCAL.search(text)
        far, near = _FAR_WORDS.search(text), _NEAR_WORDS.search(text)
        if number or (far is None) != (near is None):
            digits[group] = number[1] if number else "1" if far else "2"
        elif length:
            focal[group] = float(length[1].replace(",", "."))
    if not digits and len(set(focal.values())) == len(focal) == 2:
        return {group: "12"[length == min(focal.values())] for group, length in focal.items()}
    return digits


def _filled_right(
    grid: CellGrid, row: int, upper: Mapping[int, str], lower: Mapping[int, str]
) -> dict[int, str]:
    """Return the upper headings, each reaching right over its merged or empty cells."""
    reach = {left: right for top, left, _, right in grid.merged if top == row}
    groups: dict[int, str] = {}
    for column in sorted(upper):
        right = reach.get(column, 0)
        following = next((c for c in sorted(upper) if c > column), max(lower) + 1)
        for target in range(column, (right or following - 1) + 1):
            if not right and target > column and target not in lower:
                break  # an empty column ends the group
            groups[target] = upper[column]
    return groups


def _assign(
    columns: Sequence[Column],
    texts: Mapping[int, list[str]],
    fixed: Mapping[str, int],
    header: int,
    mapped: Mapping[str, str],
) -> Match:
    """Give each column asked for a heading: as the user says, by key, then by alias in order."""
    match = Match(columns=dict(fixed), first=header + 1, header=header)
    key_of: dict[int, str] = {number: key for key, number in fixed.items()}
    forms = {number: forms_of(variants) for number, variants in texts.items()}
    # "X/Easting" is X as well as Easting, and "Höhe NHN" a height, where nothing else is.
    parts = {number: parts_of(variants[-1]) for number, variants in texts.items()}
    keys = {column.key: bare(column.key) for column in columns}
    aliases = {column.key: {bare(alias) for alias in column.aliases} for column in columns}

    def take(column: Column, number: int) -> None:
        match.columns[column.key], key_of[number] = number, column.key
        shown = texts[number][0].strip()
        match.headings[column.key] = shown
        unit = next((u for u in map(unit_of, texts[number]) if u), "")
        if unit:
            match.units[column.key] = unit

    def alike(key: str, number: int, rival: int) -> bool:
        """Whether a further heading says as much as that of a column."""
        is_whole = {keys[key], *aliases[key]} & {*forms[number]}
        shared = not is_whole and not parts[number].isdisjoint(parts[rival])
        return shared or forms[rival][0] == forms[number][0]

    mapped_columns = [
        column for column in columns if column.key in mapped and column.key not in fixed
    ]
    for column in mapped_columns:
        place = column.aliases[0]
        fitting = [n for n in sorted(texts) if n not in key_of and bare(place) in forms[n]]
        if fitting:
            take(column, min(fitting, key=lambda n: place not in map(str.strip, texts[n])))
    others = [column for column in columns if column not in mapped_columns]
    by_column = [(column, number) for column in others for number in sorted(texts)]
    by_number = [(column, number) for number in sorted(texts) for column in others]
    ways: tuple[tuple[list[tuple[Column, int]], Callable[[str, int], bool]], ...] = (
        (by_column, lambda key, number: key in map(str.strip, texts[number])),
        (by_column, lambda key, number: keys[key] in forms[number]),
        (by_number, lambda key, number: not aliases[key].isdisjoint(forms[number])),
        (
            by_number,
            lambda key, number: any(p == keys[key] or p in aliases[key] for p in parts[number]),
        ),
    )
    matched = [len(match.columns)]
    for pairs, fits in ways:
        for column, number in pairs:
            is_free = column.key not in match.columns and number not in key_of
            if is_free and fits(column.key, number):
                take(column, number)
        matched.append(len(match.columns))
    for column in columns:
        number = match.columns.get(column.key, 0)
        if number in texts and column.key not in fixed:
            same = [
                text
                for text in sorted(texts)
                if text == number or (text not in key_of and alike(column.key, number, text))
            ]
            if len(same) > 1:
                match.doubles[column.key] = same
    match.score = (len(match.columns), matched[1] - matched[0], 0)
    return match


def _take_names(
    grid: CellGrid, match: Match, columns: Sequence[Column], span: tuple[int, int]
) -> None:
    """Take for the point names what looks like them, where no heading says so.

    That is the column left of the others if only its heading is missing; else one of short texts or
    whole numbers, each once: one whose heading speaks of points, or the first of those that stand
    without a gap left of the measurements.
    """
    name = next((column for column in columns if column.kind == "text"), None)
    if name is None or name.key != "id" or name.key in match.columns or not match.columns:
        return
    used, heads = match.columns.values(), grid.rows.get(match.header, {})
    below = [row for row in sorted(grid.rows) if row >= match.first][:_SEARCHED]
    number = min(used) - 1
    filled = sum(number in grid.rows[row] for row in below if row <= match.header + 50)
    count = sum(row <= match.header + 50 for row in below)
    if number > 0 and filled > count / 2 and number not in heads:
        note = remark("table.unnamed_column", column=column_letters(number))
    else:
        kinds = {column.key: column.kind for column in columns}
        measured = [n for key, n in match.columns.items() if kinds[key] in ("number", "integer")]
        data = [grid.rows[row] for row in below if _is_measured(grid.rows[row], measured)]
        edge = first = min(measured, default=0)
        while any(edge - 1 in cells for cells in (heads, *data)):
            edge -= 1
        north = [n for n in heads if heads[n] == "N" and "E" in heads.values()]
        named = [n for n in sorted(heads) if _OF_POINTS.match(bare(str(heads[n])))]
        places = [n for n in (*named, *range(edge, first)) if span[0] <= n <= span[1]]
        free = (n for n in places if n not in (*used, *north))
        number = next((n for n in free if _are_names(heads.get(n, ""), n, data)), 0)
        about = {"heading": heads.get(number, ""), "column": column_letters(number)}
        note = match.guessed = remark("table.guessed_names", **about)
    if number:
        match.columns[name.key] = number
        match.headings[name.key] = str(heads.get(number, ""))
        match.remarks.append(note)
        # "N." of points beside "N" of the north.
        others = {
            key: [n for n in numbers if n != number] for key, numbers in match.doubles.items()
        }
        match.doubles = {key: numbers for key, numbers in others.items() if len(numbers) > 1}


def _is_measured(cells: Mapping[int, Value], measured: Sequence[int]) -> bool:
    """Whether a row holds a number in half of the columns, and is no mean or sum of others."""
    numbers = [n for n in measured if _NUMBER.match(str(cells.get(n, "")).strip())]
    return 2 * len(numbers) >= len(measured) > 0 and not is_summary(cells, min(measured))


def _are_names(heading: Value, number: int, rows: Sequence[Mapping[int, Value]]) -> bool:
    """Whether a column holds a short text or a whole number in each row, none of them twice."""
    text = str(heading)
    if unit_of(text) or unknown_unit(text) or re.fullmatch("[^np#]", bare(text)):
        return False
    values = (cells.get(number) for cells in rows)
    texts = [f"{v:.15g}" if isinstance(v, float) else v for v in values]
    plain = sum(isinstance(v, str) and _NAME.fullmatch(v.strip()) is not None for v in texts)
    return 0 < len(rows) == plain == len(set(texts))


def is_summary(cells: Mapping[int, Value], first: int, *, apart: bool = False) -> bool:
    """Whether a row says left of a column, or in it, that it is the mean, sum or like of others.

    Of a row that stands apart the first word says so: "mean of x1".
    """
    texts = (value for number, value in cells.items() if number <= first)
    starts = (
        text.split()[0] if apart else text
        for text in texts
        if str(text).strip() and isinstance(text, str)
    )
    return any(_SUMMARIES.fullmatch(bare(text)) for text in starts)


def _without_heading(
    grid: CellGrid, columns: Sequence[Column], fixed: dict[str, int], candidates: Sequence[int]
) -> Match:
    """Return where the data begin in a table whose columns are known by letter."""
    from photocore.tables.numbers import take_apart

    kinds = {column.key: column.kind for column in columns}
    numeric = [number for key, number in fixed.items() if kinds[key] in ("number", "integer")]
    match = Match(columns=fixed, first=candidates[0] if candidates else 1, score=(len(fixed), 0, 1))
    previous: Mapping[int, Value] = {}

    def count(row: int) -> int:
        """Return how many numbers a row holds; none where a text stands among them."""
        values = [grid.rows[row][number] for number in numeric if number in grid.rows[row]]
        numbers = [v for v in values if not isinstance(v, str) or take_apart(v) is not None]
        return len(numbers) if len(numbers) == len(values) else 0

    # Headings may hold numbers too (that of the photo above x and y), but fewer than data do.
    usual = max((count(row) for row in candidates[:50]), default=0)
    sparse = 0
    for row in candidates:
        cells = grid.rows[row]
        lonely = len(cells) == 1 and len(numeric) > 1
        if not numeric or (count(row) and 2 * count(row) > usual and not lonely):
            match.first = sparse or row
            match.header = row - 1 if previous and not sparse else 0
            break
        if count(row) and not lonely:
            # Without headings below it, this is a point that is measured in part only.
            sparse = sparse or row
        elif any(isinstance(cells.get(number), str) for number in numeric):
            sparse = 0
        previous = cells
    for key, number in fixed.items():
        above = grid.rows.get(match.first - 1, {}).get(number, "")
        heading = above if isinstance(above, str) else ""
        match.headings[key] = heading or f"column {column_letters(number)}"
        if unit_of(heading):
            match.units[key] = unit_of(heading)
    return match
