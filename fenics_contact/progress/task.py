"""A piece of work that tells how far it is."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import Any

from fenics_contact.errors import tell
from fenics_contact.progress.event import Event, Kind

#: Through this logger everything is reported.
LOGGER_NAME = "fenics_contact.progress"
#: What else hears every event: `show_progress` while it draws.
LISTENERS: list[Callable[[Event], None]] = []

_LOGGER = logging.getLogger(LOGGER_NAME)


class Task:
    """A piece of work that tells how far it is, if anybody listens.

    Attributes:
        outcome: What is told when it ends.

    Example:
        >>> with Task("load steps", total=2) as task:
        ...     for number in (1, 2):
        ...         task.step(number)
    """

    def __init__(
        self,
        what: str,
        *,
        unit: str = "steps",
        total: int | None = None,
        most: int | None = None,
        target: float | None = None,
        measured: str = "residual",
    ) -> None:
        """Describe the work; nothing is told before it begins.

        Args:
            what: Name of the work.
            unit: What is counted, in the plural.
            total: How many there are, None if nobody knows.
            most: How many there may be.
            target: What the measure of the steps must fall to.
            measured: What that measure is.
        """
        self.outcome = ""
        self._event = Event(id(self), what, Kind.BEGIN, unit, None, total, most, None, target, measured)

    def begin(self, number: int | None = None) -> None:
        """Say that the work begins, and how many steps an earlier run has done."""
        self._tell(Kind.BEGIN, number=number)

    def step(
        self,
        number: int,
        *,
        measure: float | None = None,
        target: float | None = None,
        value: float | None = None,
        left: float | None = None,
        words: str = "",
        timed: bool = True,
    ) -> None:
        """Say how far the work is: the attributes of an `Event`; a target is told where it has changed."""
        if LISTENERS or _LOGGER.isEnabledFor(logging.DEBUG):
            known = {} if target is None else {"target": target}
            found = {"measure": measure, "value": value, "left": left, "words": words, "timed": timed}
            self._tell(Kind.STEP, number=number, **found, **known)

    def end(self, error: BaseException | None = None) -> None:
        """Say that the work is over, and what it ended with instead of its result: a failure, or Ctrl-C."""
        kind = Kind.END
        if error is not None:
            kind = Kind.FAILED if isinstance(error, Exception) else Kind.STOPPED
        self._tell(kind, words=self.outcome)

    def __enter__(self) -> Task:
        """Begin; work of which steps are known or a limit shows that none is done."""
        self.begin(None if self._event.total is None and self._event.most is None else 0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End, as a failure where an exception passes."""
        self.end(error)

    def _tell(self, kind: Kind, **found: Any) -> None:
        if LISTENERS or _LOGGER.isEnabledFor(logging.DEBUG):
            event = replace(self._event, kind=kind, **found)
            for listen in LISTENERS:
                listen(event)
            tell(_LOGGER.debug, "%s", event, extra={"progress": event})
