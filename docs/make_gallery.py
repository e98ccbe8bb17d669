"""Write docs/gallery.md's table and pictures: `python docs/make_gallery.py [FOLDER]`.

Six rendered walls, whose relief is known everywhere, surveyed as any others: `bifocal facade`.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from PIL import Image, ImageDraw, ImageFont

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from bifocal import ReliefMap  # noqa: E402
from bifocal.cli.main import main as bifocal  # noqa: E402
from bifocal.model.relief_map import Quality  # noqa: E402
from bifocal.reports.control_survey import solve_control  # noqa: E402
from photocore.tables import write_csv  # noqa: E402
from tests.scenes import (  # noqa: E402
    POOR,
    RICH,
    Material,
    Rendering,
    Scene,
    SetupErrors,
    bifocal_cameras,
    facade,
    render,
)
from tests.scenes.balconies import balconies  # noqa: E402
from tests.scenes.church import church  # noqa: E402
from tests.scenes.delivery import AWAY, edge_distance  # noqa: E402
from tests.scenes.loggia import loggia  # noqa: E402

#: Photos [px], a pixel on the wall [m], the precision of picks [px] and of measured points [m].
SIZE, PIXEL, PICK, SITE = (1152, 768), 0.00984, 0.3, 0.003
#: Measured points that hold the pair, and independent ones.
HELD, CHECKED = 10, 20
BRICK = replace(
    RICH, wall=Material(colour=(0.55, 0.27, 0.20), contrast=0.09, courses=(0.075, 0.25, 0.008))
)
GREY = replace(RICH, stone=Material(colour=(0.55, 0.55, 0.52), contrast=0.09))
WALLS: dict[str, tuple[str, Callable[..., Scene], dict[str, object]]] = {
    "palace": ("plaster and ashlar", facade, {"seed": 11, "palette": RICH, "targets": False}),
    "brick": ("brick", facade, {"seed": 23, "palette": BRICK, "targets": False}),
    "plain": ("plain plaster, hardly any texture", facade,
              {"seed": 5, "palette": POOR, "targets": False}),
    "church": ("buttresses, rose, portal", church, {"seed": 3, "palette": GREY}),
    "loggia": ("portals, bars, a balcony", loggia, {"seed": 5, "palette": RICH}),
    "balconies": ("iron balconies, steps", balconies, {"seed": 2, "palette": RICH}),
}  # fmt: skip
OPTIONS = ("--focal1", "35", "--focal2", "19", "--sensor-width", "22.67", "--scale", "1:100")
#: Height of a picture in the docs. [px]
HEIGHT = 330
MARK = "<!-- figures -->"


def shot_of(make: Callable[..., Scene], how: dict[str, object], seed: int) -> Rendering:
    """Return both photos of a wall, taken by hand: stations and lenses a little off."""
    rng = np.random.default_rng(seed)
    cameras = bifocal_cameras(size=SIZE, pixel=PIXEL, errors=SetupErrors(), rng=rng)
    return render(make(texel=PIXEL / 2, **how), cameras, rng=rng)


def write_points(folder: Path, shot: Rendering, seed: int) -> None:
    """Write points that both photos show, away from edges, measured and picked with errors."""
    rng = np.random.default_rng(seed)
    good = shot.visible1 & shot.visible2 & (edge_distance(shot.truth.r) > AWAY)
    xy = shot.truth.plane_positions()[good]
    xyz = np.column_stack([xy, shot.truth.r[good]]).astype(float)
    pixels = shot.pair.project(xyz)
    inside = np.all([((p > 8) & (p < np.subtract(SIZE, 9))).all(axis=1) for p in pixels], axis=0)
    rows = np.flatnonzero(inside)
    chosen: list[int] = []
    for row in rng.permutation(rows):
        if all(np.hypot(*(xyz[row, :2] - xyz[other, :2])) > 1.0 for other in chosen):
            chosen.append(int(row))
        if len(chosen) == HELD + CHECKED:
            break
    for name, part in (("points.csv", chosen[:HELD]), ("check.csv", chosen[HELD:])):
        columns: dict[str, object] = {"id": tuple(f"P{k}" for k in part)}
        measured = xyz[part] + rng.normal(0, SITE, (len(part), 3))
        columns |= dict(zip(("X [m]", "Y [m]", "r [m]"), np.round(measured, 4).T, strict=True))
        for number, seen in enumerate(pixels, start=1):
            picked = np.round(seen[part] + rng.normal(0, PICK, (len(part), 2)), 2)
            columns |= {f"col{number} [px]": picked[:, 0], f"row{number} [px]": picked[:, 1]}
        write_csv(folder / name, columns, overwrite=True)


def survey(folder: Path, shot: Rendering, seed: int) -> tuple[list[str], Image.Image]:
    """Survey a wall; return its row of figures and its picture."""
    for name, image in (("far.png", shot.image1), ("near.png", shot.image2)):
        Image.fromarray(image).save(folder / name)
    write_points(folder, shot, seed)
    given = [str(folder / name) for name in ("far.png", "near.png", "points.csv", "check.csv")]
    out = folder / "wall"
    words = ["facade", *given[:2], "--control", given[2], "--check", given[3], *OPTIONS]
    words += ["--products", "relief,drawing", "--out", str(out)]
    run = CliRunner().invoke(bifocal, words, catch_exceptions=False)
    if run.exit_code:
        raise SystemExit(f"{folder}: {run.stderr}")
    pair = out / "align" / "wall.pair.json"
    check = solve_control(pair, control=Path(given[2]), check=Path(given[3])).check
    assert check is not None
    errors = 1000 * np.sqrt(np.nanmean(np.square(check.errors), axis=0))
    relief = ReliefMap.read(out / "relief" / "wall_relief.tif")
    both = shot.visible1 & shot.visible2 & np.isfinite(shot.truth.r)
    places = shot.truth.plane_positions()[both]
    found = relief.sample(places)
    known = np.isfinite(found)
    off = np.abs(found - shot.truth.r[both])[known]
    share = float((relief.quality == Quality.MEASURED).sum() / np.isfinite(relief.r).sum())
    figures = [*(f"{value:.0f}" for value in errors), f"{1000 * np.median(off):.1f}",
               f"{100 * (off > 0.03).mean():.1f}", f"{100 * share:.0f}"]  # fmt: skip
    sheets = [Image.fromarray(shot.image1)]
    sheets += [Image.open(out / "drawing" / f"wall{part}.png") for part in ("", "_relief")]
    return figures, side_by_side(sheets)


def side_by_side(pictures: list[Image.Image]) -> Image.Image:
    """Return pictures in one row, of one height, with what they are below."""
    small = []
    for picture in pictures:
        white = Image.new("RGBA", picture.size, "white")
        flat = Image.alpha_composite(white, picture.convert("RGBA")).convert("RGB")
        small.append(flat.resize((round(flat.width * HEIGHT / flat.height), HEIGHT), Image.LANCZOS))
    row = Image.new("RGB", (sum(one.width for one in small) + 20, HEIGHT + 26), "white")
    left, labels = 0, ("far photo", "orthophoto", "relief")
    for one, label in zip(small, labels, strict=True):
        row.paste(one, (left, 0))
        ImageDraw.Draw(row).text(
            (left + one.width / 2, HEIGHT + 13), label, fill="#1b2733", anchor="mm",
            font=ImageFont.load_default(16),
        )  # fmt: skip
        left += one.width + 10
    return row


def main(folder: Path, page: Path) -> None:
    """Survey all walls; write their pictures and the table of the page."""
    lines = ["| wall | X | Y | r | map | beyond 3 cm | measured |", "|---|---|---|---|---|---|---|"]
    for seed, (name, (what, make, how)) in enumerate(WALLS.items()):
        with tempfile.TemporaryDirectory() as place:
            figures, picture = survey(Path(place), shot_of(make, how, seed), seed)
        picture.save(folder / f"gallery-{name}.jpg", quality=82, optimize=True)
        lines.append(f"| {name}: {what} | {' | '.join(figures)} |")
        print(lines[-1], flush=True)  # noqa: T201
    before, _, after = page.read_text("utf-8").split(MARK)
    page.write_text(MARK.join((before, "\n" + "\n".join(lines) + "\n", after)), "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "images", HERE / "gallery.md")
