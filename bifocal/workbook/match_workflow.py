"""A pair file in, a survey workbook (or CSV) of homologous points out."""

from __future__ import annotations

from pathlib import Path
from typing import TypedDict

import numpy as np

from bifocal.files import photo_info, read_greys, set_photo_info
from bifocal.matching import Matches, MatchSettings, match_pair, match_set, precision
from bifocal.model import Pair, PhotoSet, rests_on
from bifocal.remarks import remark
from bifocal.survey import PointObservations
from bifocal.workbook.template_workflow import write_survey
from photocore.arrays import ByteArray
from photocore.output import check_ending
from photocore.workbook import check_new_workbook


def match_photos(
    pair_path: Pair | Path,
    out: Path,
    settings: MatchSettings,
    *,
    language: str = "en",
    overwrite: bool = False,
) -> tuple[Pair, Matches]:
    """Find homologous points and write them as a survey workbook (.xlsx) or table (.csv).

    Raises
    ------
    InputError, GeometryError
        If a file is at fault, or photos and pair do not belong together.
    """
    check_ending(out, "points are written as .xlsx (survey workbook) or .csv.", ".xlsx", ".csv")
    check_new_workbook(out, overwrite=overwrite)
    pair, matches = match_pair_file(pair_path, settings)
    if out.suffix.lower() == ".csv":
        matches.write(out, overwrite=overwrite)
        return pair, matches
    notes = zip(matches.sigma, matches.misfit, strict=True)
    write_survey(
        out,
        PointObservations(
            ids=matches.ids,
            pixels1=np.round(matches.pixels1, 4),
            pixels2=np.round(matches.pixels2, 4),
            code=matches.kinds,
            note=tuple(f"sigma {s:.2f} px, misfit {abs(m):.2f} px" for s, m in notes),
        ),
        pair=pair,
        pair_path=None if isinstance(pair_path, Pair) else pair_path,
        sigma_px=round(precision(matches), 3),
        language=language,
        what=f"{len(matches.ids)} points found by bifocal match",
        overwrite=overwrite,
    )
    return pair, matches


def match_pair_file(pair_path: Pair | Path, settings: MatchSettings) -> tuple[Pair, Matches]:
    """Return a pair from its file, and the homologous points found in its photos.

    Raises
    ------
    InputError, GeometryError
        If a file is at fault, or photos and pair do not belong together.
    """
    pair = Pair.of(pair_path)
    paths = photo_info(pair, 1).path, photo_info(pair, 2).path
    images = read_greys(*paths, in_water=pair.refracted)
    return pair, match_pair(pair, images, settings)


class SetSummary(TypedDict):
    """What `match` reports of a set."""

    count: int
    photos: dict[str, int]
    in_three: int
    kinds: dict[str, int]
    sigma_px: float
    relief_range: tuple[float, float]
    sigma_r_median: float


class MatchSummary(TypedDict):
    """What `match` reports of a pair."""

    count: int
    kinds: dict[str, int]
    sigma_px: float
    misfit_px: float
    relief_range: tuple[float, float]
    sigma_r_median: float
    rests_on: str
    fewest_in_part: int
    empty: list[dict[str, list[int]]]


def match_set_file(
    photos: PhotoSet, out: Path, settings: MatchSettings, *, overwrite: bool = False
) -> SetSummary:
    """Find homologous points in three photos and more, write them as a table, return a summary.

    Raises
    ------
    InputError, GeometryError
        If a file is at fault, or photos and set do not belong together.
    """
    check_ending(
        out, remark("photo_set.matches_as_table", name=out.with_suffix(".csv").name), ".csv"
    )
    check_new_workbook(out, overwrite=overwrite)
    paths = [set_photo_info(photos, number).path for number in range(len(photos))]

    def greys(first: int, second: int) -> tuple[ByteArray, ByteArray]:
        return read_greys(paths[first], paths[second], in_water=photos.layers is not None)

    matches = match_set(photos, greys, settings)
    matches.write(out, overwrite=overwrite)
    picked = np.isfinite(matches.pixels[..., 0])
    low, high = np.nanpercentile(matches.points.xyz[:, 2], [1, 99])
    return {
        "count": len(matches.ids),
        "photos": dict(zip(photos.names, picked.sum(axis=1).tolist(), strict=True)),
        "in_three": int((picked.sum(axis=0) > 2).sum()),
        "kinds": {kind: matches.kinds.count(kind) for kind in sorted(set(matches.kinds))},
        "sigma_px": matches.sigma_px,
        "relief_range": (float(low), float(high)),
        "sigma_r_median": float(np.nanmedian(matches.points.sigma[:, 2])),
    }


#: A part of the photo with fewer features counts as empty: one or two may be chance.
FEWEST_IN_PART = 3
#: Parts of the far photo that are asked, across and down.
PARTS = (6, 4)


def match_summary(pair: Pair, matches: Matches) -> MatchSummary:
    """Return what `match` reports."""
    solved = pair.intersect(matches.pixels1, matches.pixels2, sigma_px=precision(matches))
    kinds = {kind: matches.kinds.count(kind) for kind in sorted(set(matches.kinds))}
    least = fewest_in_part(matches)
    low, high = np.nanpercentile(solved.xyz[:, 2], [1, 99])
    return {
        "count": len(matches.ids),
        "kinds": kinds,
        "sigma_px": float(np.median(matches.sigma)),
        "misfit_px": float(np.median(np.abs(matches.misfit)) * 1.4826),
        "relief_range": (float(low), float(high)),
        "sigma_r_median": float(np.nanmedian(solved.sigma[:, 2])),
        "rests_on": rests_on(
            pair,
            setup="the pair as given",
            picks=f"matches of {precision(matches):.2g} px measured",
        ),
        "fewest_in_part": least,
        "empty": empty_parts(pair, matches, least),
    }


def fewest_in_part(matches: Matches) -> int:
    """Return how many points a part of the far photo must hold, not to count as empty.

    One, where there are only targets, which stand where they were put, or so few points that an
    even spread leaves hardly more than that in a part.
    """
    features = matches.kinds.count("feature")
    return FEWEST_IN_PART if features >= 4 * FEWEST_IN_PART * PARTS[0] * PARTS[1] else 1


def empty_parts(pair: Pair, matches: Matches, least: int) -> list[dict[str, list[int]]]:
    """Return the parts of the far photo that both photos show with fewer points than ``least``.

    Each as ``columns`` and ``rows``, first and last. [px]
    """
    sizes = [photo_info(pair, number).size for number in (1, 2)]
    parts = np.array(PARTS)
    side = np.array(sizes[0]) / parts
    place = np.clip((matches.pixels1 + 0.5) // side, 0, parts - 1).astype(int)
    counts = np.zeros(parts, dtype=int)
    np.add.at(counts, (place[:, 0], place[:, 1]), 1)
    out = []
    for row in range(int(parts[1])):
        for column in range(int(parts[0])):
            low = np.array([column, row]) * side
            corners = low + side * np.array([[0.2, 0.2], [0.8, 0.2], [0.2, 0.8], [0.8, 0.8]])
            near = pair.image2.pixels_from_plane(pair.image1.plane_from_pixels(corners))
            shown = ((near > 0) & (near < sizes[1])).all()
            if shown and counts[column, row] < least:
                last = low + side - 1
                out.append(
                    {
                        "columns": [round(low[0]), round(last[0])],
                        "rows": [round(low[1]), round(last[1])],
                    }
                )
    return out
