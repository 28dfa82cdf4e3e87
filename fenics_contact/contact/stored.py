"""A state as a few arrays, and back: the content of a checkpoint of an equilibrium."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact.contact.state import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import DirectSystem, DualSystem, TornSystem
from fenics_contact.qp import CountedOperator, DualSolution, iterate_at

Stored = Mapping[str, np.ndarray]


def stored_state(state: State) -> dict[str, np.ndarray]:
    """Return the arrays from which a state can be rebuilt, on any number of ranks. Collective.

    Returns:
        ``multiplier`` λ and ``origin``, from which slip is measured, of all rows in their order, shape
        (n_rows,), ``slid``, the same for points without friction, and ``motion``, the coefficients α of the
        rigid motions; all replicated. Empty for a state that was computed without multipliers. Of bodies with
        nonlinear materials what `stored_deformed` returns.
    """
    if isinstance(state.system, DirectSystem):
        return {}
    if state.scene.is_nonlinear:
        from fenics_contact.contact.deformed_state import DeformedState
        from fenics_contact.contact.stored_deformed import stored_deformed

        assert isinstance(state, DeformedState)
        return stored_deformed(state)
    torn, solution = state.torn, state.dual_solution
    rows = np.arange(torn.numbering.total)
    return {
        "multiplier": torn.numbering.gather(solution.multiplier, rows),
        "origin": torn.numbering.gather(torn.right + torn.supported, rows),
        "slid": torn.slid,
        "motion": np.asarray(solution.alpha),
    }


def with_stored_slip(torn: TornSystem, stored: Stored) -> TornSystem:
    """Return a system in which slip is measured from the same origin as for a stored state.

    Raises:
        InvalidInputError: If the arrays are those of another system.
    """
    require_rows(torn, stored)
    return torn.with_slip_from(stored["origin"][torn.numbering.owned], stored["slid"])


def require_rows(torn: TornSystem, stored: Stored) -> None:
    """Reject a stored state with other rows.

    Raises:
        InvalidInputError: If it has.
    """
    if stored["multiplier"].shape != (torn.numbering.total,):
        raise InvalidInputError(
            f"a stored state needs {torn.numbering.total} multipliers, got "
            f"{stored['multiplier'].size}: give the scene and the partition of that state"
        )


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
