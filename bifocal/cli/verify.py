"""``bifocal verify``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from photocore.cli import print_result, progress_bar
from photocore.errors import InputError
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption


@dataclass(frozen=True, kw_only=True)
class VerifyCommand:
    """The options of ``bifocal verify``, and examples.

    bifocal verify DIR
    bifocal verify DIR --remake
    """

    delivery: Annotated[Path, Argument(unit="DIR|ZIP")]
    remake: bool = False
    """Make the products anew in a folder that only passes, and compare them."""
    sources: Annotated[Path | None, Typed(unit="DIR")] = None
    """Photos and tables for --remake.  [default: where they were, or in the delivery]"""
    as_json: JsonOption = False


@declared(VerifyCommand)
def command(options: VerifyCommand) -> None:
    """Check that a delivery is what was made: one line a file, exit status 1 if anything differs.

    DIR is a folder of facade or survey, ZIP an archive of it or the page's download. Every file is
    held against the hash kept when it was made, the worked point of each report is computed anew
    from its pixels and the pair file. Nothing is written into the delivery. The digest at the end,
    told by another way (in the letter), proves that the list of hashes was not exchanged as well.
    """
    from bifocal.campaigns import verify

    with progress_bar("verify", quiet=options.as_json) as progress:
        verification = verify(
            options.delivery, remake=options.remake, sources=options.sources, progress=progress
        )
    print_result(verification.to_dict(), verification.lines(), as_json=options.as_json)
    if not verification.same:
        raise InputError(f"{options.delivery}: is not what was made: {verification.summary()}.")
