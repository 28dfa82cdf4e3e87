"""Progress on a terminal: a bar for each piece of work under way, redrawn in place by rich."""

from __future__ import annotations

import logging
import math
import sys
import time
from contextlib import suppress
from datetime import timedelta
from typing import Any, TextIO

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Column, Table
from rich.text import Text

from fenics_contact.progress.places import at_terminal
from fenics_contact.progress.words import visible
from fenics_contact.progress.works import Works

#: Columns of a bar.
BAR = 12


class Bars:
    """Draws bars below all other output of the program, at their own rate."""

    pause = math.inf

    def __init__(self, works: Works, stream: TextIO) -> None:
        """Start drawing; output and logs of the program appear above the bars."""
        self._works = works
        self._console = Console(file=stream, force_terminal=True, markup=False, highlight=False, emoji=False)
        streams = {id(stream): name for name in ("stdout", "stderr") if (stream := getattr(sys, name))}
        self._live = Live(
            console=self._console,
            get_renderable=self._drawn,
            transient=True,
            redirect_stdout=at_terminal(sys.stdout),  # output to a file must not be redirected
        )
        self._live.start()
        self._console.show_cursor(True)  # a run that is killed could not bring it back
        handlers = [*logging.getLogger().handlers, *logging.getLogger("fenics_contact").handlers]
        self._logging: list[tuple[logging.StreamHandler[Any], Any]] = []
        for handler in handlers:
            if isinstance(handler, logging.StreamHandler) and id(handler.stream) in streams:
                self._logging.append((handler, handler.stream))
                handler.setStream(getattr(sys, streams[id(handler.stream)]))

    def show(self, lines: list[str]) -> None:
        """Do nothing: the bars are drawn at their own rate."""

    def leave(self, line: str) -> None:
        """Leave a line above the bars."""
        with suppress(OSError):
            self._console.out(visible(line), highlight=False)

    def stop(self) -> None:
        """Remove the bars and restore the streams."""
        for handler, stream in self._logging:
            handler.setStream(stream)
        self._live.stop()

    def _drawn(self) -> Table:
        now = time.time()
        details = Column(no_wrap=True, overflow="ellipsis", ratio=1)
        names, others = Column(no_wrap=True, min_width=16), [Column(no_wrap=True) for _ in range(3)]
        table = Table.grid(names, others[0], details, *others[1:], padding=(0, 2, 0, 0), expand=True)
        for depth, work in enumerate(self._works.shown()):
            done, spent = work.fraction, timedelta(seconds=int(now - work.begun))
            bar = "" if done is None else ProgressBar(total=1.0, completed=done, width=BAR)
            words = (Text(visible(text)) for text in (work.event.details, work.left(now), str(spent)))
            table.add_row(Text("  " * depth + visible(work.event.what)), bar, *words)
        return table
