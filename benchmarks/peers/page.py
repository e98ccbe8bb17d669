"""The page of a run: conditions, tables, and how time and memory grow."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers.comparison import Comparison

#: By tool and size: seconds, memory, error, or why it failed.
Found = Mapping[str, Mapping[int, Mapping[str, Any]]]
INTRODUCTION = """# Beside other programs

Written by `python -m benchmarks.peers`, which runs every comparison anew on your machine. Every run
has a process and one core of its own; times are processor seconds, the least of several; memory is
what a run needs beyond its data. A result is compared with the truth first: the column *error* is
that of the largest size. A ratio of 2 means: takes twice as long as the first line. Growth is the
exponent of time over size: 1 is in proportion.
"""


def write_page(
    page: Path, comparisons: Mapping[str, Comparison], found: Mapping[str, Found], minutes: float
) -> None:
    """Write a Markdown page, and its plots beside it in ``images``."""
    lines = [INTRODUCTION, *_conditions(minutes)]
    for name, results in found.items():
        comparison = comparisons[name]
        lines += ["", f"## {comparison.title}", "", comparison.data, ""]
        lines += _table(comparison, results)
        failed = sorted(
            {
                f"{tool}: {one['failed']}"
                for tool, sizes in results.items()
                for one in sizes.values()
                if "failed" in one
            }
        )
        if failed:
            lines += ["", "Failed: " + "; ".join(failed)]
        if len(comparison.sizes) > 1:
            picture = page.parent / "images" / f"peers-{name}.svg"
            picture.parent.mkdir(parents=True, exist_ok=True)
            _draw(picture, comparison, results)
            growth = f"Time and memory of each tool over the number of {comparison.item}s"
            lines += ["", f"![{growth}](images/{picture.name})"]
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _conditions(minutes: float) -> list[str]:
    return [
        f"Run on {datetime.now(UTC).date().isoformat()}, {minutes:.0f} minutes: {_processor()}, "
        f"{os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}, "
        f"NumPy {np.__version__}."
    ]


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text("utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in text.splitlines() if "model name" in line]
    return names[0] if names else platform.machine()


def _table(comparison: Comparison, found: Found) -> list[str]:
    sizes = comparison.sizes
    heads = [f"{_count(size)} {comparison.item}s" for size in sizes]
    lines = [
        "| tool | " + " | ".join([*heads, "ratio", "growth", "memory", comparison.error]) + " |",
        "|---" * (len(sizes) + 5) + "|",
    ]
    first = next(iter(comparison.tools))
    for tool, how in comparison.tools.items():
        good = {size: one for size, one in found[tool].items() if "failed" not in one}
        if not good:
            why = "failed" if found[tool] else f"{how.package} not installed"
            lines.append(f"| {tool} | " + " | ".join([why, *[""] * (len(sizes) + 3)]) + " |")
            continue
        times = [_time(good[size]["seconds"]) if size in good else "" for size in sizes]
        largest = max(good)
        base = found[first].get(largest, {}).get("seconds")
        ratio = f"{good[largest]['seconds'] / base:.2g}" if base else ""
        last = [ratio, _growth(good), f"{good[largest]['memory']:.0f} MB"]
        name = tool if how.package == "bifocal-relief" else f"{tool} ({how.package} {how.version})"
        row = [*times, *last, f"{good[largest]['error']:.2g}"]
        lines.append(f"| {name} | " + " | ".join(row) + " |")
    return lines


def _growth(good: Mapping[int, Mapping[str, Any]]) -> str:
    """Return the slope of log time over log size."""
    if len(good) < 2:
        return ""
    seconds = [max(one["seconds"], 1e-7) for one in good.values()]
    return f"{np.polyfit(np.log(list(good)), np.log(seconds), 1)[0]:.2f}"


def _count(size: int) -> str:
    if size >= 1_000_000:
        return f"{size / 1e6:g} million"
    return f"{size:,}".replace(",", " ")


def _time(seconds: float) -> str:
    if seconds >= 1:
        return f"{seconds:.3g} s"
    return f"{1000 * seconds:.3g} ms"


def _draw(path: Path, comparison: Comparison, found: Found) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    # The same run gives the same file.
    mpl.rcParams["svg.hashsalt"] = path.stem
    figure, panels = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    for panel, key, label in zip(
        panels, ("seconds", "memory"), ("processor time [s]", "memory [MB]"), strict=True
    ):
        for number, (tool, sizes) in enumerate(found.items()):
            good = {n: one[key] for n, one in sizes.items() if one.get(key, 0) > 0}
            if good:
                panel.plot(list(good), list(good.values()), "os^Dv"[number % 5] + "-", label=tool)
        panel.set(xscale="log", yscale="log", xlabel=f"{comparison.item}s", ylabel=label)
        panel.grid(visible=True, which="major", color="0.88")
    panels[0].legend(fontsize=8, frameon=False)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)
