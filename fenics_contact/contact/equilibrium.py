"""From a scene to its state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._libraries import MPI, check_not_forked
from fenics_contact.contact.coulomb import FixedPoint
from fenics_contact.contact.energies import compute_energies
from fenics_contact.contact.held import check_held
from fenics_contact.contact.result import ContactResult, Status, no_contact
from fenics_contact.contact.state import State
from fenics_contact.contact.tolerance import Tolerance, checked_tolerance
from fenics_contact.contact.warm_start import carried_over
from fenics_contact.errors import collectively, together
from fenics_contact.feti import (
    Decomposition,
    DirectSystem,
    DualSystem,
    TornSystem,
    build_torn_system,
    decompose,
)
from fenics_contact.feti.same_input import check_same_input
from fenics_contact.qp import DualSolution, DualSolver, FaceNewton, ProjectedCG, Smalse, contact_step, solve
from fenics_contact.scene import Scene, SolverKind, choose_solver
from fenics_contact.timing import PhaseTimer

if TYPE_CHECKING:
    from fenics_contact.accuracy import Balanced

#: Largest relative residual of a scene without contact; its answer then equals that of a direct solver.
LINEAR_TOLERANCE = 1e-10


@collectively("solve_scene", lambda scene, partitions, comm, **_: comm)
def solve_scene(
    scene: Scene,
    partitions: Mapping[str, np.ndarray] | None,
    comm: MPI.Comm,
    *,
    solver: DualSolver | None = None,
    tolerance: Tolerance = None,
) -> State:
    """Find the equilibrium of a scene. Collective on ``comm``.

    Args:
        scene: Bodies, supports, loads and contact pairs, the same on every rank.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body; None lets
            `Scene.partition` cut the bodies into subdomains of a good size.
        comm: Communicator over which the subdomains are spread.
        solver: Dual solver with its tolerance; `Scene.plan` tells which one is chosen if it is None.
        tolerance: Largest relative residual of the answer, or `fenics_contact.accuracy.Balanced`, which
            solves as well as the mesh deserves. By default the solver's own, and without a solver `Balanced`.
            Give a number, 1e-6 or less, where the status of single contact points matters, or small
            differences between states.

    Raises:
        InvalidInputError: If scene or partition cannot be used.
        InfeasibleError: If nothing holds some body against its load.
        ConvergenceError: If the solver does not reach its tolerance.

    Example:
        >>> parts = {"block": box_partition(mesh, (2, 1, 1))}  # doctest: +SKIP
        >>> state = solve_scene(scene, parts, MPI.COMM_WORLD)  # doctest: +SKIP
    """
    decomposition, timer = decomposed(scene, partitions, comm)
    return find_state(scene, decomposition, solver=solver, tolerance=tolerance, timer=timer)


def decomposed(
    scene: Scene, partitions: Mapping[str, np.ndarray] | None, comm: MPI.Comm
) -> tuple[Decomposition, PhaseTimer]:
    """Cut a scene, as given or into subdomains of a good size; return the time that took, too. Collective."""
    timer = PhaseTimer()
    with timer.phase("decompose"):
        with together(comm):
            cut = scene.partition(comm.size) if partitions is None else partitions
        return decompose(scene, cut, comm), timer


@collectively("find_state", lambda scene, decomposition, **_: decomposition.comm)
def find_state(
    scene: Scene,
    decomposition: Decomposition,
    *,
    solver: DualSolver | None = None,
    tolerance: Tolerance = None,
    previous: State | None = None,
    slip_from: State | None = None,
    start_geometry: bool = True,
    sensitivity: bool = False,
    timer: PhaseTimer | None = None,
) -> State:
    """Find the equilibrium of a decomposed scene, possibly moved since. Collective.

    Args:
        scene: The scene, with the coordinates to use.
        decomposition: Its decomposition; only topology and numbering are taken from it.
        solver: Dual solver with its tolerance; `default_solver` chooses if it is None.
        tolerance: As for `solve_scene`; with ``sensitivity`` the default is a number, too.
        previous: State of a neighbouring geometry or load to start from; what did not change is not
            assembled and factored again.
        slip_from: State from which slip is measured, that of the last load step; by default the undeformed
            one.
        start_geometry: Refuse bodies that overlap before they are loaded.
        sensitivity: Whether derivatives of the state are wanted, which live on the dual system.
        timer: Collects the seconds.
    """
    check_not_forked()
    timer = timer or PhaseTimer()
    check_same_input(decomposition.comm, scene, solver=solver, tolerance=tolerance)
    with together(decomposition.comm):
        tolerance = checked_tolerance(tolerance)
        kind = choose_solver(scene, decomposition.tearing.n_subdomains, sensitivity=sensitivity)
    with timer.phase("assemble"):
        torn = build_torn_system(
            scene,
            decomposition,
            start_geometry=start_geometry,
            previous=None if previous is None else previous.torn,
        )
        if slip_from is not None:
            earlier, moved = slip_from.torn, slip_from.torn_displacement
            torn = torn.with_slip_from(earlier.relative(moved), earlier.sliding(moved))
        same = previous is not None and torn.points is previous.torn.points
        if previous is None or not same or torn.scene.loads != previous.scene.loads:
            check_held(torn)
    if solver is None and kind is SolverKind.DIRECT:
        return _found_directly(torn, previous, timer)
    chosen = solver or default_solver(kind)
    system, start = _dual_system(torn, previous, timer)
    if isinstance(tolerance, float):
        return _to_tolerance(system, chosen.with_tolerance(tolerance), start, timer)
    # Derivatives belong to the statuses of single points, which a balanced state leaves open.
    if tolerance is None and (solver is not None or sensitivity):
        return _to_tolerance(system, chosen, start, timer)
    return _balanced(system, chosen, tolerance, start, timer)


def _dual_system(
    torn: TornSystem, previous: State | None, timer: PhaseTimer
) -> tuple[DualSystem, np.ndarray | None]:
    """Return the dual system and where to start, both with what an earlier state knows. Collective."""
    known = previous.system if previous is not None and isinstance(previous.system, DualSystem) else None
    system = DualSystem(torn, timer, previous=known)
    if previous is not None and known is not None and isinstance(previous.solution, DualSolution):
        return system, carried_over(known, previous.solution, system)
    return system, None


def _to_tolerance(
    system: DualSystem, solver: DualSolver, start: np.ndarray | None, timer: PhaseTimer
) -> State:
    """Find the state to the tolerance of a solver. Collective."""
    with timer.phase("solve"):
        solution = solve_dual(system, solver, start)
    with timer.phase("state"):
        displacement = system.displacement(solution.multiplier, solution.alpha)
    return replace(state_of(system, solution, displacement, timer), tolerance=solver.tolerance)


def _balanced(
    system: DualSystem,
    solver: DualSolver,
    balanced: Balanced | None,
    start: np.ndarray | None,
    timer: PhaseTimer,
) -> State:
    """Find the state as well as the mesh deserves. Collective."""
    # A fixed tolerance needs no estimates and does not load them.
    from fenics_contact.accuracy import Balanced
    from fenics_contact.contact.balancing import solve_balanced

    wanted = balanced or Balanced()
    rounds = solve_balanced(system, solve_dual, solver, wanted, start, timer)
    state = state_of(system, rounds.solution, rounds.displacement, timer)
    return replace(state, known_errors=rounds.state_errors(state.energies.norm), tolerance=wanted)


def state_of(
    system: DualSystem, solution: DualSolution, displacement: np.ndarray, timer: PhaseTimer
) -> State:
    """Return the state of a solution with its torn displacement. Collective."""
    with timer.phase("state"):
        contact = contact_result(system, solution, displacement)
        friction = float(np.sum(contact.slip_bound * np.linalg.norm(contact.slip, axis=1)))
        rigid = system.kernel @ solution.alpha
        energies = compute_energies(system, displacement, solution.multiplier, friction, rigid)
    return State(system, solution, displacement, contact, energies, dict(timer.seconds))


def _found_directly(torn: TornSystem, previous: State | None, timer: PhaseTimer) -> State:
    """Find the state of one body without multipliers."""
    known = previous.system if previous is not None and isinstance(previous.system, DirectSystem) else None
    system = DirectSystem(torn, timer, previous=known)
    with timer.phase("solve"):
        solution = system.solve()
    energies = compute_energies(system, solution.displacement, solution.multiplier, 0.0)
    contact = no_contact(torn.points)
    return State(system, solution, solution.displacement, contact, energies, dict(timer.seconds))


def default_solver(kind: SolverKind) -> DualSolver:
    """Return the dual solver of a kind, with its tolerance."""
    if kind is SolverKind.FACE_NEWTON:
        return FaceNewton()
    return ProjectedCG(tolerance=LINEAR_TOLERANCE)


def solve_dual(
    system: DualSystem, solver: DualSolver, start: DualSolution | np.ndarray | None = None
) -> DualSolution:
    """Solve the dual problem of a system with the friction laws of its scene. Collective.

    Args:
        system: The system.
        solver: `FaceNewton` and `FixedPoint` know Coulomb's law; a `FixedPoint` is put around `Smalse`.
        start: Earlier solution, or multiplier to start from, owned, or None.
    """
    discs, torn = system.owned_discs(), system.torn
    tresca, coefficient = torn.tresca_bound[discs], torn.friction_coefficient[discs]
    if not np.any(torn.friction_coefficient > 0):
        return solve(system.problem, tresca, solver, start)
    if isinstance(solver, Smalse):
        solver = FixedPoint(solver)
    return solve(system.problem, tresca, solver, start, friction_coefficient=coefficient)


def contact_result(system: DualSystem, solution: DualSolution, displacement: np.ndarray) -> ContactResult:
    """Gather forces, gaps and status of all contact points on every rank. Collective."""
    torn, problem = system.torn, system.problem
    rows = np.concatenate([torn.normal_rows, torn.tangential_rows.ravel()])
    step = contact_step(problem.layout, problem.diagonal)
    gathered = [torn.numbering.gather(x, rows) for x in (solution.multiplier, solution.residual, step)]
    count, frictional = torn.points.count, torn.frictional
    normal, gap, normal_step = (x[:count] for x in gathered)
    tau, minus_slip, tangential_step = (x[count:].reshape(-1, torn.dim - 1) for x in gathered)
    trial_normal = normal - normal_step * gap
    trial_tangential = tau - tangential_step * minus_slip
    bound = torn.tresca_bound + torn.friction_coefficient * np.maximum(normal[frictional], 0)
    status = np.where(trial_normal > 0, Status.SLIP, Status.OPEN).astype(int)
    sticks = (np.linalg.norm(trial_tangential, axis=1) < bound) & (trial_normal[frictional] > 0)
    status[frictional[sticks]] = Status.STICK

    def spread(values: np.ndarray, others: float | np.ndarray = 0.0) -> np.ndarray:
        full = np.empty((count, *values.shape[1:]))
        full[frictional], full[torn.frictionless] = values, others
        return full

    origin = torn.numbering.gather(torn.right + torn.supported, torn.tangential_rows.ravel())
    return ContactResult(
        torn.points,
        normal,
        spread(tau),
        spread(bound),
        gap,
        spread(-minus_slip, torn.sliding(displacement) - torn.slid),
        spread(origin.reshape(-1, torn.dim - 1), torn.slid),
        status,
    )
