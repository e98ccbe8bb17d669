"""Homologous points and their text table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from photocore.arrays import FloatArray
from photocore.tables import Column, read_table, write_csv
from photocore.tables.csvwrite import Columns

_PIXELS = ("col1 [px]", "row1 [px]", "col2 [px]", "row2 [px]")
_QUALITY = ("sigma [px]", "misfit [px]", "agreement")
_FORMATS = dict.fromkeys(_PIXELS, ".4f") | dict.fromkeys(_QUALITY, ".3f")
_COLUMNS = (
    Column("id", kind="text"),
    *(Column(key.split(" ")[0], unit="px", required=True) for key in _PIXELS),
    *(Column(key.split(" ")[0]) for key in _QUALITY),
    Column("code", kind="text"),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matches:
    """Homologous points.

    Attributes
    ----------
    pixels1, pixels2 : ndarray, shape (n, 2)
        Raw pixels. [px]
    sigma : ndarray, shape (n,)
        Precision of the position along the radial line. [px]
    misfit : ndarray, shape (n,)
        How far off the line the patch fits best. [px]
    agreement : ndarray, shape (n,)
        Correlation of the patches, up to 1.
    ids : tuple of str
    kinds : tuple of str
        ``feature``, ``disc`` or ``code``.
    """

    pixels1: FloatArray
    pixels2: FloatArray
    sigma: FloatArray
    misfit: FloatArray
    agreement: FloatArray
    ids: tuple[str, ...]
    kinds: tuple[str, ...]

    @classmethod
    def read(cls, path: Path | str) -> Matches:
        """Return the points of a table that `write` or ``bifocal match`` wrote.

        Raises
        ------
        InputError
            If the file is missing or lacks a column of pixels.
        """
        table = read_table(path, _COLUMNS)
        col1, row1, col2, row2, sigma, misfit, agreement = (
            table.numbers(column.key) for column in _COLUMNS[1:-1]
        )
        return cls(
            pixels1=np.stack([col1, row1], axis=-1),
            pixels2=np.stack([col2, row2], axis=-1),
            sigma=sigma,
            misfit=misfit,
            agreement=agreement,
            ids=tuple(table.texts("id")),
            kinds=tuple(table.texts("code")),
        )

    @property
    def columns(self) -> Columns:
        """Names and raw pixels by the keys that `bifocal.solve` takes. [px]"""
        keys = (heading.split(" ")[0] for heading in _PIXELS)
        pixels = dict(zip(keys, np.hstack([self.pixels1, self.pixels2]).T, strict=True))
        return {"id": list(self.ids), **pixels, "code": list(self.kinds)}

    def write(self, path: Path | str, *, overwrite: bool = False) -> None:
        """Write the points as a text table that ``bifocal solve --pair`` takes.

        Raises
        ------
        InputError
            If the file exists and is not to be overwritten, or cannot be written.
        """
        pixels = np.hstack([self.pixels1, self.pixels2]).T
        columns = {
            "id": list(self.ids),
            **dict(zip(_PIXELS, pixels, strict=True)),
            **dict(zip(_QUALITY, (self.sigma, self.misfit, self.agreement), strict=True)),
            "code": list(self.kinds),
        }
        write_csv(path, columns, formats=_FORMATS, overwrite=overwrite)
