"""Point clouds read and copied in pieces with every attribute kept."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from photocore.arrays import FloatArray, IntArray
from photocore.errors import LARGEST, InputError
from photocore.output import atomic_path
from photocore.provenance import note

#: Points per piece: some 100 MB at the most, whatever the attributes.
PIECE = 200_000


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudPiece:
    """A piece of a cloud.

    Attributes
    ----------
    xyz : ndarray, shape (n, 3)
    numbers : dict of str to ndarray, shape (n,)
        Further numeric columns that were asked for and exist.
    texts : dict of str to list of str
        Further text columns that were asked for and exist.
    raw : object
        What a copy needs to give every attribute back.
    """

    xyz: FloatArray
    raw: Any
    numbers: Mapping[str, FloatArray] = field(default_factory=dict)
    texts: Mapping[str, list[str]] = field(default_factory=dict)


def checked_positions(path: Path, xyz: FloatArray) -> FloatArray:
    """Return positions, shape (n, 3), as they are; NaN stands for unknown.

    Raises
    ------
    InputError
        If one is infinite or beyond `LARGEST`.
    """
    if (np.abs(xyz) > LARGEST).any():
        worst = np.nanmax(np.abs(xyz))
        raise InputError(f"{path}: a coordinate of {worst:.3g} cannot be; expected metres.")
    return xyz


#: Values of the new attributes by name.
NewValues = Mapping[str, FloatArray | IntArray | list[str]]
#: Writes a piece with new positions and the values of the new attributes, by name; rows whose
#: position is unchanged stay bit for bit.
PieceWriter = Callable[[CloudPiece, FloatArray, NewValues], None]
#: New attributes of a copy: name to numpy type without byte order, and a description.
NewAttributes = Mapping[str, tuple[str, str]]


class Cloud(ABC):
    """An open point cloud.

    Attributes
    ----------
    path : Path
    remarks : list of str
        What the user should know about the file.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.remarks = path, list[str]()
        note(path)

    @abstractmethod
    def pieces(
        self, *, numbers: Sequence[str] = (), texts: Sequence[str] = ()
    ) -> Iterator[CloudPiece]:
        """Yield the cloud in pieces, with the further columns asked for."""

    @contextmanager
    def copy(self, path: Path, extra: NewAttributes, *, overwrite: bool) -> Iterator[PieceWriter]:
        """Yield a writer of the same format with new attributes; whole or not at all."""
        with (
            atomic_path(path, overwrite=overwrite) as temporary,
            self._written(temporary, extra) as write,
        ):
            yield write

    @abstractmethod
    def _written(self, path: Path, extra: NewAttributes) -> AbstractContextManager[PieceWriter]:
        """Yield the writer of a file that is empty yet."""

    @abstractmethod
    def has(self, name: str) -> bool:
        """Return whether the cloud has an attribute of that name."""
