"""The model 3D as live formulas: Horn's start, then turns of Gauss-Newton, to the right of tblGeo.

Plain functions of one cell each, no array formulas: columns of the nine entries of B = m R' in the
order XE XN XH YE YN YH ZE ZN ZH are multiplied by SUMPRODUCT. Horn's start is the first eigenvector
of a 4 x 4 matrix (B. K. P. Horn, "Closed-form solution of absolute orientation using unit
quaternions", JOSA A 4(4), 1987), found by squaring it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bifocal.workbook.formulas.placed_formulas import entry
from photocore.workbook import LABEL_FONT, SheetBuilder, column_letters

#: First column, right of the table of control points; first row, that nine stand above its keys.
LEFT, TOP = 72, 3
#: First column right of the table: all that stands there is folded away.
FOLDED = 55
#: Turns of Gauss-Newton: from the unweighted fit five reach rounding on walls that lean or lie.
SPACE_STEPS = 6
#: Squarings of Horn's matrix: its first eigenvector then counts 1024 times its own share.
SQUARINGS = 10
#: Name of the whole block, by which its results are stored in a workbook that exists.
BLOCK = "g_space_block"
#: Steps range from 1E-13 to 1E+6; a column of usual width holds them so.
STEP_FORM = "0.00E+00"
_KEYS = tuple((axis, world) for axis in "XYZ" for world in "ENH")
_NINE = range(len(_KEYS))
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

    def squared(self, i: int, j: int) -> str:
        """Return an entry of the square of a symmetric matrix, brought to length 1."""
        return f"SUMPRODUCT({self.column(i)},{self.column(j)})/SUMSQ({self.range})"

    @property
    def range(self) -> str:
        """All of it."""
        return f"{self.fixed(0, 0)}:{self.fixed(self.rows - 1, self.columns - 1)}"


class SpaceBlock:
    """Places matrices of formulas side by side and remembers where they stand.

    Of another model than 3D all of them are blank, which needs no calculation.
    """

    def __init__(self, sheet: SheetBuilder, *, blank: bool) -> None:
        self.sheet = sheet
        self.next = LEFT
        self.shown = "" if blank else None
        self._write()

    def _put(
        self, label: str, shape: tuple[int, int], body: Callable[[int, int], str]
    ) -> CellMatrix:
        """Write a matrix of formulas and return where it stands."""
        matrix = CellMatrix(TOP, self.next, *shape)
        self.next += shape[1]
        self.sheet.text(f"{column_letters(matrix.left)}{TOP - 1}", label, LABEL_FONT)
        for i, j in np.ndindex(shape):
            text = f'IF(g_space=1,{body(i, j)},"")'
            self.sheet.formula(matrix.cell(i, j), text, self.shown, form=STEP_FORM)
        return matrix

    def _column(self, label: str, bodies: Sequence[str]) -> CellMatrix:
        """Write a single column of formulas."""
        return self._put(label, (len(bodies), 1), lambda i, _: bodies[i])

    def _write(self) -> None:
        put = self._put
        world = [f"tblGeo[c{name}]" for _, name in _KEYS]
        axes = [axis for axis, _ in _KEYS]

        def weight(first: str, second: str) -> str:
            return f"tblGeo[p_{entry(first, second)}]"

        def freed(i: int, j: int) -> str:
            both = f"{weight(axes[i], axes[j])},{world[i]},{world[j]}"
            return f"SUMPRODUCT({both})-SUMPRODUCT({mixed.row(i)},{self.shift.row(j)})"

        def solved(i: int, j: int) -> str:
            row = (f"g_i_{entry('XYZ'[j], o)}*{mixed.fixed(i, n)}" for n, o in enumerate("XYZ"))
            return "+".join(row)

        mixed = put("L", (9, 3), lambda i, j: f"SUMPRODUCT({weight(axes[i], 'XYZ'[j])},{world[i]})")
        self.shift = put("F", (9, 3), solved)
        reduced = put("H", (9, 9), freed)
        means = (
            "+".join(f"{mixed.fixed(i, n)}*g_f_{o}" for n, o in enumerate("XYZ")) for i in _NINE
        )
        rights = (f"SUMPRODUCT(tblGeo[h_{axes[i]}],{world[i]})" for i in _NINE)
        left = self._column("g", [f"{r}-({m})" for r, m in zip(rights, means, strict=True)])
        entries = self._start()
        for number in range(SPACE_STEPS):
            entries = self._turn(number, entries, reduced, left)
        self.entries = entries

    def _start(self) -> CellMatrix:
        """Write the unweighted rotation by Horn's matrix, and B of it."""
        put = self._put
        sums = [f"SUMPRODUCT(tblGeo[c{axis}],tblGeo[c{name}])" for axis, name in _KEYS]
        crossed = self._column("S", sums)
        xx, xy, xz, yx, yy, yz, zx, zy, zz = crossed.cells()
        bound = f"SQRT(3*SUMSQ({crossed.range}))"
        horn = (
            (f"{xx}+{yy}+{zz}+{bound}", f"{yz}-{zy}", f"{zx}-{xz}", f"{xy}-{yx}"),
            (f"{yz}-{zy}", f"{xx}-{yy}-{zz}+{bound}", f"{xy}+{yx}", f"{zx}+{xz}"),
            (f"{zx}-{xz}", f"{xy}+{yx}", f"{yy}-{xx}-{zz}+{bound}", f"{yz}+{zy}"),
            (f"{xy}-{yx}", f"{zx}+{xz}", f"{yz}+{zy}", f"{zz}-{xx}-{yy}+{bound}"),
        )
        power = put("Q", (4, 4), lambda i, j: horn[i][j])
        for _ in range(SQUARINGS):
            power = put("Q^2", (4, 4), power.squared)
        diagonal = [power.fixed(i, i) for i in range(4)]
        longest = f"MAX({','.join(diagonal)})"
        tests = [f"IF({cell}={longest}," for cell in diagonal[:3]]

        def chosen(i: int, _: int) -> str:
            cases = "".join(f"{test}{power.fixed(i, n)}," for n, test in enumerate(tests))
            return f"{cases}{power.fixed(i, 3)})))"

        column = put("q", (4, 1), chosen)
        a, b, c, d = column.cells()
        # R' row by row: world axes in the wall's frame.
        turned = (
            *(f"({a}^2+{b}^2-{c}^2-{d}^2)", f"2*({b}*{c}+{a}*{d})", f"2*({b}*{d}-{a}*{c})"),
            *(f"2*({b}*{c}-{a}*{d})", f"({a}^2-{b}^2+{c}^2-{d}^2)", f"2*({c}*{d}+{a}*{b})"),
            *(f"2*({b}*{d}+{a}*{c})", f"2*({c}*{d}-{a}*{b})", f"({a}^2-{b}^2-{c}^2+{d}^2)"),
        )
        start = self._column("R'", [f"{cell}/SUMSQ({column.range})" for cell in turned])
        squares = "+".join(f"SUMSQ(tblGeo[c{axis}])" for axis in "XYZ")
        scale = self._column("m", [f"({squares})/SUMPRODUCT({start.range},{crossed.range})"])
        return self._column("B0", [f"{scale.fixed(0, 0)}*{cell}" for cell in start.cells()])

    def _turn(
        self, number: int, entries: CellMatrix, reduced: CellMatrix, left: CellMatrix
    ) -> CellMatrix:
        """Write one turn and return B after it."""
        put, b = self._put, entries.cells()

        def design(i: int, j: int) -> str:
            if j == 3:
                return b[i]
            axis, world = divmod(i, 3)
            # e_j x column: for each axis of the wall another row of B, or nothing.
            for main, cross, sign in _axis_rows(j):
                if main == axis:
                    return f"{'-' if sign < 0 else ''}{b[3 * cross + world]}"
            return "0"

        def product_of(first: CellMatrix, second: CellMatrix) -> Callable[[int, int], str]:
            return lambda i, j: f"SUMPRODUCT({first.column(i)},{second.column(j)})"

        self.design = slopes = put("D", (9, 4), design)
        product = put("HD", (9, 4), product_of(reduced, slopes))
        normal = put("N", (4, 4), product_of(slopes, product)).range
        self.inverse = put("1/N", (4, 4), lambda i, j: f"INDEX(MINVERSE({normal}),{i + 1},{j + 1})")
        own, now = product_of(slopes, left), product_of(slopes, product)
        right = self._column("n", [f"{own(i, 0)}-{now(i, 3)}" for i in range(4)])
        step = put("step", (4, 1), product_of(self.inverse, right))
        a = [f"{cell}/2" for cell in step.cells()[:3]]

        def crossed(i: int, cells: list[str]) -> str:
            axis, world = divmod(i, 3)
            one, first, other, second = _CROSS[axis]
            return f"{a[one]}*{cells[3 * first + world]}-{a[other]}*{cells[3 * second + world]}"

        u = self._column("U", [f"{b[i]}+{crossed(i, b)}" for i in _NINE]).cells()
        turns, stretch = ",".join(step.cells()[:3]), f"EXP({step.fixed(3, 0)})"
        twice = f"2/(1+SUMSQ({turns})/4)"
        after = [f"{stretch}*({b[i]}+{twice}*({crossed(i, u)}))" for i in _NINE]
        return self._column(f"B{number + 1}", after)

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
