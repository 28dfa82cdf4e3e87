"""A piece of work that reports its progress."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import Any

from fenics_contact.errors import tell
from fenics_contact.progress.event import Event, Kind

#: Logger of all reports.
LOGGER_NAME = "fenics_contact.progress"
#: Other listeners of events: `show_progress` while it draws.
LISTENERS: list[Callable[[Event], None]] = []

_LOGGER = logging.getLogger(LOGGER_NAME)


class Task:
    """A piece of work that reports its progress if there are listeners.

    Attributes:
        outcome: Reported when it ends.

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
        """Describe the work; nothing is reported before it begins.

        Args:
            what: Name of the work.
            unit: Unit of the count, in the plural.
            total: Total number, None if unknown.
            most: Largest number.
            target: Target of the steps' measure.
            measured: Name of that measure.
        """
        self.outcome = ""
        self._event = Event(id(self), what, Kind.BEGIN, unit, None, total, most, None, target, measured)

    def begin(self, number: int | None = None) -> None:
        """Report that the work begins, and the number of steps of an earlier run."""
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
        """Report progress by the attributes of an `Event`; a target only if it has changed."""
        if LISTENERS or _LOGGER.isEnabledFor(logging.DEBUG):
            known = {} if target is None else {"target": target}
            given = {"measure": measure, "value": value, "left": left, "words": words, "timed": timed}
            self._tell(Kind.STEP, number=number, **given, **known)

    def end(self, error: BaseException | None = None) -> None:
        """Report that the work is over, and what it ended with instead of a result: a failure, or Ctrl-C."""
        kind = Kind.END
        if error is not None:
            kind = Kind.FAILED if isinstance(error, Exception) else Kind.STOPPED
        self._tell(kind, words=self.outcome)

    def __enter__(self) -> Task:
        """Begin; work with a known number or limit of steps reports that none is done."""
        self.begin(None if self._event.total is None and self._event.most is None else 0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End, as a failure where an exception passes."""
        self.end(error)

    def _tell(self, kind: Kind, **attributes: Any) -> None:
        if LISTENERS or _LOGGER.isEnabledFor(logging.DEBUG):
            event = replace(self._event, kind=kind, **attributes)
            for listen in LISTENERS:
                listen(event)
            tell(_LOGGER.debug, "%s", event, extra={"progress": event})
