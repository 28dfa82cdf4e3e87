"""The context in which progress is shown: bars on a terminal, an output of a notebook, lines in a log."""

from __future__ import annotations

import html
import importlib.util
import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TextIO

from fenics_contact.errors import safe_log
from fenics_contact.progress.task import (
    LISTENERS,
    LOGGER_NAME,
    Event,
    Work,
    Works,
    at_terminal,
    in_notebook,
    visible,
)

if TYPE_CHECKING:
    from mpi4py import MPI


#: Outermost work leaves a line if it took this long, [s], and this fraction of the time so far.
WORTH, SHARE = 1.0, 0.05


@contextmanager
def show_progress(
    comm: MPI.Comm | None = None, stream: TextIO | None = None, interval: float = 10.0
) -> Iterator[None]:
    """Show the progress of the work in the block.

    On a terminal there are bars, below what the program prints. In a notebook there is one output of the
    cell. Elsewhere, or without rich, a line is logged at level INFO at intervals, by the logger
    ``fenics_contact.progress``: it is invisible unless logging is configured. Only rank 0 shows anything, and
    no rank waits for another. Within another `show_progress` the inner one does nothing.

    Args:
        comm: Communicator of the work; None for a program that is not started by mpirun.
        stream: Stream for drawing if it is a terminal; stderr by default.
        interval: Smallest time between two lines in the log, [s].

    Example:
        >>> with show_progress(MPI.COMM_WORLD):  # doctest: +SKIP
        ...     state = solve_scene(scene, MPI.COMM_WORLD)
    """
    if LISTENERS or (comm is not None and comm.rank != 0):
        yield
        return
    works = Works()
    writer = _writer(stream, interval)
    begun = last = time.time()

    def listen(event: Event) -> None:
        nonlocal last
        now = time.time()
        over = works.take(event, now)
        if over is not None and now - over.begun >= max(WORTH, SHARE * (now - begun)):
            writer.leave(over.summary())
        if now >= last + writer.pause:
            last = now
            writer.show(works.shown())

    LISTENERS.append(listen)
    try:
        yield
    finally:
        LISTENERS.remove(listen)
        writer.stop()


def _writer(stream: TextIO | None, interval: float) -> Bars | Log | Notebook:
    """Return the display that suits the environment of the program."""
    if in_notebook() and stream is None:
        return Notebook()
    stream = stream or sys.stderr
    if not at_terminal(stream) or importlib.util.find_spec("rich") is None:
        return Log(interval)
    return Bars(stream)


class Log:
    """Logs a line at level INFO at intervals, and one about finished work."""

    def __init__(self, pause: float) -> None:
        """Begin; ``pause`` is the smallest time between two lines, [s]."""
        self.pause = pause

    def show(self, works: list[Work]) -> None:
        """Log the progress of the work."""
        if works:
            self.leave("; ".join(work.line for work in works))

    def leave(self, line: str) -> None:
        """Log the outcome."""
        safe_log(logging.getLogger(LOGGER_NAME).info, "%s", line)

    def stop(self) -> None:
        """Do nothing."""


class Notebook:
    """Replaces an output of the cell; needs no widgets, so that a saved notebook shows the final output."""

    pause = 0.3

    def __init__(self) -> None:
        """Begin without an output."""
        self._over: list[str] = []
        self._output: Any = None

    def show(self, works: list[Work]) -> None:
        """Replace the output."""
        from IPython.display import display  # available in notebooks

        text = "\n".join([*self._over, *(work.line for work in works)])
        content = {"text/plain": text, "text/html": f"<pre>{html.escape(text)}</pre>"}
        if self._output is None:
            self._output = display(content, raw=True, display_id=True)
        else:
            self._output.update(content, raw=True)

    def leave(self, line: str) -> None:
        """Keep a line."""
        self._over.append(line)

    def stop(self) -> None:
        """Keep only the lines about finished work."""
        if self._output is not None:
            self.show([])


class Bars:
    """Draws bars of rich below all other output of the program."""

    pause = 0.05

    def __init__(self, stream: TextIO) -> None:
        """Start drawing; output and logs of the program appear above the bars."""
        from rich import progress  # takes a tenth of a second, only for terminals
        from rich.console import Console
        from rich.table import Column

        details = Column(no_wrap=True, overflow="ellipsis", ratio=1)
        self._progress = progress.Progress(
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(bar_width=12),
            progress.TextColumn("{task.fields[details]}", markup=False, table_column=details),
            progress.TimeRemainingColumn(),
            progress.TimeElapsedColumn(),
            console=Console(file=stream, force_terminal=True, markup=False, highlight=False, emoji=False),
            transient=True,
            expand=True,
            redirect_stdout=at_terminal(sys.stdout),  # output to a file must not be redirected
        )
        self._drawn: dict[int, progress.TaskID] = {}
        streams = {id(stream): name for name in ("stdout", "stderr") if (stream := getattr(sys, name))}
        self._progress.start()
        self._progress.console.show_cursor(True)  # a run that is killed could not bring it back
        handlers = [*logging.getLogger().handlers, *logging.getLogger("fenics_contact").handlers]
        self._logging: list[tuple[logging.StreamHandler[Any], Any]] = []
        for handler in handlers:
            if isinstance(handler, logging.StreamHandler) and id(handler.stream) in streams:
                self._logging.append((handler, handler.stream))
                handler.setStream(getattr(sys, streams[id(handler.stream)]))

    def show(self, works: list[Work]) -> None:
        """Update the bars: one for each work, outer ones first."""
        shown = [work.event.task for work in works]
        for name in [name for name in self._drawn if name not in shown]:
            self._progress.remove_task(self._drawn.pop(name))
        for depth, work in enumerate(works):
            name, details, done = work.event.task, visible(work.event.details), work.fraction
            if name not in self._drawn:
                title = "  " * depth + visible(work.event.what)
                self._drawn[name] = self._progress.add_task(title, total=None, details=details)
            total = None if done is None else 1.0
            self._progress.update(self._drawn[name], total=total, completed=done or 0.0, details=details)

    def leave(self, line: str) -> None:
        """Leave a line above the bars."""
        with suppress(OSError):
            self._progress.console.out(visible(line), highlight=False)

    def stop(self) -> None:
        """Remove the bars and restore the streams."""
        for handler, stream in self._logging:
            handler.setStream(stream)
        self._progress.stop()
