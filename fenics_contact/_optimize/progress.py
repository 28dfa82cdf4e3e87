"""Progress of a minimisation: reported, and stored in its checkpoint with the memory of the function."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import fields
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from fenics_contact._base.checkpoint import (
    Checkpoint,
    reporting_what_is_stored,
    safe_point,
    without_checkpoint,
)
from fenics_contact._base.display import counted
from fenics_contact._base.fingerprint import described
from fenics_contact._base.progress import Task
from fenics_contact._optimize.objective import Function
from fenics_contact._optimize.problem import CheckedProblem
from fenics_contact._optimize.result import MethodState, Record
from fenics_contact.errors import collective

if TYPE_CHECKING:
    from mpi4py import MPI


Array = NDArray[np.float64]
#: Called after every evaluation with its record and the best point so far.
Callback = Callable[[Record, Array], None]


KIND = "minimisation by the bundle trust method"
#: Parameters that only decide when to stop: a run may continue with others.
LIMITS = {"tolerance", "max_iterations", "max_evaluations", "feasibility", "raise_on_failure"}
_OF_FUN = "fun."


@runtime_checkable
class Resumable(Function, Protocol):
    """A function whose values depend on earlier ones, for example by a warm start."""

    @property
    def comm(self) -> MPI.Comm:
        """Communicator on which it is evaluated."""

    def fingerprint(self) -> Mapping[str, str]:
        """Identify the function, see `fenics_contact._base.fingerprint.described`."""

    def memory(self) -> Mapping[str, NDArray[Any]]:
        """Return what the next values depend on. Collective."""

    def recall(self, memory: Mapping[str, NDArray[Any]]) -> None:
        """Continue from what `memory` returned, possibly in another process. Collective."""


@runtime_checkable
class Started(Function, Protocol):
    """A constraint's function that starts from what it had before; the states are those of the objective."""

    def starts(self) -> Mapping[str, NDArray[Any]]:
        """Return what its next value starts from. Collective."""

    def start_from(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Start from what `starts` returned, after the objective has recalled its memory. Collective."""


class _Forgetful:
    """The memory of a function whose values depend on no earlier ones."""

    comm = None

    def fingerprint(self) -> Mapping[str, str]:
        return {}

    def memory(self) -> Mapping[str, NDArray[Any]]:
        return {}

    def recall(self, memory: Mapping[str, NDArray[Any]]) -> None:
        pass


class Method(Protocol):
    """Parameters of a method, a dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def max_evaluations(self) -> int:
        """Evaluations after which it stops."""

    @property
    def tolerance(self) -> float:
        """Predicted decrease at which it stops."""

    def size_of(self, first: float) -> float:
        """Return the size below which values count as zero, from the first one."""


class Progress:
    """Reports the progress of a minimisation, of which nothing is stored."""

    def __init__(self, method: Method, problem: CheckedProblem, callback: Callback | None) -> None:
        """Describe the problem."""
        self._method, self._callback, self._evaluations = method, callback, 0
        self._task = Task(
            "optimisation",
            unit="evaluations",
            most=method.max_evaluations,
            target=method.tolerance,
            measured="decrease",
        )
        self._constrained = bool(problem.nonlinear)
        self._fun = problem.fun if isinstance(problem.fun, Resumable) else _Forgetful()
        self.comm: MPI.Comm | None = self._fun.comm

    def recalled(self) -> MethodState | None:
        """Return the stored state, None where the run starts anew. Collective."""
        return None

    @contextmanager
    def reporting(self) -> Iterator[Task]:
        """Report the minimisation as under way, and what it leaves if it is interrupted."""
        with self._task as task, reporting_what_is_stored(self._summary, self.comm):
            yield task

    def evaluated(self, state: MethodState) -> None:
        """Report a state, store it, and stop here if a signal requested it. Collective.

        It is stored after the callback, so that the callback's output exists for every stored evaluation.
        """
        self._tell(state)
        if self._callback is not None:
            # The callback may be collective, as the writing of a state is.
            with nullcontext() if self.comm is None else _asking(self.comm):
                self._callback(state.history[-1], state.centre.x.copy())
        self.keep(state)
        safe_point(self._summary, lambda: self.keep_last(state), self.comm)

    def _tell(self, state: MethodState) -> None:
        self._evaluations, record = state.evaluations, state.history[-1]
        size = self._method.size_of(state.history[0].value) + abs(record.best)
        predicted = record.predicted_decrease / size
        words = f"violation {record.violation:.1e}" if self._constrained else ""
        measure = predicted or None
        self._task.step(record.evaluations, measure=measure, value=record.best, words=words)

    def keep(self, state: MethodState) -> None:
        """Write the state if that is due. Collective."""

    def keep_last(self, state: MethodState) -> None:
        """Write the state of the end if that has not been done. Collective."""

    def _summary(self) -> str:
        """Describe what a run that ends now leaves, and how to continue it."""
        return without_checkpoint(counted(self._evaluations, "evaluation"))


class StoredProgress(Progress):
    """Stores a minimisation in a checkpoint, and reports its progress."""

    def __init__(
        self, checkpoint: Checkpoint, method: Method, problem: CheckedProblem, callback: Callback | None
    ) -> None:
        """Describe the problem; nothing is read or written yet."""
        super().__init__(method, problem, callback)
        self._checkpoint, self._written = checkpoint, -1
        if checkpoint.comm is not None:
            self.comm = checkpoint.comm
        self._fingerprint = {**_fingerprint(method, problem), **self._fun.fingerprint()}
        self._limits: dict[str, Started] = {}
        for number, limit in enumerate(problem.nonlinear):
            if isinstance(limit.fun, Started):
                self._limits[f"limit {number}."] = limit.fun

    def recalled(self) -> MethodState | None:
        """Return the stored state, None where the run starts anew. Collective."""
        stored = self._checkpoint.read(KIND, self._fingerprint, self.comm)
        if stored is None:
            return None
        names = [name for name in stored if name.startswith(_OF_FUN)]
        self._fun.recall({name.removeprefix(_OF_FUN): stored.pop(name) for name in names})
        for head, fun in self._limits.items():
            names = [name for name in stored if name.startswith(head)]
            fun.start_from({name.removeprefix(head): stored.pop(name) for name in names})
        state = MethodState.from_arrays(stored)
        self._written = state.evaluations
        self._tell(state)
        return state

    def keep(self, state: MethodState) -> None:
        """Write the state if that is due. Collective."""
        self._keep_after(state, self._checkpoint.every)

    def keep_last(self, state: MethodState) -> None:
        """Write the state of the end if that has not been done. Collective."""
        self._keep_after(state, 1)

    def _keep_after(self, state: MethodState, evaluations: int) -> None:
        if 0 <= self._written and state.evaluations < self._written + evaluations:
            return
        arrays, memory = state.arrays(), self._fun.memory()
        arrays.update({f"{_OF_FUN}{name}": value for name, value in memory.items()})
        for head, fun in self._limits.items():
            arrays.update({f"{head}{name}": value for name, value in fun.starts().items()})
        self._checkpoint.write(KIND, self._fingerprint, arrays, self.comm)
        self._written = state.evaluations

    def _summary(self) -> str:
        written = max(self._written, 0)
        return self._checkpoint.resume_hint(written, counted(written, "evaluation"))


def _asking(comm: MPI.Comm) -> AbstractContextManager[None]:
    return collective(comm, "the callback of a minimisation", closed=True, users=True)


def _fingerprint(method: Method, problem: CheckedProblem) -> dict[str, str]:
    options = {
        field.name: getattr(method, field.name) for field in fields(method) if field.name not in LIMITS
    }
    descriptions = {"variables": str(problem.start.size)}
    descriptions.update(described(options, "method"))
    for field in fields(problem.allowed):
        values = np.asarray(getattr(problem.allowed, field.name))
        descriptions.update(described(values, f"constraints.{field.name}"))
    limits = [
        f"{one.name} in [{one.lower!r}, {one.upper!r}], scale {one.size!r}" for one in problem.nonlinear
    ]
    descriptions["nonlinear constraints"] = "; ".join(limits) or "none"
    for one in problem.nonlinear:
        descriptions.update(getattr(one.fun, "fingerprint", dict)())
    descriptions.update(described(problem.scale, "scale"))
    descriptions.update(described(problem.start, "x0"))
    return descriptions
