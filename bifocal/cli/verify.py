"""``bifocal verify``."""

from __future__ import annotations

from pathlib import Path

from photocore.cli import print_result, progress_bar
from photocore.errors import InputError
from photocore.options import declared


@declared
def command(delivery: Path, remake: bool, sources: Path | None, as_json: bool) -> None:
    """Check that a delivery is what was made: one line a file, exit status 1 if anything differs.

    DIR is a folder of facade or survey, ZIP an archive of it or the page's download. Every file is
    held against the hash kept when it was made, the worked point of each report is computed anew
    from its pixels and the pair file. Nothing is written into the delivery. The digest at the end,
    told by another way (in the letter), proves that the list of hashes was not exchanged as well.
    """
    from bifocal.campaigns.verification import verify

    with progress_bar("verify", quiet=as_json) as progress:
        found = verify(delivery, remake=remake, sources=sources, progress=progress)
    print_result(found.to_dict(), found.lines(), as_json=as_json)
    if not found.same:
        raise InputError(f"{delivery}: is not what was made: {found.summary()}.")
