"""The checkpoint of a minimisation: the method's state and what the function itself remembers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenics_contact.checkpoint import Checkpoint, described
from fenics_contact.optimize.problem import Problem
from fenics_contact.optimize.state import MethodState

Array = NDArray[np.float64]

if TYPE_CHECKING:
    from mpi4py import MPI

KIND = "minimisation by the bundle trust method"
#: Parameters that only say when to stop: a run may go on with others.
LIMITS = {"tolerance", "max_iterations", "max_evaluations", "raise_on_failure"}
_OF_FUN = "fun."


@runtime_checkable
class Resumable(Protocol):
    """A function whose values depend on those before, by a warm start for example."""

    def __call__(self, x: Array) -> tuple[float, ArrayLike]:
        """Return value and subgradient."""

    @property
    def comm(self) -> MPI.Comm:
        """Communicator on which it is evaluated."""

    def fingerprint(self) -> Mapping[str, str]:
        """Say which function it is, see `fenics_contact.checkpoint.described`."""

    def memory(self) -> Mapping[str, NDArray[Any]]:
        """Return what the next values depend on. Collective."""

    def recall(self, memory: Mapping[str, NDArray[Any]]) -> None:
        """Go on from what `memory` returned, in another process maybe. Collective."""


class Progress:
    """Writes a minimisation to its checkpoint and reads it; does nothing where there is none."""

    def __init__(self, checkpoint: Checkpoint | None, method: Any, problem: Problem) -> None:
        """Describe the problem; nothing is read or written yet.

        Args:
            checkpoint: The file, or None.
            method: Parameters of the method, a dataclass.
            problem: The checked problem.
        """
        self._checkpoint, self._written = checkpoint, -1
        self._fun = problem.fun if isinstance(problem.fun, Resumable) else None
        if checkpoint is None:
            return
        self._comm = checkpoint.comm
        if self._comm is None and self._fun is not None:
            self._comm = self._fun.comm
        self._fingerprint = _fingerprint(method, problem)
        if self._fun is not None:
            self._fingerprint.update(self._fun.fingerprint())

    def recalled(self) -> MethodState | None:
        """Return the state that was stored, None where the run starts anew. Collective.

        Raises:
            InvalidInputError: If the file is no checkpoint of this problem; says what to do.
        """
        if self._checkpoint is None:
            return None
        stored = self._checkpoint.read(KIND, self._fingerprint, self._comm)
        if stored is None:
            return None
        if self._fun is not None:
            names = [name for name in stored if name.startswith(_OF_FUN)]
            self._fun.recall({name.removeprefix(_OF_FUN): stored.pop(name) for name in names})
        state = MethodState.from_arrays(stored)
        self._written = state.evaluations
        return state

    def keep(self, state: MethodState, *, last: bool = False) -> None:
        """Write the state where it is due. Collective.

        Args:
            state: Where the method stands.
            last: Write it unless the file holds it already.

        Raises:
            CheckpointError: If it cannot be written; the file is then what it was.
        """
        if self._checkpoint is None:
            return
        due = 0 if last else self._checkpoint.every - 1
        if 0 <= self._written and state.evaluations <= self._written + due:
            return
        arrays = state.arrays()
        if self._fun is not None:
            memory = self._fun.memory()
            arrays.update({f"{_OF_FUN}{name}": value for name, value in memory.items()})
        self._checkpoint.write(KIND, self._fingerprint, arrays, self._comm)
        self._written = state.evaluations


def _fingerprint(method: Any, problem: Problem) -> dict[str, str]:
    options = {
        field.name: getattr(method, field.name) for field in fields(method) if field.name not in LIMITS
    }
    found = {"variables": str(problem.start.size)}
    found.update(described(options, "method"))
    for field in fields(problem.allowed):
        values = np.asarray(getattr(problem.allowed, field.name))
        found.update(described(values, f"constraints.{field.name}"))
    found.update(described(problem.scale, "scale"))
    found.update(described(problem.start, "x0"))
    return found
