"""The communicator of a command, and its output."""

from __future__ import annotations

import io
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import typer
from rich.console import Console, ConsoleOptions, RenderResult
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from fenics_contact.cli.streams import say
from fenics_contact.display import counted
from fenics_contact.progress import at_terminal, visible

if TYPE_CHECKING:
    from mpi4py import MPI

#: Columns of output to a file or a pipe.
WIDTH = 110


@dataclass(frozen=True)
class Desk:
    """A communicator and the console of rank 0.

    Attributes:
        comm: All ranks of the program.
    """

    comm: MPI.Comm

    @property
    def ranks(self) -> str:
        """The number of ranks in words."""
        return counted(self.comm.size, "rank")

    def say(self, text: str = "") -> None:
        """Write a line verbatim."""
        self._write(Text(text))

    def show(self, table: Table) -> None:
        """Write a table."""
        self._write(table)

    def _write(self, what: Table | Text) -> None:
        """Write on rank 0: with colours to a terminal, else without trailing blanks."""
        if self.comm.rank != 0:
            return
        drawn = at_terminal(sys.stdout)
        console = Console(
            file=io.StringIO(),
            width=None if drawn else WIDTH,
            force_terminal=drawn,
            no_color=None if drawn else True,
            highlight=False,
        )
        console.print(_Visible(what), soft_wrap=isinstance(what, Text))
        lines = console.file.getvalue().split("\n")  # type: ignore[attr-defined]
        # Through sys.stdout itself, so that progress bars stay below.
        say("\n".join(lines if drawn else [line.rstrip() for line in lines]))


@dataclass(frozen=True)
class _Visible:
    """Output with the control characters of its texts escaped."""

    what: Table | Text

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Render the texts, with colours and alignment, and write anything else in them as escapes."""
        for segment in console.render(self.what, options):
            yield segment if segment.control else Segment(visible(segment.text), segment.style)


def desk_of(context: typer.Context) -> Desk:
    """Return the desk that the program passed to a command."""
    return cast(Desk, context.obj)


def facts(rows: dict[str, Any], title: str = "") -> Table:
    """Return a table of names and values."""
    table = Table(title=title or None, title_justify="left", show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows.items():
        table.add_row(name, str(value))
    return table
