"""The sketch on the first sheet: two cameras before a wall, and what the symbols mean."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from photocore.workbook import Place, Sketch

#: Colours that the colour-blind tell apart (Okabe and Ito); dashes and symbols say the same.
FAR, NEAR, POINT, INK, FAINT = "0072B2", "D55E00", "009E73", "222222", "777777"
#: The set-up drawn, not to scale: distances, principal distances, place and relief of the point.
_D1, _D2, _C1, _C2, _X, _R = 8.6, 4.7, 1.55, 0.85, 2.6, 1.35
_UNIT, _ZERO = 40.0, (68.0, 372.0)
#: Width and height. [pt]
SIZE = (280.0, 425.0)


def _at(x: float, z: float) -> Place:
    """Return a place on the paper from one in the set-up: x along the wall, z towards cameras."""
    return _ZERO[0] + _UNIT * x, _ZERO[1] - _UNIT * z


def cameras_sketch(nadir: str, caption: str) -> Sketch:
    """Return the drawing.

    Parameters
    ----------
    nadir : str
        The word at the foot of the perpendicular.
    caption : str
        What is to be seen, in words.
    """
    sketch = Sketch(size=SIZE, told=caption)
    sketch.line(_at(-1.2, 0), _at(4.6, 0), INK, width=2.0)
    left, right = _X - 0.55, _X + 0.55
    for start, end in (
        ((left, 0), (left, _R)),
        ((left, _R), (right, _R)),
        ((right, _R), (right, 0)),
    ):
        sketch.line(_at(*start), _at(*end), INK, width=1.25)
    sketch.line(_at(0, 0), _at(0, _D1 + 0.6), INK, width=0.75, dash="dashDot")
    for d, c, colour, dash in ((_D1, _C1, FAR, "solid"), (_D2, _C2, NEAR, "dash")):
        _camera(sketch, d, c, colour, dash)
    sketch.measure(_at(-1, 0), _at(-1, _D1), "d_1", FAR, (-14, 0))
    sketch.measure(_at(-0.45, 0), _at(-0.45, _D2), "d_2", NEAR, (-13, 22))
    sketch.measure(_at(-0.45, _D2), _at(-0.45, _D1), "Δd", INK, (-12, 0))
    sketch.measure(_at(_X + 0.8, 0), _at(_X + 0.8, _R), "r", POINT, (10, -2))
    sketch.line(_at(_X, 0), _at(_X, -1.05), INK, width=0.75, dash="sysDot")
    for d, colour, n, down in ((_D1, FAR, 1, 0.35), (_D2, NEAR, 2, 0.95)):
        meets = _X * d / (d - _R)
        sketch.line(_at(meets, 0), _at(meets, -down - 0.1), colour, width=0.5)
        beside = (_UNIT * (meets - _X) / 2 + 19, 0)
        sketch.measure(_at(_X, -down), _at(meets, -down), f"m e_{n}", colour, beside)
    sketch.dot(_at(_X, _R), POINT, size=9, form="diamond")
    sketch.text(_at(_X - 0.25, _R + 0.25), "P", POINT, bold=True)
    sketch.text(_at(0, -0.35), nadir, INK, size=10)
    for d, c, colour, n in ((_D1, _C1, FAR, 1), (_D2, _C2, NEAR, 2)):
        sketch.text(_at(0.3, d + 0.25), str(n), colour, size=13, bold=True)
        sketch.measure(_at(1.6, d), _at(1.6, d - c), f"c_{n}", colour, (14, 0))
    return sketch


def hand_sketch(sketch: Sketch, top: float, words: Sequence[str]) -> None:
    """Draw how points are measured by hand: from the nadir of a photo; photos of one scale.

    Parameters
    ----------
    sketch : Sketch
        The drawing of the cameras, to which these are added.
    top : float
        Where they begin. [pt]
    words : sequence of str
        The nadir, and what is as large on both photos.
    """
    nadir, alike = words
    left, right, low, high = 20.0, 250.0, top + 160, top + 28
    middle = ((left + right) / 2, (low + high) / 2)
    _frame(sketch, (left, high), (right, low))
    for start, end in (((left, low), (right, high)), ((left, high), (right, low))):
        sketch.line(start, end, FAINT, width=0.5, dash="sysDot")
    for end, name in (((right + 14, middle[1]), "x"), ((middle[0], high - 14), "y")):
        sketch.line(middle, end, INK, width=0.75)
        sketch.text((end[0] + 6, end[1] + 3), name, INK, italic=True)
    sketch.dot(middle, INK, size=7)
    sketch.text((middle[0] - 28, middle[1] + 14), nadir, INK, size=10)
    base, seen = (middle[0] + 60, middle[1] - 30), (middle[0] + 90, middle[1] - 45)
    sketch.measure(middle, seen, "s", FAR, (0, 16))
    sketch.measure(base, seen, "e", POINT, (-6, -14))
    sketch.dot(seen, POINT, size=9, form="diamond")
    sketch.text((middle[0] + 14, middle[1] - 46), "θ", INK, italic=True)
    below = low + 22
    for number, corner, size in ((1, left, 110.0), (2, left + 120, 110.0)):
        _frame(sketch, (corner, below), (corner + size, below + 85))
        sketch.text((corner + 10, below + 12), str(number), (FAR, NEAR)[number - 1], bold=True)
        window = corner + 22
        _frame(sketch, (window, below + 30), (window + 30, below + 70), width=2.0)
        sketch.dot((corner + (85, 100)[number - 1], below + 40), POINT, size=8, form="diamond")
        sketch.measure((window, below + 78), (window + 30, below + 78), "", INK, (0, 0))
    sketch.text((135, below + 97), alike, INK, size=10)


def _frame(sketch: Sketch, first: Place, last: Place, *, width: float = 1.25) -> None:
    """Draw a rectangle between two corners."""
    (x0, y0), (x1, y1) = first, last
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]
    for start, end in pairwise(corners):
        sketch.line(start, end, INK, width=width)


def _camera(sketch: Sketch, d: float, c: float, colour: str, dash: str) -> None:
    """Draw a camera with its image, a positive between centre and wall, and its rays."""
    plane, meets, seen = d - c, _X * d / (d - _R), _X * c / (d - _R)
    sketch.line(_at(-0.6, plane), _at(1.35, plane), colour, width=2.0, dash=dash)
    sketch.line(_at(0, d), _at(_X, 0), FAINT, width=0.75, dash="sysDot")
    sketch.line(_at(0, d), _at(meets, 0), colour, width=1.25, dash=dash)
    sketch.dot(_at(0, d), colour, size=7)
    below = plane - 0.28
    sketch.line(_at(seen, plane), _at(seen, below - 0.07), colour, width=0.5)
    name = "s_1" if colour == FAR else "s_2"
    sketch.measure(_at(0, below), _at(seen, below), name, colour, (0, 12))
