"""MPI and PETSc, loaded on first use: importing the package starts nothing.

The environment after MPI_Init makes every `mpirun` started from the process fail, so a program that only
imports the package must not start MPI. Starting PETSc is collective, by default over all ranks: `start` does
it over the ranks that compute.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from types import ModuleType
from typing import TYPE_CHECKING, Any

from fenics_contact._base import requirements as _requirements
from fenics_contact.errors import ForkedProcessError

__all__ = ["MPI", "Late", "PETSc", "check_not_forked", "free_communicators", "start"]


class Late(ModuleType):
    """A proxy of a module that is loaded on first access."""

    def __init__(self, name: str, load: Callable[[], ModuleType]) -> None:
        """Store the function that loads the module."""
        super().__init__(name)
        self._load = load
        self._module: ModuleType | None = None

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the module, which is loaded by the first call."""
        check_not_forked()
        if self._module is None:
            self._module = self._load()
        return getattr(self._module, name)


if TYPE_CHECKING:
    from mpi4py import MPI
    from petsc4py import PETSc
else:
    MPI = Late("MPI", _requirements.load_mpi)
    PETSc = Late("PETSc", _requirements.load_petsc)


def start(comm: MPI.Comm) -> None:
    """Start PETSc on the ranks of a communicator unless it runs already. Collective on ``comm``.

    PETSc's world then consists of these ranks. A program that uses ``PETSc.COMM_WORLD`` itself must import
    petsc4py on all ranks before.
    """
    check_not_forked()
    ready = _requirements.petsc_is_started()
    if not comm.allreduce(ready, MPI.LAND):
        world = comm.Split(MPI.UNDEFINED if ready else 0, comm.rank)
        if not ready:
            _requirements.load_petsc(world)  # which holds it: it is never freed


def free_communicators(most: int) -> int:
    """Return how many communicators of this rank MPI can make, ``most`` at the most.

    MPICH has 2048 a process and aborts beyond; other MPIs have no limit.
    """
    if not MPI.Get_library_version().startswith("MPICH"):
        return most
    found: list[MPI.Comm] = []
    with suppress(MPI.Exception):
        while len(found) < most:
            found.append(MPI.COMM_SELF.Dup())
    for one in found:
        one.Free()
    return len(found)


_forked = False


def check_not_forked() -> None:
    """Raise where libraries would wait for threads that exist in another process."""
    if _forked:
        raise ForkedProcessError(
            "computing needs a process that starts its libraries itself, this one was forked after "
            "computing: start it by multiprocessing.get_context('spawn') or mpirun"
        )


def _note_fork() -> None:
    """Record in a child that its parent has computed, so that factorisations may have started threads."""
    global _forked
    _forked = _forked or vars(PETSc)["_module"] is not None


os.register_at_fork(after_in_child=_note_fork)
