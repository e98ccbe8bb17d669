"""A figure of matplotlib as a file, whole or absent."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

from photocore.output import atomic_path
from photocore.png_text import with_provenance


def write_figure(path: Path | str, figure: Any, *, overwrite: bool, **options: Any) -> None:
    """Write a figure as what its ending says: .png, .svg or .pdf.

    It is drawn in memory: where the disk is full, matplotlib goes on writing while it closes a
    PDF, and fails in zlib with an error of another kind.

    Parameters
    ----------
    path : path
        Of the file.
    figure : matplotlib.figure.Figure
        What is drawn, with its canvas.
    overwrite : bool
        Replace an existing file.
    **options
        As of ``Figure.savefig``.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    written = BytesIO()
    ending = Path(path).suffix.lower().lstrip(".")
    figure.savefig(written, format=ending, **options)
    data = written.getvalue()
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(with_provenance(data) if ending == "png" else data)
