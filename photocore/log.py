"""What -q, -v and --log do: remarks on the terminal or not, and a log of a command's work.

The library speaks to `logging` (loggers ``bifocal``, ``multimedia``, ``photocore``) and configures
none of it; only a command does, for its own time.
"""

from __future__ import annotations

import logging
import sys
from pathlib import Path

import click

from photocore.errors import InputError
from photocore.provenance import checked_date, program, set_day

PACKAGES = ("bifocal", "multimedia", "photocore")
#: First words of every log, by which a file is known to be one.
HEAD = "# log of "
#: Where a command finds its own line, and the date it was told.
COMMAND_LINE, DATE = "photocore.command_line", "photocore.date"
_QUIET = "photocore.quiet"
_FORMAT = "%(asctime)s %(levelname)-7s %(name)s: %(message)s"


class LogFile(logging.FileHandler):
    """A log that is written line by line, and says so once where that fails."""

    _failed = False

    def emit(self, record: logging.LogRecord) -> None:
        """Add a record; the work goes on where the disk takes none."""
        if self._failed:
            return
        try:
            with Path(self.baseFilename).open("a", encoding="utf-8") as file:
                file.write(self.format(record) + "\n")
        except OSError as error:
            self._failed = True
            reason = error.strerror or error
            click.echo(f"The log {self.baseFilename} ends here: {reason}. Work goes on.", err=True)


def is_quiet() -> bool:
    """Tell whether the command that runs was asked to be quiet."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(_QUIET))


def log_options() -> list[click.Option]:
    """Return the options that every command and both programs have."""
    return [
        click.Option(
            ["-q", "--quiet"], is_flag=True, is_eager=True, expose_value=False, callback=_be_quiet,
            help="No remarks and no progress; errors are still told.",
        ),
        click.Option(
            ["-v", "--verbose"], is_flag=True, is_eager=True, expose_value=False,
            callback=_be_verbose, help="Tell what is read and written.",
        ),
        click.Option(
            ["--log"], type=click.Path(path_type=Path), is_eager=True, expose_value=False,
            callback=_keep_log, metavar="FILE", help="Add what happens to a log file.",
        ),
        click.Option(
            ["--date"], is_eager=True, expose_value=False, callback=_bear_date,
            metavar="YYYY-MM-DD", help="Date that outputs bear.  [default: today]",
        ),
    ]  # fmt: skip


def _be_quiet(ctx: click.Context, param: click.Parameter, value: bool) -> None:  # noqa: ARG001
    ctx.meta[_QUIET] = ctx.meta.get(_QUIET, False) or value


def _be_verbose(ctx: click.Context, param: click.Parameter, value: bool) -> None:  # noqa: ARG001
    if value:
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(logging.Formatter("%(message)s"))
        # Remarks stand on the terminal already.
        handler.addFilter(lambda record: record.name != "photocore.cli")
        _attach(ctx, handler)


def _keep_log(ctx: click.Context, param: click.Parameter, value: Path | None) -> None:
    if value is None:
        return
    try:
        if value.exists() and value.stat().st_size:
            with value.open("rb") as file:
                if file.read(len(HEAD)) != HEAD.encode():
                    raise click.BadParameter(
                        f"{value} exists already and is no log of this program; name another "
                        "file.", ctx, param,
                    )  # fmt: skip
        with value.open("a", encoding="utf-8") as file:
            file.write(f"{HEAD}{program()}: {ctx.meta[COMMAND_LINE]}\n")
        handler = LogFile(value, encoding="utf-8", delay=True)
    except OSError as error:
        raise click.BadParameter(
            f"{value} cannot be written ({error.strerror or error}).", ctx, param
        ) from None
    handler.setFormatter(logging.Formatter(_FORMAT))
    _attach(ctx, handler)


def _bear_date(ctx: click.Context, param: click.Parameter, value: str | None) -> None:
    if value is not None:
        try:
            ctx.meta[DATE] = checked_date(value)
        except InputError as error:
            raise click.BadParameter(str(error), ctx, param) from None
        set_day(ctx.meta[DATE])  # given behind the command; before it, the program reads it there


def _attach(ctx: click.Context, handler: logging.Handler) -> None:
    """Let a handler hear the packages until the whole command has ended."""
    handler.setLevel(logging.INFO)
    loggers = [logging.getLogger(name) for name in PACKAGES]
    for logger in loggers:
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)

    def detach() -> None:
        for logger in loggers:
            logger.removeHandler(handler)
            logger.setLevel(logging.NOTSET)
        handler.close()

    ctx.find_root().call_on_close(detach)
