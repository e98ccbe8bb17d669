"""Results put beside a table of the user's own, with the sheet `Setup` that its formulas need."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bifocal.remarks import remark
from bifocal.survey import ENTRIES, Georeference, SurveyInput
from bifocal.workbook.changing.kinds import refuse_earlier
from bifocal.workbook.changing.setup_update import add_sheets, write_corrections, write_options
from bifocal.workbook.changing.update import (
    BookUpdate,
    changed_results,
    saved,
    store_named_cells,
)
from bifocal.workbook.content import SurveyContent
from bifocal.workbook.formulas.columns import FORMULAS, NEAR
from bifocal.workbook.formulas.placed_formulas import added_covariance
from bifocal.workbook.formulas.setup_cells import TITLE_BLOCK, cells_of
from bifocal.workbook.making.book import build
from bifocal.workbook.reading.reader import TO_DEGREES, TO_MM
from bifocal.workbook.reading.setup_reader import home_of
from bifocal.workbook.words import term, word
from photocore.errors import InputError
from photocore.tables import Table
from photocore.workbook import (
    BookBuilder,
    CellValue,
    LiveColumn,
    OwnTable,
    PlainFormulas,
    ResultColumn,
    WorkbookEditor,
    fixed_cell,
    head_row,
    make_numbers,
    place_of,
    put_result_columns,
    quoted_title,
    split_cell,
)

#: Name of the headings of the results in a workbook of the user's own.
MARK = "bifocal_results"
#: What a survey is for: these columns come first, the steps to them are folded away behind.
_RESULTS = ("r", "flag", "X", "Y", "sigma_r", "E", "N", "H")
#: Under which headings raw pixels stand, where an ideal pair takes them for coordinates.
_RAW = {"x1": "col1", "y1": "row1", "x2": "col2", "y2": "row2"}


#: The sheet of the set-up in a workbook of ours.
_SETUP = "'Setup'"


def add_results(
    source: Path,
    target: Path,
    survey: SurveyInput,
    content: SurveyContent,
    *,
    options: Mapping[str, object],
    overwrite: bool,
) -> BookUpdate:
    """Copy a workbook with the results in new columns of its own table; all else as it was.

    Parameters
    ----------
    source, target : Path
        The workbook, and where the changed one goes; may be the same.
    survey : SurveyInput
        What was read from it.
    content : SurveyContent
        What came out, evaluated as formulas see it.
    options : mapping
        The options that take the place of what the workbook says.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    BookUpdate
        What the user should be told.

    Raises
    ------
    InputError
        If the workbook cannot be changed.
    """
    if source.suffix.lower() != target.suffix.lower():
        raise InputError(remark("survey.into_itself", of=target, name=source.name))
    refuse_earlier(source, survey)
    editor = WorkbookEditor(source, survey.book)
    editor.home = "" if survey.book is None else home_of(survey.book)
    content = replace(content, links=_links(editor, survey, options))
    built = build(content)
    cells = {
        name: defined.attr_text
        for name, defined in built.book.defined_names.items()
        if defined.attr_text.startswith(_SETUP)
    }
    needed = [name for name in cells if name not in TITLE_BLOCK and not name.startswith("a")]
    if any(place_of(editor, name) is None for name in needed):
        editor.home = ""
        title = editor.free_title(word("own_setup", content.language))
        add_sheets(editor, built, {"Setup": title})
        named = {n: f"{quoted_title(title)}{at.removeprefix(_SETUP)}" for n, at in cells.items()}
    else:
        named = dict(editor.named)
    store_named_cells(editor, built, content)
    write_options(editor, content, options)
    write_corrections(editor, content)
    table = survey.table
    # A unit typed into the cells goes with the text; one of a heading stays.
    factors, typed = _factors(table), table.typed_units
    make_numbers(editor, table, lambda key: factors[key] if key in typed else 1.0)
    grid = editor.grid(table.sheet).rows
    users_table = OwnTable(
        sheet=table.sheet,
        head=head_row(grid, table.columns, table.headings, table.rows[0]),
        rows=table.rows,
        columns=_inputs(table.columns, content),
        factors={key: factor for key, factor in factors.items() if key not in typed},
    )
    columns = sorted(
        _columns(users_table, content, built),
        key=lambda column: (*_RESULTS, column.key).index(column.key),
    )
    # Names may mean something else to the user: formulas on their sheets hold addresses alone.
    plain = PlainFormulas((), named)
    columns = [replace(column, formula=plain.plain(column.formula, "")) for column in columns]
    put_result_columns(editor, users_table, columns, mark=MARK)
    return saved(editor, changed_results(editor, built), target, overwrite=overwrite)


def _links(
    editor: WorkbookEditor, survey: SurveyInput, options: Mapping[str, object]
) -> dict[str, str]:
    """Return where values of `Setup` stand in sheets of the user's own, to refer to them."""
    replaced = cells_of(options)
    links = {}
    for key, (sheet, cell) in survey.setup.places.items():
        place = (sheet, *split_cell(cell))
        is_number = isinstance(editor.value_at(*place), float)
        if is_number and key not in replaced and place_of(editor, key) != place:
            links[key] = f"{quoted_title(sheet)}!{fixed_cell(*place[1:])}"
    return links


def _factors(table: Table) -> dict[str, float]:
    """Return what brings the numbers of a column that has a unit to mm or degrees."""
    scales = {key: TO_DEGREES if key == "theta" else TO_MM for key in table.units}
    return {key: scales[key].get(unit, 1.0) for key, unit in table.units.items()}


def _inputs(columns: Mapping[str, int], content: SurveyContent) -> dict[str, int]:
    """Return the input columns by the keys of the formulas."""
    inputs = dict(columns)
    if not content.is_pair and "x1" not in inputs and set(_RAW.values()) <= inputs.keys():
        inputs |= {key: inputs[raw] for key, raw in _RAW.items()}
    return inputs


def _columns(table: OwnTable, content: SurveyContent, built: BookBuilder) -> list[ResultColumn]:
    """Return the results: what the formulas need and the table lacks, then the formulas."""
    cells = _of_rows(built, "tblPoints", table)
    described = content.point_columns(
        xy="x1" in table.columns or bool(content.corrected),
        polar="s1" in table.columns,
        theta="theta" in table.columns,
        code="code" in table.columns,
    )
    results = []
    for column in described:
        if column.key in ("id", "use", "code", "note", *NEAR, "o_EN"):
            continue
        if column.kind == "input" and column.key in table.columns:
            continue
        results.append(_column(column, cells[column.key]))
    if content.georeference is not None:
        results += _world(content, built, {**cells, **_of_rows(built, "tblResults", table)})
    return results


def _column(column: LiveColumn, values: Sequence[CellValue]) -> ResultColumn:
    wording = term("columns", column.key)
    unit = "" if wording is None else wording.unit
    return ResultColumn(
        key=column.key,
        heading=f"{column.key} [{unit}]" if unit else column.key,
        values=values,
        formula=column.formula,
        number_format="0." + "0" * column.places if column.places else "",
        folded=column.key not in _RESULTS,
    )


def _of_rows(built: BookBuilder, name: str, table: OwnTable) -> dict[str, Sequence[CellValue]]:
    """Return the columns of a table of ours without its spare rows."""
    return {key: cells[: len(table.rows)] for key, cells in built.tables[name].cells.items()}


def _world(
    content: SurveyContent, built: BookBuilder, values: Mapping[str, Sequence[CellValue]]
) -> list[ResultColumn]:
    """Return E, N, H, their sigmas and what these need; the transformation stands as numbers."""
    geo, table = content.georeference, content.table
    assert geo is not None
    assert table is not None
    used = {name for name, is_used in zip(geo.ids, geo.used, strict=True) if is_used}
    shared: list[CellValue] = [-1 if name in used else 1 for name in table.ids]
    facts = {"pair"} if content.is_pair else set[str]()
    facts |= {"2D"} if geo.model == "2D" else set()
    lists = ["columns"]
    if geo.precision is not None and table.covariance is not None:
        lists.append("sigmas")
    parts, values = _numbers(geo, built), {**values, "shared": shared}
    columns = (c for rows in lists for c in FORMULAS.columns("own_world", facts, parts, rows=rows))
    return [_column(column, values[column.key]) for column in columns]


def _numbers(geo: Georeference, built: BookBuilder) -> dict[str, str]:
    """Return the numbers of the transformation as parts of formulas."""
    fit = geo.world_from_wall
    origin, centre = np.asarray(geo.origin) + np.asarray(geo.offset), fit.source_centre.tolist()
    near, parts = {name: f"[@n_{name}]" for name in "ENH"}, {"scale": repr(fit.scale)}
    for i, name in enumerate("ENH"):
        row = (fit.scale * fit.rotation[i]).tolist()
        for kind, factors in (("turned", fit.rotation[i].tolist()), ("scaled", row)):
            terms = zip(factors, "XYZ", centre, strict=True)
            text = "+".join(f"({factor!r})*([@{axis}]-({at!r}))" for factor, axis, at in terms)
            parts[f"{kind}_{name}"] = text
        parts |= {f"origin_{name}": repr(float(origin[i])), f"t_{name}": repr(float(geo.offset[i]))}
        parts[f"own_{name}"] = "+".join(
            f"({(1 if a == b else 2) * row[a] * row[b]!r})*{{kept {key}}}"
            for key, (a, b) in ENTRIES.items()
        )
        parts[f"added_{name}"] = re.sub(
            r"g_[zuw]_[A-Z]+",
            lambda name: f"({built.value_of(name[0])!r})",
            added_covariance(name, name, near),
        )
    return parts
