"""``multimedia index`` as a user runs it."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner, Result

from tests.builders.commands import multimedia_command as main


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["index", *arguments])


def test_the_papers_tank_on_stdout_alone() -> None:
    result = run(
        "--wavelength", "520", "--temperature", "22.2", "--salinity", "0", "--depth", ".15"
    )
    assert result.exit_code == 0
    assert float(result.stdout) == pytest.approx(1.33575, abs=5e-6)
    assert "Eq. (4) of Maas" in result.stderr


def test_json_holds_conditions_and_precision() -> None:
    result = run(
        "--temperature", "18", "--salinity", "3.5", "--wavelength", "532",
        "--sigma-temperature", "1", "--formula", "quan-fry", "--json",
    )  # fmt: skip
    data = json.loads(result.stdout)
    assert data["refractive_index"] == pytest.approx(1.3416, abs=1e-3)
    assert data["sigma"] == pytest.approx(9e-5, rel=0.2)
    assert data["formula"] == "quan-fry"


def test_salinity_comes_back_with_its_precision() -> None:
    # Maas 2015: sigma n of 0.00015 is better than 0.1 % of salt.
    result = run(
        "--from-index", "1.3409", "--sigma-index", "0.00015", "--find", "salinity",
        "--temperature", "15", "--wavelength", "550", "--json",
    )  # fmt: skip
    data = json.loads(result.stdout)
    # 1.338 + 4e-5 (486 - 550 + 50 S - 15) = 1.3409
    assert data["salinity_percent"] == pytest.approx((0.0029 / 4e-5 + 79) / 50)
    assert data["sigma"] == pytest.approx(0.075)


def test_temperature_comes_back() -> None:
    forward = run("--temperature", "12.5", "--formula", "parrish").stdout.strip()
    back = run("--from-index", forward, "--find", "temperature", "--formula", "parrish")
    assert float(back.stdout) == pytest.approx(12.5, abs=1e-3)


def test_values_out_of_range_are_noted_not_refused() -> None:
    result = run("--temperature", "40")
    assert result.exit_code == 0
    assert "temperature is outside the range of hoehle" in result.stderr


def test_per_mille_is_refused_with_the_remedy() -> None:
    result = run("--salinity", "35")
    assert result.exit_code == 1
    assert "sea water is 3.5, not 35" in result.stderr


def test_an_impossible_index_is_refused() -> None:
    result = run("--from-index", "1.5", "--find", "temperature", "--formula", "quan-fry")
    assert result.exit_code == 1
    assert "no temperature of liquid water" in result.stderr
    result = run("--from-index", "1.5", "--find", "salinity")
    assert result.exit_code == 1
    assert "no salinity" in result.stderr


def test_half_an_inverse_is_wrong_usage() -> None:
    result = run("--from-index", "1.34")
    assert result.exit_code == 2
    assert "belong together" in result.stderr
