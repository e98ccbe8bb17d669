"""Command-line plumbing: commands loaded on demand, one place that prints errors, progress."""

from __future__ import annotations

import json
import logging
import re
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import Any, Protocol

import click

from photocore.errors import PhotogrammetryError
from photocore.installation import (
    LEAST_MEMORY,
    allowed_memory,
    is_of_memory,
    left_out,
    too_old,
)
from photocore.interrupts import STOPPED
from photocore.log import COMMAND_LINE, DATE, is_quiet, log_options
from photocore.option_types import STREAMS
from photocore.provenance import noted_remarks, recording
from photocore.textfile import odd_name

#: Exit status of a fault of the program: EX_SOFTWARE of sysexits.h, which Windows' os lacks.
UNFORESEEN = 70

_DEBUG = "photocore.debug"
#: What the command printed as remarks.
_PRINTED = "photocore.printed"
_HELP = {"-h", "--help"}
_NO_MEMORY = "not enough memory. Use smaller images, a coarser --gsd or --bounds."
_LOG = logging.getLogger(__name__)
_LOG.addHandler(logging.NullHandler())  # errors are printed here, not by logging as well


def _debug_option() -> click.Option:
    """Return the option that every command and both programs have."""

    def remember(ctx: click.Context, param: click.Parameter, value: bool) -> None:  # noqa: ARG001
        # Commands share this dictionary with their group; given before or after, it holds.
        ctx.meta[_DEBUG] = ctx.meta.get(_DEBUG, False) or value

    return click.Option(
        ["--debug"],
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=remember,
        help="Show the technical details of an error.",
    )


def unforeseen_message(task: str, error: BaseException) -> str:
    """Return one line about an error that nobody foresaw while a command was at work.

    Parameters
    ----------
    task : str
        Program and command.
    error : BaseException
        What ended it.
    """
    words = " ".join(str(error).split())
    words = f"{type(error).__name__}: {words}" if words else type(error).__name__
    return (
        f"{task} failed on something nobody foresaw ({words:.300}). The fault is the "
        "program's, not yours: please report this line, your command and what it prints with "
        "--debug to its authors."
    )


#: Jobs shorter than this need no progress lines where stderr is no terminal. [s]
SILENT_SECONDS = 2.0


class LazyGroup(click.Group):
    """A group whose commands are imported only when they are used.

    Parameters
    ----------
    commands_package : str
        Package that holds one module per command, each with an attribute ``command``.
    summaries : mapping of str to str
        Command name to one-line help, in the order of ``--help``. Dashes in a name become
        underscores in the module's.
    """

    def __init__(
        self, *args: Any, commands_package: str, summaries: Mapping[str, str], **kwargs: Any
    ) -> None:
        kwargs.setdefault("context_settings", {"help_option_names": ["-h", "--help"]})
        super().__init__(*args, **kwargs)
        self.params += [_debug_option(), *log_options()]
        self.commands_package, self.summaries = commands_package, dict(summaries)

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Return the names in the order of work, not of the alphabet."""
        return list(self.summaries)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import and return one command."""
        if cmd_name not in self.summaries:
            return None
        module = import_module(f"{self.commands_package}.{cmd_name.replace('-', '_')}")
        command: click.Command = module.command
        command.short_help = self.summaries[cmd_name]
        if not any("--debug" in parameter.opts for parameter in command.params):
            command.params += [_debug_option(), *log_options()]
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Suggest the nearest command when the name is unknown."""
        if args and args[0] not in self.summaries and not args[0].startswith("-"):
            from difflib import get_close_matches

            near = get_close_matches(args[0], self.summaries, n=1)
            hint = f" Did you mean '{near[0]}'?" if near else ""
            ctx.fail(f"No such command '{args[0]}'.{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """List the summaries without importing a single command."""
        with formatter.section("Commands"):
            formatter.write_dl(list(self.summaries.items()))

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the words of the command line, for what is written about it."""
        program = self.commands_package.partition(".")[0]
        ctx.meta[COMMAND_LINE] = shlex.join([program, *args])
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; the one place where errors become messages and an exit status.

        1: the input, the disk or the user ended it. 70: a fault of the program.
        """
        if isinstance(sys.stdout, TextIOWrapper):  # a name the terminal lacks letters for
            sys.stdout.reconfigure(errors="backslashreplace")
        for line in too_old():
            click.echo(f"{line}.", err=True)
        if (allowed := allowed_memory()) < LEAST_MEMORY and not _HELP & set(ctx.args):
            _tell_error(
                f"Error: only {allowed:.0f} MB of memory are allowed here (ulimit -v), and "
                f"{LEAST_MEMORY} MB are needed at least."
            )
            return ctx.exit(1)
        try:
            with recording(ctx.meta[COMMAND_LINE], day=ctx.meta.get(DATE)):
                try:
                    return super().invoke(ctx)
                finally:
                    printed = ctx.meta.get(_PRINTED, [])
                    for text in noted_remarks():
                        # What a reader did is told once, by the command or else here.
                        words = text.partition(": ")[2] or text
                        if not any(words in line for line in printed):
                            remark(text)
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except PhotogrammetryError as error:
            _show_details(ctx)
            _tell_error(f"Error: {error}")
        except KeyboardInterrupt:
            _tell_error(STOPPED)
        except MemoryError:
            _tell_error(f"Error: {_NO_MEMORY}")
        except BrokenPipeError:
            # The reader of our output went away (``| head``): not our failure, nothing to say.
            sys.stderr.close()
        except OSError as error:
            _show_details(ctx)
            name = f"{error.filename}: " if error.filename else ""
            _tell_error(f"Error: {name}{error.strerror or error}.")
        except UnicodeEncodeError as error:
            _show_details(ctx)
            _tell_error(f"Error: {odd_name(error)}")
        except Exception as error:  # the last resort; the tests let nobody get here
            _show_details(ctx)
            program = self.commands_package.partition(".")[0]
            task = f"{program} {ctx.invoked_subcommand or ''}".rstrip()
            if is_of_memory(error):
                _tell_error(f"Error: {_NO_MEMORY}")
                ctx.exit(1)
            if lacks := left_out(error) or next(iter(too_old()), ""):
                _tell_error(f"Error: {task} cannot be done with what is installed: {lacks}.")
                ctx.exit(1)
            _tell_error(f"Error: {unforeseen_message(task, error)}")
            ctx.exit(UNFORESEEN)
        return ctx.exit(1)


def _tell_error(message: str) -> None:
    """Print an error on stderr, and log it."""
    message = _named_streams(message)
    _LOG.error("%s", message)
    click.echo(message, err=True)


def _named_streams(message: str) -> str:
    """Return a message that calls stdin and stdout so, not by the files that stand for them."""
    context = click.get_current_context(silent=True)
    streams = {} if context is None else context.meta
    for key in STREAMS:
        if key in streams:
            message = message.replace(str(streams[key]), key.rpartition(".")[2])
    return message


def _show_details(ctx: click.Context) -> None:
    """Print the traceback of the error at hand where --debug asks for it."""
    if ctx.meta.get(_DEBUG):
        from traceback import format_exc

        click.echo(format_exc(), err=True)


def print_json(value: Any) -> None:
    """Print one JSON object on stdout, given as such or as its text; NaN becomes null.

    Letters that the encoding of stdout lacks become JSON's own escapes.
    """
    from photocore.jsonfile import to_text

    text = value if isinstance(value, str) else to_text(value)
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")  # None: stdout is closed
    except UnicodeEncodeError:
        # Outside of its texts JSON is ASCII, so each letter may be escaped where it stands.
        text = re.sub(r"[^\x00-\x7f]", lambda letter: json.dumps(letter[0])[1:-1], text)
    click.echo(text)


def remark(message: str) -> None:
    """Print a remark on stderr, so that results on stdout stay clean, and log it."""
    message = _named_streams(message)
    context = click.get_current_context(silent=True)
    if context is not None:
        context.meta.setdefault(_PRINTED, []).append(message)
    _LOG.info("%s", message)
    if not is_quiet():
        click.echo(message, err=True)


def print_result(
    data: object,
    lines: Iterable[str],
    *,
    as_json: bool,
    remarks: Iterable[str] = (),
    notes: Iterable[str] = (),
) -> None:
    """Print remarks and notes on stderr, then the result on stdout: as JSON, or for people."""
    for message in (*remarks, *(f"Note: {note}" for note in notes)):
        remark(message)
    if as_json:
        print_json(data)
    else:
        for line in lines:
            click.echo(line)


def tell_written(*paths: Path | None) -> None:
    """Say on stderr which files were written; None stands for one that was not asked for."""
    for path in paths:
        if path is not None:
            remark(f"Written: {path}")


class Progress(Protocol):
    """Told how far a long job is; pass `no_progress` where nobody listens."""

    def __call__(self, done: float, total: float, what: str = "") -> None:
        """Report that ``done`` of ``total`` parts are finished."""


def no_progress(done: float, total: float, what: str = "") -> None:
    """Ignore a progress report."""


@contextmanager
def progress_bar(title: str, *, quiet: bool = False) -> Iterator[Progress]:
    """Yield a reporter that draws a bar on stderr, or lines of a long job if it is no terminal."""
    if quiet or is_quiet():
        yield no_progress
        return
    if not sys.stderr.isatty():
        yield _progress_lines(title)
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as RichProgress

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with RichProgress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0)

        def report(done: float, total: float, what: str = "") -> None:
            bar.update(task, completed=done, total=total, description=what or title)

        yield report


def _progress_lines(title: str) -> Progress:
    """Return a reporter that prints a line per tenth, of jobs that take their time."""
    from time import monotonic

    start, told = monotonic(), 0

    def report(done: float, total: float, what: str = "") -> None:
        nonlocal told
        tenth = int(10 * done / total + 1e-9) if total > 0 else 0
        # A restart counts anew; the end needs no line, for the result follows.
        told = min(told, tenth)
        if told < tenth < 10 and monotonic() - start > SILENT_SECONDS:
            told = tenth
            remark(f"{what or title}: {10 * tenth} %")

    return report


def text_table(headings: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a plain aligned table; text to the left, everything else to the right."""
    cells = [[str(item) for item in row] for row in rows]
    widths = [
        max(len(heading), *(len(row[i]) for row in cells), 0) for i, heading in enumerate(headings)
    ]
    left = [all(isinstance(row[i], str) for row in rows) and i == 0 for i in range(len(headings))]

    def line(items: Sequence[str]) -> str:
        parts = [
            item.ljust(width) if is_left else item.rjust(width)
            for item, width, is_left in zip(items, widths, left, strict=True)
        ]
        return "  ".join(parts).rstrip()

    return "\n".join(
        [line(headings), "  ".join("-" * width for width in widths), *map(line, cells)]
    )
