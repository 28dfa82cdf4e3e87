"""Checkpoints of runs: files of arrays by name, and the point at which a signal stops a run.

Arrays by name in a file of NumPy's .npz format, with their kind and the fingerprint of the problem.

The format is a zip archive with one .npy file per array, which `numpy.load` reads with
``allow_pickle=False``, as do libraries for other languages. The arrays are those of the whole problem,
independent of the number of ranks. HDF5 would need h5py, built for the MPI and the HDF5 of dolfinx, which
Debian's FEniCSx lacks, without any saving: a file that must be complete is rewritten anyway.

| array | what it is |
|---|---|
| ``_format``, ``_version`` | "fenics_contact checkpoint", 2 |
| ``_kind`` | "load history" or "minimisation by the bundle trust method" |
| ``_fingerprint`` | JSON text: parts of the problem by name with their descriptions, see `described` |
| ``_digest`` | SHA-256 of all other arrays in the order of their names: of each the text "NAME TYPE SHAPE " \
as NumPy prints type and shape, then its bytes in C order |

A load history has ``steps``, the number of steps done, and for each, numbered from 000000, ``NUMBER.step``
(JSON text that describes it), ``NUMBER.multiplier`` (λ of all rows, [force]), ``NUMBER.origin`` (from where
slip is measured, [length]), ``NUMBER.slid`` (the same of points without friction) and ``NUMBER.motion``
(coefficients of the rigid motions); a state without multipliers has only the description.

A minimisation has ``centre.*`` (best point ``x``, ``value``, ``subgradient``), ``bundle.*``, ``trust.*`` and
``first_t``, ``careful`` (state of the method), ``history.*`` (a list for each attribute of a `Record` of the
optimiser) and ``fun.*``, the memory of the function: of a shape problem the states of the first, best and
last design, and the one to start from.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import signal
import threading
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fenics_contact._base.files import write_whole
from fenics_contact._base.fingerprint import differences
from fenics_contact._base.launching import ranks_of
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.errors.kinds import safe_log

if TYPE_CHECKING:
    from mpi4py import MPI


FORMAT = "fenics_contact checkpoint"
#: Of the format: a file of another one is rejected.
VERSION = 2

Arrays = dict[str, NDArray[Any]]


def write_archive(path: Path, kind: str, fingerprint: Mapping[str, str], arrays: Mapping[str, Any]) -> None:
    """Write arrays with their kind and the problem's fingerprint, atomically."""
    buffer = io.BytesIO()
    head = {
        "_format": FORMAT,
        "_version": VERSION,
        "_kind": kind,
        "_fingerprint": json.dumps(dict(fingerprint)),
    }
    members: dict[str, Any] = {name: np.asarray(value) for name, value in {**head, **arrays}.items()}
    np.savez(buffer, **members, _digest=np.array(_digest(members)))
    write_whole(path, buffer.getvalue())


def read_archive(path: Path, kind: str, fingerprint: Mapping[str, str]) -> Arrays:
    """Read the arrays of a problem."""
    arrays = _loaded(path)
    if str(arrays.pop("_format", "")) != FORMAT:
        raise InvalidInputError(f"{str(path)!r} is another file: give a checkpoint or a new name to begin")
    version, stored_kind = int(arrays.pop("_version")), str(arrays.pop("_kind"))
    if version != VERSION:
        raise InvalidInputError(f"{str(path)!r} has version {version}, not {VERSION}: use that release")
    if stored_kind != kind:
        raise InvalidInputError(f"{str(path)!r} must be of a {kind}, is of a {stored_kind}: give another")
    unlike = differences(json.loads(str(arrays.pop("_fingerprint"))), fingerprint)
    if unlike:
        raise InvalidInputError(
            f"{str(path)!r} differs (there, here) in {'; '.join(unlike)}: give the same problem or a new name"
        )
    return arrays


def _digest(members: Arrays) -> str:
    """Return a hash of names and contents: the checksums of the format exclude the names."""
    digest = hashlib.sha256()
    for name in sorted(members):
        digest.update(f"{name} {members[name].dtype.str} {members[name].shape} ".encode())
        digest.update(np.ascontiguousarray(members[name]).tobytes())
    return digest.hexdigest()


def _loaded(path: Path) -> Arrays:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InvalidInputError(
            f"checkpoint {str(path)!r} cannot be read: {error.strerror or error}; give one that can"
        ) from error
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            spoilt = archive.testzip()  # before any stored length is trusted
        if spoilt is None:
            with np.load(io.BytesIO(content), allow_pickle=False) as members:
                arrays = {name: members[name] for name in members.files}
            digest = str(arrays.pop("_digest", ""))
            if "_format" not in arrays or digest == _digest(arrays):
                return arrays
        reason = "its checksums do not agree"
    except Exception as error:  # arbitrary bytes can make the libraries raise anything
        reason = str(error) or type(error).__name__
    raise InvalidInputError(
        f"{str(path)!r} is not a complete checkpoint ({len(content)} bytes; {reason}): restore or remove it"
    )


@dataclass(frozen=True)
class Checkpoint:
    """A file from which an interrupted run continues.

    It is replaced atomically: killed at any moment, a run leaves the last complete one. The same command run
    again continues from there, on any number of ranks.

    Attributes:
        path: The file, in NumPy's .npz format; its folder is created.
        every: Evaluations or load steps between two writes; the end of the run is always written. Each write
            contains all steps so far: for hundreds of them on fine meshes write less often.
        resume: None continues from the file if it exists, True requires it, False starts anew and replaces
            it.
        comm: Communicator on which the run is replicated: rank 0 reads and writes. Needed only for functions
            that do not know their communicator.

    Example:
        >>> kept = Checkpoint("output/run.npz", every=5)
        >>> states = solve_steps(ContactProblem(scene, comm), steps, checkpoint=kept)  # doctest: +SKIP
        >>> result = minimize(problem, start, bounds=(-1.0, 1.0), checkpoint=kept)  # doctest: +SKIP
    """

    path: str | Path
    every: int = 1
    resume: bool | None = None
    comm: MPI.Comm | None = None

    def __post_init__(self) -> None:
        """Reject invalid intervals."""
        if self.every < 1:
            raise InvalidInputError(f"every must be at least 1, got {self.every}: it counts evaluations")

    def read(self, kind: str, fingerprint: Mapping[str, str], comm: MPI.Comm | None) -> Arrays | None:
        """Return the stored arrays, None if the run starts anew. Collective on ``comm``.

        Raises:
            InvalidInputError: On all ranks, see `read_archive`.
        """
        if self.resume is False:
            return None
        ranks, path = ranks_of(comm), Path(self.path)
        arrays: Arrays = {}
        stored = False
        with together(ranks):
            if ranks.rank == 0 and (self.resume or path.exists()):
                arrays, stored = read_archive(path, kind, fingerprint), True
        stored, names = ranks.bcast((stored, list(arrays)))
        # One by one: an MPI message is limited to 2 GB, which a long history exceeds.
        return {name: ranks.bcast(arrays.get(name)) for name in names} if stored else None

    def write(
        self, kind: str, fingerprint: Mapping[str, str], arrays: Mapping[str, Any], comm: MPI.Comm | None
    ) -> None:
        """Replace the stored arrays. Collective on ``comm``.

        Raises:
            CheckpointError: On all ranks; the file is then unchanged.
        """
        ranks = ranks_of(comm)
        with together(ranks):
            if ranks.rank == 0:
                write_archive(Path(self.path), kind, fingerprint, arrays)

    def resume_hint(self, done: int, kept: str) -> str:
        """Describe what an interrupted run leaves in the file, and how to continue it.

        Args:
            done: Number of pieces of work in the file.
            kept: Their description: "3 of 5 load steps".
        """
        if done == 0:
            return f"nothing was done yet that {self.path} could keep: run the same command again"
        again = "run the same command again to go on"
        if self.resume is False:
            again = "to go on run again without resume=False"
        return f"{kept} {'is' if done == 1 else 'are'} kept in {self.path}: {again}"


def without_checkpoint(done: str) -> str:
    """Describe that an interrupted run leaves nothing, and how it could."""
    return (
        f'nothing is kept of {done}: give checkpoint=Checkpoint("run.npz"), and the same command, run again, '
        "goes on from where it was stopped"
    )


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

    `requested`: number of the received signal, 0 if none.
    """

    def __init__(self, comm: MPI.Comm | None) -> None:
        """Begin without a signal."""
        self.comm, self.requested = ranks_of(comm), 0
        self._kept = ""

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal: the second one ends the run at once."""
        name = signal.Signals(number).name
        if not self.requested:
            self.requested = number
            self._say("%s: the run stops after the step under way, at once on a second signal%s", name)
            return
        self._say("%s again: the run stops at once%s", name)
        if self.comm.size > 1:
            self.comm.Abort(128 + number)  # the other ranks would wait for this one forever
        raise Interrupted(f"stopped at once by {name}", number)

    def safe_point(
        self,
        kept: Callable[[], str] = str,
        save: Callable[[], object] = str,
        comm: MPI.Comm | None = None,
    ) -> None:
        """Stop here if a rank received a signal. Collective on the communicator, by default the run's."""
        self._kept = kept()
        comm = comm or self.comm
        number = max(comm.allgather(self.requested))
        if not number:
            return
        save()
        words = kept()
        message = f"stopped by {signal.Signals(number).name}" + (f": {words}" if words else "")
        if self.comm.rank == 0:
            safe_log(_LOG.warning, "%s", message)
        raise Interrupted(message, number)

    def _say(self, words: str, name: str) -> None:
        if self.comm.rank == 0:
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
        raise InvalidInputError("signals reach the main thread alone: enter interruptible there")
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
        if ranks_of(comm).rank == 0:
            safe_log(_LOG.info, "interrupted: %s", words)
        raise
