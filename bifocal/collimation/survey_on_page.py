"""What a survey open on the page shows of itself to the modules that it is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from bifocal.collimation.pictures import Pictures
from bifocal.collimation.products import Products
from bifocal.collimation.project import SurveyFiles
from bifocal.collimation.proposals import Proposal, Report
from bifocal.collimation.records import SurveyState
from bifocal.model import Pair


class SurveyOnPage(Protocol):
    """Its files, records, pictures and products; the orientation accepted, and what is proposed."""

    files: SurveyFiles
    state: SurveyState
    pictures: Pictures
    products: Products
    proposal: Proposal | None

    @property
    def proposed_path(self) -> Path | None:
        """The pair file that waits to be accepted."""
        ...

    @property
    def accepted_pair(self) -> Pair | None:
        """The orientation that the workbook is written for; None before one is accepted."""
        ...

    def take_files(self, pair: Path | None, proposal: Proposal | None) -> None:
        """Let this be the pair file of the photos shown, or what is proposed instead."""

    def note_proposed(self, path: Path, report: Report) -> None:
        """Let a pair file be the orientation that waits to be accepted."""

    def note_made(
        self, kind: str, names: Sequence[str], causes: Mapping[str, str] | None = None
    ) -> None:
        """Say in the journal which files the page made, and from what."""

    def show_products(self) -> None:
        """Show the orthophoto, where there is one."""
