"""Products in Italian and German hold no English: report, sheets, sections, workbook, view.

Sheets and reports say the same as PDF.
"""

from __future__ import annotations

import html
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path

import ezdxf
import openpyxl
import pytest
from click.testing import CliRunner

from tests.bifocal.campaigns.sample_tables import write_small_photos, write_tables
from tests.builders.commands import bifocal_command as main

#: Words of English sentences that are neither Italian nor German.
ENGLISH = re.compile(
    r"(?<![\w./-])(the|of|is|are|with|and|which|from|this|that|than|not|were|has|have|its|for|"
    r"only|each|photo|photos|wall|near|assumed|unknown|given|lines)(?![\w./-])",
    re.IGNORECASE,
)
#: Titles of papers, and keys, which are the same in every language.
TITLES = re.compile(r'"On the accuracy[^"]*"|"?Bifocal pairs of images[^")]*[")]|^[a-z_\d]+$')


def texts(path: Path) -> Iterator[str]:
    """Yield what a reader of a file sees, piece by piece."""
    if path.suffix in (".html", ".svg"):
        page = re.sub(r"<(script|style)\b.*?</\1>", " ", path.read_text("utf-8"), flags=re.DOTALL)
        # The command that made a report is told as it was typed.
        page = re.sub(r"<code>.*?</code>", " ", page, flags=re.DOTALL)
        yield from map(html.unescape, re.split(r"<[^>]+>", page))
    elif path.suffix == ".dxf":
        document = ezdxf.readfile(path)
        for layout in document.layouts:
            yield layout.name
            yield from (entity.dxf.text for entity in layout.query("TEXT"))
    elif path.suffix == ".xlsx":
        for sheet in openpyxl.load_workbook(path):
            for row in sheet.iter_rows():
                for cell in row:
                    if isinstance(cell.value, str) and not cell.value.startswith("="):
                        yield cell.value
                    if cell.comment:
                        yield cell.comment.text
            for rule in sheet.data_validations.dataValidation:
                yield from filter(None, (rule.prompt, rule.error, rule.promptTitle))
        with zipfile.ZipFile(path) as file:
            for name in file.namelist():
                if "chart" in name:
                    yield from re.findall(r"<a:t>([^<]*)", file.read(name).decode())


def english(folder: Path) -> set[str]:
    """Return the pieces that hold English words, with their files."""
    return {
        f"{path.name}: {piece}"
        for path in sorted(folder.rglob("*"))
        for piece in texts(path)
        if ENGLISH.search(TITLES.sub("", piece))
    }


@pytest.mark.acceptance
@pytest.mark.parametrize("language", ["it", pytest.param("de", marks=pytest.mark.long)])
def test_products_hold_no_english(tmp_path, language):
    photos = write_small_photos(tmp_path)
    control, check = write_tables(tmp_path, small=True)
    out = tmp_path / "torre"
    words = ["facade", *photos, "--control", control, "--check", check, "--out", out]
    words += ["--language", language, "--section", "x=0", "--quality", "fast"]
    done = CliRunner().invoke(main, [str(word) for word in words])
    assert done.exit_code == 0, done.stderr
    assert {path.suffix for path in out.rglob("*")} >= {".html", ".dxf", ".svg", ".xlsx"}
    assert not english(out)


@pytest.mark.parametrize("language", ["it", "de"])
@pytest.mark.parametrize(
    "wishes",
    [
        "--focal 85 --object 12x8 --free-space 20",
        "--scale 1:100 --indices 1,1.49,1.337 --thicknesses 0.01 --depth 0.9",
        "--scale 1:100 --indices 1,1.49,1.337 --thicknesses 0.01 --port 0.1",
    ],
)
def test_a_plan_holds_no_english(tmp_path, language, wishes):
    out = tmp_path / "plan.xlsx"
    words = f"plan --focal 35 --focal 18 --sensor 23.5x15.6 --pixels 6000x4000 {wishes}".split()
    done = CliRunner().invoke(main, [*words, "--out", str(out), "--language", language])
    assert done.exit_code == 0, done.stderr
    assert not english(tmp_path)
