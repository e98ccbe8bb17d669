"""Forty pairs on two cores: killed and resumed, what the bookkeeping costs, memory, a second run.

    python benchmarks/bench_campaign.py [FOLDER] [PAIRS] [WIDTH]

Renders PAIRS walls (default 40, photos 300 px wide; two are broken on purpose), unless FOLDER has
them, and runs:

- the bare steps of every pair, one call after the other in one process, nothing recorded;
- `bifocal survey` undisturbed, one pair at once;
- `bifocal survey` with two at once and 2.5 GiB, killed five times at random moments;
- the same once more, with nothing changed.

CPU seconds are those of all processes; memory is the proportional set size of them all. Products
of the second and the third must be the same to the last byte. About twenty minutes
of two cores.
"""

from __future__ import annotations

import hashlib
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

PRODUCTS = ("relief", "points", "drawing", "report")
MEMORY_GIB = 2.5
KILLS, SEED = 5, 16


def bare(survey: Path, out: Path) -> None:
    """Run the steps of every pair and nothing else."""
    import cv2

    from bifocal.campaigns.pair_steps import steps_of
    from bifocal.campaigns.survey_file import read_survey_file
    from photocore.cli import no_progress
    from photocore.errors import PhotogrammetryError

    cv2.setNumThreads(1)
    for job in read_survey_file(survey, out=out):
        try:
            for step in steps_of(job):
                (job.folder / step.name).mkdir(parents=True)
                step.make(job.folder / step.name, no_progress)
        except PhotogrammetryError as error:
            print(f"  {job.name}: {str(error)[:70]}")


def digests(folder: Path) -> dict[str, str]:
    """Return the hashes of all products."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith(".")
    }


def children() -> float:
    """Return the CPU time of all processes that ended. [s]"""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def memory(root: int) -> float:
    """Return the memory of a process and its descendants, shared pages shared out. [GiB]"""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
        except (OSError, IndexError):
            continue
    family = {root}
    while more := {pid for pid, parent in parents.items() if parent in family} - family:
        family |= more
    total = 0
    for pid in family:
        try:
            rows = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        except OSError:
            continue
        total += sum(int(row.split()[1]) for row in rows if row.startswith("Pss:"))
    return total / (1 << 20)


def run(words: list[str], end: float = float("inf")) -> tuple[float, float, float, str]:
    """Run a command, killed after ``end`` seconds; return CPU, wall time, memory, what it said."""
    words = [sys.executable, *words]
    before, start, peak = children(), time.perf_counter(), 0.0
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen(words, stdout=said, stderr=subprocess.STDOUT, text=True)
        while process.poll() is None:
            peak = max(peak, memory(process.pid))
            if time.perf_counter() - start > end:
                process.send_signal(signal.SIGKILL)
                process.wait()
            time.sleep(0.1 if end > 10 else 0.02)
        said.seek(0)
        text = said.read()
    return children() - before, time.perf_counter() - start, peak, text


def main(folder: Path, pairs: int, width: int) -> None:
    """Run all and print the figures."""
    from tests.bifocal.campaigns.rendered_survey import write_rendered_survey

    survey = folder / "survey" / "street.toml"
    if not survey.exists():
        write_rendered_survey(survey.parent, pairs=pairs, width=width, products=PRODUCTS)
    command = ["-m", "bifocal", "survey", str(survey), "--out"]
    cpu_bare, *_, text = run([__file__, "--bare", str(survey), str(folder / "bare")])
    print(text, f"bare steps: {cpu_bare:.1f} CPU s", sep="", flush=True)
    cpu, wall, peak, text = run([*command, str(folder / "whole"), "--jobs", "1"])
    print(f"survey, one at once: {cpu:.1f} CPU s, {wall:.1f} s, {peak:.2f} GiB at most")
    print(f"  overhead {cpu / cpu_bare - 1:+.1%}\n{text}", flush=True)
    rng = np.random.default_rng(SEED)
    limited = [*command, str(folder / "killed"), "--jobs", "2", "--memory", str(MEMORY_GIB)]
    peaks = []
    for pause in rng.uniform(0.05, 0.28, KILLS) * cpu / 2:
        *_, peak, _ = run(limited, end=pause)
        peaks.append(peak)
        ended = len(list((folder / "killed").glob("*/report")))
        print(f"killed after {pause:.1f} s, {ended} pairs whole", flush=True)
    cpu, wall, peak, text = run(limited)
    print(f"resumed: {cpu:.1f} CPU s, {wall:.1f} s; {max(*peaks, peak):.2f} GiB at most\n{text}")
    whole, killed = digests(folder / "whole"), digests(folder / "killed")
    other = [name for name in whole.keys() | killed.keys() if whole.get(name) != killed.get(name)]
    print(f"{len(whole)} files, {len(other)} differ {sorted(other)[:5]}", flush=True)
    cpu, wall, peak, text = run(limited)
    print(f"a second run: {cpu:.2f} CPU s, {wall:.2f} s, {peak:.2f} GiB\n{text.splitlines()[0]}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--bare"]:
        bare(Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        sys.path.insert(0, str(Path(__file__).parents[1]))
        given = sys.argv[1:]
        sizes = [int(word) for word in given[1:]] + [40, 300][len(given[1:]) :]
        if given:
            main(Path(given[0]), *sizes)
        else:
            with tempfile.TemporaryDirectory() as place:
                main(Path(place), *sizes)
