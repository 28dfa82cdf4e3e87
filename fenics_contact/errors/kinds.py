"""The classes of errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


class FenicsContactError(Exception):
    """Base of every error that this package raises on purpose."""


class InvalidInputError(FenicsContactError, ValueError):
    """The input cannot be used as given; the message says what would be accepted."""


class InvalidDesignError(InvalidInputError):
    """The objective is undefined at this design, for example because a cell is inverted.

    A minimisation that meets it tries a shorter step.
    """


class FoldedFacetsError(InvalidInputError):
    """Facets that contact needs convex are not.

    Where bodies deform much a Newton step may fold them, and a shorter load step is tried.
    """


class InfeasibleError(FenicsContactError):
    """No equilibrium exists: some motion of some body is not resisted."""


class MissingRequirementError(FenicsContactError, ImportError):
    """A library that the package needs is missing or has an unsupported version."""


class ForkedProcessError(FenicsContactError, RuntimeError):
    """A computation in a process that was forked from one that had computed already."""


class ConvergenceError(FenicsContactError, RuntimeError):
    """An iterative method stopped before its tolerance was met.

    Attributes:
        history: The record of every iteration up to the stop, oldest first.
    """

    def __init__(self, message: str, history: Sequence[Any] = ()) -> None:
        """Store the history with the message."""
        super().__init__(message)
        self.history = tuple(history)


class LoadStepError(ConvergenceError):
    """A load that cannot be followed to its end, however small its steps.

    Attributes:
        state: The last equilibrium (`fenics_contact.contact.DeformedState`); None if there was none after the
            start of the step.
    """

    def __init__(self, message: str, history: Sequence[Any], state: Any) -> None:
        """Store the last equilibrium with the message."""
        super().__init__(message, history)
        self.state = state


class UserCodeError(FenicsContactError, RuntimeError):
    """A function, material or obstacle that was given to this package failed.

    The message states which one, how and where; its exception is the cause on the rank where it was raised.
    """


class RemoteError(FenicsContactError, RuntimeError):
    """Another rank of the communicator raised an error; its message is repeated here."""
