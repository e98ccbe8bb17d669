"""Write pictures of the docs from a demo: `python docs/make_pictures.py bifocal-demo`."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from bifocal.reports.view_workflow import view_relief

HERE = Path(__file__).parent
PANELS = (
    ("near.jpg", "two photos (here the near one)"),
    ("relief.png", "relief map"),
    ("ortho.png", "orthophoto to scale"),
)
WIDTH = 620


def panel(path: Path, label: str) -> Image.Image:
    """Return one picture at the common width with its label below."""
    picture = Image.open(path).convert("RGBA")
    white = Image.new("RGBA", picture.size, "white")
    picture = Image.alpha_composite(white, picture).convert("RGB")
    picture = picture.resize((WIDTH, round(picture.height * WIDTH / picture.width)), Image.LANCZOS)
    height = round(WIDTH * 2 / 3)
    sheet = Image.new("RGB", (WIDTH, height + 40), "white")
    sheet.paste(picture, (0, (height - picture.height) // 2))
    ImageDraw.Draw(sheet).text(
        (WIDTH / 2, height + 20), label, fill="#1b2733", anchor="mm",
        font=ImageFont.load_default(22),
    )  # fmt: skip
    return sheet


def main(folder: Path) -> None:
    """Write docs/images/demo.jpg, and the page of the relief in three dimensions."""
    view_relief(
        folder / "relief.tif", HERE / "relief-3d.html", ortho=folder / "ortho.tif",
        title="The sample façade", overwrite=True,
    )  # fmt: skip
    panels = [panel(folder / name, label) for name, label in PANELS]
    sheet = Image.new("RGB", (len(panels) * (WIDTH + 12) - 12, panels[0].height), "white")
    for k, picture in enumerate(panels):
        sheet.paste(picture, (k * (WIDTH + 12), 0))
    (HERE / "images").mkdir(exist_ok=True)
    sheet.save(HERE / "images" / "demo.jpg", quality=86, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "bifocal-demo"))
