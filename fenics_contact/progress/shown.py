"""The context in which progress is shown."""

from __future__ import annotations

import importlib.util
import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from fenics_contact.progress.event import Event
from fenics_contact.progress.lines import Lines
from fenics_contact.progress.places import in_notebook, terminal_width
from fenics_contact.progress.presenter import Presenter
from fenics_contact.progress.task import LOGGER_NAME
from fenics_contact.progress.tracker import Tracker

if TYPE_CHECKING:
    from mpi4py import MPI

#: Outermost work leaves a line if it took so long, [s], and such a part of all the time so far.
WORTH, SHARE = 1.0, 0.05


@contextmanager
def shown(
    comm: MPI.Comm | None = None, stream: TextIO | None = None, interval: float = 10.0
) -> Iterator[None]:
    """Show how far the work in the block is.

    On a terminal there are bars, below what the program prints. In a notebook there is one output of the
    cell. Elsewhere a line is logged at level INFO now and then, by the logger ``fenics_contact.progress``:
    nobody sees it unless logging is configured. Only rank 0 shows anything, and no rank waits for another.

    What was configured before is as it was after the block, also where that fails. Within another `shown`
    the inner one does nothing.

    Args:
        comm: Communicator of the work; None for a program that is not started by mpirun.
        stream: Where to draw if it is a terminal; stderr by default.
        interval: Least time between two lines in the log, [s].

    Example:
        >>> with shown(MPI.COMM_WORLD):  # doctest: +SKIP
        ...     state = solve_scene(scene, MPI.COMM_WORLD)
    """
    logger = logging.getLogger(LOGGER_NAME)
    shows = any(isinstance(handler, _Listener) for handler in logger.handlers)
    if shows or (comm is not None and comm.rank != 0):
        yield
        return
    tracker = Tracker()
    presenter = _presenter(tracker, stream or sys.stderr, own=stream is not None, interval=interval)
    listener = _Listener(tracker, presenter, logger)
    before = (logger.level, logger.propagate, logger.handlers)
    presenter.start()
    try:
        # Only here, not in the loggers above: nobody else is to hear more than he has asked for.
        logger.handlers, logger.propagate = [listener], False
        logger.setLevel(logging.DEBUG)
        yield
    finally:
        logger.handlers, logger.propagate = before[2], before[1]
        logger.setLevel(before[0])
        presenter.stop()


def _presenter(tracker: Tracker, stream: TextIO | None, *, own: bool, interval: float) -> Presenter:
    """Return the way of showing that suits where the program runs."""
    if in_notebook() and not own:
        from fenics_contact.progress.notebook import Notebook

        return Notebook(tracker)
    width = None if stream is None else terminal_width(stream)
    if stream is None or width is None or importlib.util.find_spec("rich") is None:
        return Lines(tracker, interval)
    from fenics_contact.progress.terminal import Terminal  # costs a tenth of a second, for terminals alone

    return Terminal(tracker, stream, width)


class _Listener(logging.Handler):
    """Hears all reports, and passes on those that would have been heard without it."""

    def __init__(self, tracker: Tracker, presenter: Presenter, logger: logging.Logger) -> None:
        super().__init__()
        self._tracker, self._presenter = tracker, presenter
        self._level = logger.getEffectiveLevel()
        self._others = list(logger.handlers)
        self._above = logger.parent if logger.propagate else None
        self._begun = time.time()

    def emit(self, record: logging.LogRecord) -> None:
        event = getattr(record, "progress", None)
        if isinstance(event, Event):
            work = self._tracker.take(event, record.created)
            if work is not None:
                spent = record.created - work.begun
                if spent >= max(WORTH, SHARE * (record.created - self._begun)):
                    self._presenter.finished(work)
            self._presenter.changed(record.created)
        if record.levelno >= self._level:
            for handler in self._others:
                if record.levelno >= handler.level:
                    handler.handle(record)
            if self._above is not None:
                self._above.callHandlers(record)
