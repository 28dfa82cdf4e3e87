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

#: Outermost work leaves a line if it took so long, [s], and such a part of all the time so far.
WORTH, SHARE = 1.0, 0.05


@contextmanager
def show_progress(
    comm: MPI.Comm | None = None, stream: TextIO | None = None, interval: float = 10.0
) -> Iterator[None]:
    """Show how far the work in the block is.

    On a terminal there are bars, below what the program prints. In a notebook there is one output of the
    cell. Elsewhere, or without rich, a line is logged at level INFO now and then, by the logger
    ``fenics_contact.progress``: nobody sees it unless logging is configured. Only rank 0 shows anything, and
    no rank waits for another. Within another `show_progress` the inner one does nothing.

    Args:
        comm: Communicator of the work; None for a program that is not started by mpirun.
        stream: Where to draw if it is a terminal; stderr by default.
        interval: Least time between two lines in the log, [s].

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
    """Return the way of showing that suits where the program runs."""
    if in_notebook() and stream is None:
        return Notebook()
    stream = stream or sys.stderr
    if not at_terminal(stream) or importlib.util.find_spec("rich") is None:
        return Log(interval)
    from fenics_contact.progress.terminal import Bars  # costs a tenth of a second, for terminals alone

    return Bars(works, stream)
