"""What stands around the content of every report: title, program and date; provenance."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from photocore.provenance import file_hash, program, provenance, today
from photocore.reports.document import Block, Document, Heading, Paragraph, TextTable
from photocore.reports.words import Words


def dated_document(title: str, language: str, say: Words, blocks: Iterable[Block]) -> Document:
    """Return a report that says below its title by which program it was made, and when."""
    words = say("made", program=program(), date=today())
    head = (Heading(text=title, level=1), Paragraph(text=words, small=True))
    return Document(title=title, language=language, subject=words, blocks=(*head, *blocks))


def provenance_blocks(say: Words, files: Iterable[Path] = ()) -> Iterator[Block]:
    """Yield the command and the files with their checksums; nothing where none is known."""
    origin = provenance()
    rows = [(path.name, file_hash(path)) for path in files if path.is_file()]
    # Files of one name in two folders are two files.
    rows = list(dict.fromkeys([*rows, *origin.inputs]))
    if origin.command or rows:
        yield Heading(text=say("provenance"))
    if origin.command:
        yield Paragraph(text=say("made_by"), lines=(origin.command,), small=True)
    if rows:
        yield TextTable(headings=[say("file"), "SHA-256"], rows=[list(row) for row in rows])
