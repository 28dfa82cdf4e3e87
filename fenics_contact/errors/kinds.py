"""The classes of errors.

Reports to loggers: a failing handler must not stop a run, least of all on one rank.

Calls of user code, whose errors name their source.
"""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
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


class OutOfMemoryError(FenicsContactError, MemoryError):
    """The machine, or a limit such as that of ``ulimit -v``, has no more memory."""


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
        state: The last equilibrium (`fenics_contact.DeformedState`); None if there was none after the
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


def safe_log(log: Callable[..., None], message: str, *arguments: Any, **named: Any) -> None:
    """Log a message, whatever handlers raise.

    A user's handler that raises is treated as in the standard library: its traceback goes to stderr if
    ``logging.raiseExceptions`` is set, and the run continues.

    Example:
        >>> safe_log(logging.getLogger("fenics_contact").debug, "%d products", 3)
    """
    try:
        log(message, *arguments, stacklevel=2, **named)
    except Exception:
        record = logging.makeLogRecord({"msg": message, "args": arguments})
        logging.Handler().handleError(record)


@contextmanager
def user_code(what: str) -> Iterator[None]:
    """Call user code: its exceptions become a `UserCodeError` that names it.

    An exit counts as a failure, too: a load or a material may not end a program, least of all on one rank.
    Errors of this package, which such code may raise on purpose, and interrupts pass.

    Example:
        >>> with user_code("the stress of material Foam"):
        ...     1 / 0
        Traceback (most recent call last):
        ...
        fenics_contact.errors.UserCodeError: the stress of material Foam failed with ZeroDivisionError...
    """
    try:
        yield
    except FenicsContactError:
        raise
    except (Exception, SystemExit) as error:
        raise failure(what, error) from error


def failure(what: str, error: BaseException) -> UserCodeError:
    """Return the exception for an error of user code."""
    reason = described_error(error)
    return UserCodeError(f"{what} failed with {reason}: fix it, or handle the exception inside it")


@contextmanager
def scene_file_code(what: str) -> Iterator[None]:
    """Run code that a scene file names: any exception, also an exit, is a mistake in the file."""
    try:
        yield
    except InvalidInputError:
        raise
    except (Exception, SystemExit) as error:
        raise InvalidInputError(
            f"{what} must run without errors, it raised {type(error).__name__}: {error}"
        ) from error


def described_error(error: BaseException) -> str:
    """Return class, message and place of an error in one line."""
    try:
        message = str(error)
    except Exception:  # a user's class may fail at that, too
        message = "a message that cannot be shown"
    name = type(error).__name__
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({frames[-1].filename}, line {frames[-1].lineno})" if frames else ""
    return f"{name}: {message}{place}" if message else f"{name}{place}"
