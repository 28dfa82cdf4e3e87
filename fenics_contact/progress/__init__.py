"""Progress of long work: reported by every part of the package, shown on request.

The package reports through the logger ``fenics_contact.progress``, at level DEBUG. Each record carries an
`Event` in its attribute ``progress``: work, number and total, residual and target. Without a listener, the
default, a report costs less than a microsecond. `show_progress` listens and draws.

Example:
    >>> with show_progress(comm):  # doctest: +SKIP
    ...     state = solve_scene(scene, comm)
"""

from fenics_contact.progress.show import show_progress
from fenics_contact.progress.task import (
    LOGGER_NAME,
    Event,
    Kind,
    Task,
    at_terminal,
    duration,
    is_visible,
    visible,
)

__all__ = [
    "LOGGER_NAME",
    "Event",
    "Kind",
    "Task",
    "at_terminal",
    "duration",
    "is_visible",
    "show_progress",
    "visible",
]
