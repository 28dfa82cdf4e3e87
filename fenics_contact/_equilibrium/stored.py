"""From the arrays that checkpoints keep of a state back to its slip and its solution."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.problem import CountedOperator
from fenics_contact.qp.solution import DualSolution, iterate_at

Stored = Mapping[str, np.ndarray]


def with_stored_slip(torn: TornSystem, stored: Stored) -> TornSystem:
    """Return a system in which slip is measured from the same origin as for a stored state."""
    require_rows(torn, stored)
    return torn.with_slip_from(stored["origin"][torn.numbering.owned], stored["slid"])


def require_rows(torn: TornSystem, stored: Stored) -> None:
    """Reject a stored state with other rows."""
    require_shape(stored, "multiplier", (torn.numbering.total,))


def require_shape(stored: Stored, name: str, shape: tuple[int, ...]) -> None:
    """Reject a stored state with an array of another shape."""
    if stored[name].shape != shape:
        raise InvalidInputError(
            f"a stored state needs {name}s {shape}, got {stored[name].shape}: give its scene and partition"
        )


def restored_solution(system: DualSystem, stored: Stored) -> DualSolution:
    """Compute the residuals of a stored multiplier. Collective; one product."""
    problem, law = system.problem, system.torn.law
    multiplier, motion = stored["multiplier"][system.torn.numbering.owned], stored["motion"]
    operator = CountedOperator(problem.operator, exact=problem.exact)
    iterate = iterate_at(problem.with_law(law), multiplier, operator.exactly(multiplier), motion)
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
