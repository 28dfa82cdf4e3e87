"""Load steps: equilibria with slip measured from step to step, and the checkpoint of such a history."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from fenics_contact._base.checkpoint import (
    Checkpoint,
    reporting_what_is_stored,
    safe_point,
    without_checkpoint,
)
from fenics_contact._base.checks import brief, kind_in_words, naming_arguments
from fenics_contact._base.display import counted, displayed
from fenics_contact._base.files import CheckpointError
from fenics_contact._base.fingerprint import described, differences, require_alike
from fenics_contact._base.progress import Task
from fenics_contact._equilibrium.other_rows import require_values_to_keep, with_kept
from fenics_contact._equilibrium.outer_loops import outer_loops
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._pairing.inside import InFacets
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.feti.direct import DirectSolution
from fenics_contact.feti.joints import JOINTS
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact.results.deformed_state import AnyState, DeformedState

KIND = "load history"


def stored_state(state: State) -> dict[str, np.ndarray]:
    """Return the arrays from which a state can be rebuilt, on any number of ranks. Collective.

    Returns ``multiplier`` λ and ``origin``, from which slip is measured, of all rows in their order, shape
    (n_rows,), ``slid``, the same for points without friction, and ``motion``, the coefficients α of the rigid
    motions; all replicated. Empty for a state that was computed without multipliers. Of bodies with nonlinear
    materials what `stored_deformed` returns. Of points inside facets what `InFacets.stored` returns.
    """
    if isinstance(state.solution, DirectSolution):
        return {}
    if not isinstance(state, LinearState):
        from fenics_contact._equilibrium.deformed import stored_deformed

        return stored_deformed(cast("DeformedState", state)) | stored_by_joints(state.scene)
    torn, solution = state.torn, state.dual_solution
    rows = np.arange(torn.numbering.total)
    return {
        "multiplier": torn.numbering.gather(solution.multiplier, rows),
        "origin": torn.numbering.gather(torn.right + torn.supported, rows),
        "slid": torn.slid,
        "motion": np.asarray(solution.alpha),
        **stored_by_joints(state.scene),
        **InFacets.of(torn.points).stored(),
        **{name: array for loop in outer_loops(state.scene) for name, array in loop.stored(torn).items()},
    }


def stored_by_joints(scene: Scene) -> dict[str, np.ndarray]:
    """Return what of the scene of a state joints begin the next load step with."""
    return {name: values for kind in JOINTS for name, values in kind.stored(scene).items()}


def timed(step: LoadStep, number: int) -> LoadStep:
    """Return a load step with its time, by default its number, from 1."""
    return step if step.time is not None else replace(step, time=float(number))


class StepCheckpoint:
    """No checkpoint: every step is solved, and none is kept."""

    @classmethod
    def of(cls, checkpoint: Checkpoint | None, problem: ContactProblem) -> StepCheckpoint:
        """Return what keeps the states of steps; a file is read if it exists. Collective."""
        return cls() if checkpoint is None else StepsInFile(checkpoint, problem)

    def recalled(self, step: LoadStep, scene: Scene, problem: ContactProblem) -> AnyState | None:
        """Return the state after the next step if it is stored, else None. Collective."""
        return None

    def keep(self, step: LoadStep, state: AnyState) -> None:
        """Add the state after a step and write it if that is due. Collective."""

    def write(self) -> None:
        """Write all steps unless the file holds them. Collective."""

    def write_rest(self) -> None:
        """Write the completed steps in the middle of a step, if that needs no other rank."""

    def summary(self, done: int, count: int | None) -> str:
        """Describe what a run that ends now leaves, and how to continue it."""
        return without_checkpoint(counted(done, "load step"))


class StepsInFile(StepCheckpoint):
    """Reads the states of completed steps and writes new ones."""

    def __init__(self, checkpoint: Checkpoint, problem: ContactProblem) -> None:
        """Read the file if it exists. Collective."""
        self._checkpoint, self._comm = checkpoint, problem.comm
        self._fingerprint: dict[str, str] = {}
        names = ("scene", "partitions", "solver", "tolerance")
        for name in (*names, *(("steps",) if problem.scene.is_nonlinear else ())):
            self._fingerprint.update(described(getattr(problem, name), name))
        self._arrays = checkpoint.read(KIND, self._fingerprint, problem.comm) or {"steps": np.array(0)}
        self._here, self._stored = 0, int(self._arrays.pop("steps"))
        self._written = self._stored

    def recalled(self, step: LoadStep, scene: Scene, problem: ContactProblem) -> AnyState | None:
        if self._here >= self._stored:
            return None
        names = [name for name in self._arrays if name.startswith(self._prefix)]
        stored = {name.removeprefix(self._prefix): self._arrays[name] for name in names}
        with together(self._comm):
            unlike = differences(json.loads(str(stored.pop("step"))), described(step, "step"))
            if unlike:
                raise InvalidInputError(
                    f"step {self._here} of the checkpoint is a different one; there and here differ "
                    f"{'; '.join(unlike)}: give the same steps to continue, or a new name to start anew"
                )
        self._here += 1
        problem.state = problem.restore(stored, scene)
        return problem.state

    def keep(self, step: LoadStep, state: AnyState) -> None:
        self._arrays[f"{self._prefix}step"] = np.array(json.dumps(described(step, "step")))
        for name, values in stored_state(state).items():
            self._arrays[f"{self._prefix}{name}"] = values
        self._here += 1
        if self._here >= self._written + self._checkpoint.every:
            self.write()

    def write(self) -> None:
        if self._here > self._written:
            arrays = {"steps": np.array(self._here), **self._arrays}
            self._checkpoint.write(KIND, self._fingerprint, arrays, self._comm)
            self._written = self._here

    def write_rest(self) -> None:
        if self._comm.size == 1:
            with suppress(CheckpointError):
                self.write()

    def summary(self, done: int, count: int | None) -> str:
        number = self._written
        words = f"{number} of {count}" if count is not None else f"{number}"
        steps = "load step" if (count or number) == 1 else "load steps"
        return self._checkpoint.resume_hint(number, f"{words} {steps}")

    @property
    def _prefix(self) -> str:
        return f"{self._here:06d}."


@displayed
class LoadSequence:
    """The quasi-static history of a scene, one step at a time.

    Slip is measured from the last step: friction opposes u_T(t) − u_T(t − 1). So a block that was pushed and
    released keeps the shear that its floor sustains, and reversed sliding dissipates again.

    With a checkpoint, steps completed by an earlier run are read instead of solved: one product each.

    Attributes:
        scene: The scene with the loads of the last step.
        problem: The problem that computes its equilibria.

    Example:
        >>> steps = LoadSequence(ContactProblem(scene, comm))  # doctest: +SKIP
        >>> for push in (0.0, 0.1, 0.2, 0.0):  # doctest: +SKIP
        ...     supports = [Support("block", "z1", (push, 0.0, -0.01))]
        ...     state = steps.advance(LoadStep(f"pushed by {push} mm", supports=supports))

    References:
        P. Wriggers, Computational Contact Mechanics, 2nd ed., Springer 2006, section 5.2.
    """

    def __init__(
        self,
        problem: ContactProblem,
        *,
        checkpoint: Checkpoint | None = None,
        count: int | None = None,
    ) -> None:
        """Start unloaded. Collective on the problem's communicator.

        Args:
            problem: Bodies, contact pairs, and the supports and loads that the steps do not give. Give it
                partitions if a run may continue with another number of ranks.
            checkpoint: File that is written after the steps and from which an interrupted history continues.
            count: Number of steps, for progress reports; optional.

        Raises:
            InvalidInputError: If the checkpoint cannot be read or belongs to another scene, or if only some
                ranks have one.
        """
        self.problem, self.scene, self._comm = problem, problem.scene, problem.comm
        settings = None if checkpoint is None else (checkpoint.every, checkpoint.resume)
        require_alike(
            self._comm, described({"count": count, "checkpoint (every, resume)": settings}, "steps")
        )
        self._done = StepCheckpoint.of(checkpoint, problem)
        self._task, self._count, self._number = Task("load steps", unit="done", total=count), count, 0

    def _facts(self) -> dict[str, Any]:
        total = "" if self._count is None else f" of {self._count}"
        return {"steps": f"{self._number}{total} done", "problem": self.problem}

    @property
    def state(self) -> AnyState | None:
        """State after the last step, None before the first."""
        return self.problem.state if self._number else None

    @collectively("LoadSequence.advance", lambda self, *_, **__: self._comm)
    def advance(self, step: LoadStep) -> AnyState:
        """Compute the state at the end of the next step. Collective.

        Raises:
            InvalidInputError: If it is no `LoadStep`, or a `RigidSurface` is new where materials are
                nonlinear.
            InfeasibleError: If nothing holds some body against the new load.
            ConvergenceError: If the solver does not reach its tolerance.
            CheckpointError: If the checkpoint cannot be written.
        """
        with together(self._comm):
            _require_step(step)
        if self._number == 0 or self._count is None:
            self._task.begin(self._number)
        self._task.step(self._number, words=step.name)
        try:
            self._may_stop()
            with reporting_what_is_stored(self._left, self._comm):
                state = self._advanced(step)
            self._number += 1
            self._may_stop()
        except BaseException as error:
            self._task.end(error)
            raise
        self._task.step(self._number)
        if self._count in (None, self._number):
            self._task.end()
        return state

    def _may_stop(self) -> None:
        """Stop between two steps if a signal requested it. Collective."""
        safe_point(lambda: self._done.summary(self._number, self._count), self._done.write, self._comm)

    def _left(self) -> str:
        """Write what can be written in the middle of a step, and describe what is stored."""
        self._done.write_rest()
        return self._done.summary(self._number, self._count)

    def _advanced(self, step: LoadStep) -> AnyState:
        with together(self._comm):
            scene = step.applied_to(self.scene)
            require_values_to_keep(step, scene)
        scene = with_kept(scene, self.state)
        state = self._done.recalled(step, scene, self.problem)
        if state is None:
            state = self.problem.solve(scene, before=self.state, step=timed(step, self._number + 1))
            self._done.keep(step, state)
        self.scene = scene
        return state

    @collectively("LoadSequence.finish", lambda self: self._comm)
    def finish(self) -> None:
        """Write the steps that the checkpoint does not hold yet, if it is written less often. Collective."""
        self._done.write()
        if self._count not in (None, self._number):
            self._task.end()


@naming_arguments
def solve_steps(
    problem: ContactProblem | Scene,
    steps: Sequence[LoadStep],
    comm: MPI.Comm | None = None,
    *,
    checkpoint: Checkpoint | None = None,
) -> tuple[AnyState, ...]:
    """Compute the states at the end of every load step, see `LoadSequence`. Collective.

    Args:
        problem: Bodies, contact pairs, and the supports and loads that the steps do not give, as a scene; or
            as a `ContactProblem`, which has further options.
        steps: The steps in their order.
        comm: Communicator over which the subdomains of a scene are spread; a problem has its own.
        checkpoint: As for `LoadSequence`.

    Example:
        >>> push = [LoadStep(f"push {s}", loads=[weight, pull(s)]) for s in (0.5, 1.0, 0.0)]  # doctest: +SKIP
        >>> states = solve_steps(scene, push, comm)  # doctest: +SKIP
        >>> states = solve_steps(ContactProblem(scene, comm, tolerance=1e-8), push)  # doctest: +SKIP
    """
    problem = problem_of(problem, comm, "solve_steps")
    with together(problem.comm):
        require_steps(steps)
    sequence = LoadSequence(problem, checkpoint=checkpoint, count=len(steps))
    states = tuple(sequence.advance(step) for step in steps)
    sequence.finish()
    return states


def problem_of(given: ContactProblem | Scene, comm: MPI.Comm | None, caller: str) -> ContactProblem:
    """Return the problem of load steps, of a scene on a communicator."""
    if not isinstance(given, Scene):
        if comm not in (None, given.comm):
            raise InvalidInputError(
                f"{caller} of a ContactProblem is on its own communicator, got another: leave it out"
            )
        return given
    if comm is None or not hasattr(comm, "allreduce"):
        raise InvalidInputError(
            f"{caller} of a scene needs a communicator, got {kind_in_words(type(comm))}: MPI.COMM_WORLD"
        )
    return ContactProblem(given, comm)


def require_steps(steps: object) -> None:
    """Reject what is no sequence of load steps."""
    if not isinstance(steps, Sequence):
        raise InvalidInputError(f"steps must be a sequence, got {type(steps).__name__}: write [step] for one")
    for step in steps:
        _require_step(step)


def _require_step(step: object) -> None:
    if not isinstance(step, LoadStep):
        raise InvalidInputError(
            f"each load step must be a LoadStep, got {brief(step)}: write LoadStep(name, loads=...)"
        )
