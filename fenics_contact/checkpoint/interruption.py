"""Stopping of runs by signals, at the next point at which everything can be stored."""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

from fenics_contact.errors import InvalidInputError, safe_log

if TYPE_CHECKING:  # the optimiser does without mpi4py
    from mpi4py import MPI

#: Ctrl-C, the end of a job, and the earlier warning that queues can send.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)

_LOG = logging.getLogger(__name__)


class Interrupted(SystemExit):
    """The run stopped on a signal, at a point from which it can continue.

    Uncaught, it ends the program with exit status 128 + the signal's number, as in shells, and without a
    traceback; what is stored was logged.

    Attributes:
        signal: The signal.
    """

    def __init__(self, message: str, number: int) -> None:
        """Store the message with the exit status."""
        super().__init__(128 + number)
        self.signal = signal.Signals(number)
        self._message = message

    def __str__(self) -> str:
        """Return what is stored and how to continue."""
        return self._message


class Interruption:
    """Handles signals and records the first one until the run can stop.

    Attributes:
        comm: Communicator of the run; rank 0 logs.
        requested: Number of the received signal, 0 if none.
    """

    def __init__(self, comm: MPI.Comm | None) -> None:
        """Begin without a signal."""
        self.comm, self.requested = comm, 0
        self._kept = ""

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal: the second one ends the run at once."""
        name = signal.Signals(number).name
        if not self.requested:
            self.requested = number
            self._say("%s: the run stops after the step under way, at once if it is told again%s", name)
            return
        self._say("%s again: the run stops at once%s", name)
        if self.comm is not None and self.comm.size > 1:
            self.comm.Abort(128 + number)  # the other ranks would wait for this one forever
        raise Interrupted(f"stopped at once by {name}", number)

    def safe_point(
        self,
        kept: Callable[[], str] = str,
        save: Callable[[], None] | None = None,
        comm: MPI.Comm | None = None,
    ) -> None:
        """Stop here if a rank received a signal. Collective on the communicator.

        Args:
            kept: Describes what a run that ends here leaves, and how to continue it.
            save: Stores what is not stored yet; collective.
            comm: Communicator whose ranks agree; that of the run by default.

        Raises:
            Interrupted: On all ranks, if one of them has received a signal.
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
            safe_log(_LOG.warning, "%s", message)
        raise Interrupted(message, number)

    def _say(self, words: str, name: str) -> None:
        if self.comm is None or self.comm.rank == 0:
            # Launchers may kill the ranks a second later: report what is stored now.
            safe_log(_LOG.warning, words, name, f"; so far {self._kept}" if self._kept else "")


@contextmanager
def interruptible(comm: MPI.Comm | None = None, signals: Sequence[int] = SIGNALS) -> Iterator[Interruption]:
    """Let a signal stop the load history or the optimisation in the block where it can continue.

    After the first signal the step or evaluation under way is completed and written; then all ranks raise
    `Interrupted`, which ends the program quietly. A second signal stops at once; the checkpoint is then the
    last complete one. Handlers are restored after the block. Collective on ``comm``.

    Queues send SIGTERM some seconds before they kill a job, and an earlier signal on request (Slurm:
    ``--signal=USR1@300``). mpirun kills its ranks one second after Ctrl-C or SIGTERM; it forwards SIGUSR1 and
    waits.

    Args:
        comm: Communicator of the run; None for a program that is not started by mpirun.
        signals: Signals to handle. Yields: Their handler: your own loop calls its `Interruption.safe_point`.

    Raises:
        InvalidInputError: If this is not the main thread, the only one that receives signals.

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
            # None is a handler that was not installed from Python and cannot be restored.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def safe_point(kept: Callable[[], str], save: Callable[[], None], comm: MPI.Comm | None) -> None:
    """Stop here if an `interruptible` run received a signal; see `Interruption.safe_point`. Collective."""
    for number in signal.valid_signals():
        # The process's table of handlers holds this state, so no other global is needed.
        handler = signal.getsignal(number)
        if isinstance(handler, Interruption):
            handler.safe_point(kept, save, comm)
            return


@contextmanager
def reporting_what_is_stored(kept: Callable[[], str], comm: MPI.Comm | None) -> Iterator[None]:
    """Report what an interrupted block leaves: as a note on the exception, and in the log of rank 0."""
    try:
        yield
    except Interrupted:
        raise
    except (KeyboardInterrupt, SystemExit) as stop:
        words = kept()
        stop.add_note(words)
        if comm is None or comm.rank == 0:
            safe_log(_LOG.info, "interrupted: %s", words)
        raise
