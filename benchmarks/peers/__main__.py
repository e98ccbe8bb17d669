"""Every comparison with other programs on this machine, as one page.

    python -m benchmarks.peers                             all of them, at most 12 minutes
    python -m benchmarks.peers --only shift orthophoto     some of them
    python -m benchmarks.peers --page docs/benchmarks.md   the page, with its plots in images/

Each run has a process and one core of its own; times are processor seconds. A result is compared
with the truth before its time counts. Peers that are not installed are left out and named:
pip install -r benchmarks/peers/requirements.txt
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ONE_CORE = {key: "1" for key in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")} | {
    "OPENCV_FOR_THREADS_NUM": "1"
}


def _comparisons() -> dict[str, Any]:
    from benchmarks.peers import images, pairs, tables, water

    return {
        name: comparison
        for module in (water, images, pairs, tables)
        for name, comparison in module.COMPARISONS.items()
    }


def _run(words: list[str]) -> dict[str, Any]:
    """Run a part in a process of its own; return what it says, or why it failed."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.peers", "--child", *words],
        capture_output=True, text=True, env={**os.environ, **ONE_CORE}, check=False,
    )  # fmt: skip
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:] or ["no word"]
        return {"failed": last[0]}
    return dict(json.loads(done.stdout.splitlines()[-1]))


def _child(name: str, tool: str, size: str, folder: str) -> None:
    """Prepare data where no tool is named, else measure one run."""
    import cv2

    from benchmarks.peers.comparison import measured

    cv2.setNumThreads(1)
    comparison = _comparisons()[name]
    if not tool:
        comparison.prepare(int(size), Path(folder))
        print("{}")
        return
    print(json.dumps(measured(comparison.tools[tool].make(int(size), Path(folder)))))


def main() -> None:
    """Run, print, write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help="comparisons, by their names")
    parser.add_argument("--page", type=Path, help="a Markdown page; its plots go beside it")
    parser.add_argument("--list", action="store_true", help="names and tools")
    parser.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        _child(*given.child)
        return
    if given.page and not given.page.parent.is_dir():
        parser.error(f"{given.page}: the folder does not exist; create it first.")
    comparisons = _comparisons()
    unknown = set(given.only or ()) - set(comparisons)
    if unknown:
        parser.error(
            f"no comparison {', '.join(sorted(unknown))}; there are {', '.join(comparisons)}"
        )
    if given.list:
        for name, comparison in comparisons.items():
            print(f"{name:18s} {comparison.title}: {'; '.join(comparison.tools)}")
        return
    begin, found = time.monotonic(), {}
    for name, comparison in comparisons.items():
        if given.only and name not in given.only:
            continue
        if comparison.sizes:
            found[name] = _compared(name, comparison)
        else:
            print(f"\n{comparison.title}: no data here, see $BIFOCAL_DATA in CONTRIBUTING.md")
    minutes = (time.monotonic() - begin) / 60
    print(f"{minutes:.1f} minutes")
    if given.page:
        from benchmarks.peers.page import write_page

        write_page(given.page, comparisons, found, minutes)
        print(f"Written: {given.page}")


def _compared(name: str, comparison: Any) -> dict[str, dict[int, dict[str, Any]]]:
    """Return what was measured, by tool and size; tools that are not installed have nothing."""
    print(f"\n{comparison.title}")
    found: dict[str, dict[int, dict[str, Any]]] = {tool: {} for tool in comparison.tools}
    for size in comparison.sizes:
        with tempfile.TemporaryDirectory() as folder:
            if comparison.prepare is not None:
                told = _run([name, "", str(size), folder])
                if told:
                    print(f"  no data: {told['failed']}")
                    continue
            for tool, how in comparison.tools.items():
                if not how.version:
                    print(f"  {tool}: {how.package} is not installed")
                elif size <= how.largest:
                    one = found[tool][size] = _run([name, tool, str(size), folder])
                    print(f"  {size:9d} {tool:42s} {_in_words(one, comparison, size)}")
    return found


def _in_words(one: dict[str, Any], comparison: Any, size: int) -> str:
    if "failed" in one:
        return str(one["failed"])
    return (
        f"{one['seconds']:8.3f} s {one['seconds'] / size * 1e6:10.3f} us/{comparison.item} "
        f"{one['memory']:7.0f} MB  {one['error']:.2g} {comparison.error}"
    )


if __name__ == "__main__":
    main()
