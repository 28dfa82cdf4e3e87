"""The final face of the chain as a linear problem: what the state would cost if its face were known.

Closed contacts with the status that was found are kept as equalities, and the solve starts cold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

from benchmarks.cases.chain import cold_state
from benchmarks.cases.measuring import state_record
from fenics_contact.qp import Stop
from fenics_contact.qp.face import classify
from fenics_contact.qp.face_system import FaceSystems
from fenics_contact.qp.krylov import projected_cg
from fenics_contact.qp.newton_steps import residual_weights
from fenics_contact.qp.problem import CountedOperator
from fenics_contact.qp.solution import contact_step
from fenics_contact.results.linear_state import LinearState, as_linear

MAX_ITERATIONS = 2000


@dataclass(frozen=True)
class LinearSolve:
    """What the face cost.

    Attributes:
        products: F-products, with the first residual and the recomputed one.
        measure: Norm of the residual at the end, natural and gluing residual joined.
    """

    products: int
    measure: float


def solve_face(state: LinearState, tolerance: float = 1e-6) -> LinearSolve:
    """Solve the face of a state from the shortest multiplier in equilibrium. Collective.

    Operator, preconditioner, weights of the residual and tolerance are those of the state.

    Raises:
        RuntimeError: If conjugate gradients end early; a face that was found can be solved.
    """
    problem, solution = state.dual.problem, state.dual_solution
    operator = CountedOperator(problem.operator)
    step = contact_step(problem.layout, problem.diagonal)
    face = classify(problem.layout, solution.slip_bound, solution.multiplier, solution.residual, step)
    system = FaceSystems(problem, operator).build(face)
    start = system.enter(problem.coarse.particular())
    gradient = system.gradient(start, operator(start) - problem.rhs)
    weights = residual_weights(face, solution.residuals, step)
    solved = projected_cg(system, gradient, weights, tolerance, MAX_ITERATIONS)
    if solved.stop is not Stop.CONVERGED:
        raise RuntimeError(
            f"the final face must be solvable, got {solved.stop.value}: look at its state first"
        )
    operator(start + system.advance(solved.step))
    return LinearSolve(operator.products, solved.measure)


def measure(comm: MPI.Comm) -> dict[str, Any]:
    """Return the products of the chain's state and of its final face. Collective."""
    state = as_linear(cold_state(comm)[0], "linear faces")
    linear = solve_face(state)
    return {
        "counts": {**state_record(state)["counts"], "linear_products": linear.products},
        "linear_residual": linear.measure,
    }
