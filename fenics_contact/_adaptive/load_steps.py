"""Load steps to an accuracy: each on meshes of its own, to which the history of the one before is carried."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeAlias

from fenics_contact._adaptive.equilibrium import AdaptiveLoop
from fenics_contact._adaptive.levels import AccurateResult, Level, Limits, require_share
from fenics_contact._adaptive.quantities import quantity as named
from fenics_contact._base.libraries import MPI
from fenics_contact._equilibrium.carried import TransferredState
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import require_steps, timed
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.design.objective import Objective
from fenics_contact.errors import collectively, together
from fenics_contact.mesh.refinement import Refinement
from fenics_contact.mesh.transfer import MeshTransfer
from fenics_contact.qp.solve import DualSolver
from fenics_contact.results.state import State


@collectively("solve_steps_to", lambda scene, steps, quantity, relative_error, comm, **_: comm)
def solve_steps_to(
    scene: Scene,
    steps: Sequence[LoadStep],
    quantity: Objective | str,
    relative_error: float,
    comm: MPI.Comm,
    *,
    limits: Limits | None = None,
    solver: DualSolver | None = None,
    tolerance: float = 1e-6,
    callback: Callable[[LoadStep, Level], None] | None = None,
) -> tuple[AccurateResult[State], ...]:
    """Compute a quantity at the end of every load step to an accuracy, each on meshes of its own.

    Every step begins on the meshes of the scene and refines them where its quantity needs that, as `solve_to`
    does: small cells follow a spot that moves on, and are not kept behind it. Slip is measured from the state
    before, and histories of materials go on from it, carried from its last meshes to each of the step's, see
    `fenics_contact.TransferredState`. Errors are those of a step alone: what the state before was wrong by,
    and what its histories lose on larger cells, is not part of them.

    Args:
        scene: Bodies, contact pairs, and the supports and loads that the steps do not give, on coarse meshes.
        steps: The steps in their order; what one does not give stays as it was.
        quantity: As for `solve_to`, of every step.
        relative_error: Largest error of the quantity relative to it, in every step, between 0 and 1.
        comm: Communicator over which the subdomains are spread.
        limits: What may be spent on each step.
        solver: As for `fenics_contact.solve_scene`.
        tolerance: Largest relative residual of each state.
        callback: Called on all ranks with the step and every level of it once it is done.

    Returns:
        The results of the steps; one whose accuracy was not reached says so, and a warning.

    Raises:
        InvalidInputError: As `solve_to`, or if a history cannot be carried to other meshes: of friction by
            slip, of fluid that enters contacts, of preloads in scenes with nonlinear materials.
        InfeasibleError: If nothing holds some body against its load.
        ConvergenceError: If the solver does not reach its tolerance on some mesh.

    Example:
        >>> push = [LoadStep("pressed"), LoadStep("pulled", loads=[pull])]  # doctest: +SKIP
        >>> results = solve_steps_to(scene, push, "peak_pressure", 0.02, MPI.COMM_WORLD)  # doctest: +SKIP
    """
    with together(comm):
        require_steps(steps)
        require_share(relative_error)
        objective = named(quantity, scene) if isinstance(quantity, str) else quantity
    results: list[AccurateResult[State]] = []
    carried: Carried = _nothing
    for number, step in enumerate(steps, start=1):
        with together(comm):
            scene = step.applied_to(scene)
        last = _StepLoop(timed(step, number), carried, objective, relative_error, limits or Limits(), comm)
        carried = last.to_next
        show = None if callback is None else partial(callback, step)
        problem = ContactProblem(scene, comm, solver=solver, tolerance=tolerance)
        results.append(last.follow(problem, show))
    return tuple(results)


#: Body name -> the refinements that led to its mesh.
Chains: TypeAlias = "dict[str, tuple[Refinement, ...]]"
#: Returns the state of the step before on the meshes of a scene.
Carried: TypeAlias = "Callable[[Scene, Chains], TransferredState | None]"


def _nothing(scene: Scene, new: Chains) -> None:
    """Return that no step comes before the first."""


class _StepLoop(AdaptiveLoop):
    """The levels of a load step after another one."""

    def __init__(
        self,
        step: LoadStep,
        carried: Carried,
        quantity: Objective,
        wanted: float,
        limits: Limits,
        comm: MPI.Comm,
    ) -> None:
        super().__init__(quantity, wanted, limits, comm)
        self.where, self._step = f" in load step {step.name!r}", step
        self._carried = carried
        # The refinements of each body that led to the last meshes.
        self._chains: Chains = {}

    def _solved(self, problem: ContactProblem) -> State:
        """Return the state on the next mesh. Collective."""
        for name, refinement in self._refinements.items():
            self._chains[name] = (*self._chains.get(name, ()), refinement)
        start, refinements = (self._state, self._refinements) if self.levels else (None, None)
        return problem.solve(
            start=start,
            refinements=refinements,
            before=self._carried(problem.scene, self._chains),
            step=self._step,
            adjoint=True,
        )

    def to_next(self, scene: Scene, new: Chains) -> TransferredState:
        """Return the last state on the meshes of the next step."""
        state, old = self._state, self._chains
        names = (name for name in scene.bodies if name in old or name in new)
        return TransferredState(
            state, {name: MeshTransfer(old.get(name, ()), new.get(name, ())) for name in names}
        )
