"""``bifocal calibrate``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click

from bifocal.options import LensDatabaseOptions
from photocore.cli import print_result, progress_bar, remark, text_table
from photocore.option_types import POSITIVE, Size
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption, PatternOption

if TYPE_CHECKING:
    from bifocal.calibration import Calibration


@dataclass(frozen=True, kw_only=True)
class CalibrateCommand:
    """The options of ``bifocal calibrate``, and examples.

    bifocal calibrate board*.jpg --out lens35.json
    bifocal calibrate charuco*.jpg --pattern charuco --board 8x11 --out lens35.json
    bifocal calibrate facade.jpg --straight-edges --focal-px 4740 --out lens35.json
    bifocal calibrate facade.jpg --lines lines.csv --out lens35.json
    bifocal calibrate facade.jpg --database --out lens35.json

    One lens file holds for one lens at one focus and one zoom mark.
    """

    images: Annotated[tuple[Path, ...], Argument(unit="IMAGE...")]
    out: Path
    """The lens file."""
    pattern: PatternOption = "chessboard"
    board: Annotated[tuple[int, int] | None, Typed(Size(least=1, whole=True))] = None
    """Inner corners of a chessboard, circles of a grid, squares of a ChArUco board, across x
    up.  [default: chessboard recognised by itself]"""
    model: Literal["auto", "k1", "k1k2", "k1k2p", "k1k2pk3", "fisheye"] = "auto"
    """Distortion terms; auto takes in what an F test at 1 % asks for."""
    straight_edges: bool = False
    """No board: use the straight edges of a façade (radial terms only)."""
    lines: Path | None = None
    """No board: points picked along straight lines; headings line, col [px], row [px]."""
    focal_px: Annotated[float | None, Typed(POSITIVE, "PX")] = None
    """With lines: principal distance [px]."""
    database: bool = False
    """Take the lens database's data for this photo."""
    lens_database: LensDatabaseOptions = field(default_factory=LensDatabaseOptions)
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(CalibrateCommand)
def command(
    images: tuple[Path, ...], out: Path, straight_edges: bool, lines: Path | None, database: bool,
    focal_px: float | None, overwrite: bool, as_json: bool, **options: Any,
) -> None:  # fmt: skip
    """Find principal distance, principal point and distortion of a lens.

    From ten or more photos of a flat board, tilted differently and filling every corner; or, where
    there is no board, from straight lines of a façade or from the lens database.
    """
    from bifocal.calibration import workflow as lenses

    if sum([straight_edges or lines is not None, database]) > 1:
        raise click.UsageError("choose one of board photos, straight lines and --database.")
    of_board = {name: options.pop(name) for name in ("pattern", "board", "model")}
    if database:
        lens, notes = lenses.write_database_lens(images[0], out, overwrite=overwrite, **options)
        data, text = lens.to_dict(), [f"Lens: {lens.source}"]
    elif straight_edges or lines is not None:
        fit, notes = lenses.calibrate_from_edges(
            images, out, lines=lines, focal_px=focal_px, overwrite=overwrite
        )
        k1, k2 = fit.lens.coefficients[:2]
        text = [
            f"{fit.lines} lines; straight to {fit.rms_before:.2f} px before, "
            f"{fit.rms_after:.2f} px after the correction",
            f"k1 = {k1:+.5f} (sigma {fit.sigma_k1:.5f}), k2 = {k2:+.5f} ({fit.sigma_k2:.5f})"
            if fit.straightens
            else "no distortion: k1 = k2 = 0",
        ]
        data = fit.lens.to_dict()
    else:
        with progress_bar("Calibrating", quiet=as_json) as progress:
            result = lenses.calibrate_from_boards(
                images, out, overwrite=overwrite, progress=progress, **of_board
            )
        notes = tuple(f"{name}: the board was not found; left out" for name in result.without_board)
        keys = ("photo_rms", "dropped", "tried", "without_board", "suspicious")
        data = result.lens.to_dict() | {key: getattr(result, key) for key in keys}
        data["tried"] = dict(result.tried)
        text = _board_text(result)
    print_result(data, text, as_json=as_json, remarks=notes)
    remark(f"Lens file written to {out}")


def _board_text(result: Calibration) -> list[str]:
    """Return the calibration in words and tables."""
    lens, sigma = result.lens, result.standard_deviations
    matrix = lens.camera_matrix
    values = dict(zip(("fx", "fy", "cx", "cy"), matrix[[0, 1, 0, 1], [0, 1, 2, 2]], strict=True))
    names = ("k1", "k2", "k3", "k4") if lens.model == "fisheye" else ("k1", "k2", "p1", "p2", "k3")
    values |= dict(zip(names, lens.coefficients.tolist(), strict=False))
    rows = [
        (name, *(f"{one:.{3 if name[0] in 'fc' else 6}f}" for one in (value, sigma[name])))
        for name, value in values.items()
        if name in sigma
    ]
    text = [text_table(("", "value", "sigma"), rows), f"\nRMS {lens.sigma0:.3f} px; {lens.source}"]
    if result.tried:
        text.append("Models: " + ", ".join(f"{name} {rms:.3f} px" for name, rms in result.tried))
    text.append("\nPhotos, RMS [px]:")
    text += [f"  {name}  {value:.3f}" for name, value in result.photo_rms.items()]
    text += [f"Left out, does not fit the others: {name}" for name in result.dropped]
    text += [f"Look at it, much worse than the others: {name}" for name in result.suspicious]
    text.append("\nCoverage, board points per part of the photo:")
    text += ["  " + " ".join(f"{count:4d}" for count in row) for row in result.coverage.tolist()]
    text.append(f"\nVerdict: {result.verdict}")
    return text
