"""Tide over time per photo, sigmas of network and waves, and soundings by depth: own truth."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner
from scipy.optimize import brentq

import multimedia as mm
from tests.builders.commands import multimedia_command as main

N = 1.34
CENTRES = np.array([[0.0, 0, 60], [40, 0, 58], [0, 40, 62], [40, 40, 61], [20, 20, 60]])
LEVELS = np.array([2.0, 2.3, 2.7, 3.0, 2.4])


def air_direction(camera: np.ndarray, point: np.ndarray, level: float) -> np.ndarray:
    """Return the direction in air by Snell's law in the plane of the ray, one scalar root."""
    if point[2] >= level:
        return (point - camera) / np.linalg.norm(point - camera)
    aside = point[:2] - camera[:2]
    far = np.hypot(*aside)
    height, depth = camera[2] - level, level - point[2]

    def miss(sine: float) -> float:
        below = sine / N
        return height * sine / np.sqrt(1 - sine**2) + depth * below / np.sqrt(1 - below**2) - far

    sine = brentq(miss, 0, 1 - 1e-12, xtol=1e-15)
    return np.array([*(sine * aside / far), -np.sqrt(1 - sine**2)])


def apparent_of(directions: np.ndarray) -> np.ndarray:
    """Return where straight rays in air meet best, equal precision in the images."""
    weight, across = np.ones(len(CENTRES)), np.eye(3) - directions[:, :, None] * directions[:, None]
    for _ in range(15):
        normal = np.einsum("m,mij->ij", weight, across)
        point = np.linalg.solve(normal, np.einsum("m,mij,mj->i", weight, across, CENTRES))
        weight = 1 / ((point - CENTRES) ** 2).sum(-1)
    return point


TRUE = np.column_stack(
    [np.random.default_rng(3).uniform(5, 35, (40, 2)), np.linspace(-6.0, 2.9, 40)]
)


def survey(levels: np.ndarray) -> np.ndarray:
    seen = list(zip(CENTRES, levels, strict=True))
    return np.array(
        [apparent_of(np.array([air_direction(c, p, z) for c, z in seen])) for p in TRUE]
    )


def run(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    return result.exit_code, result.stdout, result.stderr


def test_every_photo_has_the_level_of_its_time(tmp_path: Path) -> None:
    apparent = survey(LEVELS)
    np.savetxt(tmp_path / "cloud.csv", apparent, "%.9f", ",", header="X,Y,Z", comments="")
    rows = [f"c{k},{x},{y},{z},2026-06-01T10:{10 * k:02}:00" for k, (x, y, z) in enumerate(CENTRES)]
    (tmp_path / "cams.csv").write_text("\n".join(["id,X,Y,Z,time", *rows]))
    tide = [f"2026-06-01T10:{10 * k:02}:00,{z}" for k, z in enumerate(LEVELS)]
    (tmp_path / "tide.csv").write_text("\n".join(["time,level", *tide]))
    by_name = [f"c{k},{z}" for k, z in enumerate(LEVELS)]
    (tmp_path / "levels.csv").write_text("\n".join(["camera,level", *by_name]))
    for table in ("tide.csv", "levels.csv"):
        out = tmp_path / f"bed_{table}"
        code, _, said = run(
            "bathymetry", tmp_path / "cloud.csv", "--water-level", tmp_path / table, "--index", N,
            "--cameras", tmp_path / "cams.csv", "--out", out,
        )  # fmt: skip
        assert code == 0, said
        assert "2.000 to 3.000 m" in said
        bed = np.loadtxt(out, delimiter=",", skiprows=1, usecols=(0, 1, 2))
        # Also what is dry in some photos and wet in others, up to the highest level.
        assert np.abs(bed - TRUE).max() < 2e-8
    mean = mm.correct_bathymetry(apparent, water_level=2.48, refractive_index=N, cameras=CENTRES)
    assert np.abs(mean.xyz - TRUE).max() > 0.05  # what one level for all photos leaves


@pytest.mark.parametrize(
    ("tide", "cameras", "said"),
    [
        ("time,level\n10:00,1\n10:20,2\n", "id,X,Y,Z,time\na,0,0,9,10:30\nb,1,0,9,10:05\n", "zone"),
        ("time,level\n0,1\n9,2\n", "id,X,Y,Z\na,0,0,9\nb,1,0,9\n", "column time"),
        ("camera,level\na,1\n", "id,X,Y,Z\na,0,0,9\nb,1,0,9\n", "no level for photo b"),
        (
            "camera,level\nDJI_01,1\nIMG_O2,1\n",
            "id,X,Y,Z\nDJI_01,0,0,9\nIMG_02,1,0,9\n",
            "no level for photo IMG_02 (did you mean IMG_O2?)",
        ),
        ("time,level\nnoon,1\n9,2\n", "id,X,Y,Z,time\na,0,0,9,1\nb,1,0,9,2\n", "is no time"),
    ],
)
def test_a_tide_that_does_not_fit_the_photos_is_refused(
    tmp_path: Path, tide: str, cameras: str, said: str
) -> None:
    (tmp_path / "tide.csv").write_text(tide)
    (tmp_path / "cams.csv").write_text(cameras)
    (tmp_path / "cloud.csv").write_text("X,Y,Z\n1,2,0\n2,2,0\n")
    code, _, errors = run(
        "bathymetry", tmp_path / "cloud.csv", "--water-level", tmp_path / "tide.csv", "--index", N,
        "--cameras", tmp_path / "cams.csv", "--out", tmp_path / "out.csv",
    )  # fmt: skip
    assert code == 1
    assert said in errors
    assert not (tmp_path / "out.csv").exists()


def test_sigmas_of_network_and_waves_are_those_of_draws() -> None:
    """Noise of every ray, and a ray-traced wave of its own in every photo."""
    point, rng = np.array([14.0, 22.0, -5.0]), np.random.default_rng(8)
    straight = np.array([air_direction(c, point, 0.0) for c in CENTRES])
    centre = apparent_of(straight)
    noise, draws = 2e-4, 400
    turned = straight + noise * rng.normal(size=(draws, *straight.shape))
    noisy = [apparent_of(of / np.linalg.norm(of, axis=1)[:, None]) for of in turned]
    # One wave; direction and phase come from turning and moving camera and point over it.
    angle, move = rng.uniform(0, 2 * np.pi, (draws, 5)), rng.uniform(0, 3, (draws, 5, 2))
    turn = np.zeros((draws, 5, 3, 3))
    turn[..., 0, 0] = turn[..., 1, 1] = np.cos(angle)
    turn[..., 1, 0], turn[..., 2, 2] = np.sin(angle), 1.0
    turn[..., 0, 1] = -turn[..., 1, 0]
    aside = np.concatenate([move, np.zeros((draws, 5, 1))], axis=-1)
    wave = mm.WaveSurface.sinusoid(0.0, amplitude=0.003, wavelength=3.0)
    water = mm.Interfaces(surfaces=(wave,), indices=(1.0, N))
    rays = mm.aim_rays((turn @ CENTRES[:, :, None])[..., 0] + aside, turn @ point + aside, water)
    bent = (turn.swapaxes(-1, -2) @ rays.directions[..., 0, :, None])[..., 0]
    wavy = [apparent_of(of) for of in bent]
    level = {"water_level": 0.0, "refractive_index": N, "cameras": CENTRES}
    for drawn, precision, accuracy in (
        (noisy, mm.Precision(direction=noise), 0.1),
        (wavy, mm.Precision(wave=(0.003, 3.0)), 0.1),
    ):
        spread = np.std(mm.correct_bathymetry(drawn, **level).xyz, axis=0)
        sigma = mm.correct_bathymetry(centre, **level, precision=precision).sigma
        np.testing.assert_allclose(sigma / spread, 1.0, atol=accuracy)


def test_soundings_tell_a_wrong_index_from_a_wrong_level_by_depth(tmp_path: Path) -> None:
    """A sloping bed whose DEM was corrected with 1.33 at level 10.00 for 1.34 at 10.03."""
    rows, columns = np.mgrid[0:80, 0:120]
    bed = 9.5 - 0.06 * columns - 0.01 * rows
    apparent = 10.03 - (10.03 - bed) / 1.34
    heights = 10.0 - 1.33 * (10.0 - apparent)
    dem = tmp_path / "bed.tif"
    with rasterio.open(
        dem, "w", driver="GTiff", width=120, height=80, count=2, dtype="float32",
        crs="EPSG:32632", transform=rasterio.Affine(0.5, 0, 1000, 0, -0.5, 2000), nodata=np.nan,
    ) as file:  # fmt: skip
        file.write(np.stack([heights, np.full_like(heights, 0.01)]).astype("float32"))
        file.descriptions = ("height", "sigma")
    rng = np.random.default_rng(5)
    at = np.column_stack([rng.uniform(0, 119, 3000), rng.uniform(0, 79, 3000)])
    z = 9.5 - 0.06 * at[:, 0] - 0.01 * at[:, 1] + rng.normal(0, 0.02, 3000)
    z[::100] += 1.0  # fish
    xyz = np.column_stack([1000.25 + 0.5 * at[:, 0], 1999.75 - 0.5 * at[:, 1], z])
    np.savetxt(tmp_path / "multibeam.xyz", xyz, "%.4f", " ")
    code, out, said = run(
        "soundings", dem, tmp_path / "multibeam.xyz", "--water-level", 10.03, "--sigma", 0.02,
        "--classes", "0,2,4,6,9", "--out", tmp_path / "offsets.csv", "--json",
    )  # fmt: skip
    assert code == 0, said
    found = json.loads(out)
    assert found["soundings"] == 3000
    assert found["outside"] == 0
    trend = found["trend"]
    assert trend["count"] >= 2950  # the fish are left out
    slope, start = -0.01 / 1.34, (1 - 1.33) * 0.03  # from the rules on paper
    assert abs(trend["per_metre"] - slope) < 4 * trend["per_metre_sigma"] < 2e-3
    assert abs(trend["at_surface"] - start) < 4 * trend["at_surface_sigma"] < 8e-3
    for of in found["classes"]:
        middle = start + slope * (of["shallow"] + of["deep"]) / 2
        assert abs(of["median"] - middle) < 0.006
        assert of["expected"] == pytest.approx(np.hypot(0.02, 0.01), rel=1e-6)
        assert of["robust"] == pytest.approx(0.02, rel=0.2)
    assert sum(of["gross"] for of in found["classes"]) >= 30
    assert len((tmp_path / "offsets.csv").read_text().splitlines()) == 3001

    # The same bed as a cloud, its soundings as a workbook's check points beside and on it.
    cloud = np.column_stack([1000.25 + 0.5 * columns.ravel(), 1999.75 - 0.5 * rows.ravel(),
                             heights.ravel()])  # fmt: skip
    np.savetxt(tmp_path / "bed.csv", cloud, "%.6f", ",", header="X,Y,Z", comments="")
    few = np.vstack([xyz[1:60], [[900.0, 1990, 5], [1030, 1950, 5]]])
    rows_of = [f"s{k},{x:.4f},{y:.4f},{h:.4f}" for k, (x, y, h) in enumerate(few)]
    (tmp_path / "check.csv").write_text("\n".join(["id,X,Y,Z", *rows_of]))
    code, out, _ = run(
        "soundings", tmp_path / "bed.csv", tmp_path / "check.csv", "--water-level", 10.03, "--json"
    )
    cloudy = json.loads(out)
    assert (code, cloudy["outside"]) == (0, 2)
    assert abs(cloudy["trend"]["per_metre"] - slope) < 4 * cloudy["trend"]["per_metre_sigma"]
    assert cloudy["all"]["expected"] is None

    code, out, _ = run("soundings", dem, tmp_path / "check.csv", "--water-level", 10.03)
    assert code == 0
    assert "59" not in out.splitlines()[0]
    assert "over depth" in out
    (tmp_path / "far.csv").write_text("X,Y,Z\n0,0,0\n1,1,1\n")
    code, _, said = run("soundings", dem, tmp_path / "far.csv", "--water-level", 10.03)
    assert code == 1
    assert "none of 2 soundings" in said


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (lambda z: 102.4 - z, "SOUNDINGS ARE DEPTHS"),
        (lambda z: z - 102.4, "SOUNDINGS COUNT FROM THE WATER"),
        (lambda z: 2 * 102.4 - z, "SOUNDINGS ARE WATER LEVEL PLUS DEPTH"),
        (lambda z: z / 0.3048, "SOUNDINGS LOOK LIKE FEET"),
        (lambda z: z, ""),
        (lambda z: z + 2.0, ""),
    ],
)
def test_soundings_of_another_datum_are_told(tmp_path: Path, written, said: str) -> None:
    x, y = np.mgrid[0:20.0, 0:20.0].reshape(2, -1)
    bed = 100.0 - 0.15 * x + 0.02 * y
    table = np.column_stack([x, y, bed])
    np.savetxt(tmp_path / "bed.csv", table, "%.3f", ",", header="X,Y,Z", comments="")
    table[:, 2] = written(bed + np.random.default_rng(1).normal(0, 0.05, len(bed)))
    np.savetxt(tmp_path / "s.csv", table[::9], "%.3f", ",", header="X,Y,Z", comments="")
    code, _, told = run(
        "soundings", tmp_path / "bed.csv", tmp_path / "s.csv", "--water-level", 102.4
    )
    assert code == 0, told
    assert said in told
    assert ("SOUNDINGS" in told) == bool(said)


def test_a_level_that_nothing_shows_to_be_right_is_told(tmp_path: Path) -> None:
    x, y = np.mgrid[0:20.0, 0:20.0].reshape(2, -1)
    table = np.column_stack([x, y, 100.0 - 0.3 * x])
    np.savetxt(tmp_path / "bed.csv", table, "%.3f", ",", header="X,Y,Z", comments="")
    for level, doubted in ((98.0, False), (101.0, False), (118.0, True)):
        out = tmp_path / f"{level}.csv"
        words = ("bathymetry", tmp_path / "bed.csv", "--water-level", level, "--index", 1.34)
        code, _, told = run(*words, "--out", out)
        assert code == 0, told
        assert ("No point is dry" in told) == doubted
