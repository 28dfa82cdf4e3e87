"""How far long work is: told by every part of the package, shown where somebody asks for it.

The package reports through the logger ``fenics_contact.progress``, at level DEBUG. Each record carries an
`Event` in its attribute ``progress``: which work, how many of how many, residual and target. Nobody listens
by default, and then a report costs less than a microsecond. `show_progress` listens and draws.

Example:
    >>> with show_progress(comm):  # doctest: +SKIP
    ...     state = solve_scene(scene, comm)
"""

from fenics_contact.progress.event import Event, Kind
from fenics_contact.progress.places import at_terminal
from fenics_contact.progress.show import show_progress
from fenics_contact.progress.task import LOGGER_NAME, Task
from fenics_contact.progress.words import duration, is_visible, visible

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
