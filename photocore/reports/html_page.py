"""A report as one HTML file that needs nothing else: figures are SVG inside it."""

from __future__ import annotations

import base64
import html
import io
import os
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

from photocore.cli import Progress, no_progress
from photocore.output import atomic_path
from photocore.provenance import provenance
from photocore.reports.document import (
    Banner,
    Block,
    Document,
    Heading,
    Paragraph,
    Picture,
    TextTable,
)

#: Width of figures [inch], resolution of what is drawn as pixels, quality of photos in them.
WIDTH, DPI, JPEG = 7.4, 110, 82


def provenance_text() -> str:
    """Return the provenance as one line, for the head of a page."""
    return "; ".join(provenance().lines())


def write_html(
    path: Path, document: Document, *, overwrite: bool = False, progress: Progress = no_progress
) -> None:
    """Write a report as one HTML file."""
    parts: list[str] = []
    for index, block in enumerate(document.blocks):
        progress(index, len(document.blocks), "report")
        parts += _block(block, path.parent)
    style = files(__package__).joinpath("report.css").read_text("utf-8")
    title, subject = html.escape(document.title), html.escape(document.subject)
    text = (
        f'<!DOCTYPE html>\n<html lang="{document.language}">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta name="generator" content="{subject}">\n'
        f'<meta name="provenance" content="{html.escape(provenance_text())}">\n'
        f"<title>{title}</title>\n"
        f"<style>\n{style}</style>\n</head>\n<body>\n" + "\n".join(parts) + "\n</body>\n</html>\n"
    )
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _block(block: Block, folder: Path) -> Iterator[str]:
    if isinstance(block, Heading):
        yield f"<h{block.level}>{html.escape(block.text)}</h{block.level}>"
    elif isinstance(block, Banner):
        kind = {True: " good", False: " bad", None: ""}[block.good]
        lines = "".join(f"<p>{html.escape(text)}</p>" for text in (block.text, *block.details))
        yield f'<div class="banner{kind}">{lines}</div>'
    elif isinstance(block, Paragraph):
        kind = ' class="small"' if block.small else ""
        text = html.escape(block.text)
        if block.link is not None:
            text = f'<a href="{html.escape(_address(block.link, folder))}">{text}</a>'
        yield f"<p{kind}>{text}</p>"
        if block.lines:
            yield f"<pre>{html.escape(chr(10).join(block.lines))}</pre>"
    elif isinstance(block, TextTable):
        yield from _table(block)
    else:
        yield from _picture(block)


def _address(target: Path, folder: Path) -> str:
    """Return the way from a folder to a file, as an address: both can be moved together."""
    try:
        return quote(Path(os.path.relpath(target, folder)).as_posix())
    except ValueError:  # on another drive
        return target.absolute().as_uri()


def _table(block: TextTable) -> Iterator[str]:
    caption = f"<caption>{html.escape(block.caption)}</caption>" if block.caption else ""
    head = "".join(f'<th scope="col">{html.escape(text)}</th>' for text in block.headings)
    left = [f"left{column}" for column, words in enumerate(block.to_the_left, start=1) if words]
    yield f'<table class="{" ".join(left)}">{caption}<thead><tr>{head}</tr></thead><tbody>'
    for row in block.rows:
        yield "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
    yield "</tbody></table>"


def _picture(block: Picture) -> Iterator[str]:
    data = base64.b64encode(_svg(block).encode("utf-8")).decode("ascii")
    caption = html.escape(block.caption)
    yield (
        f'<figure><img alt="{html.escape(block.caption, quote=True)}" '
        f'src="data:image/svg+xml;base64,{data}"><figcaption>{caption}</figcaption></figure>'
    )


def _svg(block: Picture) -> str:
    """Return a figure as SVG, the same bytes for the same content."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with mpl.rc_context({"svg.hashsalt": "bifocal"}):
        figure = Figure(figsize=(WIDTH, WIDTH * block.ratio), dpi=DPI)
        FigureCanvasSVG(figure)
        block.draw(figure)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return re.sub(r'"data:image/png;base64,([^"]+)"', _smaller, buffer.getvalue())


def _smaller(match: re.Match[str]) -> str:
    """Return a picture inside a figure as JPEG where that loses nothing that is transparent."""
    from PIL import Image

    data = base64.b64decode(match[1])
    with Image.open(io.BytesIO(data), formats=("PNG",)) as image:
        picture: Any = image.convert("RGBA")
    if picture.getextrema()[3][0] < 255 or len(data) < 50_000:
        return match[0]
    out = io.BytesIO()
    picture.convert("RGB").save(out, "JPEG", quality=JPEG)
    if out.tell() >= len(data):
        return match[0]
    return f'"data:image/jpeg;base64,{base64.b64encode(out.getvalue()).decode("ascii")}"'
