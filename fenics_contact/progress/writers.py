"""Progress where nothing is drawn in place: lines in a log, or an output of a notebook that is replaced."""

from __future__ import annotations

import html
import logging
from typing import Any

from fenics_contact.errors import tell
from fenics_contact.progress.task import LOGGER_NAME


class Log:
    """Logs a line at level INFO now and then, and one about work that is over."""

    def __init__(self, pause: float) -> None:
        """Begin; ``pause`` is the least time between two lines, [s]."""
        self.pause = pause

    def show(self, lines: list[str]) -> None:
        """Log how far the work is."""
        if lines:
            self.leave("; ".join(lines))

    def leave(self, line: str) -> None:
        """Log what came out."""
        tell(logging.getLogger(LOGGER_NAME).info, "%s", line)

    def stop(self) -> None:
        """Nothing remains to be done."""


class Notebook:
    """Replaces an output of the cell; needs no widgets, so that a stored notebook shows the end of it."""

    pause = 0.3

    def __init__(self) -> None:
        """Begin without an output."""
        self._over: list[str] = []
        self._output: Any = None

    def show(self, lines: list[str]) -> None:
        """Replace the output."""
        from IPython.display import display  # a notebook has it

        text = "\n".join([*self._over, *lines])
        content = {"text/plain": text, "text/html": f"<pre>{html.escape(text)}</pre>"}
        if self._output is None:
            self._output = display(content, raw=True, display_id=True)
        else:
            self._output.update(content, raw=True)

    def leave(self, line: str) -> None:
        """Keep a line."""
        self._over.append(line)

    def stop(self) -> None:
        """Leave the lines about what is over."""
        if self._output is not None:
            self.show([])
