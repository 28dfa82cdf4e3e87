"""The error that the certificate must bound: the distance from the exact solution of the discrete problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.accuracy import certify
from fenics_contact.contact import ContactProblem, LinearState, State, as_linear
from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import DualSolution, FaceNewton, solve

#: Tolerances of the reference solution: the first that can be reached is used.
EXACT = (1e-11, 1e-10, 1e-9)


@dataclass(frozen=True)
class TrueErrors:
    """Energy norms of displacement errors over that of the displacement.

    The larger one of the torn displacement and of that of the fields is used.

    Attributes:
        algebraic: Distance from the solution for the state's own slip bounds.
        total: Distance from the solution of the friction law, including the error of the slip bounds.
        uncertainty: Error of these reference solutions, by their own certificates.
        tolerance: Residual of the reference solutions.
    """

    algebraic: float
    total: float
    uncertainty: float
    tolerance: float


def true_errors(states: tuple[State, ...]) -> TrueErrors | None:
    """Solve the last step again, as exactly as possible, and compare. Collective.

    Returns:
        The errors; None where no such solution could be computed.
    """
    state = states[-1]
    if not isinstance(state, LinearState) or not isinstance(state.solution, DualSolution):
        return None
    for tolerance in EXACT:
        try:
            errors = _compared(state, states[:-1], FaceNewton(tolerance=tolerance))
        except ConvergenceError:
            continue
        if np.isfinite(errors.uncertainty):
            return errors
    return None


def _compared(state: LinearState, earlier: tuple[State, ...], solver: FaceNewton) -> TrueErrors:
    problem = ContactProblem.following(state, solver=solver)
    exact = as_linear(problem.solve(slip_from=earlier[-1] if earlier else None), "true errors")
    norm = exact.energies.norm
    total = _distance(state, exact.dual_solution, exact.torn_displacement) / norm
    if not np.any(state.torn.friction_coefficient > 0.0):
        doubt = certify(exact.dual, exact.dual_solution).bound / norm
        return TrueErrors(total, total, doubt, solver.tolerance)
    own = solve(state.dual.problem, state.dual_solution.slip_bound, solver, state.dual_solution.multiplier)
    displacement = state.dual.displacement(own.multiplier, own.alpha)
    doubt = certify(state.dual, own).bound / norm
    return TrueErrors(_distance(state, own, displacement) / norm, total, doubt, solver.tolerance)


def _distance(state: LinearState, other: DualSolution, displacement: np.ndarray) -> float:
    """Return √(dᵀK d) for a difference d of displacements, K d = −Bᵀδλ plus the sewing part. Collective.

    The larger one, of the torn displacement and of that of the fields.
    """
    system = state.dual
    moved = displacement - state.torn_displacement
    force = system.force(state.dual_solution.multiplier - other.multiplier)
    sewn = system.sewn(state.dual_solution.residual)
    energy, _ = system.inverse.energy(sewn)
    by_force, by_sewing = float(moved @ force), energy - 2.0 * float(system.inverse.extend(sewn) @ force)
    squares = state.torn.numbering.comm.allreduce(np.array([by_force, by_force + by_sewing]))
    return float(np.sqrt(max(0.0, *squares)))
