"""Errors that say what is needed, what was given and what to do, raised by all ranks or by none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # these errors also report that mpi4py is missing
    from mpi4py import MPI


class FenicsContactError(Exception):
    """Base of every error that this package raises on purpose."""


class InvalidInputError(FenicsContactError, ValueError):
    """The input cannot be used as given; the message says what would be accepted."""


class InvalidDesignError(InvalidInputError):
    """The objective does not exist at this design, for example because a cell is inverted.

    A minimisation that meets it tries a shorter step.
    """


class InfeasibleError(FenicsContactError):
    """No equilibrium exists: nothing holds some motion of some body."""


class MissingRequirementError(FenicsContactError, ImportError):
    """A library that the package stands on is missing or has an unsupported version."""


class ConvergenceError(FenicsContactError, RuntimeError):
    """An iterative method stopped before its tolerance was met.

    Attributes:
        history: The record of every iteration up to the stop, oldest first.
    """

    def __init__(self, message: str, history: Sequence[Any] = ()) -> None:
        """Keep the history beside the message."""
        super().__init__(message)
        self.history = tuple(history)


class RemoteError(FenicsContactError, RuntimeError):
    """Another rank of the communicator met an error; its message is repeated here."""


def agree(comm: MPI.Comm, error: Exception | None) -> None:
    """Let all ranks raise as soon as one of them has an error.

    A rank with an error of its own raises that; a rank without one raises an error of the
    same class with the message of the lowest failing rank. Collective on ``comm``.

    Args:
        comm: Communicator whose ranks must stay together.
        error: This rank's error, or None.

    Raises:
        Exception: ``error`` itself where there is one.
        FenicsContactError: On the other ranks, of the failing rank's class where that is one of
            this package's, else `RemoteError`.
    """
    if not comm.allreduce(int(error is not None)):
        return
    reports = comm.allgather(None if error is None else (type(error), str(error)))
    if error is not None:
        raise error
    rank, (kind, message) = next((r, report) for r, report in enumerate(reports) if report is not None)
    remote = kind if issubclass(kind, FenicsContactError) else RemoteError
    raise remote(f"{message} (met on rank {rank})")


@contextmanager
def together(comm: MPI.Comm) -> Iterator[None]:
    """Run a block that makes no collective calls, then raise on all ranks if it failed on one.

    Collective on ``comm``, which the block itself must not use.

    Args:
        comm: Communicator whose ranks must stay together.

    Raises:
        Exception: What the block raised on this rank, or as in `agree` what it raised on another.

    Example:
        >>> with together(comm):  # doctest: +SKIP
        ...     if comm.rank == 0:
        ...         text = path.read_text()
    """
    error: Exception | None = None
    try:
        yield
    except Exception as caught:
        error = caught
    agree(comm, error)
