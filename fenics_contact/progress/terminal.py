"""Progress on a terminal: a bar for each piece of work under way, redrawn in place."""

from __future__ import annotations

import logging
import sys
import time
from typing import Any, TextIO

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Column, Table
from rich.text import Text

from fenics_contact.progress.places import terminal_width
from fenics_contact.progress.presenter import Presenter
from fenics_contact.progress.tracker import Tracker, Work, summary
from fenics_contact.progress.words import visible

#: How often the bars are drawn, [1/s]: rank 0 draws while others compute.
RATE = 4
#: Least columns of names and bars.
NAME, BAR = 16, 12


class Terminal(Presenter):
    """Draws bars below everything else that the program writes."""

    def __init__(self, tracker: Tracker, stream: TextIO, width: int) -> None:
        """Prepare.

        Args:
            tracker: What is under way.
            stream: Where to draw.
            width: Columns of the terminal.
        """
        self._tracker = tracker
        self._console = Console(
            file=stream, force_terminal=True, width=width, markup=False, highlight=False, emoji=False
        )
        # What goes to a file must go on to do so.
        by_program = terminal_width(sys.stdout) is not None
        self._live = Live(
            console=self._console,
            get_renderable=self._drawn,
            refresh_per_second=RATE,
            transient=True,
            redirect_stdout=by_program,
        )
        self._logging: list[tuple[logging.StreamHandler[Any], Any]] = []

    def start(self) -> None:
        """Draw from now on; what the program prints and logs appears above the bars."""
        before = {id(stream): name for name in ("stdout", "stderr") if (stream := getattr(sys, name))}
        self._live.start()
        self._console.show_cursor(True)  # a run that is killed could not bring it back
        for handler in _stream_handlers():
            name = before.get(id(handler.stream))
            if name is not None:
                self._logging.append((handler, handler.stream))
                handler.setStream(getattr(sys, name))

    def stop(self) -> None:
        """Remove the bars and give the streams back."""
        for handler, stream in self._logging:
            handler.setStream(stream)
        self._logging.clear()
        self._live.stop()

    def changed(self, moment: float) -> None:
        """Nothing: the bars are drawn at their own rate."""

    def finished(self, work: Work) -> None:
        """Leave a line above the bars."""
        self._console.out(visible(summary(work)), highlight=False)

    def _drawn(self) -> RenderableType:
        rows = self._tracker.rows(time.time())
        if not rows:
            return Text("", end="")
        table = Table.grid(
            Column(no_wrap=True, min_width=NAME),
            Column(no_wrap=True, min_width=BAR),
            Column(no_wrap=True, overflow="ellipsis", ratio=1),
            Column(no_wrap=True, justify="right"),
            Column(no_wrap=True, justify="right"),
            padding=(0, 2, 0, 0),
            expand=True,
        )
        for depth, row in enumerate(rows):
            bar = "" if row.fraction is None else ProgressBar(total=1.0, completed=row.fraction, width=BAR)
            details, what = visible(row.details), visible(row.what)
            words = (Text(text) for text in (details, row.left_in_words, _clock(row.spent)))
            table.add_row(Text("  " * depth + what), bar, *words)
        return table


def _stream_handlers() -> list[logging.StreamHandler[Any]]:
    """Return the handlers that write what this package and the program log."""
    found: list[logging.StreamHandler[Any]] = []
    for name in (None, "fenics_contact"):
        handlers = logging.getLogger(name).handlers
        found += [handler for handler in handlers if isinstance(handler, logging.StreamHandler)]
    return found


def _clock(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
