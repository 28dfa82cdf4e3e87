"""Progress in a notebook: one output that is replaced, and stays with what came out."""

from __future__ import annotations

import html
from typing import Any

from fenics_contact.progress.presenter import Presenter
from fenics_contact.progress.tracker import Tracker, Work, summary

#: Least time between two changes of the output, [s].
PAUSE = 0.3


class Notebook(Presenter):
    """Replaces an output of the cell; needs no widgets, so that a stored notebook shows the end of it."""

    def __init__(self, tracker: Tracker) -> None:
        """Prepare.

        Args:
            tracker: What is under way.
        """
        self._tracker, self._last = tracker, 0.0
        self._over: list[str] = []
        self._output: Any = None

    def stop(self) -> None:
        """Leave the lines about what is over."""
        if self._output is not None:
            self._show([])

    def changed(self, moment: float) -> None:
        """Replace the output where that is due."""
        if moment >= self._last + PAUSE:
            self._last = moment
            self._show([str(row) for row in self._tracker.rows(moment)])

    def finished(self, work: Work) -> None:
        """Keep a line."""
        self._over.append(summary(work))

    def _show(self, lines: list[str]) -> None:
        from IPython.display import display  # a notebook has it

        text = "\n".join([*self._over, *lines])
        content = {"text/plain": text, "text/html": f"<pre>{html.escape(text)}</pre>"}
        if self._output is None:
            self._output = display(content, raw=True, display_id=True)
        else:
            self._output.update(content, raw=True)
