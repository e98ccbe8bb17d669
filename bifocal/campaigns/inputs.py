"""What a pair is made from, looked at before any work is done."""

from __future__ import annotations

from bifocal.campaigns.pair_steps import PairJob, tables_of
from bifocal.faces.faces_files import read_faces
from bifocal.model.lens import Lens
from bifocal.orientation.control_points import read_control
from photocore.images import image_info
from photocore.textfile import check_file, check_name


def check_files(job: PairJob) -> None:
    """Refuse photos, lens files and tables that cannot be read, before any work is done.

    Raises
    ------
    InputError
        Naming the first of them.
    """
    for path in (*job.photos, *job.files.values()):
        check_name(path)
        check_file(path)
    if "faces" in job.files:
        read_faces(job.files["faces"])
    for path in job.photos:
        image_info(path)
    for role in sorted({"lens", "lens1", "lens2"} & job.files.keys()):
        Lens.read(job.files[role])
    for path in tables_of(job).values():
        read_control(
            path, sigma=0.003, sigma_plane=0.005, unit=job.options.get("unit", ""),
            photos=len(job.photos),
        )  # fmt: skip
