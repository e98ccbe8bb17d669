"""Reports and figures on a disk that is full from their first bytes on, or from later ones."""

from __future__ import annotations

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

from bifocal import InputError
from photocore.reports.document import Document, Paragraph, TextTable
from photocore.reports.figure_file import write_figure
from photocore.reports.html_page import _smaller, write_html
from photocore.reports.writing import write_document
from tests.full_disk import full_after


@pytest.mark.parametrize("size", [0, 4000])
@pytest.mark.parametrize("ending", [".pdf", ".html"])
def test_a_report_is_whole_or_absent(tmp_path, ending, size):
    blocks = tuple(Paragraph(text=f"Paragraph {k}. " + 40 * "word ") for k in range(30))
    document = Document(title="Wall", subject="test", language="en", blocks=blocks)
    path = tmp_path / f"report{ending}"
    path.write_bytes(b"mine")
    with full_after(size), pytest.raises(InputError, match="could not be written"):
        write_document(path, document, overwrite=True)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"mine"]


@pytest.mark.parametrize("size", [0, 4000])
@pytest.mark.parametrize("ending", [".pdf", ".PDF", ".svg", ".png"])
def test_a_figure_is_whole_or_absent(tmp_path, ending, size):
    from matplotlib.figure import Figure

    figure, path = Figure(dpi=50), tmp_path / f"figure{ending}"
    axes = figure.add_subplot()
    axes.plot(range(9))
    axes.text(0.5, 0.5, "a text, and the letters of it in the file")
    path.write_bytes(b"mine")
    with full_after(size), pytest.raises(InputError, match="could not be written"):
        write_figure(path, figure, overwrite=True)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"mine"]


def test_words_stand_to_the_left_and_numbers_to_the_right(tmp_path):
    rows = [
        ["1", "cam1, cam2", "1.00000, 1.46000", "-0.3 ± 0.1", "047b8c82", "-", "12 %", "mm⁻²"],
        ["2", "cam3", "1.33", "1e-05", "fe41c0", "plane, fixed", "-", "mm"],
    ]
    table = TextTable(headings=list("abcdefgh"), rows=rows)
    assert table.to_the_left == (True, True, False, False, True, True, False, True)
    blocks = (table, Paragraph(text="Made by:", lines=("long " * 100,)))
    document = Document(title="T", language="en", subject="s", blocks=blocks)
    write_html(tmp_path / "t.html", document)
    page = (tmp_path / "t.html").read_text(encoding="utf-8")
    assert '<table class="left1 left2 left5 left6 left8">' in page
    assert ".left8 :is(th,td):nth-child(8){text-align:left}" in page
    assert "white-space:pre-wrap" in page


@pytest.mark.parametrize(
    ("side", "alpha", "step", "kind"),
    [(200, 255, 1, "jpeg"), (200, 254, 1, "png"), (100, 255, 1, "png"), (700, 255, 255, "png")],
)
def test_a_large_picture_in_a_figure_becomes_a_jpeg_where_that_is_smaller_and_shows_nothing_else(
    side, alpha, step, kind
):
    """Noise of 200 x 200 px is a PNG of 120 kB, of 100 x 100 px one of 30 kB.

    Dots of black and white at random are smaller as a PNG, of 700 x 700 px some 70 kB.
    """
    rng = np.random.default_rng(1)
    noise = rng.integers(0, 255 // step + 1, (side, side, 4), dtype=np.uint8) * np.uint8(step)
    if step > 1:
        noise[..., 1:3] = noise[..., :1]
    noise[..., 3] = alpha
    Image.fromarray(noise).save(buffer := io.BytesIO(), "PNG")
    code = base64.b64encode(buffer.getvalue()).decode("ascii")
    match = re.fullmatch(r'"data:image/png;base64,([^"]+)"', f'"data:image/png;base64,{code}"')
    address, _, data = _smaller(match).strip('"').partition(";base64,")
    assert address == f"data:image/{kind}"
    with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
        assert picture.size == (side, side)
