"""Control points and distances measured on site, and their tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from bifocal.model import Points, WorldFrame
from bifocal.orientation.control_lists import (
    ListedPoints,
    in_plane_frame,
    is_long,
    lacks_axis,
    of_rows,
    without_unseen,
)
from bifocal.orientation.tuning import CONTROL
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import CellError, InputError, WorkbookError
from photocore.names import meant, nearest
from photocore.tables import Column, Table, parse_column_map, read_table
from photocore.tables.axes import (
    COLUMNS_OF_PIXELS,
    EAST,
    HEIGHT,
    NAMES,
    NORTH,
    PHOTOS,
    ROWS_OF_PIXELS,
)
from photocore.tables.heading_words import bare
from photocore.tables.numbers import METRES

_ALONE = {"col1": ("col", *COLUMNS_OF_PIXELS), "row1": ("row", *ROWS_OF_PIXELS)}
COLUMNS = (
    Column("id", NAMES, kind="text"),
    Column("X", ("X_ref", "X wall", "X control", *EAST), unit="m"),
    Column("Y", ("Y_ref", "Y wall", "Y control", *NORTH), unit="m"),
    Column("r", ("r measured", "relief", "Z", "Z_ref", "r_ref", "rilievo", "relief measured"),
           unit="m"),
    Column("H", HEIGHT, unit="m"),
    Column("col1", ("column1", "col far", "x far", "colonna1", "spalte1"), unit="px"),
    Column("row1", ("row far", "y far", "riga1", "zeile1"), unit="px"),
    Column("col2", ("column2", "col near", "x near", "colonna2", "spalte2"), unit="px"),
    Column("row2", ("row near", "y near", "riga2", "zeile2"), unit="px"),
    Column("sigma", ("sigma control", "std"), unit="m"),
    Column("use", ("usa", "usare", "verwenden", "benutzen", "active", "enabled"), kind="flag"),
)  # fmt: skip
#: The same of one photo alone.
ALONE = tuple(
    replace(column, aliases=(*column.aliases, *_ALONE.get(column.key, ()))) for column in COLUMNS
)
#: Of a row for each photo that shows a point.
A_PHOTO = (
    Column("photo", PHOTOS, kind="text"),
    *(
        Column(key, words, unit="px")
        for key, words in zip(("col", "row"), _ALONE.values(), strict=True)
    ),
)
LENGTHS = (
    Column("from", ("point 1", "da", "von", "a"), kind="text", required=True),
    Column("to", ("point 2", "nach", "b"), kind="text", required=True),
    Column("length", ("distance", "lunghezza", "distanza", "laenge", "länge", "strecke"),
           required=True, unit="m"),
    Column("sigma", ("sigma length", "std"), unit="m"),
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Control:
    """Control points: what was measured on site, and where it is seen.

    Attributes
    ----------
    ids : tuple of str
    xyz : ndarray, shape (n, 3)
        X, Y, r in the plane frame; NaN where not measured. [m]
    sigma : ndarray, shape (n, 3)
        Standard deviations of xyz. [m]
    pixels1, pixels2 : ndarray, shape (n, 2)
        Picks in the far and the near photo; NaN where not picked. [px]
    lengths : tuple of (int, int, float)
        Taped distances between two of the points: indices and metres.
    sigma_lengths : tuple of float
        Standard deviations of these; where they are left out or NaN, that of the best coordinate,
        3 mm at most. [m]
    more : tuple of ndarray, each of shape (n, 2)
        Picks in the third photo of a set and those that follow. [px]
    remarks : tuple of str
        What the reader of the table left out or used with doubt.
    frame : WorldFrame or None
        Where X, Y, r lie, if they were made of E, N, H.
    """

    ids: tuple[str, ...] = ()
    xyz: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    sigma: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    pixels1: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    pixels2: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    lengths: tuple[tuple[int, int, float], ...] = ()
    sigma_lengths: tuple[float, ...] = ()
    more: tuple[FloatArray, ...] = ()
    remarks: tuple[str, ...] = ()
    frame: WorldFrame | None = None

    def __post_init__(self) -> None:
        count = len(self.ids)
        shapes = [self.xyz.shape, self.sigma.shape, *(picks.shape for picks in self.picks)]
        if shapes != [(count, 3)] * 2 + [(count, 2)] * len(self.picks):
            raise InputError(f"control: {count} ids but arrays of shape {shapes}.")
        if len(self.sigma_lengths) not in (0, len(self.lengths)):
            raise InputError("control: sigma_lengths and lengths are not equally many.")

    def exchanged(self) -> Control:
        """Return the same points with far and near photo exchanged."""
        return replace(self, pixels1=self.pixels2, pixels2=self.pixels1)

    @property
    def picks(self) -> tuple[FloatArray, ...]:
        """Picks in every photo, as they were given."""
        return (self.pixels1, self.pixels2, *self.more)

    def of(self, far: int, near: int) -> Control:
        """Return the points of two photos of a set, by numbers from 0; not picked: blank."""
        blank = np.full((len(self.ids), 2), np.nan)  # a length is picked in the first photo alone
        picks = [self.picks[k] if k < len(self.picks) else blank for k in (far, near)]
        return replace(self, pixels1=picks[0], pixels2=picks[1], more=())

    def only(self, rows: BoolArray) -> Control:
        """Return the points of some rows; taped lengths are added later."""
        return replace(
            self, ids=tuple(name for name, is_in in zip(self.ids, rows, strict=True) if is_in),
            xyz=self.xyz[rows], sigma=self.sigma[rows], pixels1=self.pixels1[rows],
            pixels2=self.pixels2[rows], more=tuple(picks[rows] for picks in self.more),
        )  # fmt: skip

    def with_length(self, length: tuple[tuple[float, ...], float], sigma: float) -> Control:
        """Return control with two more points on the wall and the length between them.

        Parameters
        ----------
        length : tuple
            Column and row of both ends in photo 1 [px], and the metres between them.
        sigma : float
            Of control. [m]
        """
        count = len(self.ids)
        ends = np.array(length[0], dtype=np.float64).reshape(2, 2)
        sigmas = np.full((2, 3), max(sigma, CONTROL.sigma_on_wall))
        unseen = np.full((2, 2), np.nan)
        return replace(
            self,
            ids=(*self.ids, "length, one end", "length, other end"),
            xyz=np.concatenate([self.xyz, [[np.nan, np.nan, 0.0]] * 2]),
            sigma=np.concatenate([self.sigma, sigmas]),
            pixels1=np.concatenate([self.pixels1, ends]),
            pixels2=np.concatenate([self.pixels2, unseen]),
            more=tuple(np.concatenate([picks, unseen]) for picks in self.more),
            lengths=(*self.lengths, (count, count + 1, length[1])),
        )

    @property
    def positioned(self) -> BoolArray:
        """Which points have X and Y, shape (n,)."""
        return np.asarray(np.isfinite(self.xyz[:, :2]).all(axis=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteMeasures:
    """What was measured on site beside the control points, and what is known of the photos.

    Attributes
    ----------
    distance1, distance2, delta_d : float or None
        Of the cameras from the wall, and their difference; None where not measured. [m]
    sigma : float
        Of the distances. [m]
    parallel : bool
        Whether both photos were taken parallel to the wall.
    sigma_control : float
        Of the coordinates of control points. [m]
    sigma_pick : float
        Of their pixels. [px]
    wall : (float, float) or None
        Column and row of a pixel of the far photo that shows the wall. [px]
    ordered : bool
        Whether the photos are in the order in which the user wants them, whatever they show.
    """

    distance1: float | None = None
    distance2: float | None = None
    delta_d: float | None = None
    sigma: float = 0.02
    parallel: bool = False
    sigma_control: float = 0.003
    sigma_pick: float = 0.5
    wall: tuple[float, float] | None = None
    ordered: bool = False

    @property
    def distances(self) -> tuple[float | None, float | None]:
        """Both distances, one of them by the difference where only that was measured. [m]"""
        d1, d2, delta = self.distance1, self.distance2, self.delta_d
        if delta:
            d1, d2 = d1 or (d2 + delta if d2 else None), d2 or (d1 - delta if d1 else None)
        return d1, d2

    @property
    def far_first(self) -> SiteMeasures:
        """These, with the longer of both taped distances as the far camera's."""
        d1, d2 = self.distance1, self.distance2
        return replace(self, distance1=d2, distance2=d1) if d1 and d2 and d1 < d2 else self


def read_control(
    path: Path | str,
    *,
    sigma: float = 0.003,
    sigma_plane: float | None = CONTROL.sigma_on_wall,
    unit: str = "",
    columns: str | None = None,
    unnamed: str = "",
    photos: int = 2,
    names: Sequence[str] = (),
    frame: WorldFrame | None = None,
    with_places: bool = False,
) -> Control:
    """Read control points: id, X, Y, r and their pixels col1, row1, col2, row2.

    Three coordinates E, N, H of an upright wall are made X along it, Y its height, r outwards.

    Parameters
    ----------
    path : path
        ``.csv``, ``.xlsx``, ``.xlsm`` or ``.ods``.
    sigma : float
        Standard deviation of a coordinate where the table has none. [m]
    sigma_plane : float or None
        That of r = 0 for a point on the wall whose r is blank; None: it stays unknown. [m]
    unit : str
        Unit of the coordinates; by default the headings', else metres.
    columns : str, optional
        Which column is which, ``"id=A,X=East"``; by default as the headings say.
    unnamed : str
        Goes before the row's number in the name of a row that has none.
    photos : int
        How many there are; of more than two the pixels are col3, row3 and so on, of one alone col1,
        row1, which may be called col, row.
    names : sequence of str
        The photos' files, for tables with a row for each photo: id, photo, col, row.
    frame : WorldFrame, optional
        Of the pair, for E, N, H; by default that of these points.
    with_places : bool
        Whether a table without X and Y is refused.

    Returns
    -------
    Control
        A row without a name is called by its number, counted from 1, unless another one is.
        r is 0 where X and Y are given and r is blank: a point on the wall.

    Raises
    ------
    WorkbookError, InputError
        Naming every bad cell; if there are no pixels.
    """
    alone = photos == 1
    keys = tuple(f"{axis}{k}" for k in range(1, photos + 1) for axis in ("col", "row"))
    expected = ALONE if alone else (*COLUMNS, *(Column(key, unit="px") for key in keys[4:]))
    expected = (*expected, *(A_PHOTO[:1] if alone else A_PHOTO))
    table = read_table(path, expected, column_map=_places(columns, expected))
    listed = is_long(table, keys, names)
    missing = [key for key in keys if key not in table.present and not listed]
    if missing and alone:
        raise InputError(remark("rectify.no_picks", path=path))
    if missing:
        each = "both photos (col1, row1, col2, row2)."
        if photos > 2:
            each = f"every photo that shows it (col1, row1 to {', '.join(keys[-2:])}), else blank."
        raise InputError(
            f"{path}: the columns {', '.join(missing)} are missing: where the points are seen. "
            f"Each control point needs its pixel in {each}"
        )
    lone = [axis for axis in "XY" if axis not in table.present]
    # Relief alone is some control; a height alone has a plan whose headings are not understood.
    is_height = "H" in table.present or bare(table.headings.get("r", "")).startswith("z")
    if len(lone) == 1 or (lone and (is_height or with_places)):
        raise InputError(lacks_axis(table, path, ", ".join(lone)))
    if not len(table):
        raise InputError(f"{path}: no control points in the table.")
    xyz = np.column_stack([metres_of(table, key, unit) for key in ("X", "Y", "r", "H")])
    errors = _halves(table, ("col", "row") if listed and not alone else keys)
    if listed and not errors:
        points = of_rows(table, keys if alone else ("col", "row"), names, xyz)
    else:
        errors += table.repeated("id") if "id" in table.present and not listed else []
        points = ListedPoints(
            rows=list(range(len(table))),
            picks=[
                np.column_stack([table.numbers(column), table.numbers(row)])
                for column, row in zip(keys[::2], keys[1::2], strict=True)
            ],
        )
    if errors:
        raise WorkbookError(errors)
    ids = _names([table.texts("id")[row] for row in points.rows], unnamed)
    picks, unseen = without_unseen(points.picks, ids)
    xyz, frame, placed = in_plane_frame(
        table, xyz[points.rows, :3], xyz[points.rows, 3], picks, frame
    )
    sigmas = metres_of(table, "sigma", unit)[points.rows]
    spread = np.tile(np.where(np.isfinite(sigmas), sigmas, sigma)[:, None], (1, 3))
    spread = np.maximum(spread, 1e-5)
    if sigma_plane is not None:
        on_wall = np.isfinite(xyz[:, :2]).all(axis=1) & np.isnan(xyz[:, 2])
        xyz[on_wall, 2] = 0.0
        spread[on_wall, 2] = sigma_plane
    picks += [np.full((len(ids), 2), np.nan)] * alone
    control = Control(
        ids=tuple(ids), xyz=xyz, sigma=spread,
        pixels1=picks[0], pixels2=picks[1], more=tuple(picks[2:]), frame=frame,
    )  # fmt: skip
    notes = [*table.remarks, *points.remarks, *unseen, *placed]
    remarks = [f"{Path(path).name}: {text}" for text in notes]
    off = table.numbers("use")[points.rows] == 0
    if off.any():
        control = control.only(~off)
        switched = ", ".join(name for name, out in zip(ids, off, strict=True) if out)
        remarks.append(remark("control.switched_off", of=Path(path).name, names=switched))
    return replace(control, remarks=tuple(remarks))


def _places(columns: str | None, headings: Sequence[Column]) -> dict[str, str] | None:
    """Return which column is which, as a user says; E and N are understood as X and Y."""
    if not columns:
        return None
    places = parse_column_map(columns, [*(column.key for column in headings), "E", "N"])
    return {{"E": "X", "N": "Y"}.get(key, key): place for key, place in places.items()}


def _names(texts: Sequence[str], before: str) -> list[str]:
    """Return the rows' names; of a row without one, its number, unless another row has that name.

    Examples
    --------
    >>> _names(["A", "", "", "2"], "")
    ['A', 'row 2', '3', '2']
    """
    typed = set(texts)
    numbered = [f"{before}{number}" for number in range(1, len(texts) + 1)]
    numbered = [
        f"{before}row {k}" if name in typed else name for k, name in enumerate(numbered, start=1)
    ]
    return [text or name for text, name in zip(texts, numbered, strict=True)]


def known_points(
    path: Path,
    *,
    unit: str = "",
    columns: str | None = None,
    photos: int = 2,
    names: Sequence[str] = (),
    frame: WorldFrame | None = None,
) -> Points:
    """Return the coordinates of a table of control or check points, NaN where it has none."""
    control = read_control(
        path, sigma=0.003, sigma_plane=None, unit=unit, columns=columns, photos=photos, names=names,
        frame=frame,
    )  # fmt: skip
    blank = ("",) * len(control.ids)
    return Points(
        ids=control.ids, xyz=control.xyz, sigma_r=control.sigma[:, 2], flags=blank, notes=blank,
        name=path.name,
    )  # fmt: skip


def read_lengths(path: Path | str, control: Control) -> Control:
    """Read taped lengths (from, to, length, sigma) between control points and add them."""
    table = read_table(path, LENGTHS)
    index = {name: number for number, name in enumerate(control.ids)}
    lengths, sigmas = metres_of(table, "length", ""), metres_of(table, "sigma", "")
    taped: list[tuple[int, int, float]] = []
    spread: list[float] = []
    errors: list[CellError] = []
    both = (meant(table.texts(key), index) for key in ("from", "to"))
    for row, ends in enumerate(zip(*both, strict=True)):
        for key, name in zip(("from", "to"), ends, strict=True):
            if name not in index:
                near = nearest(name, index)
                hint = f' Did you mean "{near}"?' if near else ""
                message = f'"{name}" is not a point of the control table.{hint}'
                errors.append(table.error(row, key, message))
        if not lengths[row] > 0:
            errors.append(table.error(row, "length", "expected a length above zero, in metres."))
        elif sigmas[row] <= 0:
            errors.append(table.error(row, "sigma", "expected a number above zero, in metres."))
        elif ends[0] in index and ends[1] in index:
            taped.append((index[ends[0]], index[ends[1]], float(lengths[row])))
            spread.append(float(sigmas[row]))
    if errors:
        raise WorkbookError(errors)
    before = control.sigma_lengths or (np.nan,) * len(control.lengths)
    return replace(control, lengths=(*control.lengths, *taped), sigma_lengths=(*before, *spread))


def metres_of(table: Table, key: str, unit: str) -> FloatArray:
    """Return a column of lengths in metres, by its heading's unit."""
    length_unit = unit or table.units.get(key, "m")
    if length_unit not in METRES:
        raise InputError(remark("control.no_length", of=table.file, key=key, said=length_unit))
    return table.numbers(key) * METRES[length_unit]


def _halves(table: Table, keys: tuple[str, ...]) -> list[CellError]:
    """Return complaints about pixels of which only one coordinate is given."""
    errors = []
    for first, second in zip(keys[::2], keys[1::2], strict=True):
        a, b = table.numbers(first), table.numbers(second)
        for row in np.flatnonzero(np.isnan(a) != np.isnan(b)):
            key = first if np.isnan(a[row]) else second
            errors.append(table.error(int(row), key, "is blank although its partner is given."))
    return errors
