"""A relief map as a page that turns it in three dimensions: one small file, nothing beside it."""

from __future__ import annotations

import base64
import html
import io
import json
from importlib.resources import files
from string import Template

import numpy as np

from bifocal.model import Bounds, ReliefMap
from photocore.arrays import ByteArray, Float32Array
from photocore.errors import InputError
from photocore.provenance import program, today
from photocore.reports import provenance_text, words_of

#: Points of the mesh: what 16-bit indices reach, in every browser.
_MOST = 65_000
#: Longer side of the orthophoto on it [px] and quality of its JPEG.
_PHOTO, _JPEG = 2048, 80
#: Share of the relief that the colours span; the rest has the colour of the ends.
_SPAN = 98.0


def relief_view(
    relief: ReliefMap,
    ortho: tuple[ByteArray, Bounds] | None = None,
    *,
    title: str = "",
    language: str = "en",
) -> str:
    """Return a relief map as an HTML page in which it can be turned, with no need of a network.

    Parameters
    ----------
    relief : ReliefMap
        Drawn with at most 65 000 points, medians of as many of its pixels; unknown stays open.
    ortho : (picture, bounds), optional
        RGB of shape (height, width, 3) and x_min, y_min, x_max, y_max [m]: the colours. Without
        it, or with a switch on the page, the relief has diverging colours about the wall.
    title : str
        By default "Relief".
    language : str
        ``en``, ``it`` or ``de``.

    Returns
    -------
    page : str
        HTML with its mesh, its picture and some plain WebGL.

    Raises
    ------
    InputError
        If no pixel of the relief is known, or the language is none of the three.

    Examples
    --------
    >>> flat = ReliefMap.from_relief(np.zeros((4, 6)), plane_from_pixel=np.diag([0.1, -0.1, 1.0]))
    >>> page = relief_view(flat, title="A wall")
    >>> "<title>A wall</title>" in page, "http" in page
    (True, False)
    """
    say = words_of("bifocal.reports", language)
    heights, step = _thinned(relief)
    finite = heights[np.isfinite(heights)]
    if not finite.size:
        raise InputError("relief: no pixel is known; there is nothing to show.")
    least, most = float(finite.min()), float(finite.max())
    unit = max((most - least) / 65534.0, 1e-9)
    levels = np.where(np.isfinite(heights), np.rint((heights - least) / unit) + 1, 0)
    x_min, y_min, x_max, y_max = relief.bounds
    gsd = relief.gsd
    reach = max(float(np.percentile(np.abs(finite), _SPAN)), 1e-3)
    data = {
        "width": heights.shape[1], "height": heights.shape[0], "step": gsd * step,
        # Centres of the blocks of pixels.
        "left": x_min + gsd * step / 2, "top": y_max - gsd * step / 2,
        "middle": [(x_min + x_max) / 2, (y_min + y_max) / 2],
        "size": max(x_max - x_min, y_max - y_min) / 2 * 1.15, "least": least, "unit": unit,
        "reach": reach, "heights": base64.b64encode(levels.astype("<u2").tobytes()).decode(),
        "bounds": list(ortho[1] if ortho else relief.bounds),
        "photo": _picture(ortho[0]) if ortho else "",
    }  # fmt: skip
    texts = {key: say(f"view_{key}") for key in ("exaggeration", "photo", "reset", "help")}
    texts |= {
        "nowebgl": say("view_nowebgl"), "title": title or say("relief_map"), "language": language,
        "low": f"{-reach:+.2f}", "high": f"{reach:+.2f}",
        "made": say("made", program=program(), date=today()), "provenance": provenance_text(),
    }  # fmt: skip
    page = files("bifocal.reports").joinpath("relief_view.html").read_text(encoding="utf-8")
    escaped = {key: html.escape(text) for key, text in texts.items()}
    return Template(page).safe_substitute(escaped, data=json.dumps(data))


def _thinned(relief: ReliefMap) -> tuple[Float32Array, int]:
    """Return the medians of square blocks of pixels, and how many pixels a block is wide."""
    r = relief.r
    step = 1
    while -(-r.shape[0] // step) * -(-r.shape[1] // step) > _MOST:
        step += 1
    if step == 1:
        return r, 1
    height, width = (-(-size // step) for size in r.shape)
    padded = np.full((height * step, width * step), np.nan, np.float32)
    padded[: r.shape[0], : r.shape[1]] = r
    blocks = padded.reshape(height, step, width, step).swapaxes(1, 2).reshape(-1, step * step)
    ordered = np.sort(blocks, axis=1)  # NaN comes last
    count = np.isfinite(ordered).sum(axis=1)
    middle = ordered[np.arange(len(ordered)), np.maximum(count - 1, 0) // 2]
    # A block of which less than half is known is open, so that holes keep their size.
    out: Float32Array = np.where(2 * count >= step * step, middle, np.float32(np.nan))
    return out.reshape(height, width), step


def _picture(picture: ByteArray) -> str:
    """Return a picture as a data address."""
    from PIL import Image

    image = Image.fromarray(np.ascontiguousarray(picture))
    image.thumbnail((_PHOTO, _PHOTO))
    out = io.BytesIO()
    image.convert("RGB").save(out, "JPEG", quality=_JPEG)
    return f"data:image/jpeg;base64,{base64.b64encode(out.getvalue()).decode('ascii')}"
