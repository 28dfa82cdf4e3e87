"""Output and exit codes of commands, the same on every rank, and tables of results."""

from __future__ import annotations

import io
import os
import signal
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any, TextIO, cast

import numpy as np
import rich.console
import typer
from rich import box
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from fenics_contact._base.display import COLUMNS, DerivedUnits, counted
from fenics_contact._base.progress import at_terminal, visible
from fenics_contact._base.sparse import rounded
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact.errors import (
    ConvergenceError,
    FenicsContactError,
    InfeasibleError,
    InvalidInputError,
    MissingRequirementError,
)
from fenics_contact.errors.memory import naming_memory
from fenics_contact.output.files import OutputError
from fenics_contact.output.result import listed_forces, scales_of
from fenics_contact.results.by_name import names_of
from fenics_contact.results.contact import NormalForces, pairs_in_words
from fenics_contact.results.joints import joint_results
from fenics_contact.results.resolution import in_words
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact._scene_file.document import UnitNames


class ExitCode(IntEnum):
    """Exit codes of all commands."""

    OK = 0
    FAILED = 1
    WRONG_INPUT = 2
    NOT_CONVERGED = 3
    NO_EQUILIBRIUM = 4
    MISSING = 5
    INTERRUPTED = 130
    STOPPED = 138
    TERMINATED = 143


MEANING = {
    ExitCode.OK: "it did what was asked for",
    ExitCode.FAILED: "something else went wrong, for instance a full disk",
    ExitCode.WRONG_INPUT: "wrong input: an option, a scene file, a file that is not there",
    ExitCode.NOT_CONVERGED: "a solver or the optimiser stopped before its tolerance was met, or an accuracy "
    "was not reached",
    ExitCode.NO_EQUILIBRIUM: "no equilibrium: nothing holds some body against its load",
    ExitCode.MISSING: "a library is missing or too old",
    ExitCode.INTERRUPTED: "interrupted from the keyboard",
    ExitCode.STOPPED: "stopped by SIGUSR1, as batch systems send, where it can go on",
    ExitCode.TERMINATED: "terminated by a signal",
}
#: For the end of the help text.
EPILOG = "\b\nExit codes:\n" + "\n".join(f"{code.value:<4d} {words}" for code, words in MEANING.items())


@dataclass(frozen=True)
class Console:
    """The ranks of a command; output is written by rank 0."""

    comm: MPI.Comm

    @property
    def ranks(self) -> str:
        """The number of ranks in words."""
        return counted(self.comm.size, "rank")

    def write(self, given: Table | str = "") -> None:
        """Write a table, or a line verbatim, on rank 0: to a terminal in colours."""
        if self.comm.rank != 0:
            return
        what = Text(given) if isinstance(given, str) else given
        drawn, text = at_terminal(sys.stdout), io.StringIO()
        look: dict[str, Any] = {} if drawn else {"width": COLUMNS, "no_color": True}
        console = rich.console.Console(file=text, force_terminal=drawn, highlight=False, markup=False, **look)
        console.print(_Visible(what), soft_wrap=isinstance(what, Text))
        lines = text.getvalue().split("\n")
        # Through sys.stdout itself, so that progress bars stay below.
        write_stdout("\n".join(lines if drawn else [line.rstrip() for line in lines]))


@dataclass(frozen=True)
class _Visible:
    """Output with the control characters of its texts escaped."""

    what: Table | Text

    def __rich_console__(
        self, console: rich.console.Console, options: rich.console.ConsoleOptions
    ) -> rich.console.RenderResult:
        """Render the texts, with colours and alignment, and write anything else in them as escapes."""
        for segment in console.render(self.what, options):
            yield segment if segment.control else Segment(visible(segment.text), segment.style)


def console_of(context: typer.Context) -> Console:
    """Return the console that the program passed to a command."""
    return cast(Console, context.obj)


def facts(rows: dict[str, Any], title: str = "") -> Table:
    """Return a table of names and values."""
    table = Table(title=title or None, title_justify="left", show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows.items():
        table.add_row(name, str(value))
    return table


def write_stdout(text: str) -> None:
    """Write to stdout; if its reader has closed it, write nothing and continue."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        redirect_to_devnull(sys.stdout)
    except OSError as error:
        raise output_error(error) from error


def write_stderr(text: str) -> None:
    """Write to stderr with control characters escaped; after a failure, which nobody sees, to nowhere."""
    try:
        sys.stderr.write(visible(text))
        sys.stderr.flush()
    except OSError:
        redirect_to_devnull(sys.stderr)


def output_error(error: OSError) -> OutputError:
    """Return the error of a command that cannot write to stdout, whose further output is discarded."""
    redirect_to_devnull(sys.stdout)
    return OutputError(
        f"the output of this command must be written to stdout, which failed: {error.strerror or error}. "
        "Free space, or send it elsewhere"
    )


def redirect_to_devnull(stream: TextIO) -> None:
    """Discard the buffer of a stream, so that it can be closed, and what is written to it later."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


class Terminated(BaseException):
    """The process received SIGTERM."""


def exit_code_of(error: BaseException) -> ExitCode:
    """Return the exit code of an error."""
    kinds: tuple[tuple[type[BaseException], ExitCode], ...] = (
        (InfeasibleError, ExitCode.NO_EQUILIBRIUM),
        (ConvergenceError, ExitCode.NOT_CONVERGED),
        (InvalidInputError, ExitCode.WRONG_INPUT),
        (MissingRequirementError, ExitCode.MISSING),
        (KeyboardInterrupt, ExitCode.INTERRUPTED),
        (Terminated, ExitCode.TERMINATED),
    )
    return next((code for kind, code in kinds if isinstance(error, kind)), ExitCode.FAILED)


@contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM end the block as Ctrl-C does, so that clean-up is done."""

    def stop(*_: Any) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def report_error(error: BaseException, comm: MPI.Comm) -> ExitCode:
    """Report on rank 0 how a command ended, and return its exit code.

    Errors of this package are raised on all ranks together. Any other may occur on one rank while the rest
    wait for it: then all are ended. The same holds for an interrupt, which reaches ranks at different places.
    """
    code = exit_code_of(error)
    known = isinstance(error, FenicsContactError)
    if known and comm.rank == 0:
        write_stderr(f"error: {error}\n")
    if isinstance(error, KeyboardInterrupt | Terminated):
        if comm.rank == 0:
            write_stderr("interrupted\n" if isinstance(error, KeyboardInterrupt) else "terminated\n")
        sys.stdout.flush()
        sys.stderr.flush()
        if comm.size > 1:
            os._exit(int(code))  # without waiting for others, whose position is unknown
    elif not known:
        named = naming_memory(error)
        write_stderr("".join(traceback.format_exception(error)) if named is error else f"error: {named}\n")
        if comm.size > 1:
            comm.Abort(int(code))
    return code


def forces_table(forces: Mapping[str, Any], units: DerivedUnits) -> Table:
    """Return forces and moments of a result file, one row each."""
    balance = forces["balance"]
    moments = np.shape(balance["loads"]["moment"])
    plane, turned, twists = moments == (), moments in ((0,), (1,)), moments == (1,)
    kinds = f"forces ({units.force}) and moments ({units.moment})"
    if turned:
        kinds = f"forces ({units.force}){f' and torques ({units.moment})' * twists}{units.per}"
    table = Table(
        title=kinds,
        title_justify="left",
        box=None,
    )
    table.pad_edge = False
    table.caption_justify = "left"
    about = f"moments about the centroids of surfaces,\nof sums about {_place(balance['about'])}\n"
    table.caption = (
        f"{'' if turned else about}imbalance of all forces{'' if turned else ' and moments'} "
        f"{balance['imbalance']:.1e}"
    )
    for column in ("", "on"):
        table.add_column(column, overflow="fold")
    in_space = ("Fr", "Fz", "T")[: 2 + twists] if turned else ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    for column in ("Fx", "Fy", "M") if plane else in_space:
        table.add_column(column, justify="right", no_wrap=True)
    scales = scales_of(forces)
    for what, entry in listed_forces(forces):
        where = f"{entry['body']} {entry['surface']}" if "surface" in entry else ""
        numbers = np.hstack([rounded(entry[kind], scale) for kind, scale in scales.items()])
        if where or numbers.any():
            table.add_row(what, where, *(f"{number:.5g}" for number in numbers))
    return table


def _place(point: Any) -> str:
    return f"({', '.join(f'{value:.4g}' for value in point)})"


def state_facts(state: State, units: UnitNames) -> dict[str, str]:
    """Return a summary of a state as text, without energies that are not known. Collective."""
    names = DerivedUnits.of(units.force, units.length, state.scene.dimension_record)
    counts, force, energy = state.counts, names.force, names.moment
    rows = {
        "unknowns": f"{counts['torn_unknowns']} in {counted(counts['subdomains'], 'subdomain')}",
        "work": f"{counted(counts['solver_steps'], 'step')}, "
        f"{counted(counts['f_products'], 'product')} with F",
        "residuals": f"natural {state.solution.natural_residual:.1e}, gluing "
        f"{state.solution.gluing_residual:.1e}",
        "strain energy": f"{state.energies.strain:.6g} {energy}",
        "total potential": f"{state.energies.total_potential:.6g} {energy}",
        "displacement": f"up to {_largest_displacement(state):.4g} {units.length}",
    }
    pairs = pairs_in_words(state.scene, state.contact, force, units.stress, units.length)
    for number, words in enumerate(pairs):
        rows[f"contact {number}"] = words
    for number, motion in enumerate(state.rigid_motions()):
        rows[f"rigid surface {number}"] = str(motion).replace("[length]", units.length)
    for each in joint_results(state):
        rows |= each.facts(force, units.length)
    if state.unheld:
        rows["held by nothing"] = " and ".join(map(str, state.unheld)) + ": stays where it is"
    if state.known_errors is not None:
        rows |= {f"error, {name}": words for name, words in state.known_errors.in_words.items()}
    if state.peak_uncertainties:
        rows["peak pressure"] = in_words(state.peak_uncertainties)
    rows["seconds"] = ", ".join(f"{name} {spent:.2f}" for name, spent in state.seconds.items())
    return {name: words for name, words in rows.items() if not words.startswith("nan")}


def step_table(rows: Sequence[Mapping[str, Any]], file: SceneFile) -> Table:
    """Return one row for every load step."""
    units = file.document.units
    force = DerivedUnits.of(units.force, units.length, file.scene.dimension_record).force
    table = Table(
        title=f"{file.title}: load steps", title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False
    )
    curved = any(NormalForces(row["normal_force"], row["normal_resultant"]).differ() for row in rows)
    named = {
        "number": "", "name": "step",
        **{name: name for name in ("iterations", "products", "open", "stick", "slip")},
        "normal_force": f"sum of normal\nforces ({force})" if curved else f"normal force\n({force})",
        **({"normal_resultant": f"their resultant\n({force})"} if curved else {}),
        "friction_force": f"friction\n({force})", "peak_pressure": f"largest pressure\n({units.stress})",
        **{f"preload {name}": f"{name}\n({force})" for name in names_of(file.scene.preloads)},
    }  # fmt: skip
    for name, words in named.items():
        table.add_column(words, justify="left" if name == "name" else "right", no_wrap=name == "name")
    for row in rows:
        values = (row[name] for name in named)
        table.add_row(*(f"{value:.6g}" if isinstance(value, float) else str(value) for value in values))
    return table


def _largest_displacement(state: State) -> float:
    moved = [np.linalg.norm(state.gather_displacement(name), axis=1).max() for name in state.scene.deforming]
    return float(max(moved))
