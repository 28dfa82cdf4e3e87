"""`fenics-contact ccx`: solve a deck as CalculiX does, for programs that start `ccx`."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import typer

from fenics_contact._cli.console import Console, console_of, exit_code_of
from fenics_contact.decks.job import Increment, run_job
from fenics_contact.errors import FenicsContactError, InvalidInputError
from fenics_contact.output.result import own_version

#: Front ends look for its name and, in what -v prints, for a version.
USAGE = "Usage: fenics-contact ccx -i jobname (reads and writes the files of CalculiX, job.inp and job.frd)"


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    passed_on = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": ["--help"]}
    app.command(
        "ccx",
        short_help="solve a deck with CalculiX's arguments, files and messages",
        context_settings=passed_on,
    )(ccx)


@dataclass(frozen=True)
class Arguments:
    """Arguments of CalculiX: the job, and whether the version is asked for."""

    job: str = ""
    version: bool = False

    #: Exit code of CalculiX without a job.
    no_job: ClassVar[int] = 201

    @classmethod
    def of(cls, given: Sequence[str]) -> Arguments:
        """Return those of a command; FreeCAD's have blanks at their ends."""
        left, job = [each.strip() for each in given], ""
        if left[:1] == ["-v"]:
            return cls(version=True)
        while left:
            name = left.pop(0)
            if name == "-o":
                kind = left.pop(0) if left else ""
                if kind not in ("", "frd"):
                    raise InvalidInputError(f"results are written as .frd alone, got -o {kind}: leave it out")
            elif name == "-i":
                job = left.pop(0) if left else ""
            elif name.startswith("-"):
                raise InvalidInputError(f"the option {name!r} is not known: give -i jobname")
            else:
                job = job or name
        return cls(job.removesuffix(".inp"))


def ccx(context: typer.Context) -> None:
    """Solve the deck JOB.inp and write JOB.frd, JOB.dat, JOB.sta and JOB.cvg beside it.

    Takes CalculiX's arguments, "-i JOB", "JOB" and "-v", and writes to the terminal what front ends look for,
    so that their path to `ccx` may name `fenics-contact-ccx`. All is written to stdout, errors with "*ERROR".
    OMP_NUM_THREADS has no effect.
    """
    console = console_of(context)
    with _log_to_stdout(), _reporting(console):
        arguments = Arguments.of(context.args)
        if arguments.version:
            console.write(f"\nThis is Version 2.20 of CalculiX as fenics_contact {own_version()} reads it\n")
            return
        if not arguments.job:
            console.write(USAGE)
            raise typer.Exit(Arguments.no_job)
        _solve(console, Path(f"{arguments.job}.inp"))


def _solve(console: Console, deck: Path) -> None:
    """Solve a deck and print a few lines for each increment."""
    stars = "*" * 60
    console.write(f"\n{stars}\n\nfenics_contact {own_version()} in place of CalculiX\n\n{stars}\n")
    console.write(f" deck {deck.name}, {console.ranks}\n")

    def watch(done: Increment) -> None:
        console.write(f" STEP {done.step:12d}\n\n increment {done.number} attempt 1")
        console.write(f" increment size= {done.length:e}\n actual total time={done.time:e}")
        console.write(f" Number of contact spring elements={done.contacts}")
        console.write(f" convergence after {done.iterations} iterations, residual {done.residual:.1e}\n")

    files = run_job(deck, console.comm, watch, lambda words: console.write(f" *WARNING {words}"))
    console.write(f" results in {', '.join(each.name for each in files)}\n\n Job finished\n")


@contextmanager
def _reporting(console: Console) -> Iterator[None]:
    """Report errors where CalculiX does: on stdout, and by the exit code."""
    try:
        yield
    except FenicsContactError as error:
        console.write(f" *ERROR {error}\n")
        raise typer.Exit(int(exit_code_of(error))) from None
    except typer.Exit:
        raise
    except Exception as error:
        console.write(f" *ERROR {type(error).__name__}: {error}\n")
        raise


@contextmanager
def _log_to_stdout() -> Iterator[None]:
    """Send what is logged to stdout: front ends take any line on stderr for a failure."""
    changed = [
        (each, each.setStream(sys.stdout))
        for each in logging.getLogger().handlers
        if isinstance(each, logging.StreamHandler) and each.stream is sys.stderr
    ]
    try:
        yield
    finally:
        for handler, stream in changed:
            handler.setStream(stream)
