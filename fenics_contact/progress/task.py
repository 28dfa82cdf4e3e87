"""A piece of work that tells how far it is."""

from __future__ import annotations

import logging
from types import TracebackType
from typing import Any

from fenics_contact.errors import tell
from fenics_contact.progress.event import Event, Kind

#: Through this logger everything is reported.
LOGGER_NAME = "fenics_contact.progress"

_LOGGER = logging.getLogger(LOGGER_NAME)


class Task:
    """A piece of work that tells how far it is, if anybody listens.

    Attributes:
        what: Name of the work.
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
        self.what, self.outcome = what, ""
        # Work of which steps are known or a limit shows from its beginning that none is done.
        self._first = None if total is None and most is None else 0
        self._known: dict[str, Any] = {
            "unit": unit, "total": total, "most": most, "target": target, "measured": measured
        }  # fmt: skip

    def begin(self, number: int | None = None, words: str = "") -> None:
        """Say that the work begins.

        Args:
            number: How many an earlier run has done.
            words: What else there is to say.
        """
        if _LOGGER.isEnabledFor(logging.DEBUG):
            self._tell(Kind.BEGIN, number=number, words=words)

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
        """Say how far the work is.

        Args:
            number: How many are done.
            measure: What must become small; None if it is not known now.
            target: What it must fall to, where that has changed.
            value: Best value so far.
            left: How long the rest will take, [s], where the work knows better than the time of its steps.
            words: What else there is to say.
            timed: Whether the time since the last step tells how long others take.
        """
        if _LOGGER.isEnabledFor(logging.DEBUG):
            known = {} if target is None else {"target": target}
            self._tell(
                Kind.STEP,
                number=number,
                measure=measure,
                value=value,
                left=left,
                words=words,
                timed=timed,
                **known,
            )

    def end(self, error: BaseException | None = None, words: str = "") -> None:
        """Say that the work is over.

        Args:
            error: What it ended with instead of its result: a failure, or Ctrl-C and the like.
            words: What else there is to say.
        """
        if _LOGGER.isEnabledFor(logging.DEBUG):
            kind = Kind.END
            if error is not None:
                kind = Kind.FAILED if isinstance(error, Exception) else Kind.STOPPED
            self._tell(kind, words=words)

    def __enter__(self) -> Task:
        """Begin."""
        self.begin(self._first)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End, as a failure where an exception passes."""
        self.end(error, words=self.outcome)

    def _tell(self, kind: Kind, **found: Any) -> None:
        event = Event(task=id(self), what=self.what, kind=kind, **{**self._known, **found})
        tell(_LOGGER.debug, "%s", event, extra={"progress": event})
