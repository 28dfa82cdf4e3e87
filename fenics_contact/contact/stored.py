"""A state as a few arrays, and back: the content of a checkpoint of an equilibrium."""

from __future__ import annotations

import numpy as np

from fenics_contact.contact.linear_state import as_linear
from fenics_contact.contact.state import State
from fenics_contact.contact.stored_rows import Stored
from fenics_contact.feti import DirectSolution, DualSystem
from fenics_contact.qp import CountedOperator, DualSolution, iterate_at


def stored_state(state: State) -> dict[str, np.ndarray]:
    """Return the arrays from which a state can be rebuilt, on any number of ranks. Collective.

    Returns:
        ``multiplier`` λ and ``origin``, from which slip is measured, of all rows in their order, shape
        (n_rows,), ``slid``, the same for points without friction, and ``motion``, the coefficients α of the
        rigid motions; all replicated. Empty for a state that was computed without multipliers. Of bodies with
        nonlinear materials what `stored_deformed` returns.
    """
    if isinstance(state.solution, DirectSolution):
        return {}
    if state.scene.is_nonlinear:
        from fenics_contact.contact.deformed_state import DeformedState
        from fenics_contact.contact.stored_deformed import stored_deformed

        assert isinstance(state, DeformedState)
        return stored_deformed(state)
    torn, solution = state.torn, as_linear(state, "multipliers of rigid motions").dual_solution
    rows = np.arange(torn.numbering.total)
    return {
        "multiplier": torn.numbering.gather(solution.multiplier, rows),
        "origin": torn.numbering.gather(torn.right + torn.supported, rows),
        "slid": torn.slid,
        "motion": np.asarray(solution.alpha),
    }


def restored_solution(system: DualSystem, stored: Stored) -> DualSolution:
    """Compute the residuals of a stored multiplier. Collective; one product."""
    problem, law = system.problem, system.torn.law
    multiplier, motion = stored["multiplier"][system.torn.numbering.owned], stored["motion"]
    operator = CountedOperator(problem.operator)
    iterate = iterate_at(problem.with_law(law), multiplier, operator(multiplier), motion)
    return DualSolution(
        problem=problem,
        multiplier=multiplier,
        residual=iterate.residual,
        product=iterate.product,
        alpha=motion,
        slip_bound=law.bound(multiplier),
        residuals=iterate.residuals,
        reason="read from a checkpoint",
        iterations=0,
        products=operator.products,
        history=(),
    )
