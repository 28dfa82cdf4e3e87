"""One call for every dual problem and every dual solver."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from fenics_contact.errors import ConvergenceError, InvalidInputError, together
from fenics_contact.qp.problem import CountedOperator, DualProblem
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.residual import measure
from fenics_contact.qp.slip_law import Coulomb, SlipLaw, Tresca
from fenics_contact.qp.solution import DualSolution
from fenics_contact.qp.start import Start


class DualSolver(Protocol):
    """Parameters of a method together with the method itself."""

    @property
    def tolerance(self) -> float:
        """Largest relative residual of an answer."""

    def run(self, problem: DualProblem, law: SlipLaw, start: Start) -> DualSolution:
        """Solve from ``start`` or raise `ConvergenceError`. Collective."""


def solve(
    problem: DualProblem,
    slip_bound: Vector | None,
    solver: DualSolver,
    start: DualSolution | Vector | None = None,
    *,
    friction_coefficient: Vector | None = None,
) -> DualSolution:
    """Solve min ½ λᵀF λ − dᵀλ subject to G λ = e, λ_N ≥ 0 and ‖τ_i‖ ≤ Ψ_i. Collective.

    Args:
        problem: Operators and layout.
        slip_bound: Ψ, shape (n_friction,), owned; None where there is no friction or the bound
            follows the normal force.
        solver: `FaceNewton`, `Smalse` or `ProjectedCG`, which hold only their parameters.
        start: An earlier solution (of this problem or of one with the same rows) or a multiplier, owned.
        friction_coefficient: μ, shape (n_friction,), owned: Coulomb's law, Ψ = μ λ_N, in place of given
            bounds; then λ is a fixed point and not a minimiser.

    Returns:
        The solution; its residuals were recomputed and are all below ``solver.tolerance``.

    Raises:
        InvalidInputError: Shapes disagree, values are not finite, or the solver does not fit the problem.
        InfeasibleError: The load drives a rigid motion that no multiplier resists.
        ConvergenceError: The tolerance was not met; carries the history.
    """
    problem.check()
    with together(problem.comm):
        law = _slip_law(problem, slip_bound, friction_coefficient)
    solution = solver.run(problem, law, _begin(problem, law, start))
    if not solution.residuals.within(solver.tolerance):
        raise ConvergenceError(
            f"a solution needs residuals below {solver.tolerance:.1e}, got {solution.residuals}: "
            "the solver claims convergence that its own answer does not show",
            solution.history,
        )
    return solution


def _slip_law(
    problem: DualProblem, slip_bound: Vector | None, friction_coefficient: Vector | None
) -> SlipLaw:
    layout = problem.layout
    if friction_coefficient is not None:
        if slip_bound is not None:
            raise InvalidInputError(
                "give slip_bound or friction_coefficient, got both: a bound is given or follows λ_N"
            )
        return Coulomb(layout, np.asarray(friction_coefficient, dtype=np.float64))
    if slip_bound is None:
        if layout.n_friction:
            raise InvalidInputError(
                f"{layout.n_friction} friction discs need a slip_bound or a friction_coefficient, got neither"
            )
        slip_bound = np.zeros(0)
    law = Tresca(layout, np.asarray(slip_bound, dtype=np.float64))
    law.feasible(np.zeros(layout.size))
    return law


def _begin(problem: DualProblem, law: SlipLaw, start: DualSolution | Vector | None) -> Start:
    """Compute product and residual of the starting multiplier. Collective; at most one product."""
    coarse, operator = problem.coarse, CountedOperator(problem.operator)
    if isinstance(start, DualSolution) and start.problem is problem:
        multiplier, product = start.multiplier, start.product
    else:
        given = start.multiplier if isinstance(start, DualSolution) else start
        multiplier = coarse.particular() if given is None else np.array(given, dtype=np.float64)
        with together(problem.comm):
            _require_size(multiplier, problem.layout.size)
        moved = problem.norm(multiplier) > 0.0
        product = operator(multiplier) if moved else np.zeros_like(multiplier)
    flexed = product - problem.rhs
    if isinstance(start, DualSolution) and start.alpha.shape == (coarse.m,):
        residual = flexed - coarse.transpose(start.alpha)
    else:
        residual = coarse.project(flexed)
    residuals = measure(problem, law.feasible(multiplier), multiplier, product, residual)
    memory = start.memory if isinstance(start, DualSolution) else None
    return Start(operator, multiplier, product, residual, residuals, memory, warm=start is not None)


def _require_size(multiplier: Vector, size: int) -> None:
    if multiplier.shape != (size,):
        raise InvalidInputError(
            f"start must have shape ({size},) like this rank's owned vector, got {multiplier.shape}: "
            "start cold where the rows have changed"
        )
