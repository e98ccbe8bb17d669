"""What every DXF drawing of this package shares: metres, named layers, points, texts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from photocore.arrays import FloatArray
from photocore.provenance import provenance

#: Flag of a polyline (PLINEGEN).
_PATTERN_RUNS_ON = 128


def new_drawing(
    layers: Mapping[str, int], *, point_style: int, point_size: float
) -> tuple[Any, Any]:
    """Return an empty R2010 drawing in metres and its model space.

    Parameters
    ----------
    layers : mapping of str to int
        Layers and their colours (AutoCAD colour index).
    point_style : int
        ``$PDMODE``: 3 a cross, 34 a cross in a circle.
    point_size : float
        Of drawn points. [m]
    """
    import ezdxf
    from ezdxf import units

    with _reproducible():
        drawing = ezdxf.new("R2010", setup=True)
    drawing.units = units.M
    drawing.header["$PDMODE"] = point_style
    drawing.header["$PDSIZE"] = point_size
    # Dashes are as long on a sheet as its viewport's scale makes those of the model.
    drawing.header["$PSLTSCALE"] = 0
    for layer, colour in layers.items():
        drawing.layers.add(layer, color=colour)
    return drawing, drawing.modelspace()


def save_drawing(drawing: Any, path: Path) -> None:
    """Write a drawing with its provenance among its properties, else the same every time."""
    origin = provenance()
    properties = [("Program", origin.program), ("Date", origin.date), ("Command", origin.command)]
    properties += [(f"Input {name}", f"SHA-256 {digest}") for name, digest in origin.inputs]
    for name, value in properties:
        if value:
            # A line of a DXF ends at a line break, and has no more than 255 characters in R2010.
            drawing.header.custom_vars.append(name[:255], " ".join(value.split())[:255])
    _show_all(drawing)
    # ezdxf adds the classes of a drawing from a set, in an order that changes from run to run.
    for name in sorted(drawing.entitydb.dxf_types_in_use()):
        drawing.classes.add_class(name)
    with _reproducible():
        drawing.saveas(path)


def _show_all(drawing: Any) -> None:
    """Say where the drawing lies, so that it opens on what is drawn, wherever that is."""
    from ezdxf import bbox

    model = drawing.modelspace()
    box = bbox.extents(model, fast=True)
    if not box.has_data:
        return
    model.reset_extents(box.extmin, box.extmax)
    height = 1.15 * max(float(box.size.y), 0.5 * float(box.size.x), 0.1)
    drawing.set_modelspace_vport(height=height, center=(box.center.x, box.center.y))


def add_line(model: Any, points: FloatArray | Sequence[Any], style: Mapping[str, object]) -> None:
    """Draw a line through points; one that ends where it begins is closed."""
    places = [tuple(point) for point in points]
    is_closed = len(places) > 3 and places[0] == places[-1]
    model.add_lwpolyline(places[:-1] if is_closed else places, close=is_closed, dxfattribs=style)


@contextmanager
def _reproducible() -> Iterator[None]:
    """Keep times of day and random numbers out of what ezdxf writes."""
    import ezdxf

    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def add_text(model: Any, text: str, place: tuple[float, ...], height: float, layer: str) -> Any:
    """Write a text of one line and return it; ``place`` is its lower left corner. [m]"""
    style = {"layer": layer, "insert": place}
    return model.add_text(text.replace("\n", " "), height=height, dxfattribs=style)


def turned(text: Any, angle: float, *, middle: bool) -> None:
    """Turn a text about its place, counter-clockwise [deg], and centre it there if asked."""
    from ezdxf.enums import TextEntityAlignment

    text.dxf.rotation = angle
    if middle:
        text.set_placement(text.dxf.insert, align=TextEntityAlignment.CENTER)


def dashed(model: Any, linetype: str, length: float) -> dict[str, object]:
    """Return the attributes of a dashed polyline whose pattern repeats after a length.

    In units of the drawing. The pattern runs on over corners: beginning anew at each of them, it
    would leave a profile of points 5 mm apart without a gap.
    """
    pattern = model.doc.linetypes.get(linetype).pattern_tags.tags.get_first_value(40)
    return {"linetype": linetype, "ltscale": length / pattern, "flags": _PATTERN_RUNS_ON}


def add_ellipse(model: Any, place: tuple[float, ...], ellipse: FloatArray, layer: str) -> None:
    """Draw an ellipse: half axes [m] and direction of the longer, clockwise from +Y [deg]."""
    long, short, azimuth = ellipse.tolist()
    direction = np.radians(azimuth)
    axis = (long * float(np.sin(direction)), long * float(np.cos(direction)))
    # A ratio of 1e-6 is the least that the format allows.
    ratio = max(short / long, 1e-6)
    model.add_ellipse(place, major_axis=axis, ratio=ratio, dxfattribs={"layer": layer})


def layer_name(text: str) -> str:
    """Return a text as the name of a layer that every CAD program takes.

    Examples
    --------
    >>> layer_name("window/edge: left")
    'window_edge_ left'
    """
    name = "".join("_" if c in '<>/\\":;?*|=`' or not c.isprintable() else c for c in text).strip()
    return name[:120] or "0"
