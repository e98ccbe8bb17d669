"""Planted faults: single lines made wrong, each of which the default tests must notice.

    .venv/bin/python -m tests.planted_faults             every fault by its nearest tests, 15 min
    .venv/bin/python -m tests.planted_faults --whole     survivors by the whole default suite too
    .venv/bin/python -m tests.planted_faults 3 17        some of them

Not collected by pytest; `tests/test_planted_faults.py` only holds that every fault still fits the
code. A fault is planted in a copy of the tree, never in the tree itself.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True, slots=True)
class Fault:
    """A text that occurs once in a file, what takes its place, and the tests nearest to it."""

    file: str
    right: str
    wrong: str
    tests: str

    def planted(self, text: str) -> str:
        """Return the file's text with the fault in it."""
        if text.count(self.right) != 1:
            raise ValueError(f"{self.file}: {self.right!r} stands {text.count(self.right)} times")
        return text.replace(self.right, self.wrong)


# Each file, the tests nearest to it, and its lines as they are and as they must not be.
_GROUPS: tuple[tuple[str, str, tuple[tuple[str, str], ...]], ...] = (
    # The equations
    (
        "bifocal/equations.py",
        "bifocal/equations.py tests/papers/test_midulla.py",
        (
            ("rate = s2 / d2 - s1 / d1", "rate = s2 / d1 - s1 / d2"),
            ("relief_displacement(s2, r, d=d2)", "relief_displacement(s2, r, d=d1)"),
            ("s_prime = s - e", "s_prime = s + e"),
        ),
    ),
    (
        "bifocal/rays.py",
        "tests/papers/test_midulla.py tests/bifocal/model/test_pair.py",
        (
            ("d1 * near.nadir - d2 * far.nadir", "d1 * far.nadir - d2 * near.nadir"),
            ("return (d2 - relief) ** 2", "return (d1 - relief) ** 2"),
            (
                "by_relief = factor / (camera.distance - xyz[:, 2])",
                "by_relief = factor / camera.distance",
            ),
            ("rows[:, 1, 1] = factor", "rows[:, 1, 1] = 1 / factor"),
        ),
    ),
    (
        "bifocal/precision.py",
        "bifocal/precision.py tests/papers/test_midulla.py tests/bifocal/planning/test_planning.py",
        (
            ("return r, -reduction(r, d1)", "return r, -(1 + r / d1)"),
            ("(r + s2 * by_2) * sigma_2", "(r - s2 * by_2) * sigma_2"),
            ("(d1 - r) * (d2 - r) / (d1 - d2) * spread", "(d1 - r) * d2 / (d1 - d2) * spread"),
        ),
    ),
    # The model
    (
        "bifocal/model/pair.py",
        "tests/bifocal/model/test_pair.py",
        (("[0, -scale, scale * row]", "[0, -scale, -scale * row]"),),
    ),
    (
        "bifocal/model/homography.py",
        "tests/bifocal/model/test_homography.py",
        (("matrix[None, :2, :2] - mapped", "matrix[None, :2, :2] + mapped"),),
    ),
    (
        "bifocal/model/intersection.py",
        "tests/bifocal/model/test_pair.py",
        (
            (
                "e2=_displacement(a2, xyz, near.foot)",
                "e2=_displacement(a2, xyz, far.foot)",
            ),
        ),
    ),
    (
        "bifocal/rays.py",
        "tests/bifocal/model/test_pair.py",
        (("(xyz[:, 2] / depth**2)", "(xyz[:, 2] / depth)"),),
    ),
    (
        "bifocal/media.py",
        "tests/bifocal/model/test_pair_through_media.py",
        (
            ("bend = first * cosine  # Maas Eq. (3)", "bend = index * cosine  # Maas Eq. (3)"),
            ("by_bend = -0.5 * excess", "by_bend = 0.5 * excess"),
            ("return by_away, turned - rays.slope", "return by_away, turned + rays.slope"),
            ("h * last / index for h", "h * index / last for h"),
        ),
    ),
    (
        "bifocal/model/pair_media.py",
        "tests/bifocal/orientation/test_adjustment_through_media.py",
        (
            ("NAMES.index(turn)] = 1.0", "NAMES.index(turn)] = -1.0"),
            ("stated = stated @ camera.rotation", "stated = stated @ camera.rotation.T"),
        ),
    ),
    (
        "bifocal/model/pair_media.py",
        "tests/bifocal/orientation/test_align_through_media.py",
        (
            ('if name[5] == "X" else 0.0 - aside', 'if name[5] == "X" else aside'),
            (
                "return np.asarray(-camera.rotation[2] @ lean)",
                "return np.asarray(-camera.rotation[2])",
            ),
        ),
    ),
    (
        "bifocal/files/haze.py",
        "tests/bifocal/files/test_haze.py",
        (("weights[None])", "weights[None, ::-1])"),),
    ),
    (
        "bifocal/planning/stations.py",
        "tests/bifocal/planning/test_plan_through_media.py",
        (("(rest - z0) * last / first", "(rest - z0) * first / last"),),
    ),
    (
        "bifocal/model/flags.py",
        "tests/bifocal/model tests/bifocal/survey/test_point_survey.py",
        (("sigma_r > limit / 2", "sigma_r > limit / 4"),),
    ),
    (
        "bifocal/model/grid.py",
        "tests/bifocal/model",
        (
            (
                "self.y0 - (self.height - 1) * self.gsd - half",
                "self.y0 - self.height * self.gsd - half",
            ),
        ),
    ),
    (
        "bifocal/model/surface.py",
        "tests/bifocal/model tests/bifocal/orthophotos/test_visibility.py",
        (("max(r0, 0) : max(r1 + 1, 0)", "max(r0, 0) : max(r1, 0)"),),
    ),
    (
        "bifocal/model/relief_map.py",
        "tests/bifocal/model",
        (("np.array(self.shape[::-1]) - 0.5", "np.array(self.shape[::-1]) + 0.5"),),
    ),
    # The survey
    (
        "bifocal/survey/point_survey.py",
        "tests/bifocal/survey/test_point_survey.py tests/bifocal/workbook/test_solve.py",
        (
            (
                "scale_number = first.scale_number or 1000.0",
                "scale_number = second.scale_number or 1000.0",
            ),
            ("np.sqrt(1.0 + (s2 / s1) ** 2)", "np.sqrt(1.0 + s2 / s1)"),
        ),
    ),
    (
        "bifocal/survey/georeferencing.py",
        "tests/bifocal/survey/test_georeference.py",
        (("redundancy = model.axes * int(", "redundancy = 3 * int("),),
    ),
    (
        "bifocal/survey/check_points.py",
        "tests/bifocal/survey/test_check_points.py",
        (("solved - known.xyz, np.nan", "known.xyz - solved, np.nan"),),
    ),
    (
        "bifocal/survey/orientation_check.py",
        "tests/bifocal/survey/test_orientation_check.py",
        (('(degrees * distance, "deg", -base', '(degrees, "deg", -base'),),
    ),
    (
        "bifocal/workbook/formulas/formulas.toml",
        "tests/bifocal/workbook/test_survey_workbook.py",
        (
            ("(k_12*(1-[@r]/d_2))^2", "(k_12*(1-[@r]/d_1))^2"),
            ("(n{2}_{1}-e_{1})*1000", "n{2}_{1}*1000"),
        ),
    ),
    (
        "bifocal/survey/results.py",
        "tests/bifocal/workbook/test_solve.py tests/bifocal/workbook/test_cli_solve.py "
        "tests/bifocal/workbook/test_cli_solve_refusals.py",
        (
            (
                'dict.fromkeys(("e1", "e2", "s_c", "q"), length',
                'dict.fromkeys(("e1", "e2", "s_c", "r"), length',
            ),
        ),
    ),
    # Relief maps
    (
        "bifocal/relief_maps/seed.py",
        "tests/bifocal/relief_maps/test_dense_relief.py",
        (("np.array([low, high]), d1=d1, d2=d2", "np.array([low, high]), d1=d2, d2=d1"),),
    ),
    (
        "bifocal/relief_maps/frame.py",
        "tests/bifocal/relief_maps/test_dense_relief.py",
        (("(pixels + 0.5) * factors - 0.5", "pixels * factors"),),
    ),
    (
        "bifocal/relief_maps/forward_projection.py",
        "tests/bifocal/relief_maps/test_dense_relief.py",
        (("relief + across * x + down * y", "relief - across * x + down * y"),),
    ),
    (
        "bifocal/relief_maps/edges.py",
        "tests/bifocal/relief_maps/test_dense_relief.py",
        (("mean -= slope * self.mean", "mean += slope * self.mean"),),
    ),
    (
        "photocore/shrinkage.py",
        "tests/bifocal/relief_maps/test_dense_relief.py",
        (("np.maximum(spread - 1 / total, 0)", "np.maximum(spread + 1 / total, 0)"),),
    ),
    (
        "bifocal/relief_maps/orientation_sigma.py",
        "tests/bifocal/relief_maps/test_dense_relief.py",
        (("(high_ - low_) / 2, (high_ + low_)", "(low_ - high_) / 2, (high_ + low_)"),),
    ),
    (
        "bifocal/relief_maps/evidence.py",
        "tests/bifocal/relief_maps/test_tails.py",
        (("low - slack), high + slack", "low - slack), high - slack"),),
    ),
    (
        "bifocal/relief_maps/levels.py",
        "tests/bifocal/relief_maps/test_tails.py",
        (("result[chosen] = r + move", "result[chosen] = r - move"),),
    ),
    (
        "bifocal/relief_maps/frame.py",
        "tests/bifocal/relief_maps/test_tails.py",
        (("squares[0] / squares[1]", "squares[1] / squares[0]"),),
    ),
    # Orthophotos
    (
        "bifocal/orthophotos/whole_picture.py",
        "tests/bifocal/orthophotos/test_whole_picture.py",
        (("(far - away) / max", "(away - far) / max"),),
    ),
    (
        "bifocal/orthophotos/rectify.py",
        "tests/bifocal/orthophotos/test_compose.py tests/bifocal/orthophotos/test_cli_ortho.py",
        (("column <= width - 0.5", "column <= width + 0.5"),),
    ),
    (
        "bifocal/orthophotos/visibility.py",
        "tests/bifocal/orthophotos/test_visibility.py",
        (("over = above - r[left] - ray * t", "over = above - r[left] + ray * t"),),
    ),
    (
        "bifocal/orthophotos/compose.py",
        "tests/bifocal/orthophotos/test_compose.py tests/bifocal/orthophotos/test_cli_ortho.py",
        (("second + (first - second) * weight", "first + (second - first) * weight"),),
    ),
    (
        "bifocal/orthophotos/sections.py",
        "tests/bifocal/orthophotos/test_sections.py",
        (("np.linspace(0.0, 1.0, count)", "np.linspace(0.0, 1.0, count + 1)[:-1]"),),
    ),
    (
        "bifocal/orthophotos/mosaic_blending.py",
        "tests/bifocal/orthophotos/test_mosaic_in_memory.py"
        " tests/bifocal/orthophotos/test_mosaic.py",
        (("(coarse.y0 - grid.rows_y) / coarse.gsd", "(grid.rows_y - coarse.y0) / coarse.gsd"),),
    ),
    # Writers
    (
        "bifocal/files/exports.py",
        "tests/bifocal/files/test_exports.py",
        (('relief = f"{points.xyz[i, 2]:+.3f}"', 'relief = f"{z:+.3f}"'),),
    ),
    (
        "bifocal/model/geotiff.py",
        "tests/bifocal/model/test_geotiff.py",
        (("-grid.gsd, grid.x0, grid.y0)", "-grid.gsd, grid.bounds[0], grid.bounds[3])"),),
    ),
    (
        "photocore/cloud/ply.py",
        "tests/photocore/cloud tests/bifocal/files/test_exports.py",
        (("rows[name] = values", 'rows[name] = values if name in "xyz" else 1000 * values'),),
    ),
    (
        "photocore/cloud/las.py",
        "tests/photocore/cloud tests/bifocal/files/test_exports.py",
        (("values.astype(np.uint16) * 257", "values.astype(np.uint16) * 256"),),
    ),
    (
        "photocore/raster.py",
        "tests/photocore/test_raster.py",
        (("_moved(xy_from_pixel[:2], -0.5)", "_moved(xy_from_pixel[:2], 0.0)"),),
    ),
    # The common ground
    (
        "photocore/camera/pinhole.py",
        "tests/photocore/camera/test_pinhole.py",
        (("scale = scale / -distance", "scale = scale / distance"),),
    ),
    (
        "photocore/camera/rotation.py",
        "tests/photocore/camera/test_rotation.py",
        (
            ("[0.0, co, -so * cp], [0.0, so, co * cp]", "[0.0, co, so * cp], [0.0, so, co * cp]"),
            ("y * c - z * b", "z * b - y * c"),
        ),
    ),
    (
        "photocore/camera/similarity.py",
        "tests/photocore/camera/test_similarity.py",
        (("(length + (p[:, 1] * q[:, 2]).sum()) / total", "length / total"),),
    ),
    (
        "photocore/adjustment/blocks.py",
        "tests/photocore/test_adjustment.py tests/multimedia/adjustment/test_bundle.py",
        (("2.0 * mixed[column]", "mixed[column]"),),
    ),
    (
        "photocore/double_double.py",
        "photocore/double_double.py tests/photocore/test_double_double.py",
        (("(a.high * b.low + a.low * b.high)", "a.high * b.low"),),
    ),
    (
        "photocore/tables/numbers.py",
        "photocore/tables tests/photocore/tables/test_table_numbers.py"
        " tests/photocore/tables/test_tables.py",
        (
            ("_METRES[unit] / _METRES[wanted]", "_METRES[wanted] / _METRES[unit]"),
            ('digits.rfind(".") > digits.rfind(",")', 'digits.rfind(".") < digits.rfind(",")'),
        ),
    ),
    (
        "photocore/workbook/changing/cells.py",
        "photocore/workbook/changing/cells.py tests/photocore/workbook/test_editor.py",
        (("{piece}{row + offset}", "{piece}{row - offset}"),),
    ),
    # Through water
    (
        "multimedia/refraction/tangent.py",
        "tests/multimedia/refraction/test_radial_shift.py",
        (
            (
                "dd.add(dd.product(n, n), dd.multiply(excess",
                "dd.subtract(dd.product(n, n), dd.multiply(excess",
            ),
        ),
    ),
    (
        "multimedia/refraction/shift.py",
        "tests/multimedia/refraction/test_radial_shift.py",
        (("h * (indices[0] / n)", "h * (n / indices[0])"),),
    ),
    (
        "multimedia/refraction/water.py",
        "tests/multimedia/refraction/test_water.py",
        (("Term(-0.00423, wavelength=-1", "Term(0.00423, wavelength=-1"),),
    ),
    (
        "multimedia/refraction/layers.py",
        "tests/multimedia/refraction/test_layers.py",
        (("max(self.indices[0], self.indices[-1])", "min(self.indices[0], self.indices[-1])"),),
    ),
    (
        "multimedia/media/projection.py",
        "tests/multimedia/media/test_projection.py",
        (("by_c = ideal / camera.principal_distance", "by_c = ideal"),),
    ),
    (
        "multimedia/media/ray_march.py",
        "tests/multimedia/media/test_ray_tracing.py",
        (("(ratio * ratio * cos_a / cos_b)", "(ratio * cos_a / cos_b)"),),
    ),
    (
        "multimedia/media/surface_motion.py",
        "tests/multimedia/media/test_curved_derivatives.py",
        (("away = -float(", "away = float("),),
    ),
    (
        "multimedia/media/graded_medium.py",
        "tests/multimedia/media/test_curved_derivatives.py",
        (
            (
                "rise * tau**3 * _series(w, 3)\n        slope",
                "rise * tau**3 * _series(w, 2)\n        slope",
            ),
        ),
    ),
    (
        "multimedia/design/planarity.py",
        "tests/multimedia/design/test_planarity.py",
        (("radius = width**2 / (8 * sag)", "radius = width**2 / (2 * sag)"),),
    ),
    (
        "multimedia/media/surfaces.py",
        "tests/multimedia/media/test_ray_tracing.py",
        (("axis=rotation @ self.axis", "axis=self.axis"),),
    ),
    (
        "multimedia/orientation/intersection.py",
        "tests/multimedia/orientation/test_intersection.py",
        (("redundancy = 2 * rays - 3", "redundancy = 2 * rays - 2"),),
    ),
    (
        "multimedia/orientation/resection.py",
        "tests/multimedia/orientation/test_resection.py",
        (
            (
                "= -result.residuals.reshape(-1, 2) * sigmas",
                "= result.residuals.reshape(-1, 2) * sigmas",
            ),
        ),
    ),
    (
        "multimedia/orientation/epipolar_curves.py",
        "tests/multimedia/orientation/test_epipolar.py",
        (
            (
                "points[curve, place] * (1.0 - part) + points[curve, place + 1] * part",
                "points[curve, place] * part + points[curve, place + 1] * (1.0 - part)",
            ),
        ),
    ),
    (
        "multimedia/bathymetry/refraction_correction.py",
        "tests/multimedia/bathymetry/test_bathymetry.py",
        (("((1 - index) * precision.level)", "(index * precision.level)"),),
    ),
    (
        "multimedia/adjustment/bundle_equations.py",
        "tests/multimedia/adjustment/test_bundle.py",
        (("points[on] - pose.centre)", "pose.centre - points[on])"),),
    ),
)

FAULTS = tuple(
    Fault(file, right, wrong, tests) for file, tests, lines in _GROUPS for right, wrong in lines
)


def copied_tree(folder: Path) -> Path:
    """Copy every file that git knows into a folder; return it."""
    names = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
    ).stdout.split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


class Planted(Protocol):
    """A fault that can be planted in the text of a file."""

    @property
    def file(self) -> str: ...  # from the root of the tree

    def planted(self, text: str) -> str: ...


def first_failure(tree: Path, tests: list[str], seconds: float | None = None) -> str:
    """Return the first test that fails in a copy of the tree, "" if none does."""
    with subprocess.Popen(
        [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:cacheprovider",
         *(["-n", "0"] if tests else []), *tests],
        cwd=tree, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"},
    ) as run:  # fmt: skip
        try:
            said = run.communicate(timeout=seconds)[0].decode(errors="replace")
        except BaseException:
            os.killpg(run.pid, signal.SIGKILL)  # with what the tests started
            raise
    if run.returncode in (0, 5):  # 5: no tests were found
        return ""
    if named := re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", said, re.M):
        return str(named[-1])
    if "while loading conftest" in said:
        return "conftest.py"
    raise RuntimeError(f"pytest ended with {run.returncode}: {said[-2000:]}")


def noticed_by(tree: Path, fault: Planted, tests: list[str], seconds: float | None = None) -> str:
    """Return the first test that fails with the fault planted in a copy of the tree, or ""."""
    path = tree / fault.file
    right = path.read_text(encoding="utf-8")
    path.write_text(fault.planted(right), encoding="utf-8")
    try:
        return first_failure(tree, tests, seconds)
    finally:
        path.write_text(right, encoding="utf-8")


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> int:
    """Plant the faults one by one; say which are noticed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("numbers", nargs="*", type=int, help="faults to plant, from 1; default all")
    parser.add_argument("--whole", action="store_true", help="survivors by the whole suite too")
    given = parser.parse_args()
    numbers = given.numbers or range(1, len(FAULTS) + 1)
    survivors = []
    with tempfile.TemporaryDirectory() as folder:
        tree = copied_tree(Path(folder))
        for number in numbers:
            fault, begin = FAULTS[number - 1], time.monotonic()
            noticed = noticed_by(tree, fault, fault.tests.split())
            if not noticed and given.whole:
                noticed = noticed_by(tree, fault, [])
            seconds = time.monotonic() - begin
            word = "noticed " if noticed else "SURVIVES"
            _say(
                f"{number:3} {word} {seconds:4.0f} s  {fault.file}: {fault.right} -> {fault.wrong}"
            )
            if not noticed:
                survivors.append(number)
    _say(f"{len(numbers) - len(survivors)} of {len(numbers)} noticed; survivors: {survivors}")
    return bool(survivors)


if __name__ == "__main__":
    sys.exit(main())
