"""The sketch on the first sheet: camera, pane, water, and the radial shift."""

from __future__ import annotations

from photocore.workbook import Sketch

#: Colours that the colour-blind tell apart (Okabe and Ito); dashes and symbols say the same.
_RAY, _STRAIGHT, _WATER, _INK = "0072B2", "D55E00", "56B4E9", "222222"
#: Width and height. [pt]
_SIZE = (290.0, 300.0)
#: Camera, upper and lower side of the pane, depth of the point; where the ray meets each. [pt]
_LEFT, _CAMERA, _UPPER, _LOWER, _DEPTH = 70.0, 20.0, 130.0, 150.0, 240.0
_MEETS, _LEAVES, _POINT = 82.5, 90.0, 135.0


def shift_sketch(caption: str) -> Sketch:
    """Return the drawing; ``caption`` says in words what is to be seen."""
    sketch = Sketch(size=_SIZE, told=caption)
    straight = _MEETS / (_UPPER - _CAMERA) * (_DEPTH - _CAMERA)
    for level, width in ((_UPPER, 1.5), (_LOWER, 1.5)):
        sketch.line((20, level), (_SIZE[0] - 5, level), _WATER, width=width)
    sketch.line((20, _DEPTH), (_SIZE[0] - 5, _DEPTH), "777777", width=0.75, dash="dash")
    sketch.line((_LEFT, _CAMERA), (_LEFT, _DEPTH + 12), _INK, width=0.75, dash="dashDot")
    start = (_LEFT, _CAMERA)
    sketch.line(start, (_LEFT + straight, _DEPTH), _STRAIGHT, dash="dash")
    for across, level in ((_MEETS, _UPPER), (_LEAVES, _LOWER), (_POINT, _DEPTH)):
        end = (_LEFT + across, level)
        sketch.line(start, end, _RAY, width=1.75)
        start = end
    sketch.dot((_LEFT, _CAMERA), _RAY, size=8)
    sketch.dot((_LEFT + _POINT, _DEPTH), _RAY, size=9, form="diamond")
    sketch.measure((40, _CAMERA), (40, _UPPER), "z_0", _INK, (-14, 0))
    sketch.measure((40, _UPPER), (40, _LOWER), "t_1", _INK, (-14, 0))
    sketch.measure((40, _LOWER), (40, _DEPTH), "ZP", _INK, (-16, 0))
    sketch.measure((_LEFT, 256), (_LEFT + _POINT, 256), "R", _RAY, (0, 11))
    sketch.measure((_LEFT, 280), (_LEFT + straight, 280), "Rbar", _STRAIGHT, (0, 11))
    for level, name in ((75, "n_1"), (140, "n_2"), (195, "n_3")):
        sketch.text((250, level), name, _INK, size=14, italic=True)
    sketch.text((_LEFT + _POINT - 2, _DEPTH - 14), "P", _RAY, bold=True)
    return sketch
