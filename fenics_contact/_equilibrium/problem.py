"""The entry point: from a scene to its equilibrium, and on to the next load, geometry or slip."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._base.checks import kind_in_words
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI, check_not_forked
from fenics_contact._base.progress import PhaseTimer
from fenics_contact._base.shared import once_a_machine
from fenics_contact._base.threads import one_thread
from fenics_contact._equilibrium.carried import TransferredState
from fenics_contact._equilibrium.linear import DirectEquilibria, LinearEquilibria, default_solver
from fenics_contact._equilibrium.other_rows import continued
from fenics_contact._equilibrium.previous import ONLY_STEP, Equilibria, Previous, Wanted, after
from fenics_contact._equilibrium.stored import Stored
from fenics_contact._equilibrium.warnings import ContactWarnings, DeferredWarnings
from fenics_contact._scene.memory import Fit, Subdomains
from fenics_contact._scene.plan import SolverKind, choose_solver
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.feti.decomposition import Decomposition, decompose
from fenics_contact.feti.same_input import check_same_input
from fenics_contact.feti.torn import check_apart
from fenics_contact.qp.solve import DualSolver
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State, Tolerance, checked_tolerance

if TYPE_CHECKING:
    from fenics_contact._equilibrium.deformed import DeformedEquilibria
    from fenics_contact._large_deformations.load_steps import AutomaticSteps
    from fenics_contact.mesh.refinement import Refinement
    from fenics_contact.results.deformed_state import AnyState


@displayed
class ContactProblem:
    """Successive equilibria of a scene; each starts from the one before.

    What a change does not affect (topology, numbering, matrices, factors, contact points) is not recomputed,
    and the solver starts from the last contact forces. `LoadSequence` and `ShapeProblem` are built on it.

    Attributes:
        scene: The scene as it was given.
        comm: Communicator over which the subdomains are spread.
        solver: Dual solver with its tolerance; None: the one that `Scene.plan` names.
        tolerance: Largest relative residual of the solutions, see `solve_scene`.
        steps: How loads on nonlinear materials are followed; None: the default
            `fenics_contact.AutomaticSteps`.
        timer: Wall time of this rank by phase, over all solutions.
        state: The last solution, None before the first.

    Example:
        >>> equilibria = ContactProblem(scene, comm, tolerance=1e-6)  # doctest: +SKIP
        >>> first, again = equilibria.solve(), equilibria.solve(scene)  # doctest: +SKIP
    """

    def __init__(
        self,
        scene: Scene,
        comm: MPI.Comm,
        *,
        partitions: Mapping[str, np.ndarray] | None = None,
        solver: DualSolver | None = None,
        tolerance: Tolerance = None,
        steps: AutomaticSteps | None = None,
        memory: float | None = None,
    ) -> None:
        """Prepare; nothing is computed yet. Arguments as for `solve_scene`."""
        _require_scene(scene)
        self.scene, self.comm = scene, comm
        self.solver, self.tolerance, self.steps = solver, tolerance, steps
        self.timer = PhaseTimer()
        self.state = None
        self._partitions, self._decomposition, self._memory = partitions, None, memory
        self._warnings: ContactWarnings = ContactWarnings()

    state: AnyState | None
    _decomposition: Decomposition | None
    #: The scene whose supports hold what the decomposition does.
    _held_by: Scene | None = None
    _deformed_equilibria: DeformedEquilibria | None = None

    def _facts(self) -> dict[str, Any]:
        return {
            "scene": {name: body.in_words for name, body in self.scene.bodies.items()},
            "ranks": self.comm.size,
            "solver": self.solver or "that of the scene's plan",
            "tolerance": "by default" if self.tolerance is None else self.tolerance,
            "state": self.state.contact if self.state else "none yet",
            "seconds": self.timer.seconds,
        }

    @property
    def partitions(self) -> Mapping[str, np.ndarray]:
        """Body name -> subdomain of every cell, numbered from 0 within the body. Collective on first use."""
        if self._partitions is None:
            usual = once_a_machine(self.comm, lambda: self.scene.partition(self.comm.size))
            linear, counted = not self.scene.is_nonlinear, partial(Subdomains.of, self.scene, usual)
            if linear and Fit.of(self.scene, counted, self.comm, limit=self._memory).is_tighter:
                usual = once_a_machine(self.comm, lambda: self.scene.partition(self.comm.size, lean=True))
            self._partitions = usual
        return self._partitions

    @property
    def decomposition(self) -> Decomposition:
        """The subdomains of the scene, with the supports of the last one solved. Collective on first use."""
        return self._decomposition or self._decomposed(self.scene)

    def _decomposed(self, scene: Scene) -> Decomposition:
        """Return the subdomains with the rows of a scene's supports, those before on other meshes."""
        held_by = self._held_by
        if self._decomposition is None:
            self._warnings.warn_of_values(scene, self.comm)
            with self.timer.phase("decompose"):
                self._decomposition = decompose(scene, self.partitions, self.comm, memory=self._memory)
        elif held_by and scene.supports != held_by.supports and scene.has_meshes_of(held_by):
            self._decomposition = self._decomposition.holding(scene)
        self._held_by = scene
        return self._decomposition

    @classmethod
    def following(
        cls,
        state: AnyState,
        *,
        solver: DualSolver | None = None,
        tolerance: Tolerance = None,
        steps: AutomaticSteps | None = None,
    ) -> ContactProblem:
        """Return the problem whose last solution is the given state, with its subdomains."""
        decomposition = state.torn.decomposition
        problem = cls(
            state.scene, decomposition.comm,
            partitions=decomposition.partitions, solver=solver, tolerance=tolerance, steps=steps,
        )  # fmt: skip
        problem._decomposition, problem._held_by, problem.state = decomposition, state.scene, state
        return problem

    def on(self, scene: Scene, partitions: Mapping[str, np.ndarray] | None = None) -> ContactProblem:
        """Return the problem of a scene on other meshes, solved alike; warnings given are not repeated."""
        other = ContactProblem(
            scene, self.comm,
            partitions=partitions, solver=self.solver, tolerance=self.tolerance, steps=self.steps,
        )  # fmt: skip
        other._warnings = self._warnings
        return other

    def defer_warnings(self) -> DeferredWarnings:
        """Let only the last state be warned of, when the `DeferredWarnings` of the result are logged."""
        self._warnings = deferred = DeferredWarnings()
        return deferred

    def number(self, scene: Scene | None = None) -> float:
        """Return the tolerance as a number, for states that are differentiated or compared. Collective.

        Where none is given, or `BalancedTolerance`, which leaves the status of points uncertain, it is that
        of the solver: of the one given, of Newton's method, or of the one that the scene's plan names.

        Args:
            scene: As for `solve`.
        """
        scene = scene or self.scene
        with together(self.comm):
            given = checked_tolerance(self.tolerance)
        if isinstance(given, float):
            return given
        kind = self._kind(scene, sensitivity=True)
        if kind is SolverKind.TANGENT_NEWTON:
            from fenics_contact._large_deformations.load_steps import AutomaticSteps

            return (self.steps or AutomaticSteps()).newton.tolerance
        return (self.solver or default_solver(kind)).tolerance

    @collectively("ContactProblem.check_apart", lambda self, *_, **__: self.comm)
    def check_apart(self, scene: Scene) -> None:
        """Refuse a scene whose bodies overlap before they are loaded, unless a pair says so. Collective.

        Raises:
            InvalidInputError: Names the pair, the number of nodes and the depth.
        """
        check_apart(scene, self._decomposed(scene))

    @collectively("ContactProblem.overlaps", lambda self, *_, **__: self.comm)
    def overlaps(self, state: State) -> tuple[str, ...]:
        """Return words about surfaces that overlap before they are loaded and are pressed apart. Collective.

        Of nonlinear materials, none.
        """
        return self._warnings.overlaps(state) if isinstance(state, LinearState) else ()

    @collectively("ContactProblem.solve", lambda self, *_, **__: self.comm)
    def solve(
        self,
        scene: Scene | None = None,
        *,
        start: State | Literal["last"] | None = "last",
        before: State | TransferredState | None = None,
        tolerance: Tolerance = None,
        design: bool = False,
        step: LoadStep | None = None,
        refinements: Mapping[str, Refinement] | None = None,
        adjoint: bool = False,
    ) -> AnyState:
        """Compute an equilibrium. Collective.

        Args:
            scene: The scene with other loads, values of supports or coordinates; None: the original one.
            start: State of a neighbouring geometry or load whose forces are the first guess, by default the
                last one; None for ``before``. Nonlinear materials start from ``before``, or
                with ``refinements`` in the first step from here.
            before: State at the end of the load step before, from which slip is measured and histories of
                materials go on, also one on other meshes, see `TransferredState`; None: undeformed bodies.
            tolerance: Overrides the problem's tolerance.
            design: Whether it is the state of a design: its bodies may overlap before they are loaded, and
                derivatives are wanted, which need the dual system and a number for default tolerance.
            step: The load step: its time, for obstacles that move and materials that creep, by default 1,
                and its functions of time, of which a load that is followed in parts has the values between.
            refinements: Body name -> refinement of the mesh that ``start`` has of it, where the scene has a
                finer one: nested iteration, in which solutions take few products, as many on fine meshes as
                on coarse ones. The partition and the number of ranks may be others. An overlap that the
                facets of the coarse meshes explained is accepted. Where Newton's method makes no way from
                such a start the solve begins cold, which is logged.
            adjoint: Whether adjoints are wanted, as for errors of quantities, which need the dual system.

        Raises:
            InvalidInputError: If scene or partition cannot be used, supports hold other components on other
                meshes than before, or ``start`` is not on the meshes of the scene, nor on those that the
                refinements lead from.
            InfeasibleError: If nothing holds some body against its load.
            ConvergenceError: If the solver does not reach its tolerance; the last solution stays unchanged.

        Example:
            >>> from dataclasses import replace
            >>> coarse = solve_scene(scene, comm)  # doctest: +SKIP
            >>> finer = refined(scene.bodies["block"].mesh, [0, 1])  # doctest: +SKIP
            >>> fine_body = replace(scene.bodies["block"], mesh=finer.mesh)  # doctest: +SKIP
            >>> fine_scene = replace(scene, bodies={**scene.bodies, "block": fine_body})  # doctest: +SKIP
            >>> fine = ContactProblem(fine_scene, comm)  # doctest: +SKIP
            >>> state = fine.solve(start=coarse, refinements={"block": finer})  # doctest: +SKIP
        """
        check_not_forked()
        scene, previous = scene or self.scene, Previous(after(before))
        with together(self.comm):
            accuracy = checked_tolerance(self.tolerance if tolerance is None else tolerance)
            wanted = Wanted(accuracy, step or ONLY_STEP, design)
            _require_obstacles_at(scene, wanted.time)
            previous.before.check(scene)
        scene = previous.before.kept(scene)
        equilibria = self._equilibria(scene, self._kind(scene, sensitivity=design or adjoint))
        _dolfinx.warn_if_untested(self.comm.rank)  # once PETSc has started on the ranks that solve
        first = self.state if start == "last" else start
        linear = not scene.is_nonlinear
        with one_thread(self.comm):
            if linear:
                check_same_input(self.comm, scene, solver=self.solver, tolerance=accuracy)
            with together(self.comm):
                if linear or refinements is not None:
                    previous = previous.starting(scene, first, refinements)
            state = equilibria.solve(scene, previous.reusing(scene, self.state), wanted)
        with self.timer.phase("state"):
            self.state = self._warnings.examined(state, design=design)
        return self.state

    def _kind(self, scene: Scene, *, sensitivity: bool) -> SolverKind:
        """Return how a scene is solved, also whether by large deformations. Collective."""
        count = self._decomposed(scene).tearing.n_subdomains
        with together(self.comm):
            return choose_solver(scene, count, sensitivity=sensitivity)

    def _equilibria(self, scene: Scene, kind: SolverKind) -> Equilibria:
        """Return what finds the equilibrium of a scene. Collective."""
        if kind is SolverKind.TANGENT_NEWTON:
            self._require_no_dual_solver()
            return self._deformed(scene)
        if kind is SolverKind.DIRECT and self.solver is None:
            return DirectEquilibria(self._decomposed(scene), self.timer)
        solver = self.solver or default_solver(kind)
        return LinearEquilibria(self._decomposed(scene), solver, self.timer, balances=self.solver is None)

    def _require_no_dual_solver(self) -> None:
        if self.solver is not None:
            raise InvalidInputError(
                f"dual solvers are for linear materials, got {self.solver!r}: give steps=AutomaticSteps(...)"
            )

    def _deformed(self, scene: Scene) -> DeformedEquilibria:
        """Return what finds equilibria of nonlinear materials. Collective on first use."""
        from fenics_contact._equilibrium.deformed import DeformedEquilibria

        decomposition, last = self._decomposed(scene), self._deformed_equilibria
        if last and last.serves(scene, decomposition):
            return last
        assembled = last.assembled if last else None
        self._deformed_equilibria = last = DeformedEquilibria(
            scene, decomposition, self.steps, self.timer, assembled
        )
        return last

    @collectively("ContactProblem.restore", lambda self, *_, **__: self.comm)
    def restore(self, stored: Stored, scene: Scene | None = None) -> AnyState:
        """Build a state from what `stored_state` returned: one product instead of a solve. Collective.

        Of nonlinear materials one factorisation.

        Args:
            stored: The arrays, from the same subdomains on any number of ranks.
            scene: The scene with coordinates, loads and supports of the state; None: the original one.

        Returns:
            The state; its multiplier is that of the stored one, its residuals are recomputed. The last
            solution stays unchanged: assign the state to `state` to continue from it.

        Raises:
            InvalidInputError: If the arrays are those of another system.
        """
        scene = scene or self.scene
        scene = continued(scene, stored)
        return self._equilibria(scene, self._kind(scene, sensitivity=False)).restored(
            stored, scene, self.state
        )


def _require_scene(scene: object) -> None:
    """Reject what is solved by another call, or has a scene."""
    if not isinstance(scene, Scene):
        raise InvalidInputError(
            f"what is solved must be a Scene, got {kind_in_words(type(scene))}: load steps are solved by "
            "solve_steps(scene, steps, comm), a ContactProblem by its solve(), a scene file's scene is .scene"
        )


@collectively("solve_scene", lambda scene, comm, **_: comm)
def solve_scene(
    scene: Scene,
    comm: MPI.Comm,
    *,
    partitions: Mapping[str, np.ndarray] | None = None,
    solver: DualSolver | None = None,
    tolerance: Tolerance = None,
    steps: AutomaticSteps | None = None,
    memory: float | None = None,
) -> AnyState:
    """Compute the equilibrium of a scene. Collective on ``comm``.

    Args:
        scene: Bodies, supports, loads and contact pairs, the same on every rank.
        comm: Communicator over which the subdomains are spread.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body; None lets
            `Scene.partition` cut the bodies into subdomains of a suitable size.
        solver: Dual solver with its tolerance; None: the one that `Scene.plan` names.
        tolerance: Largest relative residual of the solution, or an `accuracy.BalancedTolerance`, which
            solves as accurately as the mesh deserves. By default the solver's own, and without a solver
            balanced. Give a number, 1e-6 or less, where the status of single contact points matters, or small
            differences between states. Where materials are nonlinear a number, 1e-8 by default.
        steps: How loads on nonlinear materials are followed; None: the default
            `fenics_contact.AutomaticSteps`.
        memory: What a state of linear materials may take on a machine, [bytes]; by default what the machine
            has left. Where it does not suffice otherwise, subdomains are stored in single precision, at less
            than half the memory, and products in double precision confirm the answer.

    Raises:
        InvalidInputError: If scene or partition cannot be used.
        InfeasibleError: If nothing holds some body against its load.
        ConvergenceError: If the solver does not reach its tolerance.

    Example:
        >>> state = solve_scene(scene, MPI.COMM_WORLD)  # doctest: +SKIP
        >>> parts = {"block": box_partition(mesh, (2, 1, 1))}  # doctest: +SKIP
        >>> state = solve_scene(scene, MPI.COMM_SELF, partitions=parts)  # doctest: +SKIP
    """
    problem = ContactProblem(
        scene, comm, partitions=partitions, solver=solver, tolerance=tolerance, steps=steps, memory=memory
    )
    return problem.solve()


def _require_obstacles_at(scene: Scene, time: float) -> None:
    """Refuse obstacles that have moved by a time where bodies with small displacements do not see it."""
    if scene.deforms_much:
        return
    for pair in scene.contacts:
        if not all(each.is_where_it_was(time) for each in pair.moving):
            raise InvalidInputError(
                f"obstacles move with large deformations alone, that of {pair.place} has by time {time:g}: "
                "move the bodies against it, or give one a material for large deformations"
            )
