"""The context in which progress is shown."""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from fenics_contact.progress.event import Event
from fenics_contact.progress.places import at_terminal, in_notebook
from fenics_contact.progress.task import LISTENERS
from fenics_contact.progress.works import Works
from fenics_contact.progress.writers import Log, Notebook

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact.progress.terminal import Bars

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
    writer = _writer(works, stream, interval)
    begun = last = time.time()

    def listen(event: Event) -> None:
        nonlocal last
        now = time.time()
        over = works.take(event, now)
        if over is not None and now - over.begun >= max(WORTH, SHARE * (now - begun)):
            writer.leave(over.summary())
        if now >= last + writer.pause:
            last = now
            writer.show([work.line(now) for work in works.shown()])

    LISTENERS.append(listen)
    try:
        yield
    finally:
        LISTENERS.remove(listen)
        writer.stop()


def _writer(works: Works, stream: TextIO | None, interval: float) -> Bars | Log | Notebook:
    """Return the display that suits the environment of the program."""
    if in_notebook() and stream is None:
        return Notebook()
    stream = stream or sys.stderr
    if not at_terminal(stream) or importlib.util.find_spec("rich") is None:
        return Log(interval)
    from fenics_contact.progress.terminal import Bars  # takes a tenth of a second, only for terminals

    return Bars(works, stream)
