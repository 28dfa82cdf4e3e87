"""Equilibria of linear materials: by the dual solver, or directly where a body meets no other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.progress import PhaseTimer
from fenics_contact._equilibrium.between_nodes import InsideFacets, needed_nodes, with_places
from fenics_contact._equilibrium.followed_loads import FollowedLoads
from fenics_contact._equilibrium.outer_loops import nested, outer_loops
from fenics_contact._equilibrium.passes import OuterLoop, Passes
from fenics_contact._equilibrium.previous import Previous, Wanted
from fenics_contact._equilibrium.starts import (
    SameMeshes,
    known_system,
    solve_from_coarse,
)
from fenics_contact._equilibrium.static_admissibility import check_held
from fenics_contact._equilibrium.stored import Stored, restored_solution, with_stored_slip
from fenics_contact._pairing.inside import InFacets
from fenics_contact._scene.plan import SolverKind
from fenics_contact._scene.scene import Scene
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.direct import DirectSystem
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.torn import TornSystem, build_torn_system
from fenics_contact.qp.face_newton import ProjectedCG
from fenics_contact.qp.in_turn import InTurn
from fenics_contact.qp.solution import DualSolution
from fenics_contact.qp.solve import DualSolver
from fenics_contact.results.contact import no_contact
from fenics_contact.results.dual_solve import contact_result, row_values, solve_dual, worn_by
from fenics_contact.results.linear_state import DirectState, LinearState
from fenics_contact.results.state import State, Tolerance, compute_energies

if TYPE_CHECKING:
    from fenics_contact._accuracy.state_errors import BalancedTolerance
    from fenics_contact._equilibrium.balancing import Solve


#: Largest relative residual of a scene without contact; its solution then equals that of a direct solver.
LINEAR_TOLERANCE = 1e-10


class DirectEquilibria:
    """Equilibria of one body that meets no other: its stiffness is factored, there are no multipliers."""

    def __init__(self, decomposition: Decomposition, timer: PhaseTimer) -> None:
        """Prepare; nothing is computed yet."""
        self._decomposition, self._timer = decomposition, timer

    def solve(self, scene: Scene, previous: Previous, wanted: Wanted) -> LinearState:
        """Compute the equilibrium of a scene. Collective."""
        with self._timer.phase("assemble"):
            torn = _checked(_torn(scene, self._decomposition, previous, wanted), previous.known)
        return self._directly(torn, previous.known)

    def restored(self, stored: Stored, scene: Scene, known: State | None) -> LinearState:
        """Compute a state once more, of which nothing is stored. Collective."""
        return self._directly(_again(scene, self._decomposition, known), known)

    def _directly(self, torn: TornSystem, known: State | None) -> LinearState:
        reused = known.system if isinstance(known, DirectState) else None
        system = DirectSystem(torn, self._timer, previous=reused)
        with self._timer.phase("solve"):
            solution = system.solve()
        return DirectState(
            torn=torn, system=system, solution=solution, torn_displacement=solution.displacement,
            contact=no_contact(torn.points), seconds=dict(self._timer.seconds),
            energies=compute_energies(torn, solution.displacement, solution.multiplier, 0.0),
        )  # fmt: skip


class LinearEquilibria:
    """Equilibria of linear materials on the subdomains of one decomposition, by their multipliers."""

    def __init__(
        self, decomposition: Decomposition, solver: DualSolver, timer: PhaseTimer, *, balances: bool
    ) -> None:
        """Prepare; `balances`: whether states without a tolerance are as accurate as their meshes deserve."""
        self._decomposition, self._solver, self._timer = decomposition, solver, timer
        self._balances = balances

    def solve(self, scene: Scene, previous: Previous, wanted: Wanted) -> LinearState:
        """Compute the equilibrium of a scene. Collective."""
        with self._timer.phase("assemble"):
            torn = _torn(scene, self._decomposition, previous, wanted)
            torn = _checked(previous.before.with_slip(torn), previous.known)
        state = self._solved(torn, previous, wanted)
        if wanted.design or scene.torsion or not scene.contacts:
            return state
        return self._with_points_inside(state, previous, wanted)

    def _with_points_inside(
        self, state: LinearState, previous: Previous, wanted: Wanted, most: int = 4
    ) -> LinearState:
        """Return the state in which facets press that lie between nodes in a master. Collective."""

        def solved(torn: TornSystem, last: LinearState | None, tolerance: Tolerance) -> LinearState:
            earlier = replace(previous, start=SameMeshes(last or state), known=None)
            return self._solved(torn, earlier, replace(wanted, tolerance=tolerance))

        torn, passes, inside = state.torn, Passes(solved, None), InsideFacets(state.scene.dim)
        passes.add(state)
        for _ in range(most):
            with self._timer.phase("state"):
                places = inside.after(state, needed_nodes(state, torn.points))
            if places is None:
                break
            with self._timer.phase("assemble"):
                others = previous.before.with_slip(with_places(torn, places))
            state = passes.run(others, wanted.tolerance)
        return state if passes.count == 1 else passes.answer(state)

    def _solved(self, torn: TornSystem, previous: Previous, wanted: Wanted) -> LinearState:
        """Compute the equilibrium of a system. Collective."""
        solver, tolerance = self._solver, wanted.tolerance
        # Derivatives need the status of every contact point, which a balanced state leaves uncertain.
        if tolerance is None and (wanted.design or not self._balances):
            tolerance = solver.tolerance
        if loops := outer_loops(torn.scene):
            if wanted.design:
                for loop in loops:
                    loop.require_derivatives(torn, previous.last)
            # They need the status of every point, too.
            exact = tolerance if isinstance(tolerance, float) else solver.tolerance
            return self._by_passes(torn, loops, previous, solver.with_tolerance(exact))
        reused = known_system(previous.known)
        system = DualSystem(torn, self._timer, previous=reused)
        with self._timer.phase("solve"):
            first = previous.start.first_guess(system)
        alone = solve_from_coarse if previous.start.is_coarser else solve_dual
        solve = alone if reused is None else FollowedLoads(reused, self._timer).solve
        if not isinstance(tolerance, float):
            return self._balanced(system, solve, solver, tolerance, first)
        with self._timer.phase("solve"):
            solution = solve(system, solver.with_tolerance(tolerance), first)
        return self._state(system, solution, tolerance=tolerance)

    def _by_passes(
        self, torn: TornSystem, loops: Sequence[OuterLoop], previous: Previous, solver: DualSolver
    ) -> LinearState:
        """Compute a state that agrees with what its outer loops find. Collective."""
        wanted = solver.tolerance

        def solve(system_of: TornSystem, last: LinearState | None, tolerance: float) -> LinearState:
            reused = known_system(last)
            system = DualSystem(system_of, self._timer, previous=reused)
            with self._timer.phase("solve"):
                first = (SameMeshes(last) if last else previous.start).first_guess(system)
                solution = solve_dual(system, solver.with_tolerance(tolerance), first)
            return self._state(system, solution, tolerance=wanted)

        first = previous.known if isinstance(previous.known, LinearState) else None
        return nested(loops, solve, first, previous.last)(torn, first, wanted)

    def restored(self, stored: Stored, scene: Scene, known: State | None) -> LinearState:
        """Build a state from what `stored_state` returned, with at most one product. Collective."""
        torn = _again(scene, self._decomposition, known)
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
            contact = worn_by(contact_result(torn, row_values(system, solution), displacement), torn)
            friction = float(np.sum(contact.slip_bound * np.linalg.norm(contact.slip, axis=1)))
            rigid = system.kernel @ solution.alpha
            energies = compute_energies(torn, displacement, solution.multiplier, friction, rigid)
        return LinearState(
            torn=torn, system=system, solution=solution, torn_displacement=displacement, contact=contact,
            energies=energies, seconds=dict(self._timer.seconds), **known,
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


def _torn(scene: Scene, decomposition: Decomposition, previous: Previous, wanted: Wanted) -> TornSystem:
    # What the facets of a coarse mesh explained, a finer one has kept: a warning names it.
    return _again(scene, decomposition, previous.known, overlap=wanted.design or previous.start.is_coarser)


def _again(
    scene: Scene, decomposition: Decomposition, known: State | None, *, overlap: bool = True
) -> TornSystem:
    torn = None if known is None else known.torn
    return build_torn_system(scene, decomposition, overlap=overlap, previous=torn)


def _checked(torn: TornSystem, known: State | None) -> TornSystem:
    """Return a system whose bodies are held against their loads, unless that is known. Collective."""
    same = known is not None and torn.points is known.torn.points
    if known is None or not same or _loads_of(torn) != _loads_of(known.torn):
        check_held(torn)
    return torn


def _loads_of(torn: TornSystem) -> tuple[list[Any], ...]:
    """Return the loads of a system, the rigid surfaces, at whose points loads act, and those of unknowns."""
    return list(torn.scene.loads), list(torn.scene.rigid_surfaces), torn.free.load.tolist()
