"""Radial shift of a table: file in, file out; and the empty workbook."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from multimedia.refraction import Layers
from multimedia.remarks import remark
from multimedia.workbook.shift_files import points_of, read_shift_input
from multimedia.workbook.shift_points import ShiftPoints, ShiftResult, ShiftSetup
from multimedia.workbook.shift_update import add_columns, is_template, update_template
from multimedia.workbook.shift_workbook import write_shift_workbook
from photocore.errors import InputError
from photocore.output import check_ending, check_not_input
from photocore.tables import write_csv
from photocore.workbook import check_new_workbook


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShiftReport:
    """What was shifted.

    Attributes
    ----------
    setup, points, result
        Camera and media, points, shifted points.
    remarks : tuple of str
        What the user should know.
    """

    setup: ShiftSetup
    points: ShiftPoints
    result: ShiftResult
    remarks: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """Return everything as plain data for ``--json``."""
        columns = self.result.columns(self.points, every=True)
        rows = zip(*columns.values(), strict=True)
        points = [dict(zip(columns, row, strict=True)) for row in rows]
        setup = {**self.setup.layers.as_dict(), "z0": self.setup.z0, "nadir": self.setup.nadir}
        return {"points": points, "setup": setup, "remarks": self.remarks}


def shift_file(
    path: Path | str,
    out: Path | str | None,
    *,
    camera: tuple[float, float, float] | None = None,
    z0: float | None = None,
    indices: tuple[float, ...] | None = None,
    thicknesses: tuple[float, ...] | None = None,
    decimal: str | None = None,
    sheet: str | None = None,
    flavour: str = "plain",
    new: bool = False,
    overwrite: bool = False,
) -> ShiftReport:
    """Shift the points of a file radially.

    Parameters
    ----------
    path : path
        An .xlsx, .xlsm, .ods or .csv file with X, Y, Z or R, ZP; a workbook may hold the set-up.
    out : path or None
        A .csv file, or a workbook: the user's own with the results put in where the points come
        from one, otherwise a new one with live formulas. None writes nothing.
    camera : (float, float, float), optional
        X, Y, Z of the camera, Z = 0 at the interface on the water side.
    z0 : float, optional
        Instead of camera, its distance from the first interface.
    indices, thicknesses : tuple of float, optional
        The media; those of the workbook otherwise.
    decimal, sheet
        How to read the table.
    flavour : str
        How to write CSV, see `photocore.tables.FLAVOURS`.
    new : bool
        Write a new workbook with live formulas in any case.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    ShiftReport

    Raises
    ------
    InputError
        If a cell, an option or a file is at fault.
    """
    out = None if out is None else Path(out)
    check_ending(out, "results are written as .xlsx or .csv.", ".xlsx", ".xlsm", ".csv")
    if out is not None:
        if new or out.suffix.lower() == ".csv":
            check_not_input(out, path)
        check_new_workbook(out, overwrite=overwrite, source=None if new else path)
    replaced = {f"n_{i}": n for i, n in enumerate(indices or (), start=1)}
    replaced |= {f"t_{i}": t for i, t in enumerate(thicknesses or (), start=1)}
    if z0 is not None:
        replaced["z_0"] = z0
    read = read_shift_input(path, decimal=decimal, sheet=sheet, given=replaced)
    setup = _setup(read.setup, camera, z0, indices, thicknesses)
    points, rows = points_of(read.table, setup.nadir)
    result = points.shifted(setup)
    table, kind = read.table, Path(path).suffix.lower()
    kept: Path | None = None
    if out is not None and out.suffix.lower() == ".csv":
        write_csv(out, result.columns(points), flavour=flavour, overwrite=overwrite)
    elif out is not None and (new or kind not in (".xlsx", ".xlsm")):
        write_shift_workbook(out, setup, points, rows=1, overwrite=overwrite)
    elif out is not None and read.setup is not None and is_template(path):
        kept = update_template(
            path, out, table, rows, setup, read.setup, points, overwrite=overwrite
        )
    elif out is not None:
        kept = add_columns(path, out, read, rows, setup, points, overwrite=overwrite)
    remarks = [*read.table.remarks]
    if kept is not None:
        remarks.append(f"{out}: the workbook as it was is kept as {kept}.")
    remarks += setup.layers.remarks_about(z0=setup.z0, zp=points.depth)
    unseen = [name for name, flag in zip(points.ids, result.flags, strict=True) if flag != "OK"]
    if unseen:
        remarks.append(remark("shift.unseen", count=len(unseen), names=", ".join(unseen[:10])))
    return ShiftReport(setup=setup, points=points, result=result, remarks=tuple(remarks))


def _setup(
    own: ShiftSetup | None,
    camera: tuple[float, float, float] | None,
    z0: float | None,
    indices: tuple[float, ...] | None,
    thicknesses: tuple[float, ...] | None,
) -> ShiftSetup:
    """Return the set-up from the options, completed from the workbook."""
    if camera is not None and z0 is not None:
        raise InputError("give the camera's position or z0, not both.")
    if indices is None and own is None:
        raise InputError(remark("shift.no_indices"))
    media = own.layers if own is not None else Layers(indices=(1.0, 1.0))
    if indices is not None or thicknesses is not None:
        media = Layers(
            indices=media.indices if indices is None else indices,
            thicknesses=thicknesses
            if thicknesses is not None
            else (media.thicknesses if indices is None or len(indices) > 2 else ()),
        )
    if camera is not None:
        return ShiftSetup.from_camera(camera, media)
    if z0 is not None:
        if z0 < 0:
            raise InputError(f"z0: the camera must be above the first interface, found {z0:g}.")
        return ShiftSetup(layers=media, z0=z0, nadir=own.nadir if own else (0.0, 0.0))
    if own is None:
        raise InputError(remark("shift.no_camera"))
    return ShiftSetup(layers=media, z0=own.z0, nadir=own.nadir)


def write_template(
    path: Path | str, *, rows: int, steps: int, language: str = "en", overwrite: bool
) -> None:
    """Write the workbook with a tank as an example set-up and an empty table, in a language.

    Raises
    ------
    InputError
        If the file cannot be written, or rows or steps are out of range.
    """
    setup = ShiftSetup(layers=Layers(indices=(1.0, 1.5, 1.337), thicknesses=(10.0,)), z0=500.0)
    write_shift_workbook(
        path, setup, rows=rows, steps=steps, language=language, overwrite=overwrite
    )
