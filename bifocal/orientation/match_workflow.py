"""A pair file in, a survey workbook (or CSV) of homologous points out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bifocal.files.images import read_image, to_eight_bit
from bifocal.model.pair import Pair
from bifocal.orientation.matching import Matches, MatchSettings, match_pair
from bifocal.survey.observations import PointObservations
from bifocal.survey.template_workflow import write_survey
from photocore.arrays import ByteArray
from photocore.errors import InputError
from photocore.output import check_writable
from photocore.tables import write_csv


def match_photos(
    pair_path: Path,
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
    if out.suffix.lower() not in {".xlsx", ".csv"}:
        raise InputError(f"{out}: points are written as .xlsx (survey workbook) or .csv.")
    check_writable(out, overwrite=overwrite)
    pair = Pair.read(pair_path)
    images = (_photo(pair, 1), _photo(pair, 2))
    found = match_pair(pair, images, settings)
    sigma = precision(found)
    if out.suffix.lower() == ".csv":
        write_csv(out, csv_columns(found), formats=_FORMATS, overwrite=overwrite)
    else:
        write_survey(
            out,
            PointObservations(
                ids=found.ids,
                pixels1=np.round(found.pixels1, 4),
                pixels2=np.round(found.pixels2, 4),
                code=found.kinds,
                note=tuple(
                    f"sigma {s:.2f} px, misfit {abs(m):.2f} px"
                    for s, m in zip(found.sigma, found.misfit, strict=True)
                ),
            ),
            pair=pair,
            pair_path=pair_path,
            sigma_px=round(sigma, 3),
            language=language,
            what=f"{len(found.ids)} points found by bifocal match",
            overwrite=overwrite,
        )
    return pair, found


def precision(found: Matches) -> float:
    """Return the precision of the points: what the patches say, or the misfits if worse. [px]

    A misfit holds the noise of both photos and what the set-up leaves.
    """
    misfit = 1.4826 * float(np.median(np.abs(found.misfit))) / np.sqrt(2.0)
    return float(np.clip(max(float(np.median(found.sigma)), misfit), 0.01, 2.0))


_FORMATS = {
    "col1 [px]": ".4f",
    "row1 [px]": ".4f",
    "col2 [px]": ".4f",
    "row2 [px]": ".4f",
    "sigma [px]": ".3f",
    "misfit [px]": ".3f",
    "agreement": ".3f",
}


def csv_columns(found: Matches) -> dict[str, Any]:
    """Return the columns of the text table, in order."""
    return {
        "id": list(found.ids),
        "col1 [px]": found.pixels1[:, 0],
        "row1 [px]": found.pixels1[:, 1],
        "col2 [px]": found.pixels2[:, 0],
        "row2 [px]": found.pixels2[:, 1],
        "sigma [px]": found.sigma,
        "misfit [px]": found.misfit,
        "agreement": found.agreement,
        "code": list(found.kinds),
    }


def match_summary(pair: Pair, found: Matches) -> dict[str, Any]:
    """Return what `match` reports."""
    solved = pair.intersect(found.pixels1, found.pixels2, sigma_px=precision(found))
    relief = solved.xyz[:, 2]
    sigma = np.sqrt(solved.covariance[:, 2, 2])
    kinds = {kind: found.kinds.count(kind) for kind in sorted(set(found.kinds))}
    return {
        "count": len(found.ids),
        "kinds": kinds,
        "sigma_px": float(np.median(found.sigma)),
        "misfit_px": float(np.median(np.abs(found.misfit)) * 1.4826),
        "relief_range": np.nanpercentile(relief, [1, 99]),
        "sigma_r_median": float(np.nanmedian(sigma)),
    }


def _photo(pair: Pair, number: int) -> ByteArray:
    """Return one photo of the pair, grey."""
    image = read_image(pair.photo_file(number), grey=True)
    return np.asarray(to_eight_bit(image), dtype=np.uint8)
