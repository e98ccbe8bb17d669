"""The comparison with other programs: what it measures is right, and its page says what was run."""

from __future__ import annotations

import re

import pytest

from benchmarks.peers import images, pairs, tables, water
from benchmarks.peers.comparison import Comparison, Task, Tool, measured
from benchmarks.peers.page import write_page

MODULES = (water, images, pairs, tables)


def test_ours_comes_first_in_every_comparison():
    for module in MODULES:
        for comparison in module.COMPARISONS.values():
            assert next(iter(comparison.tools.values())).package == "bifocal-relief"
            assert list(comparison.sizes) == sorted(comparison.sizes)


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("shift", 1e-12),
        ("projection", 1e-12),
        ("epipolar", 1e-9),
        pytest.param("resection", 1.0, marks=pytest.mark.acceptance),
    ],
)
def test_a_result_is_held_against_the_truth(name, limit):
    comparison = water.COMPARISONS[name]
    task = next(iter(comparison.tools.values())).make(comparison.sizes[0], None)
    assert task.error(task.work()) < limit


def test_the_page_tells_ratio_growth_and_what_is_missing(tmp_path):
    def never(_size, _folder):
        raise AssertionError

    comparison = Comparison(
        title="A thing done", data="Made.", item="point", error="error [mm]", sizes=(10, 100),
        tools={
            "ours": Tool(never, "bifocal-relief"),
            "theirs": Tool(never, "numpy"),
            "absent": Tool(never, "no-such-package"),
        },
    )  # fmt: skip
    one = {"seconds": 0.01, "memory": 2.0, "error": 1e-9}
    found = {
        "ours": {10: one, 100: one | {"seconds": 0.1}},
        "theirs": {10: one, 100: one | {"seconds": 1.0}},
        "absent": {},
    }
    write_page(tmp_path / "page.md", {"thing": comparison}, {"thing": found}, 1.0)
    text = (tmp_path / "page.md").read_text("utf-8")
    assert re.search(r"\| ours \| 10 ms \| 100 ms \| 1 \| 1.00 \| 2 MB \| 1e-09 \|", text)
    assert re.search(r"\| theirs \(numpy [\d.]+\) \| 10 ms \| 1 s \| 10 \| 2.00 \|", text)
    assert "no-such-package not installed" in text
    assert (tmp_path / "images/peers-thing.svg").exists()


def test_time_and_error_are_those_of_the_work():
    found = measured(Task(lambda: sum(range(2_000_000)), lambda total: total - 1_999_999_000_000))
    assert found["error"] == 0
    assert found["seconds"] > 0
