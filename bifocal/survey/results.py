"""What came out of a survey: columns of a text table, JSON, lines and sentences."""

from __future__ import annotations

import json
import math
from dataclasses import asdict

import numpy as np

from bifocal.survey.basis import basis
from bifocal.survey.image_shift import image_shift
from bifocal.survey.other_photos import is_of_others
from bifocal.survey.solved_survey import SolvedSurvey
from bifocal.survey.tolerances import FEW, sentence
from photocore.arrays import FloatArray
from photocore.jsonfile import to_text
from photocore.tables.csvwrite import Columns

_NUMBERS = ("r", "e1", "e2", "s_c", "X", "Y", "Z", "q", "sigma_X", "sigma_Y", "sigma_r")

#: Columns shown on the screen.
SHOWN = ("r", "e1", "e2", "X", "Y", "sigma_X", "sigma_Y", "sigma_r")


def csv_columns(solution: SolvedSurvey) -> Columns:
    """Return the columns of the text table, headings with units."""
    table, world = solution.table, solution.world
    columns: Columns = {"id": list(table.ids)}
    units = dict.fromkeys(("e1", "e2", "s_c", "q"), length_unit(solution))
    for key in ("X", "Y", "Z"):
        columns[f"{key} [m]"] = table[key]
    if solution.georeference is not None:
        columns |= {f"{key} [m]": world[:, i] for i, key in enumerate("ENH")}
    for key in ("r", "e1", "e2", "s_c", "q", "sigma_X", "sigma_Y", "sigma_r"):
        columns[f"{key} [{units.get(key, 'm')}]"] = table[key]
    unit = image_unit(solution)
    columns |= {f"{key} [{unit}]": values for key, values in shift_of(solution).items()}
    if solution.georeference is not None:
        sigma = solution.world_sigma
        columns |= {f"sigma_{key} [m]": sigma[:, i] for i, key in enumerate("ENH")}
    columns |= {f"{key} [{length_unit(solution)}]": table[key] for key in _more(solution)}
    for key in _of_others(solution):
        columns[key if key == "chance" else f"{key} [m]"] = table[key]
    columns["flag"] = list(table.flags)
    if any(solution.points.note):
        columns["note"] = list(solution.points.note)
    return columns


def _more(solution: SolvedSurvey) -> list[str]:
    """Return the displacements on the third photo and more of a set."""
    count = 2 if solution.photos is None else len(solution.photos)
    return [f"e{number}" for number in range(3, count + 1)]


def _of_others(solution: SolvedSurvey) -> list[str]:
    """Return the columns of photos beside an ideal pair, and of all together."""
    return [key for key in solution.table.columns if is_of_others(key)]


def solution_json(solution: SolvedSurvey) -> str:
    """Return everything as the text of one JSON object; undefined numbers are null."""
    head = to_text(_head(solution))
    # A million points: each record is put together as text, not as a tree of objects.
    records = ",\n".join(_records(solution))
    return f'{{"points": [{records}], {head[1:]}'


def _records(solution: SolvedSurvey) -> list[str]:
    table = solution.table
    shift = shift_of(solution)
    shown = {key: table[key] for key in (*_NUMBERS, *_more(solution), *_of_others(solution))}
    shown |= shift
    columns, world = [values.tolist() for values in shown.values()], []
    keys = list(shown)
    if solution.georeference is not None:
        placed = np.hstack([solution.world, solution.world_sigma])
        world = placed.T.tolist()
        keys += ["E", "N", "H", "sigma_E", "sigma_N", "sigma_H"]
    numbers = [
        [repr(value) if math.isfinite(value) else "null" for value in values]
        for values in (*columns, *world)
    ]
    names = [json.dumps(name, ensure_ascii=False) for name in table.ids]
    use = ["true" if value else "false" for value in solution.points.use]
    template = (
        '{{"id": {}, ' + ", ".join(f'"{key}": {{}}' for key in keys) + ', "flag": "{}", "use": {}'
    )
    texts = [table.flags, use]
    if solution.photos is not None:
        template += ', "note": {}'
        texts.append([json.dumps(text, ensure_ascii=False) for text in solution.points.note])
    template += "}}"
    return [template.format(*row) for row in zip(names, *numbers, *texts, strict=True)]


def _head(solution: SolvedSurvey) -> dict[str, object]:
    """Return all but the points."""
    axes = solution.check.axes
    return {
        "check": {
            **asdict(axes["Z"]),
            "axes": {key: asdict(axis) for key, axis in axes.items()},
            "errors": [
                {"id": name, "dX": e[0], "dY": e[1], "dZ": e[2]}
                for name, e in zip(solution.check.ids, solution.check.errors, strict=True)
            ],
            "verdict": verdict_lines(solution),
            "missing": list(solution.check.missing),
            "flagged": dict(solution.check.flagged),
        },
        "taped": _taped(solution),
        "georeference": _georeference(solution),
        "setup_check": _orientation_check(solution),
        "sigma_px": solution.sigma_px,
        "rests_on": basis(solution),
        "units": {
            "r": "m",
            "X": "m",
            "e1": length_unit(solution),
            "x_c": image_unit(solution),
            "sigma_X": "m",
            "sigma_Y": "m",
            "sigma_r": "m",
        },
        "remarks": list(solution.remarks),
    }


def shift_of(solution: SolvedSurvey) -> dict[str, FloatArray]:
    """Return where points belong on photo 1 and the way there; see `image_shift`."""
    first = solution.photos.photos[0] if solution.photos else solution.pair.image1
    return image_shift(first, solution.setup, solution.points, solution.table)


def image_unit(solution: SolvedSurvey) -> str:
    """Return the unit of x_c, y_c, dx and dy: that of the points measured."""
    return "px" if solution.setup is None else solution.setup.unit


def length_unit(solution: SolvedSurvey) -> str:
    """Return the unit of e1, e2, s_c and q: without an image scale they are on the wall."""
    on_photo = solution.setup is not None or solution.table.image_scale is not None
    return "mm" if on_photo else "m"


def _georeference(solution: SolvedSurvey) -> dict[str, object] | None:
    geo = solution.georeference
    if geo is None:
        return None
    return {
        "model": geo.model,
        "n": int(geo.used.sum()),
        "left_out": list(geo.bad),
        "sigma0": geo.sigma0,
        "error_ratio": geo.error_ratio,
        "scale": geo.world_from_wall.scale,
        "rotation": geo.world_from_wall.rotation,
        "wall_centre": geo.world_from_wall.source_centre,
        "world_centre": geo.world_from_wall.target_centre,
        "residuals": [
            {"id": name, "vE": v[0], "vN": v[1], "vH": v[2], "used": bool(used)}
            for name, v, used in zip(geo.ids, geo.residuals, geo.used, strict=True)
        ],
    }


def _taped(solution: SolvedSurvey) -> dict[str, object] | None:
    taped = solution.taped
    return None if taped is None else {**asdict(taped), "scale": taped.scale}


def _orientation_check(solution: SolvedSurvey) -> dict[str, object] | None:
    check = solution.orientation_check
    if check is None:
        return None
    return {
        "points": check.points,
        "sigma0": check.sigma0,
        "outliers": list(check.outliers),
        "adjusted": solution.adjusted,
        "parameters": [asdict(parameter) for parameter in check.parameters],
    }


def verdict_lines(solution: SolvedSurvey) -> list[str]:
    """Return one sentence per tolerance rule."""
    verdicts = solution.check.verdicts
    rules = list(dict.fromkeys(verdict.rule.key for verdict in verdicts))
    return [sentence(tuple(v for v in verdicts if v.rule.key == key)) for key in rules]


def point_rows(solution: SolvedSurvey, most: int) -> list[tuple[str, ...]]:
    """Return the first points as rows of text: id, the columns of `SHOWN`, flag.

    A point that is not used is no good point: its flag stands in brackets.
    """
    table = solution.table
    rows = []
    for i in range(min(most, len(table))):
        shown = [_shown(table[key][i], 4) for key in SHOWN]
        flag = table.flags[i] if solution.points.use[i] else f"({table.flags[i]}, unused)"
        rows.append((table.ids[i], *shown, flag))
    return rows


def summary(solution: SolvedSurvey) -> list[str]:
    """Return what the sigmas rest on, check points, verdict and georeference in words."""
    lines = [basis(solution)]
    for axis, errors in solution.check.axes.items():
        if errors.n:
            lines.append(
                f"Check {axis}: {errors.n} {_points(errors.n)}, RMSE {errors.rmse:.4f} m, "
                f"mean {errors.mean:+.4f} m, largest {errors.max_abs:.4f} m"
            )
    counts = [errors.n for errors in solution.check.axes.values() if errors.n]
    few = min(counts, default=FEW)
    compared = int(np.isfinite(solution.check.errors).any(axis=1).sum())
    doubt = f"; of only {compared} {_points(compared)}" if few < FEW else ""
    doubt += f", {few} of them on one axis" if few < min(compared, FEW) else ""
    lines += [f"Drawing scale, {line}{doubt}" for line in verdict_lines(solution)]
    taped = solution.taped
    if taped is not None and math.isfinite(taped.solved):
        lines.append(
            f"Taped {' - '.join(taped.tape.ends)}: {taped.tape.length:.4f} m, solved "
            f"{taped.solved:.4f} m, scale {taped.scale:.4f}, sigma {taped.sigma:.4f} m"
        )
    geo = solution.georeference
    if geo is not None:
        used = int(geo.used.sum())
        if geo.model == "frame":
            return [*lines, "Georeference: as the pair's own control points were E, N, H"]
        spread = "no redundancy" if math.isnan(geo.sigma0) else f"sigma0 {geo.sigma0:.4f} m"
        lines.append(
            f"Georeference: {geo.model}, {used} {_points(used)}, {spread}, scale "
            f"{geo.world_from_wall.scale:.6f}"
        )
    return lines


def _points(count: int) -> str:
    return "point" if count == 1 else "points"


def _shown(value: float, places: int) -> str:
    return f"{value:.{places}f}" if math.isfinite(value) else "-"
