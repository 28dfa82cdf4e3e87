"""The checkpoint of a run, and the treatment of an existing one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fenics_contact.checkpoint.archive import Arrays, read_archive, write_archive
from fenics_contact.errors import InvalidInputError, together

if TYPE_CHECKING:  # the optimiser does without mpi4py
    from mpi4py import MPI


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
            raise InvalidInputError(
                f"every must be at least 1, got {self.every}: how many evaluations lie between two writes"
            )

    def read(self, kind: str, fingerprint: Mapping[str, str], comm: MPI.Comm | None) -> Arrays | None:
        """Return the stored arrays, None if the run starts anew. Collective on ``comm``.

        Raises:
            InvalidInputError: On all ranks, see `read_archive`.
        """
        path, arrays = Path(self.path), None
        if self.resume is False:
            return None
        if comm is None:
            return read_archive(path, kind, fingerprint) if self.resume or path.exists() else None
        with together(comm):
            if comm.rank == 0 and (self.resume or path.exists()):
                arrays = read_archive(path, kind, fingerprint)
        names = comm.bcast(None if arrays is None else list(arrays))
        if names is None:
            return None
        # One by one: an MPI message is limited to 2 GB, which a long history exceeds.
        return {name: comm.bcast(None if arrays is None else arrays[name]) for name in names}

    def write(
        self, kind: str, fingerprint: Mapping[str, str], arrays: Mapping[str, Any], comm: MPI.Comm | None
    ) -> None:
        """Replace the stored arrays. Collective on ``comm``.

        Raises:
            CheckpointError: On all ranks; the file is then unchanged.
        """
        if comm is None:
            write_archive(Path(self.path), kind, fingerprint, arrays)
            return
        with together(comm):
            if comm.rank == 0:
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
