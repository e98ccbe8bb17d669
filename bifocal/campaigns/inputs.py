"""What a pair is made from, looked at before any work is done."""

from __future__ import annotations

from bifocal.campaigns.pair_points import known_of
from bifocal.campaigns.surveyed_pair import PairJob, tables_of
from bifocal.faces import read_faces
from bifocal.model import Lens
from bifocal.reports import refuse_same_names
from photocore.decoding import refuse_damaged_jpeg
from photocore.images import image_info, read_image
from photocore.textfile import check_file


def check_files(job: PairJob) -> None:
    """Refuse photos, lens files and tables that cannot be read, before any work is done.

    Raises
    ------
    InputError
        Naming the first of them.
    """
    for path in (*job.photos, *job.files.values()):
        check_file(path)
    if "faces" in job.files:
        read_faces(job.files["faces"])
    for path in job.photos:
        image_info(path)
    for role in sorted({"lens", "lens1", "lens2"} & job.files.keys()):
        Lens.read(job.files[role])
    tables = tables_of(job)
    ids = {role: points.ids for role, points in known_of(job).items()}
    if len(ids) > 1:
        refuse_same_names(tables["control"], tables["check"], ids["control"], ids["check"])


def check_photos(job: PairJob) -> None:
    """Refuse photos of which a part is missing or damaged: all of them are decoded.

    Raises
    ------
    InputError
        Naming the first of them.
    """
    for path in job.photos:
        if path.suffix.lower() in (".jpg", ".jpeg"):
            refuse_damaged_jpeg(path)
        else:
            read_image(path, grey=True)
