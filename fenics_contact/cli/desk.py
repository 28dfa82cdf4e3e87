"""What a command works with: its communicator, and where it writes."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import typer
from rich.console import Console
from rich.table import Table

from fenics_contact.progress.places import terminal_width

if TYPE_CHECKING:
    from mpi4py import MPI

#: Columns of what is written to a file or a pipe.
WIDTH = 110


@dataclass(frozen=True)
class Desk:
    """A communicator and the console of rank 0.

    Attributes:
        comm: All ranks of the program.
    """

    comm: MPI.Comm

    @property
    def console(self) -> Console:
        """The console: stdout on rank 0, nothing on other ranks; colours on terminals alone."""
        width = terminal_width(sys.stdout)
        return Console(
            width=width or WIDTH,
            force_terminal=width is not None,
            no_color=True if width is None else None,
            quiet=self.comm.rank != 0,
            highlight=False,
            soft_wrap=True,
        )

    @property
    def ranks(self) -> str:
        """The number of ranks in words."""
        return "1 rank" if self.comm.size == 1 else f"{self.comm.size} ranks"

    def say(self, text: str = "") -> None:
        """Write a line, as it is."""
        self.console.print(text, markup=False)

    def show(self, table: Table) -> None:
        """Write a table, without blanks at the ends of lines where it is no terminal."""
        console = self.console
        if console.is_terminal:
            console.print(table)
            return
        with console.capture() as captured:
            console.print(table)
        for line in captured.get().splitlines():
            self.say(line.rstrip())


def desk_of(context: typer.Context) -> Desk:
    """Return the desk that the program has handed to a command."""
    return cast(Desk, context.obj)


def facts(rows: dict[str, Any], title: str = "") -> Table:
    """Return a table of names and values."""
    table = Table(title=title or None, title_justify="left", show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows.items():
        table.add_row(name, str(value))
    return table
