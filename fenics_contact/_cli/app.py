"""The program: all commands under one name."""

from __future__ import annotations

import contextlib
import io
import logging
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from fenics_contact._base.checkpoint import Interrupted
from fenics_contact._base.progress import visible
from fenics_contact._cli import accuracy, ccx, convert, demos, info, optimize, run, view
from fenics_contact._cli.console import (
    EPILOG,
    Console,
    output_error,
    report_error,
    terminable,
    write_stderr,
    write_stdout,
)
from fenics_contact.output.result import versions

if TYPE_CHECKING:
    from mpi4py import MPI


PROGRAM = "fenics-contact"
#: Exception of the command-line library for unknown options, independent of its module names.
UsageProblem: type[Exception] = next(
    kind
    for kind in typer.BadParameter.__mro__
    if issubclass(kind, Exception) and kind.__name__ == "ClickException"
)


class Program(TyperGroup):
    """All commands; their exceptions become a sentence and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command given by the arguments."""
        try:
            with terminable():
                return super().invoke(ctx)
        except (typer.Exit, typer.Abort, UsageProblem):
            raise
        except BaseException as error:
            if isinstance(error, Interrupted):
                raise
            raise typer.Exit(int(report_error(error, ctx.obj.comm))) from None


#: The commands, a typer application.
app = typer.Typer(
    name=PROGRAM,
    cls=Program,
    help="Contact mechanics with friction and contact shape optimisation on FEniCSx. Every command also runs "
    "under mpirun.",
    epilog=EPILOG,
    no_args_is_help=False,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for module in (run, optimize, convert, ccx, demos, view, accuracy, info):
    module.add_to(app)


def _version(wanted: bool) -> None:
    if wanted:
        write_stdout(f"fenics_contact {versions()['fenics_contact']}\n")
        raise typer.Exit()


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also report what the solvers do, on stderr.")
    ] = False,
) -> None:
    """Prepare logging."""
    if verbose:
        logging.getLogger("fenics_contact").setLevel(logging.INFO)


def main(comm: MPI.Comm, arguments: Sequence[str] | None = None) -> int:
    """Run the command given by the arguments; return the exit code, the same on every rank."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # characters that it cannot encode are written as escapes
            stream.reconfigure(errors="backslashreplace")
    _log_to_stderr(comm)
    given = list(sys.argv[1:] if arguments is None else arguments)
    # Ranks above 0 print nothing: neither help nor the output of demos.
    silence = contextlib.nullcontext() if comm.rank == 0 else contextlib.redirect_stdout(io.StringIO())
    logger = logging.getLogger("fenics_contact")
    level = logger.level
    try:
        with silence:
            return _run(given, comm)
    finally:
        write_stderr("")  # what was logged and nobody has read would change Python's exit status
        logger.setLevel(level)  # a command may be more verbose than the program that called this function


def _run(arguments: Sequence[str], comm: MPI.Comm) -> int:
    command = typer.main.get_command(app)
    try:
        code = command.main(list(arguments), prog_name=PROGRAM, standalone_mode=False, obj=Console(comm))
        write_stdout("")  # what the library has written, as help does, goes out now
    except UsageProblem as problem:
        if comm.rank == 0:
            words = io.StringIO()
            problem.show(words)  # type: ignore[attr-defined]
            write_stderr(words.getvalue())
        return int(problem.exit_code)  # type: ignore[attr-defined]
    except BrokenPipeError:
        return 0
    except OSError as error:  # of the library: its own output, such as help, may fail on a full disk
        return int(report_error(output_error(error), comm))
    return code if isinstance(code, int) else 0


class _Visible(logging.Formatter):
    """Writes records with control characters escaped."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line of a record."""
        return visible(super().format(record))


def _log_to_stderr(comm: MPI.Comm) -> None:
    """Send warnings of rank 0 to stderr; those of other ranks are the same."""
    handler = logging.StreamHandler(sys.stderr) if comm.rank == 0 else logging.NullHandler()
    handler.setFormatter(_Visible("%(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
