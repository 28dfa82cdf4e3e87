"""Progress in a log: one line now and then."""

from __future__ import annotations

import logging

from fenics_contact.progress.presenter import Presenter
from fenics_contact.progress.task import LOGGER_NAME
from fenics_contact.progress.tracker import Tracker, Work, summary


class Lines(Presenter):
    """Logs a line at level INFO at most every so many seconds, and one about work that is over."""

    def __init__(self, tracker: Tracker, interval: float) -> None:
        """Begin.

        Args:
            tracker: What is under way.
            interval: Least time between two lines, [s].
        """
        self._tracker, self._interval = tracker, interval
        self._last: float | None = None

    def changed(self, moment: float) -> None:
        """Log a line where that is due."""
        if self._last is None:
            self._last = moment
        if moment < self._last + self._interval:
            return
        rows = self._tracker.rows(moment)
        if rows:
            self._log("; ".join(map(str, rows)))
            self._last = moment

    def finished(self, work: Work) -> None:
        """Log what came out."""
        self._log(summary(work))

    def _log(self, line: str) -> None:
        logging.getLogger(LOGGER_NAME).info("%s", line)
