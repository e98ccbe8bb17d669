"""The rows of a sheet that are printed, moved with the rows that hold something."""

from __future__ import annotations

import re

from photocore.workbook.changing.editor import WorkbookEditor
from photocore.workbook.reading.grid import quoted_title
from photocore.workbook.reading.package import open_package, read_part
from photocore.workbook.reading.xmltext import escaped


def move_print_area(editor: WorkbookEditor, title: str, before: int, after: int) -> bool:
    """Let the print area of a sheet end at another row, its columns and first row as they are.

    Parameters
    ----------
    editor : WorkbookEditor
        The workbook.
    title : str
        The sheet.
    before, after : int
        Its last row so far, and from now on; a print area that ends elsewhere was set by the user
        and stays.

    Returns
    -------
    bool
        Whether there is such a print area.
    """
    with open_package(editor.path) as package:
        data = read_part(editor.path, package, editor.book.part)
    names = "|".join(re.escape(escaped(name)) for name in (quoted_title(title), title))
    tag = r"<(?:\w+:)?definedName\s[^>]*_xlnm\.Print_Area[^>]*>"
    area = rf"(?:{names})!\$[A-Z]+\$\d+:\$[A-Z]+\${before}<"
    match = re.search((tag + area).encode(), data)
    if match is None:
        return False
    if after != before:
        moved = match[0][: -len(f"{before}<")] + f"{after}<".encode()
        editor.texts.append((editor.book.part, match[0], moved))
    return True
