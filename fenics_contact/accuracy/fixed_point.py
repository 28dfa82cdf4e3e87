"""Error due to slip bounds that do not satisfy Coulomb's law exactly, in energy norm."""

from __future__ import annotations

import numpy as np

from fenics_contact.accuracy.certificate import Certificate
from fenics_contact.feti import DualSystem
from fenics_contact.qp import DualSolution, global_sum


def friction_error(system: DualSystem, solution: DualSolution, certificate: Certificate) -> float:
    """Estimate the error due to inexact slip bounds. Collective; no product.

    The slip bounds of a solution follow its normal forces, Ψ = Ψ₀ + μ λ_N, and have an error μ δλ_N where
    these have an error δλ_N. The certificate approximates δλ_N by one preconditioned step. At slipping points
    friction then changes by μ δλ_N along its direction, which deforms the bodies by about √Σ F_ii (μ δλ_i)².
    Where the preconditioner overestimates, it is limited to μ times the bound.

    It is an estimate, not a bound: Coulomb's law does not minimise an energy. It measures the distance from
    the solution of Tresca's problem with the slip bounds of the certificate, to which that bound refers, to
    that of Coulomb's law, including the raise of slip bounds for the certificate. Zero where nothing slips,
    and where slip bounds do not follow the normal forces.

    Args:
        system: The dual system.
        solution: A solution of its problem.
        certificate: Its certificate.

    Returns:
        Energy norm of the change, [√(force · length)].
    """
    torn, layout, known = system.torn, system.problem.layout, certificate.known
    coefficient = torn.friction_coefficient[system.torn.owned_discs]
    change = np.where(known.statuses.slip, coefficient * certificate.error[layout.tangential_frictional], 0.0)
    raised = known.slip_bound - solution.slip_bound
    flexibility = system.problem.diagonal[layout.tangential].mean(axis=1)
    squares = global_sum(system.problem.comm, flexibility @ change**2, flexibility @ raised**2)
    by_law, by_limit = (float(part) for part in np.sqrt(squares))
    largest = float(torn.friction_coefficient.max(initial=0.0))
    return min(by_law, largest * certificate.bound) + by_limit
