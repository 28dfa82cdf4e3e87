"""Runs that are told to stop: at the next moment at which everything can be kept."""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

from fenics_contact.errors import InvalidInputError, tell

if TYPE_CHECKING:  # the optimiser does without mpi4py
    from mpi4py import MPI

#: Ctrl-C, the end of a job, and the warning before it that queues can be asked for.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)

_LOG = logging.getLogger(__name__)


class Interrupted(SystemExit):
    """A signal told the run to stop, and it has stopped where it can go on from.

    Not caught, it ends the program with exit status 128 + the signal's number, as shells count, and without
    a traceback; what is kept was logged.

    Attributes:
        signal: The signal.
    """

    def __init__(self, message: str, number: int) -> None:
        """Keep the message beside the exit status."""
        super().__init__(128 + number)
        self.signal = signal.Signals(number)
        self._message = message

    def __str__(self) -> str:
        """Return what is kept and how to go on."""
        return self._message


class Interruption:
    """Hears signals and remembers the first one until the run can stop.

    Attributes:
        comm: Communicator of the run; rank 0 says what happens.
        requested: Number of the signal that was heard, 0 if none was.
    """

    def __init__(self, comm: MPI.Comm | None) -> None:
        """Begin with no signal heard."""
        self.comm, self.requested = comm, 0
        self._kept = ""

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Hear a signal: the second one ends the run at once."""
        name = signal.Signals(number).name
        if not self.requested:
            self.requested = number
            self._say("%s: the run stops after the step under way, at once if it is told again%s", name)
            return
        self._say("%s again: the run stops at once%s", name)
        if self.comm is not None and self.comm.size > 1:
            self.comm.Abort(128 + number)  # the other ranks would wait for this one for ever
        raise Interrupted(f"stopped at once by {name}", number)

    def safe_point(
        self,
        kept: Callable[[], str] = str,
        save: Callable[[], None] | None = None,
        comm: MPI.Comm | None = None,
    ) -> None:
        """Stop here if a rank was told to. Collective on the communicator.

        Args:
            kept: Says what a run that ends here leaves, and how to go on.
            save: Writes down what is not yet; collective.
            comm: Communicator whose ranks agree; that of the run by default.

        Raises:
            Interrupted: On all ranks, if one of them has heard a signal.
        """
        self._kept = kept()
        comm = comm or self.comm
        number = self.requested if comm is None or comm.size == 1 else max(comm.allgather(self.requested))
        if not number:
            return
        if save is not None:
            save()
        words = kept()
        message = f"stopped by {signal.Signals(number).name}" + (f": {words}" if words else "")
        if self.comm is None or self.comm.rank == 0:
            tell(_LOG.warning, "%s", message)
        raise Interrupted(message, number)

    def _say(self, words: str, name: str) -> None:
        if self.comm is None or self.comm.rank == 0:
            # Those who start ranks may kill them a second later: what is kept is said now.
            tell(_LOG.warning, words, name, f"; so far {self._kept}" if self._kept else "")


@contextmanager
def interruptible(comm: MPI.Comm | None = None, signals: Sequence[int] = SIGNALS) -> Iterator[Interruption]:
    """Let a signal stop the load history or the optimisation in the block where it can go on from.

    The first signal lets the step or evaluation under way come to its end and be written; then all ranks
    raise `Interrupted`, which ends the program quietly. A second signal stops at once; the checkpoint is then
    the last whole one. Handlers are put back after the block. Collective on ``comm``.

    Queues send SIGTERM some seconds before they kill a job, and an earlier signal if they are asked for it
    (Slurm: ``--signal=USR1@300``). mpirun kills its ranks one second after Ctrl-C or SIGTERM; it passes
    SIGUSR1 on and waits.

    Args:
        comm: Communicator of the run; None for a program that is not started by mpirun.
        signals: Signals to hear.

    Yields:
        What hears them: a loop of one's own calls its `Interruption.safe_point`.

    Raises:
        InvalidInputError: If this is not the main thread, which alone hears signals.

    Example:
        >>> with interruptible(comm):  # doctest: +SKIP
        ...     solve_steps(problem, steps, checkpoint=Checkpoint("run.npz"))
    """
    if threading.current_thread() is not threading.main_thread():
        raise InvalidInputError(
            "signals are heard by the main thread alone, got interruptible in "
            f"{threading.current_thread().name!r}: enter it in the main thread"
        )
    hearing = Interruption(comm)
    before: dict[int, Any] = {number: signal.signal(number, hearing) for number in signals}
    try:
        yield hearing
    finally:
        for number, handler in before.items():
            # None is a handler that was not installed from Python and cannot be put back.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def safe_point(kept: Callable[[], str], save: Callable[[], None], comm: MPI.Comm | None) -> None:
    """Stop here if the run is `interruptible` and was told to; see `Interruption.safe_point`. Collective."""
    for number in signal.valid_signals():
        # The table of handlers is where a process keeps this: there is nothing to hide elsewhere.
        handler = signal.getsignal(number)
        if isinstance(handler, Interruption):
            handler.safe_point(kept, save, comm)
            return


@contextmanager
def telling_what_is_kept(kept: Callable[[], str], comm: MPI.Comm | None) -> Iterator[None]:
    """Say what an interrupted block leaves: as a note on the exception, and in the log of rank 0."""
    try:
        yield
    except Interrupted:
        raise
    except (KeyboardInterrupt, SystemExit) as stop:
        words = kept()
        stop.add_note(words)
        if comm is None or comm.rank == 0:
            tell(_LOG.info, "interrupted: %s", words)
        raise
