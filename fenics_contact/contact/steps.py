"""Load steps: equilibrium after equilibrium, friction remembering where the surfaces were."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from mpi4py import MPI

from fenics_contact.contact.equilibrium import decomposed, find_state
from fenics_contact.contact.state import State
from fenics_contact.contact.tolerance import Tolerance
from fenics_contact.feti import Decomposition
from fenics_contact.qp import DualSolver
from fenics_contact.scene import LoadStep, Scene
from fenics_contact.timing import PhaseTimer


class LoadSequence:
    """The quasi-static history of a scene, one step at a time.

    Slip is measured from the last step: u_T(t) − u_T(t − 1) is what friction opposes. So a block that was
    pushed and let go keeps the shear that its floor holds, and reversed sliding dissipates again.

    Attributes:
        scene: The scene with the loads of the last step.
        state: State after the last step, None before the first.

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
    ) -> None:
        """Start unloaded; arguments as for `solve_scene`."""
        self.scene, self.state = scene, None
        self._partitions, self._comm = partitions, comm
        self._solver, self._tolerance = solver, tolerance
        self._decomposition: Decomposition | None = None
        self._timer = PhaseTimer()

    state: State | None

    def advance(self, step: LoadStep) -> State:
        """Find the state at the end of the next step. Collective.

        Raises:
            InvalidInputError: If the step's supports hold other components than before.
            InfeasibleError: If nothing holds some body against the new load.
            ConvergenceError: If the solver does not reach its tolerance.
        """
        scene = step.applied_to(self.scene)
        if self._decomposition is None:
            self._decomposition, self._timer = decomposed(scene, self._partitions, self._comm)
        state = find_state(
            scene, self._decomposition, solver=self._solver, tolerance=self._tolerance, previous=self.state,
            slip_from=self.state, timer=self._timer,
        )  # fmt: skip
        self.scene, self.state = scene, state
        return state


def solve_steps(
    scene: Scene,
    steps: Sequence[LoadStep],
    partitions: Mapping[str, np.ndarray] | None,
    comm: MPI.Comm,
    *,
    solver: DualSolver | None = None,
    tolerance: Tolerance = None,
) -> tuple[State, ...]:
    """Find the states at the end of every load step, see `LoadSequence`. Collective on ``comm``.

    Args:
        scene: Bodies, contact pairs, and the supports and loads that the steps do not give.
        steps: The steps in their order.
        partitions: As for `solve_scene`.
        comm: Communicator over which the subdomains are spread.
        solver: As for `solve_scene`.
        tolerance: As for `solve_scene`, for every step.

    Example:
        >>> push = [LoadStep(f"push {s}", loads=[weight, pull(s)]) for s in (0.5, 1.0, 0.0)]  # doctest: +SKIP
        >>> states = solve_steps(scene, push, partitions, comm)  # doctest: +SKIP
    """
    sequence = LoadSequence(scene, partitions, comm, solver=solver, tolerance=tolerance)
    return tuple(sequence.advance(step) for step in steps)
