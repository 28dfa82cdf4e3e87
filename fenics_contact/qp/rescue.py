"""The fallback of the face Newton method: SMALSE steps until the residual falls again."""

from __future__ import annotations

from dataclasses import replace

from fenics_contact.qp.certify import certify
from fenics_contact.qp.iterate import Iterate, Start
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.slip_law import SlipLaw, Tresca
from fenics_contact.qp.smalse import Smalse, outer_iterations
from fenics_contact.qp.solution import SmalseMemory, SolverStep


def rescue(
    problem: DualProblem,
    law: SlipLaw,
    start: Start,
    parameters: Smalse,
    *,
    reduction: float,
    budget: int,
    reason: str,
    history: list[SolverStep],
) -> tuple[Iterate, SmalseMemory]:
    """Improve an iterate by SMALSE with its slip bound held. Collective.

    Args:
        problem: The dual problem.
        law: Where the slip bound comes from; it is frozen at the start.
        start: The iterate that Newton could not improve.
        parameters: SMALSE's.
        reduction: Stop when the residual has fallen by this factor.
        budget: Largest number of products to spend.
        reason: Why Newton's method needs it, in words.
        history: Gets one record.

    Returns:
        The improved iterate, its residuals recomputed for ``law``, and what SMALSE learned.
    """
    frozen = Tresca(problem.layout, law.bound(start.iterate.multiplier))
    feasible = frozen.feasible(start.iterate.multiplier)
    limit = start.operator.products + budget
    target = reduction * start.iterate.residuals.worst
    settings = replace(parameters, tolerance=target, max_products=limit)
    for state in outer_iterations(problem, feasible, start, settings):
        if state.residuals.within(target) or start.operator.products >= limit:
            break
    improved = certify(problem, start.operator, law, state.multiplier, state.residual).iterate
    line = state.record(len(history), problem, start.operator.products)
    reached = "met its target" if state.residuals.within(target) else "used its budget"
    note = f"rescue from {start.iterate.residuals.worst:.1e} because {reason}: {reached}"
    history.append(replace(line, method="SMALSE rescue", residuals=improved.residuals, note=note))
    return improved, state.memory
