"""Calls of user code, whose errors name their source."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from fenics_contact.errors.kinds import FenicsContactError, InvalidInputError, UserCodeError


@contextmanager
def user_code(what: str) -> Iterator[None]:
    """Call user code: its exceptions become a `UserCodeError` that names it.

    An exit counts as a failure, too: a load or a material may not end a program, least of all on one rank.
    Errors of this package, which such code may raise on purpose, and interrupts pass.

    Args:
        what: Name of the code, for the message: "the function given as Traction on body 'bar'".

    Raises:
        UserCodeError: If the block raises; the cause is chained.

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
    """Run code that a scene file names: any exception, also an exit, is a mistake in the file.

    Raises:
        InvalidInputError: With the class and the message of the exception.
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
    except Exception:  # a user's class may fail at that, too
        message = "a message that cannot be shown"
    name = type(error).__name__
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({frames[-1].filename}, line {frames[-1].lineno})" if frames else ""
    return f"{name}: {message}{place}" if message else f"{name}{place}"
