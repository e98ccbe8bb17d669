"""Jobs that set photos up: two of them, further ones beside these, or one alone."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from bifocal.campaigns import rectify_photo
from bifocal.collimation.proposals import wall_sheet
from bifocal.collimation.work.tasks import AlignTask, Joined, JoinTask, Rectified, RectifyTask
from bifocal.matching import MatchSettings
from bifocal.model import NAMES, Pair
from bifocal.networks import align_photo_set
from bifocal.options.commands import RectifyCommand
from bifocal.orientation import SiteMeasures, align_photos, alignment_as_dict
from bifocal.workbook import match_pair_file, read_pair
from photocore.cli import Progress
from photocore.images import image_info
from photocore.options import options_of
from photocore.tables import write_csv
from photocore.tables.csvwrite import Columns

#: Points of a pair that hold the frame where further photos join it.
FRAME = 24


def align(task: AlignTask, progress: Progress) -> dict[str, object]:
    """Orient two photos."""
    progress(0.0, 1.0)
    alignment = align_photos(task.far, task.near, task.out, task.options, overwrite=True)
    sizes = [image_info(path).size for path in (task.far, task.near)]
    if alignment.pair.photo_file(1).name != task.far.name:
        sizes.reverse()
    sheets = zip((alignment.tie1, alignment.tie2), sizes, strict=True)
    return alignment_as_dict(alignment) | {
        "free_scale": task.free_scale,
        "planes": alignment.setup["planes"],
        "wall": [wall_sheet(ties, alignment.wall, size) for ties, size in sheets],
    }


def join(task: JoinTask, progress: Progress) -> Joined:
    """Adjust a pair and further photos of its wall together.

    Without control points, points that the pair gives hold the frame, as precisely as it gives
    them: X, Y and r stay those of the pair.
    """
    options, photos = task.options, list(task.photos)
    with tempfile.TemporaryDirectory() as folder:
        if options.control is None:
            control, site = Path(folder) / "points.csv", options.site
            pair, distance_row = read_pair(task.pair), NAMES.index("Z 1")
            variance = (
                None if pair.orientation is None else pair.orientation[distance_row, distance_row]
            )
            site = SiteMeasures(
                sigma_control=_frame(pair, control, len(photos)), distance1=pair.d1,
                sigma=site.sigma if variance is None else max(float(np.sqrt(variance)), 1e-4),
            )  # fmt: skip
            options = replace(options, control=control, site=site)
        alignment = align_photo_set(photos, task.out, options, overwrite=True, progress=progress)
    lenses = {photo.extra.get("lens") for photo in alignment.photos.photos} - {None}
    # Of points that the program chose nobody can mend the picks.
    of_control = alignment.remarks if task.options.control else ()
    return {"remarks": [*alignment.words, *of_control], "lenses": sorted(map(str, lenses))}


def _frame(pair: Pair, table: Path, photos: int) -> float:
    """Write points of a pair, spread over it, as control points; return their precision. [m]"""
    _, matches = match_pair_file(pair, MatchSettings(count=FRAME, features=True))
    solved = pair.intersect(matches.pixels1, matches.pixels2)
    sigma = np.sqrt(np.trace(solved.covariance, axis1=1, axis2=2) / 3)
    good = np.array([flag in ("OK", "ON-PLANE") for flag in solved.flags]) & (sigma > 0)
    columns: Columns = {"id": [name for name, keep in zip(matches.ids, good, strict=True) if keep]}
    columns |= dict(zip(("X [m]", "Y [m]", "r [m]"), solved.xyz[good].T, strict=True))
    blank = np.full(int(good.sum()), np.nan)
    pixels = [*matches.pixels1[good].T, *matches.pixels2[good].T, *[blank] * (2 * photos - 4)]
    names = [f"{axis}{number} [px]" for number in range(1, photos + 1) for axis in ("col", "row")]
    write_csv(table, columns | dict(zip(names, pixels, strict=True)), overwrite=True)
    return float(np.median(sigma[good])) if good.any() else SiteMeasures().sigma_control


def rectify(task: RectifyTask, progress: Progress) -> Rectified:
    """Bring one photo alone to scale, with drawings."""
    settings = {name: one.fixed_default for name, one in options_of(RectifyCommand).items()}
    settings |= {
        "scale": 50.0, **task.settings, "corners": task.corners.ravel(), "rectangle": task.sides,
    }  # fmt: skip
    done = rectify_photo(
        task.photo, task.out, settings, folder=task.folder, overwrite=task.overwrite,
        progress=progress,
    )  # fmt: skip
    assert done.delivery is not None
    width, height = task.sides
    rectangle = np.array([[0, height], [width, height], [width, 0], [0, 0]], dtype=float)
    fitted = done.photo.as_pair().image1.pixels_from_plane(rectangle)
    apart = fitted[None] - task.corners[:, None]  # whichever corner the rectangle was begun at
    nearest = np.linalg.norm(apart, axis=2).argmin(axis=1)
    misfits = apart[range(len(task.corners)), nearest].tolist()
    words = [*done.words, *done.remarks]
    return {"words": words, "files": done.delivery.files, "misfits": misfits}
