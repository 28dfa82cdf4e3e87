"""Seconds spent by phase."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

from fenics_contact.progress import Task


class PhaseTimer:
    """Adds up wall time under names, and reports the phase under way (`fenics_contact.progress`).

    Example:
        >>> timer = PhaseTimer()
        >>> with timer.phase("factor"):
        ...     pass
        >>> list(timer.seconds)
        ['factor']
    """

    def __init__(self) -> None:
        """Start with no phases."""
        self.seconds: dict[str, float] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time spent in the block to phase ``name``, also when the block fails."""
        start = perf_counter()
        try:
            with Task(name):
                yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start
