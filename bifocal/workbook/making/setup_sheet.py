"""The sheet `Setup` of a new survey workbook: one named cell per value, and what is missing."""

from __future__ import annotations

from collections.abc import Mapping

from openpyxl.styles import Alignment

from bifocal.workbook.content import SurveyContent, setup_cells
from bifocal.workbook.formulas.columns import adjustment_names, pair_letter
from bifocal.workbook.formulas.setup_cells import (
    INDEX_LIMITS,
    STATES,
    beside,
    formulas,
    groups,
    is_above_zero,
    is_text,
    may_be_zero,
    number_format,
    sensible_limits,
    state_formula,
)
from bifocal.workbook.words import term, word
from photocore.workbook import (
    GOOD,
    HEAD_FILL,
    HEAD_FONT,
    WRONG,
    BookBuilder,
    CellValue,
    SheetBuilder,
    colour_words,
)

#: What a typed number of the set-up may be, where it need not be above zero.
_NUMBERS = (-1e7, 1e7)
#: More rows would be too small to read on one page.
_ROWS_A_PAGE = 66
#: Columns of the values: of the pair, then of further photos.
_COLUMNS = "CEFGH"


def setup_sheet(builder: BookBuilder, content: SurveyContent) -> None:
    """Write the set-up, typed and calculated, and in one line what it still lacks."""
    sheet, cells = builder.sheet("Setup", "type"), setup_cells(content)
    words = {key: builder.word(key) for key in STATES}
    if content.media_cells:
        words["state_scale"] = builder.word("state_scale_media")
    line = state_formula(words, is_pair=content.is_pair)
    sheet.formula("A3", line, name="setup_state", font=HEAD_FONT)
    sheet.headings(4, ("name", "description", "value", "unit"), (15, 66, 18, 9))
    for letter, pair in zip(_COLUMNS, pair_names(content.others), strict=False):
        if content.others:
            sheet.text(f"{letter}4", pair, HEAD_FONT)
            sheet.worksheet[f"{letter}4"].fill = HEAD_FILL
            sheet.worksheet[f"{letter}4"].alignment = Alignment(horizontal="right")
            sheet.worksheet.column_dimensions[letter].width = 18 if letter == "C" else 11
    media, leaning, is_pair = content.media_cells, content.leaning, content.is_pair
    listed = groups(is_pair=is_pair, lens=content.has_lens, media=media, leaning=leaning)
    live = formulas(is_pair=is_pair, others=content.others, media=media, leaning=leaning)
    row = 5
    for group in listed:
        for name in group:
            _setup_cell(sheet, row, name, cells, content, live, typed=group is not listed[-1])
            row += 1
        row += 1
    for image in (1, 2):
        names = [name for name in adjustment_names(image) if name in cells]
        for name in names:
            text = word("correction", builder.language).format(n=image)
            sheet.describe(row, (name, text))
            sheet.input(f"C{row}", cells[name], name=name)
            sheet.validate(f"C{row}", title=name, prompt=text, limits=_NUMBERS)
            row += 1
    for letter in _COLUMNS[: 1 + content.others]:
        area = f"{letter}5:{letter}{row}"
        colour_words(sheet.worksheet, area, {"OK": GOOD, "CHECK": WRONG}, bold=("CHECK",))
    sheet.finish(landscape=content.others > 1, freeze="A5", repeat="4:4")
    if row <= _ROWS_A_PAGE:
        sheet.worksheet.page_setup.fitToHeight = 1


def _setup_cell(
    sheet: SheetBuilder,
    row: int,
    name: str,
    cells: Mapping[str, CellValue],
    content: SurveyContent,
    live: Mapping[str, str],
    *,
    typed: bool,
) -> None:
    """Write one named value with its description and unit."""
    bent = term("setup", f"{name}_media") if content.media_cells else None
    entry = bent or term("setup", name)
    matrix = f"H{name[1]}({name[3:4]},{name[4:5]})"
    description = entry.in_language(sheet.book.language) if entry else matrix
    unit = entry.unit if entry else ""
    sheet.describe(row, (name, description), unit)
    is_default = {
        "d_1": content.pair is None,
        "sigma_s": content.setup is None or content.setup.measuring.sigma_s is None,
        "sigma_r_max": content.limits.sigma_r_max is None,
    }
    # Those of further photos stand beside a value of the second one.
    names, form = (name, *beside(name, content.others)), number_format(name)
    for letter, cell_name in zip(_COLUMNS, names, strict=False):
        cell, value = f"{letter}{row}", cells.get(cell_name)
        sheet.worksheet[cell].alignment = Alignment(horizontal="right")
        if typed:
            prompt = description if cell_name == name else f"{cell_name}: {description}"
            _validate(sheet, cell, name, f"{prompt} [{unit}]" if unit else prompt)
        if cell_name in content.links:
            sheet.formula(
                cell, content.links[cell_name], value, form=form, name=cell_name, editable=True
            )
        elif not typed or (cell_name in live and is_default.get(cell_name, False)):
            sheet.formula(cell, live[cell_name], form=form, name=cell_name, editable=typed)
        else:
            sheet.input(cell, value, form=form, name=cell_name)


def pair_names(others: int) -> list[str]:
    """Return what the pairs of photo 1 with each other one are called, by their photos."""
    return [f"{pair_letter(photo)} (1-{photo})" for photo in range(2, 3 + others)]


def _validate(sheet: SheetBuilder, cell: str, name: str, prompt: str) -> None:
    """Tell what a cell of `Setup` is for, and refuse what cannot be meant."""
    if name == "input_unit":
        sheet.validate(cell, title=name, prompt=prompt, choices="mm,px")
    elif is_text(name):
        sheet.validate(cell, title=name, prompt=prompt)
    else:
        limits = INDEX_LIMITS if name.startswith("index_") else _NUMBERS
        if may_be_zero(name):
            limits = (0.0, _NUMBERS[1])
        sensible = sensible_limits(name)
        limits = sensible or limits
        above_zero = is_above_zero(name) and not sensible
        sheet.validate(cell, title=name, prompt=prompt, above_zero=above_zero, limits=limits)
