"""Write the pictures of the survey workbook's pages: `python docs/make_workbook_pictures.py`.

A wall of forty points is typed into a form, solved, and printed by LibreOffice; wants `soffice` and
`pdftoppm`.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from bifocal.workbook.output import write_result
from bifocal.workbook.template_workflow import write_template
from bifocal.workbook.workflow import solve
from photocore.workbook.changing.editor import WorkbookEditor
from photocore.workbook.changing.named_cells import place_of

HERE = Path(__file__).parent
#: Principal distances [mm] and distances [m] of the photos.
LENSES = ((35.0, 17.5), (19.0, 9.5), (28.0, 14.0))
#: Pictures and the pages in them, by a word on each page that no other has.
PAGES = {
    "workbook.jpg": ("Order of work", "By hand, with", "The two cameras", "r_all"),
    "workbook-results.jpg": (
        "Lengths in metres",
        "World coordinates:",
        "RMSE [m]",
        "Pairs of photos",
    ),
    "workbook-charts.jpg": ("Points on the wall", "Errors at check", "What to expect", "What if"),
}
WIDTH = 700


def typed(path: Path) -> Path:
    """Type a survey into a form: set-up, picks of three photos, control points, checks."""
    write_template(path, rows=45, photos=3, what_if=True)
    editor, rng = WorkbookEditor(path), np.random.default_rng(4)
    given = {"c_1": 35, "c_2": 19, "d_2": 9.5, "delta_d": 8, "c_3": 28, "d_3": 14}
    given |= {"project": "North front", "survey_date": "2026-05-03", "sensor_w": 36, "sensor_h": 24}
    for name, value in given.items():
        editor.set_value(*place_of(editor, name), value)
    xyz = rng.uniform((-5, -3, -0.4), (5, 3, 0.6), (40, 3)).round(3)
    for i, (x, y, r) in enumerate(xyz.tolist()):
        picks = {"id": 101 + i}
        for k, (c, d) in enumerate(LENSES, start=1):
            pick = c * np.array([x, y]) / (d - r) + rng.normal(0, 0.004, 2)
            picks |= dict(zip((f"x{k}", f"y{k}"), pick.round(4).tolist(), strict=True))
        put(editor, "tblPoints", i, picks)
        x, y, r = (xyz[i] + rng.normal(0, 0.001, 3)).round(3).tolist()
        if i < 6:
            world = {"E": 351234 + x, "N": 4123456 - r, "H": 31 + y}
            put(editor, "tblGeo", i, {"id": 101 + i, **world})
        elif i < 22:
            put(editor, "tblCheck", i - 6, {"id": 101 + i, "X_ref": x, "Y_ref": y, "Z_ref": r})
    editor.save(path, overwrite=True)
    return path


def put(editor: WorkbookEditor, name: str, row: int, cells: dict[str, float]) -> None:
    """Type cells into a row of a table."""
    table = editor.table(name)
    headings = table.headings()
    for key, value in cells.items():
        editor.set_value(table.sheet, table.first + row, headings[key], float(value))


def pages(path: Path) -> list[tuple[str, Image.Image]]:
    """Return the text and the picture of every printed page."""
    folder = path.parent
    office = [
        shutil.which("soffice") or "soffice",
        f"-env:UserInstallation={folder.as_uri()}/office",
    ]
    subprocess.run(
        [*office, "--headless", "--convert-to", "pdf", "--outdir", folder, path], check=True
    )
    printed = path.with_suffix(".pdf")
    subprocess.run(["pdftoppm", "-r", "90", "-png", printed, folder / "page"], check=True)
    found = []
    for number, picture in enumerate(sorted(folder.glob("page-*.png")), start=1):
        first = ["pdftotext", "-f", str(number), "-l", str(number), printed, "-"]
        text = subprocess.run(first, check=True, capture_output=True, text=True).stdout
        found.append((text, Image.open(picture).convert("RGB")))
    return found


def joined(pictures: list[Image.Image]) -> Image.Image:
    """Return four pages, two by two, upright ones cut at their lower half."""
    height = round(WIDTH / 2**0.5)
    whole = Image.new("RGB", (2 * WIDTH + 12, 2 * height + 12), "#cfd4d9")
    for number, picture in enumerate(pictures):
        size = (WIDTH, round(picture.height * WIDTH / picture.width))
        page = picture.resize(size, Image.LANCZOS).crop((0, 0, WIDTH, height))
        whole.paste(page, ((number % 2) * (WIDTH + 12), (number // 2) * (height + 12)))
    return whole


def main() -> None:
    """Make all pictures."""
    with tempfile.TemporaryDirectory() as folder:
        path = typed(Path(folder) / "survey.xlsx")
        write_result(path, solve(path), overwrite=True)
        printed = pages(path)
    for name, words in PAGES.items():
        chosen = [next(page for text, page in printed if word in text) for word in words]
        joined(chosen).save(HERE / "images" / name, quality=78)


if __name__ == "__main__":
    main()
