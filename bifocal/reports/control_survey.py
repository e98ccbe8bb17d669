"""Control and check points of a pair measured like any others: how far off they come out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.model import Pair, PhotoSet, WorldFrame, pair_or_set
from bifocal.orientation import Control, read_control
from bifocal.survey import KnownPoints, PointObservations, SolvedSurvey, SurveyInput
from bifocal.workbook import solve
from photocore.errors import InputError

#: Code of points that the orientation rests on, and of independent ones.
CONTROL, CHECK = "CONTROL", "CHECK"


def refuse_same_names(
    control: Path, check: Path, first: Sequence[str], second: Sequence[str]
) -> None:
    """Refuse points of one name in the tables of control and of check points.

    Raises
    ------
    InputError
        Naming some of them.
    """
    counts = Counter([*first, *second])
    twice = sorted(name for name, count in counts.items() if count > 1)
    if twice:
        raise InputError(f"{check}: {', '.join(twice[:5])} is in {control} too; give other names.")


def solve_control(
    pair_path: Path,
    *,
    control: Path | None,
    check: Path | None = None,
    exchanged: bool = False,
    photos: int = 2,
    language: str = "en",
    unit: str = "",
    columns: str | None = None,
) -> SolvedSurvey:
    """Solve the points of control and check tables from their pixels, and compare.

    Parameters
    ----------
    pair_path : Path
        File of a pair or a set.
    control, check : Path, optional
        Tables: id, X, Y, r and pixels in both photos. Those of ``check`` took no part in the
        orientation: where there are any, they alone are compared.
    exchanged : bool
        Whether the tables name the photos the other way round than the pair file.
    photos : int
        How many there are, in the order of tables and file.
    language : str
        Of the workbook that may be made of it.
    unit : str
        Unit of the coordinates; empty: as the headings say, else metres.
    columns : str, optional
        Which column of the tables is which; by default as the headings say.

    Raises
    ------
    InputError
        If a table is unusable, a name is in both, or none has a point seen in two photos.
    """
    tables = [(path, code) for path, code in ((control, CONTROL), (check, CHECK)) if path]
    named = pair_or_set(pair_path)
    held = named.as_given if isinstance(named, Pair) else named.photos
    reading = {
        "unit": unit, "columns": columns, "photos": photos, "names": [p.file for p in held],
        "frame": WorldFrame.of(named.extra),
    }  # fmt: skip
    parts = [_read(path, exchanged, reading) for path, _ in tables]
    counts = np.array([len(part.ids) for part in parts], dtype=int)
    codes = np.repeat([code for _, code in tables], counts)
    ids = [name for part in parts for name in part.ids]
    if control and check:
        refuse_same_names(control, check, parts[0].ids, parts[1].ids)
    xyz = np.concatenate([part.xyz for part in parts] or [np.zeros((0, 3))])
    picks = [
        np.concatenate([part.picks[k] for part in parts] or [np.zeros((0, 2))])
        for k in range(photos)
    ]
    picked = np.sum([np.isfinite(pixels).all(axis=1) for pixels in picks], axis=0) >= 2
    if not picked.any():
        raise InputError(
            f"{control or check}: no point was picked in two photos; nothing to measure."
        )
    points = PointObservations(
        ids=tuple(compress(ids, picked)),
        pixels1=picks[0][picked],
        pixels2=picks[1][picked],
        others=np.stack(picks, axis=1)[picked, 2:],
        code=tuple(codes[picked].tolist()),
    )
    compared = codes[picked] == CHECK
    if not compared.any():
        compared[:] = True
    reference = KnownPoints(ids=points.ids, xyz=xyz[picked], use=compared)
    remarks = tuple(text for part in parts for text in part.remarks)
    survey = SurveyInput.of_points(points)
    survey = replace(
        survey, known=reference, language=language, remarks=(*survey.remarks, *remarks)
    )
    return solve(survey, pair=pair_path)


def is_exchanged(pair: Pair | PhotoSet, far: Path) -> bool:
    """Tell whether the photo given as far became the near one of a pair file; never in a set."""
    return isinstance(pair, Pair) and pair.photo_file(2).resolve() == far.resolve()


def _read(path: Path, exchanged: bool, reading: Mapping[str, Any]) -> Control:
    # The standard deviations are those of the orientation; here they play no part.
    control = read_control(path, sigma=0.003, sigma_plane=0.005, **reading)
    return control.exchanged() if exchanged else control
