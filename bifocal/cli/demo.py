"""``bifocal demo``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from photocore.cli import print_json, progress_bar, remark, text_table

if TYPE_CHECKING:
    from bifocal.demo.workflow import DemoResult

EXAMPLE = """\b
Examples:
  bifocal demo
  bifocal demo --out sample --overwrite
"""


@click.command(
    short_help="The whole workflow on the sample pair that ships with the package.",
    epilog=EXAMPLE,
)
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("bifocal-demo"), show_default=True,
    help="Folder for the results; it is made.",
)  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace the results of an earlier demo.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(out: Path, overwrite: bool, as_json: bool) -> None:
    """Survey a sample façade from two photos, and compare with the exact truth.

    The photos, 35/19 mm from 17.5/9.5 m, come with the package; targets picked on them go through
    the survey workbook; dense relief and the orthophoto follow. About a quarter of a minute.
    """
    from bifocal.demo.workflow import run_demo

    with progress_bar("Demo", quiet=as_json) as bar:

        def tell(done: float, total: float, what: str = "") -> None:
            bar(done, total, what)
            if what and not as_json:
                remark(f"... {what}")

        result = run_demo(out, overwrite=overwrite, progress=tell)
    if as_json:
        print_json(
            {
                "folder": result.folder, "rmse_targets": result.rmse,
                "map_median": result.map_median, "map_beyond_3cm": result.map_share,
                "map_known": result.map_known, "files": [name for name, _ in result.files],
                "points": [
                    {"id": i, "r_true": t, "r": r, "sigma_r": s, "flag": f}
                    for i, t, r, s, f in zip(
                        result.ids, result.true, result.found, result.sigma, result.flags,
                        strict=True,
                    )
                ],
            }
        )  # fmt: skip
    else:
        _print(result)


def _print(result: DemoResult) -> None:
    """Print found against true relief and where the results lie."""
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
    click.echo("\nRelief of targets picked to 0.2 px (a dozen of them)")
    click.echo(text_table(("target", "true m", "found m", "error mm", "sigma mm", "flag"), rows))
    click.echo(f"\nAll {len(result.ids)} targets: RMS error {result.rmse * 1000:.1f} mm")
    click.echo(
        f"Relief map: median error {result.map_median * 1000:.1f} mm, "
        f"{result.map_share:.1%} beyond 3 cm, {result.map_known:.1%} of the visible wall known"
    )
    click.echo(f"\nResults in {result.folder}/")
    click.echo(text_table(("file", "content"), result.files))
    click.echo("\nOpen ortho.png, relief.png and result.xlsx first.")
