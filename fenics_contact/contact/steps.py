"""Load steps: equilibrium after equilibrium, friction remembering where the surfaces were."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.checkpoint import Checkpoint, safe_point, telling_what_is_kept
from fenics_contact.contact.equilibrium import decomposed, find_state
from fenics_contact.contact.state import State
from fenics_contact.contact.steps_done import StepsDone
from fenics_contact.contact.tolerance import Tolerance
from fenics_contact.errors import collectively, together
from fenics_contact.feti import Decomposition
from fenics_contact.fingerprint import described, require_alike
from fenics_contact.progress import Task
from fenics_contact.qp import DualSolver
from fenics_contact.scene import LoadStep, Scene
from fenics_contact.timing import PhaseTimer


class LoadSequence:
    """The quasi-static history of a scene, one step at a time.

    Slip is measured from the last step: u_T(t) − u_T(t − 1) is what friction opposes. So a block that was
    pushed and let go keeps the shear that its floor holds, and reversed sliding dissipates again.

    With a checkpoint, steps that a run before this one has done are read instead of solved: one product each.

    Attributes:
        scene: The scene with the loads of the last step.
        state: State after the last step, None before the first.

    Example:
        >>> steps = LoadSequence(scene, None, comm)  # doctest: +SKIP
        >>> for push in (0.0, 0.1, 0.2, 0.0):  # doctest: +SKIP
        ...     supports = [Support("block", "z1", (push, 0.0, -0.01))]
        ...     state = steps.advance(LoadStep(f"pushed by {push} mm", supports=supports))

    References:
        P. Wriggers, Computational Contact Mechanics, 2nd ed., Springer 2006, section 5.2.
    """

    def __init__(
        self,
        scene: Scene,
        partitions: Mapping[str, np.ndarray] | None,
        comm: MPI.Comm,
        *,
        solver: DualSolver | None = None,
        tolerance: Tolerance = None,
        checkpoint: Checkpoint | None = None,
        count: int | None = None,
    ) -> None:
        """Start unloaded; arguments as for `solve_scene`. Collective on ``comm``.

        Args:
            scene: Bodies, contact pairs, and the supports and loads that the steps do not give.
            partitions: As for `solve_scene`; give them if a run may go on with another number of ranks.
            comm: Communicator over which the subdomains are spread.
            solver: As for `solve_scene`.
            tolerance: As for `solve_scene`, for every step.
            checkpoint: File that is written after the steps and that an interrupted history goes on from.
            count: How many steps there will be, which progress tells; not needed.

        Raises:
            InvalidInputError: If the checkpoint cannot be read or is one of another scene, or if some ranks
                have one and others none.
        """
        self.scene, self.state = scene, None
        kept = None if checkpoint is None else (checkpoint.every, checkpoint.resume)
        require_alike(comm, described({"count": count, "checkpoint (every, resume)": kept}, "steps"))
        if checkpoint is not None and partitions is None:
            with together(comm):
                partitions = scene.partition(comm.size)
        problem = {"scene": scene, "partitions": partitions, "solver": solver, "tolerance": tolerance}
        self._done = StepsDone(checkpoint, problem, comm)
        self._partitions, self._comm = partitions, comm
        self._solver, self._tolerance = solver, tolerance
        self._decomposition: Decomposition | None = None
        self._timer = PhaseTimer()
        self._task, self._count, self._number = Task("load steps", unit="done", total=count), count, 0

    state: State | None

    @collectively("LoadSequence.advance", lambda self, *_, **__: self._comm)
    def advance(self, step: LoadStep) -> State:
        """Find the state at the end of the next step. Collective.

        Raises:
            InvalidInputError: If the step's supports hold other components than before.
            InfeasibleError: If nothing holds some body against the new load.
            ConvergenceError: If the solver does not reach its tolerance.
            CheckpointError: If the checkpoint cannot be written.
        """
        if self._number == 0 or self._count is None:
            self._task.begin(self._number)
        self._task.step(self._number, words=step.name)
        try:
            self._may_stop()
            with telling_what_is_kept(self._left, self._comm):
                state = self._advanced(step)
            self._number += 1
            self._may_stop()
        except BaseException as error:
            self._task.end(error)
            raise
        self._task.step(self._number, timed=not self._done.recalling)
        if self._count in (None, self._number):
            self._task.end()
        return state

    def _may_stop(self) -> None:
        """Stop between two steps if a signal asks for it. Collective."""
        safe_point(lambda: self._done.kept(self._number, self._count), self._done.write, self._comm)

    def _left(self) -> str:
        """Write what can be written in the middle of a step, and say what is kept."""
        self._done.write_rest()
        return self._done.kept(self._number, self._count)

    def _advanced(self, step: LoadStep) -> State:
        with together(self._comm):
            scene = step.applied_to(self.scene)
        if self._decomposition is None:
            self._decomposition, self._timer = decomposed(scene, self._partitions, self._comm)
        state = self._done.recalled(step, scene, self._decomposition, self.state, self._timer)
        if state is None:
            state = find_state(
                scene, self._decomposition, solver=self._solver, tolerance=self._tolerance,
                previous=self.state, slip_from=self.state, timer=self._timer,
            )  # fmt: skip
            self._done.keep(step, state)
        self.scene, self.state = scene, state
        return state

    @collectively("LoadSequence.finish", lambda self: self._comm)
    def finish(self) -> None:
        """Write the steps that the checkpoint does not hold yet, if it is written less often. Collective."""
        self._done.write()
        if self._count not in (None, self._number):
            self._task.end()


def solve_steps(
    scene: Scene,
    steps: Sequence[LoadStep],
    partitions: Mapping[str, np.ndarray] | None,
    comm: MPI.Comm,
    *,
    solver: DualSolver | None = None,
    tolerance: Tolerance = None,
    checkpoint: Checkpoint | None = None,
) -> tuple[State, ...]:
    """Find the states at the end of every load step, see `LoadSequence`. Collective on ``comm``.

    Args:
        scene: Bodies, contact pairs, and the supports and loads that the steps do not give.
        steps: The steps in their order.
        partitions: As for `solve_scene`.
        comm: Communicator over which the subdomains are spread.
        solver: As for `solve_scene`.
        tolerance: As for `solve_scene`, for every step.
        checkpoint: As for `LoadSequence`.

    Example:
        >>> push = [LoadStep(f"push {s}", loads=[weight, pull(s)]) for s in (0.5, 1.0, 0.0)]  # doctest: +SKIP
        >>> states = solve_steps(scene, push, partitions, comm)  # doctest: +SKIP
    """
    sequence = LoadSequence(
        scene, partitions, comm, solver=solver, tolerance=tolerance, checkpoint=checkpoint, count=len(steps)
    )
    states = tuple(sequence.advance(step) for step in steps)
    sequence.finish()
    return states
