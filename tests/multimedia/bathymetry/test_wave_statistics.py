"""What waves cost by direction, and whether the frames that are advised are enough."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import WaveSurface, wave_effect, wave_statistics
from tests.builders.commands import multimedia_command

POINT, EYES = [[0.3, -0.2, -2.0]], [[-5.0, 0.0, 20.0], [5.0, 0.0, 20.0]]
WATER = {"water_level": 0.0, "refractive_index": 1.34}


def test_a_swell_along_the_base_costs_the_height():
    along, _, across = wave_statistics(
        POINT, EYES, amplitude=0.01, wavelengths=[1.0], goal=0.02, **WATER
    )
    # By hand: the slope 0.0628 turns a ray by 0.0159, 23 mm r.m.s. at two metres; rays of both
    # cameras that lean apart by it change the height by that over the base ratio.
    assert across.rms[1] == pytest.approx(0.023, abs=0.001)
    assert across.rms[2] < 0.005
    assert along.rms[2] > 5 * across.rms[1]
    assert along.period == pytest.approx(0.8, abs=0.01)
    assert along.frames > across.frames > 1


def test_the_mean_of_the_frames_advised_is_within_the_goal():
    goal, rng = 0.03, np.random.default_rng(4)
    case = wave_statistics(POINT, EYES, amplitude=0.01, wavelengths=[1.0], goal=goal, **WATER)[0]
    count = int(case.frames)
    wave = WaveSurface.sinusoid(0.0, amplitude=0.01, wavelength=1.0, direction=np.pi / 2)
    many = wave_effect(POINT, EYES, wave=wave, phases=60, **WATER).errors[:, 0]
    means = many[rng.integers(0, 60, (3000, count))].mean(axis=1)
    assert np.sqrt((means**2).sum(axis=1).mean()) == pytest.approx(goal, rel=0.1)
    fewer = many[rng.integers(0, 60, (3000, count // 2))].mean(axis=1)
    assert np.sqrt((fewer**2).sum(axis=1).mean()) > 1.2 * goal


def test_no_number_of_frames_helps_against_what_stays():
    cases = wave_statistics(POINT, EYES, amplitude=0.05, wavelengths=[1.0], goal=1e-4, **WATER)
    assert np.isinf([case.frames for case in cases]).all()


def test_design_says_how_many_frames():
    words = ["design", "--cameras", "2", "--distance", "20", "--half-angle", "14", "--c", "25",
             "--extent", "6x4", "--depths", "1x3"]  # fmt: skip
    done = CliRunner().invoke(multimedia_command, [*words, "--waves", "0.01,1"])
    assert done.exit_code == 0, done.output
    table = done.stdout.partition("Waves taken for flat water")[2].splitlines()
    assert [float(line.split()[2]) for line in table[3:6]] == [0, 45, 90]
    glass = [*words, "--indices", "1,1.5,1.33", "--thicknesses", "0.01", "--waves", "0.01,1"]
    done = CliRunner().invoke(multimedia_command, glass)
    assert done.exit_code == 1
    assert "open, level water" in done.stderr
