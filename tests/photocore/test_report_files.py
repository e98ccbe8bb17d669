"""Reports and figures on a disk that is full from their first bytes on, or from later ones."""

from __future__ import annotations

import pytest

from photocore.errors import InputError
from photocore.reports.document import Document, Paragraph
from photocore.reports.figure_file import write_figure
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
