"""``bifocal demo``: what a newcomer sees first."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from bifocal.cli.main import main


@pytest.mark.acceptance
def test_the_demo_finds_the_truth_and_says_where_the_results_lie(tmp_path):
    out = tmp_path / "demo"
    result = CliRunner().invoke(main, ["demo", "--out", str(out), "--json"])
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    assert {path.name for path in out.iterdir()} == set(data["files"])
    assert data["map_median"] < 0.003
    pulls = [(p["r"] - p["r_true"]) / p["sigma_r"] for p in data["points"] if p["flag"] == "OK"]
    assert np.abs(pulls).max() < 4.5
    again = CliRunner().invoke(main, ["demo", "--out", str(out)])
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr


def test_a_file_in_the_place_of_the_folder_is_named(tmp_path):
    (tmp_path / "demo").write_text("mine")
    result = CliRunner().invoke(main, ["demo", "--out", str(tmp_path / "demo")])
    assert result.exit_code == 1
    assert "demo" in result.stderr
    assert (tmp_path / "demo").read_text() == "mine"
