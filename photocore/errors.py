"""The exception family: every message says what is wrong, where, and how to mend it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

#: Nothing measured is larger, and squares of squares of it still are numbers.
LARGEST = 1e15


class PhotogrammetryError(Exception):
    """Root of everything raised on purpose; the command line prints it without a traceback."""

    def __new__(cls, *args: object, **_: object) -> PhotogrammetryError:
        """Return the error; the remarks among what it says are of those that stop."""
        for arg in args:
            if stop := getattr(arg, "stop", None):  # a remark that now says why nothing was made
                stop()
        return super().__new__(cls, *args)


class InputError(PhotogrammetryError, ValueError):
    """A file, option, cell or array that the user can mend."""


class CellError(InputError):
    """One bad cell of a table: knows file, sheet, cell and column.

    Parameters
    ----------
    message : str
        What was found, what is expected and how to mend it.
    file, sheet, cell, column : str
        Where; empty where it does not apply (a CSV file has no sheet).
    """

    def __init__(
        self, message: str, *, file: str = "", sheet: str = "", cell: str = "", column: str = ""
    ) -> None:
        self.message, self.column = message, column
        self.file, self.sheet, self.cell = file, sheet, cell
        place = f"{sheet}!{cell}" if sheet and cell else sheet or cell
        where = f"{file} › {place}" if file and place else file or place
        if column:
            where = f"{where} ({column})" if where else column
        super().__init__(f"{where}: {message}" if where else message)


class WorkbookError(InputError):
    """All bad cells of a workbook at once.

    Parameters
    ----------
    errors : sequence of CellError
        Every fault found; the first ``shown`` are printed, the rest are counted.
    shown : int
        How many faults the message lists.
    """

    def __init__(self, errors: Sequence[CellError], *, shown: int = 50) -> None:
        self.errors = tuple(errors)
        lines = [str(error) for error in self.errors[:shown]]
        if len(self.errors) > shown:
            lines.append(f"... and {len(self.errors) - shown} more.")
        super().__init__("\n".join(lines))


class MissingExtraError(InputError):
    """A command needs an optional dependency that is not installed.

    Parameters
    ----------
    what : str
        The capability asked for, e.g. ``"The lens database"``.
    extra : str
        The extra that brings it, e.g. ``"lens"``.
    """

    def __init__(self, what: str, extra: str) -> None:
        from photocore.installation import how_to_install  # asks the system; seldom needed

        super().__init__(
            f"{what} needs an optional part that is not installed. "
            f"Install it with: {how_to_install(extra)}"
        )


class GeometryError(PhotogrammetryError, ValueError):
    """A configuration for which the whole calculation is impossible."""


class ConvergenceError(PhotogrammetryError, RuntimeError):
    """An iteration that did not converge.

    Parameters
    ----------
    message : str
        What was being solved and what to try.
    iterations : int
        Iterations done.
    residual : float
        What was left, in the unit named by the message.
    """

    def __init__(self, message: str, *, iterations: int, residual: float) -> None:
        self.iterations, self.residual = iterations, residual
        super().__init__(f"{message} ({iterations} iterations, residual {residual:.3g})")


@contextmanager
def located(where: object) -> Iterator[None]:
    """Say where: put a file's name or a key before the message of whatever is refused within."""
    place = f"{where}: " if where else ""
    try:
        yield
    except GeometryError as error:
        raise GeometryError(f"{place}{error}") from None
    except InputError as error:
        raise InputError(f"{place}{error}") from None
