"""Calls of what a user has given: whatever they raise says who raised it."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from fenics_contact.errors.kinds import FenicsContactError, InvalidInputError, UserCodeError


@contextmanager
def calling(what: str) -> Iterator[None]:
    """Call a user's code: what it raises becomes a `UserCodeError` that names it.

    An exit counts as a failure too: a load or a material may not end a program, on one rank least of all.
    Errors of this package, which such code may raise on purpose, and interrupts pass.

    Args:
        what: Whose code it is, for the message: "the function given as Traction on body 'bar'".

    Raises:
        UserCodeError: If the block raises; the cause is chained.

    Example:
        >>> with calling("the stress of material Foam"):
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
    """Return what is raised when a user's code has met an error."""
    return UserCodeError(f"{what} failed with {described_error(error)}: mend it, or catch the error there")


@contextmanager
def running(what: str) -> Iterator[None]:
    """Run what a scene file names: whatever it raises is a mistake in the file; leaving Python, too.

    Raises:
        InvalidInputError: With the class and the words of what was raised.
    """
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
    except Exception:  # a class of the user's may fail at that, too
        message = "a message that cannot be shown"
    name = type(error).__name__
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({frames[-1].filename}, line {frames[-1].lineno})" if frames else ""
    return f"{name}: {message}{place}" if message else f"{name}{place}"
