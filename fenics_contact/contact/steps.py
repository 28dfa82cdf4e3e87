"""Load steps: a sequence of equilibria with frictional slip measured from step to step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fenics_contact.checkpoint import Checkpoint, reporting_what_is_stored, safe_point
from fenics_contact.checks import brief
from fenics_contact.contact.deformed_state import AnyState
from fenics_contact.contact.problem import ContactProblem
from fenics_contact.contact.step_checkpoint import StepCheckpoint
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.fingerprint import described, require_alike
from fenics_contact.progress import Task
from fenics_contact.scene import LoadStep


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
        self._done = StepCheckpoint(checkpoint, problem)
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
            InvalidInputError: If it is no `LoadStep`, or its supports hold other components than before.
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
        state = self._done.recalled(step, scene, self.problem)
        if state is None:
            time = self._number + 1.0 if step.time is None else step.time
            state = self.problem.solve(scene, slip_from=self.state, time=time, step=step)
            self._done.keep(step, state)
        self.scene = scene
        return state

    @collectively("LoadSequence.finish", lambda self: self._comm)
    def finish(self) -> None:
        """Write the steps that the checkpoint does not hold yet, if it is written less often. Collective."""
        self._done.write()
        if self._count not in (None, self._number):
            self._task.end()


def solve_steps(
    problem: ContactProblem, steps: Sequence[LoadStep], *, checkpoint: Checkpoint | None = None
) -> tuple[AnyState, ...]:
    """Compute the states at the end of every load step, see `LoadSequence`. Collective.

    Args:
        problem: Bodies, contact pairs, and the supports and loads that the steps do not give.
        steps: The steps in their order.
        checkpoint: As for `LoadSequence`.

    Example:
        >>> push = [LoadStep(f"push {s}", loads=[weight, pull(s)]) for s in (0.5, 1.0, 0.0)]  # doctest: +SKIP
        >>> states = solve_steps(ContactProblem(scene, comm), push)  # doctest: +SKIP
    """
    with together(problem.comm):
        if not isinstance(steps, Sequence):
            raise InvalidInputError(
                f"steps must be a sequence, got {type(steps).__name__}: write [step] for one"
            )
        for step in steps:
            _require_step(step)
    sequence = LoadSequence(problem, checkpoint=checkpoint, count=len(steps))
    states = tuple(sequence.advance(step) for step in steps)
    sequence.finish()
    return states


def _require_step(step: object) -> None:
    if not isinstance(step, LoadStep):
        raise InvalidInputError(
            f"each load step must be a LoadStep, got {brief(step)}: write LoadStep(name, loads=...)"
        )
