"""Exit codes for scripts and messages for people, the same on every rank."""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import TYPE_CHECKING, Any

from fenics_contact.cli.streams import complain
from fenics_contact.errors import (
    ConvergenceError,
    FenicsContactError,
    InfeasibleError,
    InvalidInputError,
    MissingRequirementError,
)

if TYPE_CHECKING:
    from mpi4py import MPI


class Ending(IntEnum):
    """Exit codes of all commands."""

    OK = 0
    FAILED = 1
    WRONG_INPUT = 2
    NOT_CONVERGED = 3
    NO_EQUILIBRIUM = 4
    MISSING = 5
    INTERRUPTED = 130
    STOPPED = 138
    TERMINATED = 143


MEANING = {
    Ending.OK: "it did what was asked for",
    Ending.FAILED: "something else went wrong, for instance a full disk",
    Ending.WRONG_INPUT: "wrong input: an option, a scene file, a file that is not there",
    Ending.NOT_CONVERGED: "a solver or the optimiser stopped before its tolerance was met",
    Ending.NO_EQUILIBRIUM: "no equilibrium: nothing holds some body against its load",
    Ending.MISSING: "a library is missing or too old",
    Ending.INTERRUPTED: "interrupted from the keyboard",
    Ending.STOPPED: "stopped by SIGUSR1, as batch systems send, where it can go on",
    Ending.TERMINATED: "terminated by a signal",
}
#: For the end of the help text.
EPILOG = "\b\nExit codes:\n" + "\n".join(f"{code.value:<4d} {words}" for code, words in MEANING.items())


class Terminated(BaseException):
    """The process received SIGTERM."""


def ending_of(error: BaseException) -> Ending:
    """Return the exit code of an error."""
    kinds: tuple[tuple[type[BaseException], Ending], ...] = (
        (InfeasibleError, Ending.NO_EQUILIBRIUM),
        (ConvergenceError, Ending.NOT_CONVERGED),
        (InvalidInputError, Ending.WRONG_INPUT),
        (MissingRequirementError, Ending.MISSING),
        (KeyboardInterrupt, Ending.INTERRUPTED),
        (Terminated, Ending.TERMINATED),
    )
    return next((code for kind, code in kinds if isinstance(error, kind)), Ending.FAILED)


@contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM end the block as Ctrl-C does, so that clean-up is done."""

    def stop(*_: Any) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def report_error(error: BaseException, comm: MPI.Comm) -> Ending:
    """Report on rank 0 how a command ended, and return its exit code.

    Errors of this package are raised on all ranks together. Any other may occur on one rank while the rest
    wait for it: then all are ended. The same holds for an interrupt, which reaches ranks at different places.
    """
    code = ending_of(error)
    known = isinstance(error, FenicsContactError)
    if known and comm.rank == 0:
        complain(f"error: {error}\n")
    if isinstance(error, KeyboardInterrupt | Terminated):
        if comm.rank == 0:
            complain("interrupted\n" if isinstance(error, KeyboardInterrupt) else "terminated\n")
        _leave(comm, code)
    elif not known:
        complain("".join(traceback.format_exception(error)))
        if comm.size > 1:
            comm.Abort(int(code))
    return code


def _leave(comm: MPI.Comm, code: Ending) -> None:
    """End this rank without waiting for others, whose position is unknown."""
    sys.stdout.flush()
    sys.stderr.flush()
    if comm.size > 1:
        os._exit(int(code))
