"""An adjustment as one self-contained HTML page: unknowns, residual vectors, correlations."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from multimedia.adjustment.unknowns import Adjustment
from photocore.output import atomic_path

#: Correlations from here on are printed bold: two unknowns that can hardly be told apart.
STRONG = 0.9
#: More unknowns than this would make a table nobody reads; only strong pairs are listed then.
_LARGEST_TABLE = 45

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:72em;padding:0 1em;color:#1b2733}
h1{margin-bottom:0}h2{margin-top:2em;border-bottom:1px solid #c8d2dc}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}
td,th{padding:.15em .7em;text-align:right;border-bottom:1px solid #e3e9ef}
td:first-child,th:first-child{text-align:left}
.images{display:flex;flex-wrap:wrap;gap:1.5em}figure{margin:0}figcaption{font-size:.9em}
.corr{font-size:11px}.corr td,.corr th{padding:.1em .3em;border:0}
.corr th.turn{writing-mode:vertical-rl;transform:rotate(180deg);text-align:left}
.warn{background:#fff3d6;padding:.5em 1em;border-left:4px solid #d79b00}
"""


def write_adjustment_report(
    path: Path | str, result: Adjustment, *, title: str, notes: tuple[str, ...] = (),
    overwrite: bool = False,
) -> None:  # fmt: skip
    """Write the page; no file beside it, no connection needed to read it.

    Raises
    ------
    InputError
        If the file exists and ``overwrite`` is false, or cannot be written.
    """
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        f"<title>{escape(title)}</title><style>{_STYLE}</style><h1>{escape(title)}</h1>",
        _summary(result),
        *(f"<p class=warn>{escape(note)}</p>" for note in (*notes, *result.remarks)),
        "<h2>Unknowns</h2>",
        _unknowns(result),
        "<h2>Residuals</h2>",
        _residuals(result),
        "<h2>Suspected gross errors</h2>",
        _suspects(result),
        "<h2>Correlations</h2>",
        _correlations(result),
        "<h2>Object points</h2>",
        _points(result),
    ]
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_text("\n".join(parts), encoding="utf-8")


def _summary(result: Adjustment) -> str:
    """Return the head figures."""
    count = int(np.isfinite(result.residuals[:, 0]).sum())
    return (
        f"<p>{count} image points in {len(result.project.cameras)} cameras, "
        f"{len(result.names)} unknowns besides object points, redundancy {result.redundancy}, "
        f"{result.iterations} iterations.<br><b>sigma0 = {result.sigma0 * 1000:.3f} um</b></p>"
    )


def _unknowns(result: Adjustment) -> str:
    """Return the table of adjusted values with their standard deviations."""
    rows = []
    for name, value, sigma, unit in result.rows():
        digits = max(0, min(12, 2 - int(np.floor(np.log10(sigma))) if sigma > 0 else 6))
        rows.append(
            f"<tr><td>{escape(name)}<td>{value:.{digits}f}<td>{sigma:.{digits}f}<td>{unit}</tr>"
        )
    return "<table><tr><th>unknown<th>value<th>sigma<th></tr>" + "".join(rows) + "</table>"


def _residuals(result: Adjustment) -> str:
    """Return a figure of residual vectors for every camera."""
    images = result.project.image_points
    figures = []
    every = np.hypot(*result.residuals.T)
    typical = float(np.nanmedian(every)) if np.isfinite(every).any() else 1.0
    for camera in result.project.cameras:
        rows = images.of_camera(camera.name)
        place, miss = images.image[rows], result.residuals[rows]
        good = np.isfinite(miss[:, 0])
        if not good.any():
            continue
        reach = float(np.abs(place[good]).max()) * 1.1
        if camera.sensor is not None:
            reach = float(max(camera.sensor.width, camera.sensor.height) * max(camera.sensor.pitch))
            reach /= 2
        scale = reach / 15 / max(typical, 1e-12)
        lines = []
        for (x, y), (dx, dy), name in zip(
            place[good], miss[good], np.array(images.ids)[rows][good], strict=True
        ):
            large = np.hypot(dx, dy) > 4 * typical
            lines.append(
                f"<line x1={x:.4f} y1={-y:.4f} x2={x + dx * scale:.4f} y2={-y - dy * scale:.4f} "
                f"stroke='{'#c0392b' if large else '#1f6fb2'}'><title>{escape(str(name))}: "
                f"{dx * 1000:.1f}, {dy * 1000:.1f} um</title></line>"
            )
        box = f"{-reach:.4f} {-reach:.4f} {2 * reach:.4f} {2 * reach:.4f}"
        rms = float(np.sqrt(np.mean(miss[good] ** 2)) * 1000)
        hidden = result.smallest_detectable[rows]
        least = float(np.nanmedian(hidden)) * 1000 if np.isfinite(hidden).any() else float("nan")
        figures.append(
            f"<figure><svg width=340 height=340 viewBox='{box}' role=img "
            f"aria-label='Residual vectors of camera {escape(camera.name)}'>"
            f"<rect x={-reach:.4f} y={-reach:.4f} width={2 * reach:.4f} height={2 * reach:.4f} "
            f"fill='#f6f8fa' stroke='#c8d2dc' stroke-width={reach / 200:.5f} />"
            f"<g stroke-width={reach / 150:.5f}>{''.join(lines)}</g></svg>"
            f"<figcaption>camera {escape(camera.name)}: {int(good.sum())} points, RMS "
            f"{rms:.2f} um, sigma0 {result.sigma0_of[camera.name] * 1000:.2f} um, "
            f"vectors {scale:.0f} x; a gross error is found from {least:.1f} um on "
            "(median, 80 % power)</figcaption></figure>"
        )
    return "<div class=images>" + "".join(figures) + "</div>"


def _suspects(result: Adjustment) -> str:
    """Return the list of suspects, or a word that there are none."""
    suspects = result.suspects()
    if not suspects:
        return "<p>None beyond 3.5 standard deviations.</p>"
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in suspects[:50])
    more = f"<p>... and {len(suspects) - 50} more.</p>" if len(suspects) > 50 else ""
    return f"<ol>{items}</ol>{more}"


def _correlations(result: Adjustment) -> str:
    """Return the coloured table, or the strong pairs when it would be too large."""
    matrix, names = result.correlations, result.names
    if len(names) > _LARGEST_TABLE:
        first, second = np.nonzero(np.triu(np.abs(matrix) > STRONG, 1))
        order = np.argsort(-np.abs(matrix[first, second]))[:200]
        rows = "".join(
            f"<tr><td>{escape(names[i])}<td>{escape(names[j])}<td>{matrix[i, j]:+.3f}</tr>"
            for i, j in zip(first[order], second[order], strict=True)
        )
        return f"<p>Pairs beyond {STRONG}:</p><table>{rows}</table>"
    head = "".join(f"<th class=turn>{escape(name)}" for name in names)
    lines = []
    for i, name in enumerate(names):
        cells = []
        for j in range(i + 1):
            value = matrix[i, j]
            shade = f"rgba({'192,57,43' if value > 0 else '31,111,178'},{abs(value) * 0.8:.2f})"
            text = f"<b>{value * 100:.0f}</b>" if abs(value) > STRONG else f"{value * 100:.0f}"
            cells.append(f"<td style='background:{shade}'>{text}")
        lines.append(f"<tr><th>{escape(name)}{''.join(cells)}</tr>")
    return (
        "<p>In per cent; bold: hardly told apart.</p>"
        f"<table class=corr><tr><th>{head}</tr>{''.join(lines)}</table>"
    )


def _points(result: Adjustment) -> str:
    """Return the adjusted points that were not fixed, the least precise first."""
    points = result.project.object_points
    sigma = np.sqrt(np.diagonal(result.point_covariance, axis1=1, axis2=2))
    size = np.linalg.norm(np.nan_to_num(sigma), axis=1)
    order = [int(j) for j in np.argsort(-size) if size[j] > 0]
    if not order:
        return "<p>All object points were fixed.</p>"
    rms = np.sqrt(np.mean(sigma[order] ** 2, axis=0))
    unit = escape(result.project.unit)
    rows = "".join(
        f"<tr><td>{escape(points.ids[j])}"
        + "".join(f"<td>{v:.5f}" for v in points.xyz[j])
        + "".join(f"<td>{v:.2g}" for v in sigma[j])
        + "</tr>"
        for j in order[:200]
    )
    more = f"<p>... and {len(order) - 200} more.</p>" if len(order) > 200 else ""
    return (
        f"<p>{len(order)} points; RMS of the standard deviations "
        f"{rms[0]:.3g} / {rms[1]:.3g} / {rms[2]:.3g} {unit} in X / Y / Z; least precise first.</p>"
        f"<table><tr><th>point<th>X<th>Y<th>Z<th>sigma X<th>sigma Y<th>sigma Z</tr>{rows}</table>"
        + more
    )
