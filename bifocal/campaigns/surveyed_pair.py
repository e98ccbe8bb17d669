"""A pair of a survey as plain data: its photos, files and options, and what is wanted of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bifocal.campaigns.step_store import StepRecord
from bifocal.faces import faces_path
from photocore.errors import InputError
from photocore.textfile import file_name

#: What may be wanted of a pair, in the order of work.
PRODUCTS = ("relief", "points", "ortho", "drawing", "view", "report")


#: What is made where nothing else is said: the drawing has the orthophoto.
MOST_PRODUCTS = ("relief", "points", "drawing", "view", "report")


#: The first step of every pair.
FIRST_STEP = "align"


#: Of drawings where none is asked for, 1:50.
SCALE = 50.0


#: How the file of a set of photos ends.
SET_ENDING = ".photos.json"


#: How the file is called that a step makes before all others, behind the pair's name.
MADE = {
    "align": ".pair.json",
    "relief": "_relief.tif",
    "ortho": "_ortho.tif",
    "drawing": ".tif",
    "view": "_view.html",
}


#: Memory of a pair in work: of the program, and for each pixel of its larger photo. Measured at
#: 6.3 MP: 1.63 GB on church_2, 2.30 GB on church_1, whose map reaches far beyond the photo; at 8 MP
#: 1.20 GB on berlin_1. [bytes]
BASE_MEMORY, MEMORY_PER_PIXEL = 300 << 20, 380


@dataclass(frozen=True, slots=True, kw_only=True)
class PairJob:
    """A pair to be surveyed: plain data that can be sent to another machine.

    Attributes
    ----------
    name : str
        In the survey; its files are called by it.
    folder : Path
        Where the folders of its steps lie.
    far, near : Path
        Photos.
    more : tuple of Path
        The others of a set.
    files : mapping of str to Path
        By the names of `bifocal.options.FILES`, where given.
    options : mapping
        By the names of `bifocal.options.OF_PAIR`; absent: default.
    products : tuple of str
        Of `PRODUCTS`.
    overwrite : bool
        Replace files that were changed after they were made.
    date : str
        That its files bear, wherever and whenever they are made; empty: the day they are made.
    joint : Path or None
        Folder with the pair files of all pairs adjusted in one frame; None: this pair's own.
    way : str
        What the user began it with: ``facade`` or ``survey``.
    told : mapping of str to StepRecord
        By step, that files state in place of what is typed and timed now.
    """

    name: str
    folder: Path
    far: Path
    near: Path
    more: tuple[Path, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    products: tuple[str, ...] = MOST_PRODUCTS
    overwrite: bool = False
    date: str = ""
    joint: Path | None = None
    way: str = "survey"
    told: Mapping[str, StepRecord] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Take the faces kept beside the pair, where none are given and they are not refused."""
        typed_path = self.files.get("faces")
        beside = self.folder / FIRST_STEP / f"{self.title}{MADE[FIRST_STEP]}"
        faces = faces_path(typed_path, beside, self.pair_path)
        if faces != typed_path:
            rest = {role: path for role, path in self.files.items() if role != "faces"}
            object.__setattr__(self, "files", rest | ({"faces": faces} if faces else {}))

    @property
    def photos(self) -> tuple[Path, ...]:
        """All photos, as they were named."""
        return (self.far, self.near, *self.more)

    @property
    def title(self) -> str:
        """The name as file name."""
        return file_name(self.name)

    @property
    def pair_path(self) -> Path:
        """The pair file that relief and drawings are made with."""
        alone = self.product("align")
        return alone if self.joint is None else self.joint / alone.name

    def product(self, step: str) -> Path:
        """Return the file that a step makes before all others."""
        ending = SET_ENDING if self.more and step == FIRST_STEP else MADE[step]
        return self.folder / step / f"{self.title}{ending}"

    def options_of(self, *names: str) -> dict[str, Any]:
        """Return those of the options that are given."""
        return {name: self.options[name] for name in names if name in self.options}

    def ortho_path(self, steps: Sequence[str]) -> Path | None:
        """Return the orthophoto that these steps make, that of the drawing first."""
        steps_with = (step for step in ("drawing", "ortho") if step in steps)
        return next(map(self.product, steps_with), None)

    def memory(self) -> int:
        """Return the memory it needs at most; that of small photos where they cannot be read.

        In bytes.
        """
        from photocore.images import image_info

        pixels = 0
        for path in self.photos:
            try:
                width, height = image_info(path).size
            except InputError:
                continue
            pixels = max(pixels, width * height)
        return BASE_MEMORY + MEMORY_PER_PIXEL * pixels


def tables_of(job: PairJob) -> dict[str, Path]:
    """Return the tables of known points of a pair."""
    return {role: job.files[role] for role in ("control", "check") if role in job.files}
