"""``bifocal demo``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from photocore.cli import print_result, progress_bar, remark, text_table
from photocore.options import declared
from photocore.shared_options import JsonOption, OverwriteOption

if TYPE_CHECKING:
    from bifocal.demo.workflow import DemoResult


@dataclass(frozen=True, kw_only=True)
class DemoCommand:
    """The options of ``bifocal demo``, and examples.

    bifocal demo
    bifocal demo --out sample --overwrite
    bifocal demo --water --out under-water
    """

    out: Path = Path("bifocal-demo")
    """Folder for the results; it is made."""
    water: bool = False
    """A façade under water, through flat ports, from 3.5/1.9 m: bent rays, haze."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(DemoCommand)
def command(options: DemoCommand) -> None:
    """Survey a sample façade from two photos, and compare with the exact truth.

    The photos, 35/19 mm from 17.5/9.5 m, come with the package; targets picked on them go through
    the survey workbook; dense relief and the orthophoto follow. About a quarter of a minute.
    With --water it also says what neglecting refraction would cost.
    """
    from bifocal.demo.samples import FACADE, WATER
    from bifocal.demo.workflow import run_demo

    with progress_bar("Demo", quiet=options.as_json) as bar:

        def tell(done: float, total: float, what: str = "") -> None:
            bar(done, total, what)
            if what and not options.as_json:
                remark(f"... {what}")

        sample = WATER if options.water else FACADE
        result = run_demo(options.out, sample=sample, overwrite=options.overwrite, progress=tell)
    points = zip(result.ids, result.true, result.found, result.sigma, result.flags, strict=True)
    data = {
        "folder": result.folder, "rmse_targets": result.rmse,
        "map_median": result.map_median, f"map_beyond_{_limit(result, '')}": result.map_share,
        "map_known": result.map_known, "files": [name for name, _ in result.files],
        "points": [
            dict(zip(("id", "r_true", "r", "sigma_r", "flag"), point, strict=True))
            for point in points
        ],
    }  # fmt: skip
    if result.neglect is not None:
        data["median_neglecting_refraction"] = result.neglect
    print_result(data, _lines(result), as_json=options.as_json)


def _lines(result: DemoResult) -> Iterator[str]:
    """Yield found against true relief and where the results lie."""
    rows = []
    order = sorted(range(len(result.ids)), key=lambda k: float(result.true[k]))
    for k in order[:: max(1, len(order) // 12)]:
        error = float(result.found[k] - result.true[k])
        rows.append(
            (
                result.ids[k], f"{result.true[k]:+.4f}", f"{result.found[k]:+.4f}",
                f"{error * 1000:+.1f}", f"{result.sigma[k] * 1000:.1f}", result.flags[k],
            )
        )  # fmt: skip
    yield "\nRelief of targets picked to 0.2 px (a dozen of them)"
    yield text_table(("target", "true m", "found m", "error mm", "sigma mm", "flag"), rows)
    yield f"\nAll {len(result.ids)} targets: RMS error {result.rmse * 1000:.1f} mm"
    yield (
        f"Relief map: median error {result.map_median * 1000:.1f} mm, "
        f"{result.map_share:.1%} beyond {_limit(result, ' ')}, "
        f"{result.map_known:.1%} of the visible wall known"
    )
    if result.neglect is not None:
        yield (
            f"Without `layers` in the pair file, refraction neglected: median error "
            f"{result.neglect * 1000:.0f} mm, with perfect picks"
        )
    yield f"\nResults in {result.folder}/"
    yield text_table(("file", "content"), result.files)
    yield "\nOpen ortho.png, relief.png and result.xlsx first."


def _limit(result: DemoResult, space: str) -> str:
    """Return the limit of the map's errors with its unit."""
    if result.limit < 0.01:
        return f"{result.limit * 1000:g}{space}mm"
    return f"{result.limit * 100:g}{space}cm"
