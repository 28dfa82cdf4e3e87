"""From a torn system to its state."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.contact.dual_solve import contact_result, row_values, solve_dual
from fenics_contact.contact.energies import compute_energies
from fenics_contact.contact.followed_loads import FollowedLoads
from fenics_contact.contact.linear_state import LinearState
from fenics_contact.contact.result import no_contact
from fenics_contact.contact.state import State
from fenics_contact.contact.warm_start import carried_over
from fenics_contact.feti import (
    DirectSystem,
    DualSystem,
    TornSystem,
)
from fenics_contact.qp import DualSolution, DualSolver, FaceNewton, ProjectedCG
from fenics_contact.scene import SolverKind
from fenics_contact.timing import PhaseTimer

if TYPE_CHECKING:
    from fenics_contact.accuracy import BalancedTolerance
    from fenics_contact.contact.balancing import Solve

#: Largest relative residual of a scene without contact; its solution then equals that of a direct solver.
LINEAR_TOLERANCE = 1e-10


def dual_state(
    torn: TornSystem,
    previous: State | None,
    known: State | None,
    solver: DualSolver,
    tolerance: float | BalancedTolerance | None,
    timer: PhaseTimer,
) -> LinearState:
    """Compute a state by its multipliers. Collective.

    Args:
        torn: The torn system.
        previous: LinearState of a neighbouring geometry or load to start from, or None.
        known: LinearState of which unchanged parts are reused, or None.
        solver: The dual solver.
        tolerance: Its tolerance, or its share of the discretisation error; None: `BalancedTolerance()`.
        timer: Collects the wall time.
    """
    system, start = _dual_system(torn, previous, known, timer)
    before = known_system(known)
    solve = solve_dual if before is None else FollowedLoads(before, timer).solve
    if isinstance(tolerance, float):
        return _to_tolerance(system, solve, solver.with_tolerance(tolerance), start, timer)
    return _balanced(system, solve, solver, tolerance, start, timer)


def _dual_system(
    torn: TornSystem, previous: State | None, known: State | None, timer: PhaseTimer
) -> tuple[DualSystem, np.ndarray | None]:
    """Return the dual system, with parts of a known state, and a start from the previous one. Collective."""
    system, old = DualSystem(torn, timer, previous=known_system(known)), known_system(previous)
    if previous is not None and old is not None and isinstance(previous.solution, DualSolution):
        return system, carried_over(old, previous.solution, system)
    return system, None


def known_system(state: State | None) -> DualSystem | None:
    """Return the dual system of a state, whose unchanged parts the next one reuses."""
    system = state.system if isinstance(state, LinearState) else None
    return system if isinstance(system, DualSystem) else None


def _to_tolerance(
    system: DualSystem, solve: Solve, solver: DualSolver, start: np.ndarray | None, timer: PhaseTimer
) -> LinearState:
    """Compute the state to the tolerance of a solver. Collective."""
    with timer.phase("solve"):
        solution = solve(system, solver, start)
    with timer.phase("state"):
        displacement = system.displacement(solution.multiplier, solution.alpha)
    return replace(state_of(system, solution, displacement, timer), tolerance=solver.tolerance)


def _balanced(
    system: DualSystem,
    solve: Solve,
    solver: DualSolver,
    balanced: BalancedTolerance | None,
    start: np.ndarray | None,
    timer: PhaseTimer,
) -> LinearState:
    """Compute the state as accurately as the mesh deserves. Collective."""
    # A fixed tolerance needs no estimates and should not import them.
    from fenics_contact.accuracy import BalancedTolerance
    from fenics_contact.contact.balancing import solve_balanced

    wanted = balanced or BalancedTolerance()
    rounds = solve_balanced(system, solve, solver, wanted, start, timer)
    state = state_of(system, rounds.solution, rounds.displacement, timer)
    return replace(state, known_errors=rounds.state_errors(state.energies.norm), tolerance=wanted)


def state_of(
    system: DualSystem, solution: DualSolution, displacement: np.ndarray, timer: PhaseTimer
) -> LinearState:
    """Return the state of a solution with its torn displacement. Collective."""
    with timer.phase("state"):
        contact = contact_result(system.torn, row_values(system, solution), displacement)
        friction = float(np.sum(contact.slip_bound * np.linalg.norm(contact.slip, axis=1)))
        rigid = system.kernel @ solution.alpha
        energies = compute_energies(system.torn, displacement, solution.multiplier, friction, rigid)
    return LinearState(
        torn=system.torn, system=system, solution=solution, torn_displacement=displacement, contact=contact,
        energies=energies, seconds=dict(timer.seconds),
    )  # fmt: skip


def direct_state(torn: TornSystem, previous: State | None, timer: PhaseTimer) -> LinearState:
    """Compute the state of one body without multipliers. Collective."""
    system = previous.system if isinstance(previous, LinearState) else None
    known = system if isinstance(system, DirectSystem) else None
    system = DirectSystem(torn, timer, previous=known)
    with timer.phase("solve"):
        solution = system.solve()
    return LinearState(
        torn=torn, system=system, solution=solution, torn_displacement=solution.displacement,
        contact=no_contact(torn.points), seconds=dict(timer.seconds),
        energies=compute_energies(torn, solution.displacement, solution.multiplier, 0.0),
    )  # fmt: skip


def default_solver(kind: SolverKind) -> DualSolver:
    """Return the dual solver of a kind, with its tolerance."""
    if kind is SolverKind.FACE_NEWTON:
        return FaceNewton()
    return ProjectedCG(tolerance=LINEAR_TOLERANCE)
