"""The model 3D as live formulas: Horn's start, then turns of Gauss-Newton, to the right of tblGeo.

Plain functions of one cell each, no array formulas: columns of the nine entries of B = m R' in the
order XE XN XH YE YN YH ZE ZN ZH are multiplied by SUMPRODUCT. `bifocal.survey.space_similarity`
does the same and gives the numbers shown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from bifocal.survey.space_similarity import SPACE_STEPS, SQUARINGS, SpaceSums
from bifocal.workbook.formulas.placed_formulas import entry
from photocore.arrays import FloatArray
from photocore.workbook.making.live_book import SheetBuilder
from photocore.workbook.making.look import LABEL_FONT
from photocore.workbook.reading.grid import column_letters

#: First column, right of the table of control points; first row, that nine stand above its keys.
LEFT, TOP = 60, 3
#: First column right of the table: all that stands there is folded away.
FOLDED = 44
#: Name of the whole block, by which its results are stored in a workbook that exists.
BLOCK = "g_space_block"
#: Steps range from 1E-13 to 1E+6; a column of usual width holds them so.
STEP_FORM = "0.00E+00"
_KEYS = tuple((axis, world) for axis in "XYZ" for world in "ENH")
#: Half-turn a times a column of B: for X, Y, Z which of a with which row, and what is taken off.
_CROSS = ((1, 2, 2, 1), (2, 0, 0, 2), (0, 1, 1, 0))


@dataclass(frozen=True, slots=True)
class CellMatrix:
    """Where a matrix of formulas stands: its first row and column, rows and columns."""

    top: int
    left: int
    rows: int
    columns: int

    def cell(self, i: int, j: int) -> str:
        """Return one cell."""
        return f"{column_letters(self.left + j)}{self.top + i}"

    def cells(self) -> list[str]:
        """Return the cells of a single column."""
        return [self.fixed(i, 0) for i in range(self.rows)]

    def fixed(self, i: int, j: int) -> str:
        """Return one cell as formulas name it."""
        return f"${column_letters(self.left + j)}${self.top + i}"

    def column(self, j: int) -> str:
        """Return a column."""
        return f"{self.fixed(0, j)}:{self.fixed(self.rows - 1, j)}"

    def row(self, i: int) -> str:
        """Return a row."""
        return f"{self.fixed(i, 0)}:{self.fixed(i, self.columns - 1)}"

    @property
    def range(self) -> str:
        """All of it."""
        return f"{self.fixed(0, 0)}:{self.fixed(self.rows - 1, self.columns - 1)}"


class SpaceBlock:
    """Places matrices of formulas side by side and remembers where they stand."""

    def __init__(self, sheet: SheetBuilder, sums: SpaceSums | None) -> None:
        self.sheet = sheet
        self.sums = sums
        self.next = LEFT
        self._write()

    def _put(
        self,
        label: str,
        shape: tuple[int, int],
        body: Callable[[int, int], str],
        values: FloatArray | None,
    ) -> CellMatrix:
        """Write a matrix of formulas and return where it stands."""
        left = self.next
        self.next = left + shape[1]
        matrix = CellMatrix(TOP, left, *shape)
        self.sheet.text(f"{column_letters(left)}{TOP - 1}", label, LABEL_FONT)
        shown = None if values is None else np.asarray(values, dtype=np.float64).reshape(shape)
        for i in range(shape[0]):
            for j in range(shape[1]):
                value = None if shown is None else float(shown[i, j])
                text = f'IF(g_space=1,{body(i, j)},"")'
                self.sheet.formula(matrix.cell(i, j), text, value, form=STEP_FORM)
        return matrix

    def _write(self) -> None:
        sums, put = self.sums, self._put

        def value(name: str) -> FloatArray | None:
            return None if sums is None else np.asarray(getattr(sums, name))

        def mixed_value(name: str) -> FloatArray | None:
            return None if sums is None else np.asarray(getattr(sums, name)).T

        def column(i: int, j: int) -> str:
            return f"tblGeo[c{_KEYS[i][j]}]"

        mixed = put(
            "L", (9, 3),
            lambda i, j: f"SUMPRODUCT(tblGeo[p_{entry(_KEYS[i][0], 'XYZ'[j])}],{column(i, 1)})",
            mixed_value("mixed"),
        )  # fmt: skip
        self.shift = put(
            "F", (9, 3),
            lambda i, j: "+".join(
                f"g_i_{entry('XYZ'[j], other)}*{mixed.fixed(i, n)}" for n, other in enumerate("XYZ")
            ),
            mixed_value("shift"),
        )  # fmt: skip
        reduced = put(
            "H", (9, 9),
            lambda i, j: (
                f"SUMPRODUCT(tblGeo[p_{entry(_KEYS[i][0], _KEYS[j][0])}],{column(i, 1)},"
                f"{column(j, 1)})-SUMPRODUCT({mixed.row(i)},{self.shift.row(j)})"
            ),
            value("reduced"),
        )  # fmt: skip
        left = put(
            "g", (9, 1),
            lambda i, _: f"SUMPRODUCT(tblGeo[h_{_KEYS[i][0]}],{column(i, 1)})-("
            + "+".join(f"{mixed.fixed(i, n)}*g_f_{axis}" for n, axis in enumerate("XYZ"))
            + ")",
            value("left"),
        )  # fmt: skip
        entries = self._start()
        for number in range(SPACE_STEPS):
            entries = self._turn(number, entries, reduced, left)
        self.entries = entries

    def _start(self) -> CellMatrix:
        """Write the unweighted rotation by Horn's matrix, and B of it."""
        sums, put = self.sums, self._put
        crossed = put(
            "S", (9, 1), lambda i, _: f"SUMPRODUCT(tblGeo[c{_KEYS[i][0]}],"
            f"tblGeo[c{_KEYS[i][1]}])", None if sums is None else sums.crossed,
        )  # fmt: skip
        cell = dict(zip(("".join(key) for key in _KEYS), crossed.cells(), strict=True))
        xx, xy, xz, yx, yy, yz, zx, zy, zz = cell.values()
        bound = f"SQRT(3*SUMSQ({crossed.range}))"
        horn = (
            (f"{xx}+{yy}+{zz}+{bound}", f"{yz}-{zy}", f"{zx}-{xz}", f"{xy}-{yx}"),
            (f"{yz}-{zy}", f"{xx}-{yy}-{zz}+{bound}", f"{xy}+{yx}", f"{zx}+{xz}"),
            (f"{zx}-{xz}", f"{xy}+{yx}", f"{yy}-{xx}-{zz}+{bound}", f"{yz}+{zy}"),
            (f"{xy}-{yx}", f"{zx}+{xz}", f"{yz}+{zy}", f"{zz}-{xx}-{yy}+{bound}"),
        )
        shown = [None] * (SQUARINGS + 1) if sums is None else list(sums.powers)
        power = put("Q", (4, 4), lambda i, j: horn[i][j], shown[0])
        for number in range(1, SQUARINGS + 1):
            power = self._squared(power, shown[number])
        diagonal = [power.fixed(i, i) for i in range(4)]
        longest = f"MAX({','.join(diagonal)})"
        chosen = None
        if sums is not None:
            chosen = sums.powers[-1][:, int(np.argmax(np.diag(sums.powers[-1])))]
        column = put(
            "q", (4, 1),
            lambda i, _: "".join(
                f"IF({diagonal[n]}={longest},{power.fixed(i, n)}," for n in range(3)
            ) + power.fixed(i, 3) + ")))",
            chosen,
        )  # fmt: skip
        a, b, c, d = column.cells()
        length = f"SUMSQ({column.range})"
        # R' row by row: world axes in the wall's frame.
        turned = (
            f"({a}^2+{b}^2-{c}^2-{d}^2)", f"2*({b}*{c}+{a}*{d})", f"2*({b}*{d}-{a}*{c})",
            f"2*({b}*{c}-{a}*{d})", f"({a}^2-{b}^2+{c}^2-{d}^2)", f"2*({c}*{d}+{a}*{b})",
            f"2*({b}*{d}+{a}*{c})", f"2*({c}*{d}-{a}*{b})", f"({a}^2-{b}^2-{c}^2+{d}^2)",
        )  # fmt: skip
        start = put(
            "R'", (9, 1), lambda i, _: f"{turned[i]}/{length}",
            None if sums is None else sums.start,
        )  # fmt: skip
        squares = "+".join(f"SUMSQ(tblGeo[c{axis}])" for axis in "XYZ")
        scale = put(
            "m", (1, 1), lambda *_: f"({squares})/SUMPRODUCT({start.range},{crossed.range})",
            None if sums is None else np.array([sums.squares / (sums.start @ sums.crossed)]),
        )  # fmt: skip
        return put(
            "B0", (9, 1), lambda i, _: f"{scale.fixed(0, 0)}*{start.fixed(i, 0)}",
            None if sums is None else sums.turns[0].entries,
        )  # fmt: skip

    def _squared(self, power: CellMatrix, value: FloatArray | None) -> CellMatrix:
        return self._put(
            "Q^2", (4, 4),
            lambda i, j: f"SUMPRODUCT({power.column(i)},{power.column(j)})/SUMSQ({power.range})",
            value,
        )  # fmt: skip

    def _turn(
        self, number: int, entries: CellMatrix, reduced: CellMatrix, left: CellMatrix
    ) -> CellMatrix:
        """Write one turn and return B after it."""
        turn = None if self.sums is None else self.sums.turns[number]
        after = None
        if self.sums is not None:
            last = number + 1 == SPACE_STEPS
            after = self.sums.entries if last else self.sums.turns[number + 1].entries
        put, b = self._put, entries.cells()

        def design(i: int, j: int) -> str:
            if j == 3:
                return b[i]
            axis, world = divmod(i, 3)
            # e_j x column: for each axis of the wall another row of B, or nothing.
            for own, other, sign in _axis_rows(j):
                if own == axis:
                    return f"{'-' if sign < 0 else ''}{b[3 * other + world]}"
            return "0"

        self.design = put("D", (9, 4), design, None if turn is None else turn.design)
        product = put(
            "HD", (9, 4),
            lambda i, j: f"SUMPRODUCT({reduced.column(i)},{self.design.column(j)})",
            None if turn is None else turn.product,
        )  # fmt: skip
        normal = put(
            "N", (4, 4),
            lambda i, j: f"SUMPRODUCT({self.design.column(i)},{product.column(j)})",
            None if turn is None else turn.normal,
        )  # fmt: skip
        self.inverse = put(
            "1/N", (4, 4), lambda i, j: f"INDEX(MINVERSE({normal.range}),{i + 1},{j + 1})",
            None if turn is None else turn.inverse,
        )  # fmt: skip
        right = put(
            "n", (4, 1),
            lambda i, _: f"SUMPRODUCT({self.design.column(i)},{left.range})"
            f"-SUMPRODUCT({self.design.column(i)},{product.column(3)})",
            None if turn is None else turn.right,
        )  # fmt: skip
        step = put(
            "step", (4, 1),
            lambda i, _: f"SUMPRODUCT({self.inverse.column(i)},{right.range})",
            None if turn is None else turn.step,
        )  # fmt: skip
        a = [f"{cell}/2" for cell in step.cells()[:3]]

        def crossed(i: int, cells: list[str]) -> str:
            axis, world = divmod(i, 3)
            one, first, other, second = _CROSS[axis]
            return f"{a[one]}*{cells[3 * first + world]}-{a[other]}*{cells[3 * second + world]}"

        halfway = put(
            "U", (9, 1), lambda i, _: f"{b[i]}+{crossed(i, b)}",
            None if turn is None else turn.halfway,
        )  # fmt: skip
        u, turns = halfway.cells(), ",".join(step.cells()[:3])
        stretch = f"EXP({step.fixed(3, 0)})"
        return put(
            f"B{number + 1}", (9, 1),
            lambda i, _: f"{stretch}*({b[i]}+2/(1+SUMSQ({turns})/4)*({crossed(i, u)}))",
            after,
        )  # fmt: skip

    def finish(self) -> None:
        """Fold the block away and name it as a whole."""
        last = self.next - 1
        for number in range(FOLDED, last + 1):
            width = self.sheet.worksheet.column_dimensions[column_letters(number)]
            width.outlineLevel, width.hidden = 1, True
        cells = f"${column_letters(LEFT)}${TOP}:${column_letters(last)}${TOP + 8}"
        self.sheet.book.define(BLOCK, f"'{self.sheet.worksheet.title}'!{cells}")


def _axis_rows(j: int) -> Iterator[tuple[int, int, int]]:
    """Yield for e_j x v: which component, of which of v, with which sign."""
    after, before = (j + 1) % 3, (j + 2) % 3
    yield after, before, -1
    yield before, after, 1
