"""The entry point: from a scene to its equilibrium, and on to the next load, geometry or slip."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._base.checks import kind_in_words
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI, check_not_forked
from fenics_contact._base.progress import PhaseTimer
from fenics_contact._base.threads import one_thread
from fenics_contact._equilibrium.between_nodes import InsideFacets, needed_nodes, with_places
from fenics_contact._equilibrium.carried import CarriedState
from fenics_contact._equilibrium.followed_loads import FollowedLoads
from fenics_contact._equilibrium.other_rows import has_rows_of, on_rows_of, with_kept
from fenics_contact._equilibrium.outer_loops import OuterLoop, nested, outer_loops
from fenics_contact._equilibrium.passes import Passes
from fenics_contact._equilibrium.starts import (
    CoarseStart,
    checked_start,
    first_guess,
    known_system,
    solve_from_coarse,
)
from fenics_contact._equilibrium.static_admissibility import check_held
from fenics_contact._equilibrium.stored import Stored, restored_solution, with_stored_slip
from fenics_contact._equilibrium.warnings import ContactWarnings
from fenics_contact._pairing.inside import InFacets
from fenics_contact._scene.memory import Fit
from fenics_contact._scene.obstacles import MovingObstacle
from fenics_contact._scene.plan import SolverKind, choose_solver
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene.sections import held_at
from fenics_contact._scene.supports import RigidSurface
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.feti.decomposition import Decomposition, decompose
from fenics_contact.feti.direct import DirectSystem
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.same_input import check_same_input
from fenics_contact.feti.torn import TornSystem, build_torn_system, check_apart, with_points_inside
from fenics_contact.qp.face_newton import ProjectedCG
from fenics_contact.qp.in_turn import InTurn
from fenics_contact.qp.solution import DualSolution
from fenics_contact.qp.solve import DualSolver
from fenics_contact.results.contact import no_contact
from fenics_contact.results.dual_solve import contact_result, row_values, solve_dual, sticking
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.preloads import shortenings
from fenics_contact.results.state import State, Tolerance, checked_tolerance, compute_energies

if TYPE_CHECKING:
    from fenics_contact._accuracy.state_errors import BalancedTolerance
    from fenics_contact._equilibrium.balancing import Solve
    from fenics_contact._equilibrium.deformed import DeformedEquilibria
    from fenics_contact._large_deformations.load_steps import AutomaticSteps
    from fenics_contact.mesh.refinement import Refinement
    from fenics_contact.results.deformed_state import AnyState


#: Largest relative residual of a scene without contact; its solution then equals that of a direct solver.
LINEAR_TOLERANCE = 1e-10


class LinearEquilibria:
    """Equilibria of linear materials on the subdomains of one decomposition."""

    def __init__(self, decomposition: Decomposition, solver: DualSolver | None, timer: PhaseTimer) -> None:
        """Prepare; ``solver`` is None for that of each scene's plan."""
        self._decomposition, self._solver, self._timer = decomposition, solver, timer

    def solve(
        self,
        scene: Scene,
        kind: SolverKind,
        tolerance: Tolerance,
        *,
        start: State | CoarseStart | None,
        before: State | CarriedState | None,
        known: State | None,
        design: bool,
    ) -> LinearState:
        """Compute the equilibrium of a scene. Collective.

        Args:
            start: State whose multipliers come first, also one on coarser meshes, or None.
            before: State from which slip is measured, also one on other meshes, or None.
            known: State of which parts may be reused, or None.

        Raises:
            InfeasibleError: If nothing holds some body.
            ConvergenceError: If the solver does not reach its tolerance.
        """
        with self._timer.phase("assemble"):
            # What the facets of a coarse mesh explained, a finer one has kept: a warning names it.
            torn = self._torn(scene, known, overlap=design or isinstance(start, CoarseStart))
            if before is not None:
                torn = torn.with_slip_from(*self._slip_origin(before, torn))
            same = known is not None and torn.points is known.torn.points
            if known is None or not same or _loads_of(torn.scene) != _loads_of(known.scene):
                check_held(torn)
        if self._solver is None and kind is SolverKind.DIRECT:
            return self._directly(torn, known)

        def solved(
            system_of: TornSystem, first: State | CoarseStart | None, reusable: State | None
        ) -> LinearState:
            return self._solved(
                system_of, kind, tolerance, start=first, before=before, known=reusable, design=design
            )

        state = solved(torn, start, known)
        if design or scene.torsion or not scene.contacts:
            return state
        return self._with_points_inside(state, before, solved)

    def _with_points_inside(
        self,
        state: LinearState,
        before: State | CarriedState | None,
        solved: Callable[[TornSystem, State | CoarseStart | None, State | None], LinearState],
        most: int = 4,
    ) -> LinearState:
        """Return the state in which facets press that lie between nodes in a master. Collective.

        `most`: how often other points are looked for; what a state still misses is a warning.
        """
        torn, passes = state.torn, Passes(lambda system_of, last: solved(system_of, last, None), None)
        passes.add(state)
        inside = InsideFacets(torn.scene.dim)
        for _ in range(most):
            with self._timer.phase("state"):
                places = inside.after(state, needed_nodes(state, torn.points))
            if places is None:
                break
            with self._timer.phase("assemble"):
                others = with_places(torn, places)
                others = others.with_slip_from(*self._slip_origin(before, others)) if before else others
            state = passes.run(others)
        return state if passes.count == 1 else passes.answer(state)

    def _solved(
        self,
        torn: TornSystem,
        kind: SolverKind,
        tolerance: Tolerance,
        *,
        start: State | CoarseStart | None,
        before: State | CarriedState | None,
        known: State | None,
        design: bool,
    ) -> LinearState:
        """Compute the equilibrium of a system. Collective."""
        solver, reused = self._solver or default_solver(kind), known_system(known)
        # Derivatives need the status of every contact point, which a balanced state leaves uncertain.
        if tolerance is None and (self._solver is not None or design):
            tolerance = solver.tolerance
        loops = outer_loops(torn.scene)
        if loops:
            assert not isinstance(before, CarriedState)  # refused by its check
            if design:
                for loop in loops:
                    loop.require_derivatives(torn, before)
            return self._by_passes(torn, loops, tolerance, solver, start, known, before)
        system = DualSystem(torn, self._timer, previous=reused)
        with self._timer.phase("solve"):
            first = first_guess(start, system)
        alone = solve_from_coarse if isinstance(start, CoarseStart) else solve_dual
        solve = alone if reused is None else FollowedLoads(reused, self._timer).solve
        if not isinstance(tolerance, float):
            return self._balanced(system, solve, solver, tolerance, first)
        with self._timer.phase("solve"):
            solution = solve(system, solver.with_tolerance(tolerance), first)
        return self._state(system, solution, tolerance=tolerance)

    def _slip_origin(self, before: State | CarriedState, torn: TornSystem) -> tuple[np.ndarray, np.ndarray]:
        """Return from where a system measures slip. Collective."""
        if isinstance(before, CarriedState):
            scene = before.scene_on(torn.scene)
            was = build_torn_system(scene, self._decomposition, overlap=True, previous=torn)
            return before.slip_origin(with_points_inside(was, torn))
        if has_rows_of(before, torn):
            own = before.torn
            sticks = sticking(own, before.rows) if own.tangential_rows.size else False
            return own.slip_origin(before.torn_displacement, before.solution.multiplier, sticks)
        was, multiplier = on_rows_of(before, torn)
        return was.slip_origin(before.torn_displacement, multiplier)

    def _by_passes(
        self,
        torn: TornSystem,
        loops: Sequence[OuterLoop],
        tolerance: Tolerance,
        solver: DualSolver,
        start: State | CoarseStart | None,
        known: State | None,
        before: State | None,
    ) -> LinearState:
        """Compute a state that agrees with what its outer loops find. Collective."""
        # They need the status of every point, which a balanced state leaves uncertain.
        wanted = tolerance if isinstance(tolerance, float) else solver.tolerance
        finest = min(loop.pass_tolerance(wanted) for loop in loops)

        def solve(system_of: TornSystem, last: LinearState | None) -> LinearState:
            reused = known_system(last)
            system = DualSystem(system_of, self._timer, previous=reused)
            with self._timer.phase("solve"):
                first = first_guess(last or start, system)
                solution = solve_dual(system, solver.with_tolerance(finest), first)
            return self._state(system, solution, tolerance=wanted)

        first = known if isinstance(known, LinearState) else None
        return nested(loops, solve, first, before, wanted)(torn, first)

    def restored(self, stored: Stored, scene: Scene, known: State | None) -> LinearState:
        """Build a state from what `stored_state` returned, with at most one product. Collective."""
        torn = self._torn(scene, known, overlap=True)
        if not stored:
            return self._directly(torn, known)
        with self._timer.phase("assemble"):
            torn = with_stored_slip(with_places(torn, InFacets.restored(stored, scene.dim)), stored)
        for loop in outer_loops(scene):
            torn = loop.restored(torn, stored)
        system = DualSystem(torn, self._timer, previous=known_system(known))
        with self._timer.phase("state"):
            solution = restored_solution(system, stored)
        return self._state(system, solution)

    def _state(
        self, system: DualSystem, solution: DualSolution, displacement: np.ndarray | None = None, **known: Any
    ) -> LinearState:
        """Return the state of a solution; its torn displacement is computed unless given. Collective."""
        torn = system.torn
        with self._timer.phase("state"):
            if displacement is None:
                displacement = system.displacement(solution.multiplier, solution.alpha)
            contact = contact_result(torn, row_values(system, solution), displacement)
            friction = float(np.sum(contact.slip_bound * np.linalg.norm(contact.slip, axis=1)))
            rigid = system.kernel @ solution.alpha
            energies = compute_energies(torn, displacement, solution.multiplier, friction, rigid)
        return LinearState(
            torn=torn, system=system, solution=solution, torn_displacement=displacement, contact=contact,
            energies=energies, seconds=dict(self._timer.seconds), **known,
        )  # fmt: skip

    def _torn(self, scene: Scene, known: State | None, *, overlap: bool) -> TornSystem:
        previous = None if known is None else known.torn
        return build_torn_system(scene, self._decomposition, overlap=overlap, previous=previous)

    def _directly(self, torn: TornSystem, known: State | None) -> LinearState:
        """Compute the state of one body without multipliers."""
        earlier = known.system if isinstance(known, LinearState) else None
        reused = earlier if isinstance(earlier, DirectSystem) else None
        system = DirectSystem(torn, self._timer, previous=reused)
        with self._timer.phase("solve"):
            solution = system.solve()
        return LinearState(
            torn=torn, system=system, solution=solution, torn_displacement=solution.displacement,
            contact=no_contact(torn.points), seconds=dict(self._timer.seconds),
            energies=compute_energies(torn, solution.displacement, solution.multiplier, 0.0),
        )  # fmt: skip

    def _balanced(
        self,
        system: DualSystem,
        solve: Solve,
        solver: DualSolver,
        balanced: BalancedTolerance | None,
        start: np.ndarray | None,
    ) -> LinearState:
        """Compute the state as accurately as the mesh deserves."""
        # A fixed tolerance needs no estimates and should not import them.
        from fenics_contact._accuracy.state_errors import BalancedTolerance
        from fenics_contact._equilibrium.balancing import solve_balanced

        wanted = balanced or BalancedTolerance()
        rounds = solve_balanced(system, solve, solver, wanted, start, self._timer)
        state = self._state(system, rounds.solution, rounds.displacement, tolerance=wanted)
        return replace(state, known_errors=rounds.state_errors(state.energies.norm))


def default_solver(kind: SolverKind) -> DualSolver:
    """Return the dual solver of a kind, with its tolerance."""
    if kind is SolverKind.FACE_NEWTON:
        return InTurn()
    return ProjectedCG(tolerance=LINEAR_TOLERANCE)


def _loads_of(scene: Scene) -> tuple[list[Any], ...]:
    """Return the loads of a scene, the rigid surfaces, at whose points loads act, preloads and springs."""
    rigid = [each for each in scene.supports if isinstance(each, RigidSurface)]
    return list(scene.loads), rigid, list(scene.preloads), list(scene.springs)


def _lengths_after(before: State | None, scene: Scene) -> np.ndarray:
    """Return the shortenings of preloads at the end of the load step before. Collective."""
    if before is None or not before.scene.preloads:
        return np.zeros(len(scene.preloads))
    return shortenings(before.torn, before.torn_displacement)


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
        self._warnings = ContactWarnings()

    state: AnyState | None
    _decomposition: Decomposition | None
    #: The scene whose supports hold what the decomposition does.
    _held_by: Scene | None = None
    _deformed_equilibria: DeformedEquilibria | None = None

    def _facts(self) -> dict[str, Any]:
        return {
            "scene": {name: body.in_words for name, body in self.scene.bodies.items()},
            "ranks": self.comm.size,
            "solver": "that of the scene's plan" if self.solver is None else self.solver,
            "tolerance": "by default" if self.tolerance is None else self.tolerance,
            "state": "none yet" if self.state is None else self.state.contact,
            "seconds": self.timer.seconds,
        }

    @property
    def partitions(self) -> Mapping[str, np.ndarray]:
        """Body name -> subdomain of every cell, numbered from 0 within the body. Collective on first use."""
        if self._partitions is None:
            with together(self.comm):
                usual = self.scene.partition(self.comm.size)
            linear = not self.scene.is_nonlinear
            if linear and Fit.of(self.scene, usual, self.comm, limit=self._memory).is_tighter:
                with together(self.comm):
                    usual = self.scene.partition(self.comm.size, lean=True)
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
        elif held_by is not None and scene.supports != held_by.supports and scene.has_meshes_of(held_by):
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

    def hold_warnings(self) -> ContactWarnings:
        """Let only the last state be warned of, when the `ContactWarnings` of the result are logged."""
        self._warnings = ContactWarnings(of_last=True)
        return self._warnings

    def number(self, scene: Scene | None = None) -> float:
        """Return the tolerance as a number, for states that are differentiated or compared. Collective.

        Where none is given, or `BalancedTolerance`, which leaves the status of points uncertain, it is that
        of the solver: of the one given, of Newton's method, or of the one that the scene's plan names.

        Args:
            scene: As for `solve`.
        """
        scene = self.scene if scene is None else scene
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
        before: State | CarriedState | None = None,
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
                materials go on, also one on other meshes, see `CarriedState`; None: the undeformed bodies.
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
            >>> coarse = solve_scene(scene, comm)  # doctest: +SKIP
            >>> finer = refined(scene.bodies["block"].mesh, [0, 1])  # doctest: +SKIP
            >>> fine_body = replace(scene.bodies["block"], mesh=finer.mesh)  # doctest: +SKIP
            >>> fine_scene = replace(scene, bodies={**scene.bodies, "block": fine_body})  # doctest: +SKIP
            >>> fine = ContactProblem(fine_scene, comm)  # doctest: +SKIP
            >>> state = fine.solve(start=coarse, refinements={"block": finer})  # doctest: +SKIP
        """
        check_not_forked()
        scene = self.scene if scene is None else scene
        time = 1.0 if step is None or step.time is None else step.time
        with together(self.comm):
            _require_obstacles_at(scene, time)
            wanted = checked_tolerance(self.tolerance if tolerance is None else tolerance)
            if isinstance(before, CarriedState):
                before.check(scene)
        last = before.state if isinstance(before, CarriedState) else before
        if not isinstance(before, CarriedState):
            scene = with_kept(scene, before)
        if scene.preloads:
            scene = replace(scene, preloads=held_at(scene, _lengths_after(last, scene)))
        kind = self._kind(scene, sensitivity=design or adjoint)
        _dolfinx.warn_if_untested(self.comm.rank)  # once PETSc has started on the ranks that solve
        first = (self.state if start == "last" else start) or (last if last is before else None)
        with one_thread(self.comm):
            if kind is SolverKind.TANGENT_NEWTON:
                self._require_no_dual_solver()
                with together(self.comm):
                    near = None if refinements is None else checked_start(scene, first, refinements)
                state: AnyState = self._deformed(scene).solve(
                    scene, before, wanted, time, step, overlap=design or refinements is not None, start=near
                )
            else:
                check_same_input(self.comm, scene, solver=self.solver, tolerance=wanted)
                with together(self.comm):
                    guess = checked_start(scene, first, refinements)
                known = self._alike(scene, first if guess is first else None)
                state = self._linear(scene).solve(
                    scene, kind, wanted, start=guess, before=before, known=known, design=design
                )
        self.state = state
        with self.timer.phase("state"):
            self._warnings.warn(state, design=design)
        return state

    def _kind(self, scene: Scene, *, sensitivity: bool) -> SolverKind:
        """Return how a scene is solved, also whether by large deformations. Collective."""
        count = self._decomposed(scene).tearing.n_subdomains
        with together(self.comm):
            return choose_solver(scene, count, sensitivity=sensitivity)

    def _require_no_dual_solver(self) -> None:
        if self.solver is not None:
            raise InvalidInputError(
                f"dual solvers are for linear materials, this scene has others, got {self.solver!r}: "
                "give steps=AutomaticSteps(TangentNewton(...)) instead"
            )

    def _linear(self, scene: Scene) -> LinearEquilibria:
        return LinearEquilibria(self._decomposed(scene), self.solver, self.timer)

    def _deformed(self, scene: Scene) -> DeformedEquilibria:
        """Return what finds equilibria of nonlinear materials. Collective on first use."""
        from fenics_contact._equilibrium.deformed import DeformedEquilibria

        equilibria, decomposition = self._deformed_equilibria, self._decomposed(scene)
        if equilibria is None or not equilibria.serves(scene, decomposition):
            equilibria = DeformedEquilibria(scene, decomposition, self.steps, self.timer, known=equilibria)
            self._deformed_equilibria = equilibria
        return equilibria

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
        scene = self.scene if scene is None else scene
        if "lengths" in stored:
            scene = replace(scene, preloads=held_at(scene, stored["lengths"]))
        if self._kind(scene, sensitivity=False) is SolverKind.TANGENT_NEWTON:
            return self._deformed(scene).restored(stored, scene)
        return self._linear(scene).restored(stored, scene, self.state)

    def _alike(self, scene: Scene, start: State | None) -> State | None:
        """Return the state to reuse: the last one if it has the scene's meshes, else the start."""
        if start is None or self.state is None:
            return start
        return self.state if scene.has_meshes_of(self.state.scene) else start


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
        if isinstance(pair.master, MovingObstacle) and not pair.master.is_where_it_was(time):
            raise InvalidInputError(
                f"with small displacements obstacles must not move, but that of {pair.place} has moved by "
                f"time {time:g}: move the bodies against it by their supports, or give a body a material for "
                "large deformations"
            )
