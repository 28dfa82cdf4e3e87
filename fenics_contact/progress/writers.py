"""Progress without bars: lines in a log, or an output of a notebook that is replaced."""

from __future__ import annotations

import html
import logging
from typing import Any

from fenics_contact.errors import tell
from fenics_contact.progress.task import LOGGER_NAME


class Log:
    """Logs a line at level INFO at intervals, and one about finished work."""

    def __init__(self, pause: float) -> None:
        """Begin; ``pause`` is the smallest time between two lines, [s]."""
        self.pause = pause

    def show(self, lines: list[str]) -> None:
        """Log the progress of the work."""
        if lines:
            self.leave("; ".join(lines))

    def leave(self, line: str) -> None:
        """Log the outcome."""
        tell(logging.getLogger(LOGGER_NAME).info, "%s", line)

    def stop(self) -> None:
        """Do nothing."""


class Notebook:
    """Replaces an output of the cell; needs no widgets, so that a saved notebook shows the final output."""

    pause = 0.3

    def __init__(self) -> None:
        """Begin without an output."""
        self._over: list[str] = []
        self._output: Any = None

    def show(self, lines: list[str]) -> None:
        """Replace the output."""
        from IPython.display import display  # available in notebooks

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
        """Keep only the lines about finished work."""
        if self._output is not None:
            self.show([])
